"""What a report holds: its tables by name, in their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.benchmark import radii, tables
from aerialdojo_gen.benchmark.difficulty import DIFFICULTY, SEEN, Partings, parting_tables, partings_of
from aerialdojo_gen.benchmark.grid import Table
from aerialdojo_gen.benchmark.metrics import Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import result_tables
from aerialdojo_gen.store.root import DataRoot


@dataclass(frozen=True)
class ReportRequest:
    """What a report is made of."""

    data: DataRoot  # The data root, whose release says more of the tasks; the runs need not lie in it
    runs: Sequence[Run]  # In the order and the groups of the lines
    profiles: Sequence[Profile]  # Rules of success; what has room for one judges by the first
    radii_m: Sequence[float] = radii.DEFAULT_RADII_M  # Of the table of radii, metres
    intervals: bool = True  # Whether 95 % intervals are shown
    beside: Sequence[PaperResult] = ()  # The paper's results, to be set beside ours

    @cached_property
    def partings(self) -> Partings:
        """What the episodes can be parted by: difficulty, and what training shows."""
        return partings_of(self.data, self.runs)


def _sliced(column: str) -> Callable[[ReportRequest], list[Table]]:
    return lambda w: [tables.slice_table(w.runs, w.profiles[0], column)]


_TABLES: dict[str, Callable[[ReportRequest], list[Table]]] = {
    "overall": lambda w: [tables.main_table(w.runs, w.profiles)],
    "results": lambda w: result_tables(w.runs, w.profiles, w.intervals, w.beside),
    "partition": lambda w: [tables.partition_table(w.runs, w.profiles[0])],
    "family": lambda w: [tables.family_table(w.runs, w.profiles[0])],
    "averages": lambda w: [tables.average_table(w.runs, w.profiles[0])],
    "setting": _sliced("setting"),
    "goal": lambda w: [tables.goal_table(w.runs, w.profiles[0])],
    "modality": _sliced("modality"),
    "radius": lambda w: [radii.radius_table(w.runs, w.profiles[0], w.radii_m)],
    "visits": lambda w: [radii.visit_table(w.runs, w.profiles[0])],
    "difficulty": lambda w: parting_tables(w.partings, DIFFICULTY, w.runs, w.profiles[0]),
    "seen": lambda w: parting_tables(w.partings, SEEN, w.runs, w.profiles[0]),
    "conduct": lambda w: [tables.conduct_table(w.runs)],
    "type": lambda w: [tables.type_table(w.runs, w.profiles[0])],
    "scene": lambda w: [tables.scene_table(w.runs, w.profiles[0])],
}
NAMES = tuple(_TABLES)
# The paper's own; the others are printed where they are asked for.
DEFAULT = ("results",)


def report_tables(wanted: ReportRequest, names: Sequence[str] = DEFAULT) -> list[Table]:
    """Make tables."""
    return [table for made in named_tables(wanted, names).values() for table in made]


def left_out(wanted: ReportRequest, names: Sequence[str] = DEFAULT) -> str:
    """Say in one line which breakdowns of the tables asked for there are not, and why; empty where there are all."""
    asked = "all" in names or {"difficulty", "seen"} & set(names)
    return wanted.partings.left_out if asked else ""


def check_names(names: Sequence[str]) -> Sequence[str]:
    """Return names of tables; UsageError where there is no such table."""
    for name in names:
        if name not in (*NAMES, "all"):
            raise UsageError(unknown("no table", name, NAMES, besides=("all",)))
    return names


def named_tables(wanted: ReportRequest, names: Sequence[str]) -> dict[str, list[Table]]:
    """Make tables as `report_tables` does, by the names that they go by."""
    check_names(names)
    chosen = NAMES if "all" in names else [name for name in NAMES if name in names]
    return {name: _TABLES[name](wanted) for name in chosen}
