"""What an import says: rows that make no sense, fields that found no place, columns left empty, replay errors."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aerialdojo_gen.exchange.fields import BadField

_MOST_NAMED = 1000
_FAR_M = 3.0


@dataclass
class Report:
    """Counts over all files of an import."""

    format: str  # As asked or as the format fixes it
    frame: str
    files: list[str] = field(default_factory=list)
    records: int = 0  # Records read, good and bad
    bad: list[str] = field(default_factory=list)  # A line a bad record, the first thousand
    n_bad: int = 0  # All of them
    bad_fields: Counter[str] = field(default_factory=Counter)  # How many by field
    unmapped: Counter[str] = field(default_factory=Counter)
    notes: Counter[str] = field(default_factory=Counter)  # Else worth knowing, and of how many records
    rows: dict[str, int] = field(default_factory=dict)
    empty: dict[str, int] = field(default_factory=dict)
    _errors: array[float] = field(default_factory=lambda: array("d"))

    def refuse(self, label: str, row: int, error: BadField) -> str:
        """Count a bad record; returns its line."""
        line = f"{label}: row {row}: {error.field}: {error.why}"
        self.n_bad += 1
        self.bad_fields[error.field.split("[")[0]] += 1
        if len(self.bad) < _MOST_NAMED:
            self.bad.append(line)
        return line

    def left(self, names: Iterable[str]) -> None:
        """Count the fields of a record that found no place."""
        for name in names:
            known = name in self.unmapped or len(self.unmapped) < _MOST_NAMED
            self.unmapped[name if known else "(others)"] += 1

    def replayed(self, error_m: float | None) -> None:
        """Count a route's replay error."""
        if error_m is not None:
            self._errors.append(error_m)

    def replay(self) -> dict[str, Any] | None:
        """Summarise the replay errors, metres; None where no record has actions and poses."""
        if not self._errors:
            return None
        errors = np.asarray(self._errors)
        return {
            "routes": len(errors),
            "median_m": round(float(np.median(errors)), 6),
            "max_m": round(float(errors.max()), 6),
            f"over_{_FAR_M:g}_m": int((errors > _FAR_M).sum()),
        }

    def document(self) -> dict[str, Any]:
        """All of it, for ``import.json``."""
        return {
            "format": self.format,
            "frame": self.frame,
            "files": self.files,
            "records": self.records,
            "rows": self.rows,
            "bad_records": self.n_bad,
            "bad_fields": dict(sorted(self.bad_fields.items())),
            "not_mapped": dict(sorted(self.unmapped.items())),
            "null_columns": dict(sorted(self.empty.items())),
            "notes": dict(sorted(self.notes.items())),
            "replay_error": self.replay(),
        }

    def lines(self) -> list[str]:
        """All of it, for a person."""
        made = ", ".join(f"{n:,} {name}" for name, n in sorted(self.rows.items(), reverse=True))
        lines = [f"{self.format}, frame {self.frame}: {self.records:,} records in {len(self.files)} files; {made}"]
        if self.n_bad:
            fields = ", ".join(f"{name} {n:,}" for name, n in self.bad_fields.most_common())
            lines.append(f"left out: {self.n_bad:,} bad records ({fields}): see bad_records.txt")
        if self.unmapped:
            lines.append("not mapped: " + ", ".join(f"{name} {n:,}" for name, n in sorted(self.unmapped.items())))
        for table, rows in sorted(self.rows.items(), reverse=True):
            names = [
                c.split(".")[1] for c, n in sorted(self.empty.items()) if c.startswith(f"{table}.") and n == rows
            ]
            if names:
                lines.append(f"always null in {table}: {', '.join(names)}")
        lines += [f"{n:,} x {note}" for note, n in sorted(self.notes.items())]
        if (replay := self.replay()) is not None:
            lines.append(
                f"replay_error_m over {replay['routes']:,} routes: median {replay['median_m']:g}, "
                f"largest {replay['max_m']:g}, over {_FAR_M:g} m {replay[f'over_{_FAR_M:g}_m']:,}"
            )
        return lines
