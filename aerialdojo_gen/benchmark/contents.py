"""The tables of a report, by name and in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.benchmark import radii, tables
from aerialdojo_gen.benchmark.difficulty import DIFFICULTY, SEEN, Breakdowns, breakdown_tables, find_breakdowns
from aerialdojo_gen.benchmark.grid import Table
from aerialdojo_gen.benchmark.metrics import Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import result_tables
from aerialdojo_gen.store.root import DataRoot


@dataclass(frozen=True)
class ReportRequest:
    """Runs, success rules and options of a report."""

    data: DataRoot  # Root of the release that the tasks are from; runs may be elsewhere
    runs: Sequence[Run]  # In the order and groups of the rows
    profiles: Sequence[Profile]  # Success rules; tables of a single rule use the first
    radii_m: Sequence[float] = radii.DEFAULT_RADII_M  # Of the table of radii, metres
    intervals: bool = True  # Whether 95 % intervals are shown
    paper_results: Sequence[PaperResult] = ()  # Results of the paper to show beside the runs'

    @cached_property
    def breakdowns(self) -> Breakdowns:
        """Breakdowns of the episodes by difficulty and by what training shows."""
        return find_breakdowns(self.data, self.runs)


def _sliced(column: str) -> Callable[[ReportRequest], list[Table]]:
    return lambda w: [tables.slice_table(w.runs, w.profiles[0], column)]


_TABLES: dict[str, Callable[[ReportRequest], list[Table]]] = {
    "overall": lambda w: [tables.main_table(w.runs, w.profiles)],
    "results": lambda w: result_tables(w.runs, w.profiles, w.intervals, w.paper_results),
    "partition": lambda w: [tables.partition_table(w.runs, w.profiles[0])],
    "family": lambda w: [tables.family_table(w.runs, w.profiles[0])],
    "averages": lambda w: [tables.average_table(w.runs, w.profiles[0])],
    "setting": _sliced("setting"),
    "goal": lambda w: [tables.goal_table(w.runs, w.profiles[0])],
    "modality": _sliced("modality"),
    "radius": lambda w: [radii.radius_table(w.runs, w.profiles[0], w.radii_m)],
    "visits": lambda w: [radii.visit_table(w.runs, w.profiles[0])],
    "difficulty": lambda w: breakdown_tables(w.breakdowns, DIFFICULTY, w.runs, w.profiles[0]),
    "seen": lambda w: breakdown_tables(w.breakdowns, SEEN, w.runs, w.profiles[0]),
    "conduct": lambda w: [tables.conduct_table(w.runs)],
    "type": lambda w: [tables.type_table(w.runs, w.profiles[0])],
    "scene": lambda w: [tables.scene_table(w.runs, w.profiles[0])],
}
NAMES = tuple(_TABLES)
# As in the paper; the others are optional.
DEFAULT = ("results",)


def report_tables(request: ReportRequest, names: Sequence[str] = DEFAULT) -> list[Table]:
    """Make tables."""
    return [table for made in named_tables(request, names).values() for table in made]


def missing_note(request: ReportRequest, names: Sequence[str] = DEFAULT) -> str:
    """Name the requested breakdowns that are missing, and why, in one line; empty if none is."""
    needed = "all" in names or {"difficulty", "seen"} & set(names)
    return request.breakdowns.missing_note if needed else ""


def check_names(names: Sequence[str]) -> Sequence[str]:
    """Return the names; UsageError for an unknown one."""
    for name in names:
        if name not in (*NAMES, "all"):
            raise UsageError(unknown("no table", name, NAMES, besides=("all",)))
    return names


def named_tables(request: ReportRequest, names: Sequence[str]) -> dict[str, list[Table]]:
    """Make tables by name."""
    check_names(names)
    chosen = NAMES if "all" in names else [name for name in NAMES if name in names]
    return {name: _TABLES[name](request) for name in chosen}
