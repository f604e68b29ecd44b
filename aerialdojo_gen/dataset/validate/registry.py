"""What a check is, and how checks run over a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.dataset.validate.rows import ALWAYS_AFTER, Rows, SceneData, UncheckedError

TABLES = ("scenes", "landmarks", "objects", "anchors", "viewpoints", "routes", "tasks")
_TABLE_ORDER = ("*", *(table for table in TABLES if table != "routes"), "routes")


class Fault(NamedTuple):
    """A row, part or table that fails a check."""

    check: str  # Stable name of the check
    scene: str  # Name of the scene, empty for the release as a whole
    table: str  # Name of the table, empty for what is no table
    part: str  # File, relative to the release
    key: str  # Which row, e.g. ``"nav_id=U_Mall_0-3f0c51d2a9be"``; empty for a whole part
    found: str  # The stored value, and the expected one
    expected: str


class Finding(NamedTuple):
    """What a check yields: the number of a row, the stored value and the expected one; a warning is no fault."""

    row: int
    found: str
    expected: str
    warning: bool = False


Function = Callable[[SceneData, Rows], Iterable[Finding]]


@dataclass(frozen=True)
class Check:
    """A check of one table's rows."""

    name: str  # Stable name; reports and tests go by it
    table: str  # The table whose rows it checks; ``"*"`` for every table
    after: tuple[str, ...]  # Checks of the same table that run before; rows that fail them are skipped
    run: Function  # Yields the rows at fault
    samples: bool = False


@dataclass
class Outcome:
    """Result of a check on a scene, or on the whole release."""

    check: str  # Name of the check and of the table
    table: str
    rows: int = 0  # Rows that were checked
    faults: list[Fault] = field(default_factory=list)  # The rows at fault
    skipped: str = ""  # Why nothing was checked; empty if it was
    warnings: list[Fault] = field(default_factory=list)  # Rows to report that are no fault

    def fault(
        self, found: str, expected: str, *, scene: str = "", table: str = "", part: str = "", key: str = ""
    ) -> None:
        """Add a fault of this check."""
        self.faults.append(Fault(self.check, scene, table, part, key, found, expected))


CHECKS: list[Check] = []


def check(table: str, *, after: tuple[str, ...] = (), samples: bool = False) -> Callable[[Function], Function]:
    """Register a function as a check: its name is the check's name, its docstring the rule."""

    def register(function: Function) -> Function:
        CHECKS.append(Check(function.__name__, table, after, function, samples))
        return function

    return register


def ordered(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Order checks so that each one follows those in its `after`.

    Checks of every table come first, then those of `scenes`, which find faults of the mesh. Those of `tasks` come
    before those of `routes`: the oracle flies no task that is at fault.
    """
    every = sorted(checks, key=lambda one: _TABLE_ORDER.index(one.table))
    result: dict[str, Check] = {}
    while len(result) < len(every):
        waiting = [one for one in every if one.name not in result]
        ready = next((one for one in waiting if result.keys() >= set(one.after)), None)
        if ready is None:
            raise ValueError(
                f"checks name unknown checks in `after`, or one another: {[one.name for one in waiting]}"
            )
        result[ready.name] = ready
    return tuple(result.values())


def run_checks(data: SceneData, checks: Iterable[Check]) -> Iterator[Outcome]:
    """Run checks over a scene in their order."""
    for one in checks:
        for table in TABLES if one.table == "*" else (one.table,):
            yield _run(data, one, table)


def _run(data: SceneData, one: Check, table: str) -> Outcome:
    try:
        left_out = data.flagged(table, (*(n for n in ALWAYS_AFTER if n != one.name), *one.after))
        rows = replace(data[table], left_out=left_out)
        findings = [f for f in one.run(data, rows) if not left_out[f.row]]
    except UncheckedError as reason:
        return Outcome(one.name, table, skipped=str(reason))
    except AerialDojoError:
        raise
    except Exception as error:
        raise RuntimeError(f"{data.scene}: check {one.name} of {table} failed: {error}") from error
    mask = np.zeros(len(rows), dtype=np.bool_)
    mask[[f.row for f in findings if not f.warning]] = True
    data.faulty[table, one.name] = mask
    outcome = Outcome(one.name, table, len(data.sampled(rows)) if one.samples else int(rows.judged.sum()))
    for f in findings:
        fault = Fault(one.name, data.scene, table, rows.part(f.row), rows.key(f.row), f.found, f.expected)
        (outcome.warnings if f.warning else outcome.faults).append(fault)
    return outcome
