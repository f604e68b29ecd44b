"""The report of `validate`: a table of checks, lines for the terminal, a file with every fault."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.dataset.validate.registry import Fault, Outcome
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.tables import write_file

FORMATS = (".jsonl", ".json", ".csv", ".parquet")


@dataclass(frozen=True)
class Report:
    """The outcome of every check."""

    scenes: tuple[str, ...]  # Checked scenes
    outcomes: tuple[Outcome, ...]  # One per check, table and scene, in the order of the checks

    @property
    def faults(self) -> list[Fault]:
        """Every row, part or table at fault."""
        return [fault for outcome in self.outcomes for fault in outcome.faults]

    @property
    def warnings(self) -> list[Fault]:
        """Every reported row that is no fault."""
        return [warning for outcome in self.outcomes for warning in outcome.warnings]

    def by_check(self) -> dict[str, list[Outcome]]:
        """Outcomes on scenes and tables by the name of their check, in the order of the checks."""
        found: dict[str, list[Outcome]] = {}
        for outcome in self.outcomes:
            found.setdefault(outcome.check, []).append(outcome)
        return found

    def table_lines(self, width: int | None = None, *, verbose: bool = False) -> list[str]:
        """Write a line per table, or per check: rows checked, faults, what was not checked and why."""
        groups: dict[str, list[list[Outcome]]] = {}
        for outcomes in self.by_check().values():
            of = outcomes[0].table if len({outcome.table for outcome in outcomes}) == 1 else "every table"
            groups.setdefault(of, []).append(outcomes)
        rows = []
        for of, checks in groups.items():
            for part in [[own] for own in checks] if verbose else [checks]:
                skipped = Counter(outcome.skipped for own in part for outcome in own if outcome.skipped)
                why = "; ".join(f"{why}{f' ({n} times)' if n > 1 else ''}" for why, n in skipped.items())
                judged = max(sum(outcome.rows for outcome in own) for own in part)
                faults = sum(len(outcome.faults) for own in part for outcome in own)
                first, second = (part[0][0].check, of) if verbose else (of, f"{len(part)}")
                rows.append((first, [second, f"{judged:,}", f"{faults:,}", why]))
        columns = [Column("table", words=True) if verbose else Column("checks"), Column("rows"), Column("faults")]
        if any(outcome.skipped for outcome in self.outcomes):
            columns.append(Column("not checked", words=True))
        return TextTable("check" if verbose else "table", columns, rows).lines(width)

    def fault_lines(self, limit: int) -> list[str]:
        """Name the first warnings and faults of every check, and how many there are."""
        lines = []
        for found, word in ((self.warnings, "to know of, no fault"), (self.faults, "at fault")):
            by_check: dict[str, list[Fault]] = {}
            for fault in found:
                by_check.setdefault(fault.check, []).append(fault)
            for name, faults in by_check.items():
                lines.append(f"{name}: {len(faults):,} {word}")
                lines += [f"  {fault_text(fault)}" for fault in faults[:limit]]
                if len(faults) > limit:
                    more = "--report FILE has them all" if word == "at fault" else "--max-faults N names more"
                    lines.append(f"  and {len(faults) - limit:,} more ({more})")
        return lines

    def as_json(self) -> dict[str, Any]:
        """Return all of it as plain values: verdict, scenes, checks with their counts, every fault and warning."""
        checks = [
            {
                "check": name,
                "tables": [*dict.fromkeys(outcome.table for outcome in own)],
                "judged": sum(outcome.rows for outcome in own),
                "faults": sum(len(outcome.faults) for outcome in own),
                "not_made": Counter(outcome.skipped for outcome in own if outcome.skipped),
            }
            for name, own in self.by_check().items()
        ]
        faults, warnings = ([one._asdict() for one in found] for found in (self.faults, self.warnings))
        return {
            "verdict": self.verdict(), "scenes": [*self.scenes], "checks": checks, "faults": faults,
            "warnings": warnings,
        }  # fmt: skip

    def verdict(self) -> str:
        """One line: what was checked, and whether all was well."""
        checks, faults, n = self.by_check().values(), len(self.faults), len(self.scenes)
        judged = sum(outcome.rows for outcome in self.outcomes)
        undone = sum(any(outcome.skipped for outcome in own) for own in checks)
        what = f"{len(checks)} checks, {judged:,} rows judged, {n} scene{'s' if n != 1 else ''}"
        rest = f"; {undone} checks were not made everywhere" if undone else ""
        rest += f"; {len(self.warnings):,} warnings" if self.warnings else ""
        return f"{what}: {f'{faults:,} at fault' if faults else 'no fault'}{rest}"


def fault_text(fault: Fault) -> str:
    """Write a fault as one line."""
    where = " ".join(word for word in (fault.table, fault.scene, fault.key) if word)
    part = f" [{fault.part}]" if fault.part else ""
    return f"{where or fault.part}: found {fault.found}, expected {fault.expected}{part if where else ''}"


def check_format(path: Path) -> None:
    """Raise a `UsageError` for a suffix that no report has, before any work is done."""
    if path.suffix not in FORMATS:
        raise UsageError(f"{path}: a report is one of {', '.join(FORMATS)}")


def write_report(faults: Sequence[Fault], path: Path) -> Path:
    """Write every fault to a file: JSON lines (.jsonl, .json), CSV or Parquet by its suffix; whole or not at all."""
    check_format(path)
    path = path.absolute()
    if path.suffix == ".parquet":
        schema = pa.schema([pa.field(name, pa.string(), nullable=False) for name in Fault._fields])
        write_file(path, pa.Table.from_pylist([fault._asdict() for fault in faults], schema=schema))
        return path
    with atomic_file(path.parent, path.name) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        if path.suffix == ".csv":
            csv.writer(file).writerows([Fault._fields, *faults])
        else:
            file.writelines(json.dumps(fault._asdict(), ensure_ascii=False) + "\n" for fault in faults)
    return path
