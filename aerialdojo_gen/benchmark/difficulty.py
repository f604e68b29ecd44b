"""Breakdowns of episodes by difficulty and by what training shows: from the log, else from the release."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from aerialdojo_gen.benchmark.metrics import Strings
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

DIFFICULTY, SEEN = "difficulty", "seen"

# Parts of a breakdown by their headings: the value that belongs to each, or which values do.
_Parts = Mapping[str, Any]
_Columns = dict[str, dict[str, Any]]


def _bins(*edges: float) -> _Parts:
    """Bins of numbers; a rounding error below the lowest edge belongs to the first bin."""
    heads = [f"{low:g} to {high:g}" for low, high in pairwise(edges)] + [f"{edges[-1]:g} and more"]
    bounds = pairwise((-math.inf, *edges[1:], math.inf))
    return {h: lambda value, ends=ends: ends[0] <= value < ends[1] for h, ends in zip(heads, bounds, strict=True)}


@dataclass(frozen=True)
class Breakdown:
    """A breakdown of episodes by columns of a release table."""

    kind: str  # `DIFFICULTY` or `SEEN`
    columns: tuple[str, ...]
    title: str  # Of its table
    conditions: _Parts
    table: str = "routes"
    note: str = ""
    labels: tuple[Strings, ...] = ()  # Which part every episode belongs to, (n,) a run; empty for none

    @property
    def name(self) -> str:
        """The column, or two of them."""
        return " and ".join(self.columns)

    @property
    def parts(self) -> tuple[str, ...]:
        """Headings of the parts that have episodes."""
        return tuple(head for head in self.conditions if any((own == head).any() for own in self.labels))


_SPECS = (
    Breakdown(
        DIFFICULTY, ("plan_detour",), "Detour of the route (plan_detour)", _bins(1.0, 1.05, 1.2, 1.5),
        note="plan_detour: length of the route over that of the shortest one without obstacles.",
    ),
    Breakdown(
        DIFFICULTY, ("target_visible_at_start",), "Targets in view at the start",
        {"out of view": lambda share: float(share) <= 0.0, "in view": lambda share: float(share) > 0.0},
        note="In view: one of the four views shows some of the target before the first action.",
    ),
    Breakdown(DIFFICULTY, ("straight_line_free",), "The straight way to the goal", {"free": True, "blocked": False}),
    Breakdown(DIFFICULTY, ("climb_m",), "Climb of the route, m", _bins(0.0, 1.0, 3.0, 6.0)),
    Breakdown(DIFFICULTY, ("detour_ratio",), "Detour of the route (κ)", _bins(1.0, 1.1, 1.25, 1.5)),
    *(
        Breakdown(
            SEEN, (f"{what}_seen_in_train",), f"{title} that training shows",
            {"seen in training": True, "unseen": False}, "tasks",
        )
        for what, title in (
            ("target", "Targets"), ("start", "Start poses"), ("pair", "Pairs of start object and target"),
            ("shape", "Shapes of targets"),
        )
    ),
    Breakdown(SEEN, ("target_split",), "The split by target", {"train": "train", "test": "test"}, "tasks"),
    Breakdown(
        SEEN, ("target_held_out", "start_held_out"), "Objects held out from the split by target",
        {
            "neither": (False, False), "target alone": (True, False), "start alone": (False, True),
            "target and start": (True, True),
        }, "tasks",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Breakdowns:
    """All breakdowns of the episodes of some runs."""

    found: Mapping[str, Breakdown]  # By name
    missing: Sequence[str]  # Columns that neither the logs nor the release have

    @property
    def missing_note(self) -> str:
        """Name the missing breakdowns and the reason; empty if none is missing."""
        if not self.missing:
            return ""
        them = "it" if len(self.missing) == 1 else "them"
        return (
            f"no breakdown by {', '.join(self.missing)}: neither the release in --data nor the log has {them} "
            "(a release of this version has)"
        )


def find_breakdowns(root: DataRoot, runs: Sequence[Run]) -> Breakdowns:
    """Break the episodes of runs down by columns of the log, or of the release."""
    released = cache(partial(_released, root))
    found, missing = {}, []
    for b in _SPECS:
        values = [_values(run, b, released) for run in runs]
        if any(v is None for v in values):
            missing.append(b.name)
            continue
        labels = tuple(np.array([_label(value, b.conditions) for value in v or []], dtype=np.str_) for v in values)
        found[b.name] = replace(b, labels=labels)
    return Breakdowns(found, missing)


def _label(value: Any, parts: _Parts) -> str:
    if value is None:
        return ""
    return next((head for head, own in parts.items() if (own(value) if callable(own) else own == value)), "")


def _values(run: Run, breakdown: Breakdown, released: Callable[[str, str, str], _Columns]) -> list[Any] | None:
    """Return a column's values for a run's episodes, from its log or the release; None if neither has it."""
    if breakdown.columns == ("detour_ratio",):
        straight, flown = run.episodes["euclidean_m"], run.episodes["reference_length_m"]
        return list(np.divide(flown, straight, out=np.full_like(flown, np.inf), where=straight > 0.0).tolist())
    columns = []
    for name in breakdown.columns:
        if name in run.table.column_names:
            column = run.table[name].to_pylist()
        else:
            keys = zip(*(run.table[key].to_pylist() for key in ("scene", "subset", "nav_id")), strict=True)
            column = [released(breakdown.table, scene, side).get(name, {}).get(nav) for scene, side, nav in keys]
        if all(value is None for value in column):
            return None
        columns.append(column)
    if len(columns) == 1:
        return columns[0]
    return [None if None in row else row for row in zip(*columns, strict=True)]


def _released(root: DataRoot, table: str, scene: str, subset: str) -> _Columns:
    """Read a release's columns, by navigation task; none where there is no release."""
    if not store.shards(root, f"{table}/{subset}", scene):
        return {}
    names = [name for b in _SPECS if b.table == table for name in b.columns if name != "detour_ratio"]
    read = store.read_stored(root, f"{table}/{subset}", scene, ["nav_id", *names]).to_pydict()
    ids = read.pop("nav_id")
    return {name: dict(zip(ids, values, strict=True)) for name, values in read.items()}
