"""Episodes parted by how hard their tasks are, and by what training shows: from the log, else from the release."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from aerialdojo_gen.benchmark.grid import Table
from aerialdojo_gen.benchmark.metrics import Bools, Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import part_table
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

DIFFICULTY, SEEN = "difficulty", "seen"

# What a column's value is asked, by the heading of the part that it puts an episode into.
_Asked = Mapping[str, Callable[[Any], bool]]


def _bins(*edges: float) -> _Asked:
    """Part numbers at edges; the lowest edge is where values begin, and a rounding error below it belongs to them."""
    heads = [f"{low:g} to {high:g}" for low, high in pairwise(edges)] + [f"{edges[-1]:g} and more"]
    bounds = pairwise((-math.inf, *edges[1:], math.inf))
    return {head: _within(low, high) for head, (low, high) in zip(heads, bounds, strict=True)}


def _within(low: float, high: float) -> Callable[[Any], bool]:
    return lambda value: low <= value < high


@dataclass(frozen=True)
class _Breakdown:
    """A way to part episodes: under which heading, by which columns of which table of the release, into what."""

    kind: str
    columns: tuple[str, ...]
    title: str
    parts: _Asked
    table: str = "routes"
    note: str = ""

    @property
    def name(self) -> str:
        return " and ".join(self.columns)


_BREAKDOWNS = (
    _Breakdown(
        DIFFICULTY, ("plan_detour",), "Detour of the route (plan_detour)", _bins(1.0, 1.05, 1.2, 1.5),
        note="plan_detour: length of the route over that of the shortest one without obstacles.",
    ),
    _Breakdown(
        DIFFICULTY, ("target_visible_at_start",), "Targets in view at the start",
        {"out of view": lambda share: float(share) <= 0.0, "in view": lambda share: float(share) > 0.0},
        note="In view: one of the four views shows some of the target before the first action.",
    ),
    _Breakdown(
        DIFFICULTY, ("straight_line_free",), "The straight way to the goal",
        {"free": lambda free: free is True, "blocked": lambda free: free is False},
    ),
    _Breakdown(DIFFICULTY, ("climb_m",), "Climb of the route, m", _bins(0.0, 1.0, 3.0, 6.0)),
    _Breakdown(DIFFICULTY, ("detour_ratio",), "Detour of the route (κ)", _bins(1.0, 1.1, 1.25, 1.5)),
    _Breakdown(
        SEEN, ("target_seen_in_train",), "Targets that training shows",
        {"seen in training": lambda seen: seen is True, "unseen": lambda seen: seen is False}, "tasks",
    ),
    _Breakdown(
        SEEN, ("start_seen_in_train",), "Start poses that training shows",
        {"seen in training": lambda seen: seen is True, "unseen": lambda seen: seen is False}, "tasks",
    ),
    _Breakdown(
        SEEN, ("target_split",), "The split by target",
        {"train": lambda side: side == "train", "test": lambda side: side == "test"}, "tasks",
    ),
    _Breakdown(
        SEEN, ("target_held_out", "start_held_out"), "Objects held out from the split by target",
        {
            "neither": lambda both: both == (False, False), "target alone": lambda both: both == (True, False),
            "start alone": lambda both: both == (False, True), "target and start": lambda both: both == (True, True),
        }, "tasks",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Part:
    """Some of the episodes of every run."""

    head: str  # What they have in common
    masks: tuple[Bools, ...]  # tuple of (n,) bool; which of them, a run each


@dataclass(frozen=True)
class Breakdown:
    """Episodes parted by a column."""

    kind: str  # `DIFFICULTY` or `SEEN`
    name: str  # The column, or two of them
    title: str  # Of its table
    note: str
    parts: tuple[Part, ...]  # Those that have episodes


@dataclass(frozen=True)
class Partings:
    """All that the episodes of some runs can be parted by."""

    found: tuple[Breakdown, ...] = ()
    missing: tuple[str, ...] = ()  # Columns that neither the logs nor the release have

    @property
    def left_out(self) -> str:
        """Say what is not broken down, and why; empty where nothing is missing."""
        if not self.missing:
            return ""
        them = "it" if len(self.missing) == 1 else "them"
        return (
            f"no breakdown by {', '.join(self.missing)}: neither the release in --data nor the log has {them} "
            "(a release of this version has)"
        )


def partings_of(root: DataRoot, runs: Sequence[Run]) -> Partings:
    """Part the episodes of runs by what the release says of their tasks, or the log."""
    released = _Released(root)
    found, missing = [], []
    for b in _BREAKDOWNS:
        values = [_values(run, b, released) for run in runs]
        if any(v is None for v in values):
            missing.append(b.name)
            continue
        parts = (Part(head, tuple(_asked(v or [], is_it) for v in values)) for head, is_it in b.parts.items())
        there = tuple(part for part in parts if any(mask.any() for mask in part.masks))
        found.append(Breakdown(b.kind, b.name, b.title, b.note, there))
    return Partings(tuple(found), tuple(missing))


def parting_tables(partings: Partings, kind: str, runs: Sequence[Run], profile: Profile) -> list[Table]:
    """Make a table for every way that the episodes are parted by; where all are alike there is none."""
    tables = []
    for parting in partings.found:
        if parting.kind == kind:
            counts = [tuple(int(mask.sum()) for mask in part.masks) for part in parting.parts]
            alike = all(len(set(count)) == 1 for count in counts)
            told = "; ".join(f"{part.head}: {n[0]:,}" for part, n in zip(parting.parts, counts, strict=True))
            note = " ".join(filter(None, (parting.note, f"Episodes – {told}." if alike else "")))
            pairs = [(part.head, part.masks) for part in parting.parts]
            tables.append(part_table(parting.title, runs, profile, pairs, note))
    return [table for table in tables if table is not None]


def _asked(values: Sequence[Any], is_it: Callable[[Any], bool]) -> Bools:
    return np.array([value is not None and is_it(value) for value in values], dtype=np.bool_)


def _values(run: Run, breakdown: _Breakdown, released: _Released) -> list[Any] | None:
    """Find values for a run's episodes: in its log, else in the release; None where they are in neither."""
    if breakdown.columns == ("detour_ratio",):
        straight, flown = run.episodes.euclidean_m, run.episodes.reference_length_m
        return list(np.divide(flown, straight, out=np.full_like(flown, np.inf), where=straight > 0.0).tolist())
    columns = []
    for name in breakdown.columns:
        if name in run.table.column_names:
            column = run.table[name].to_pylist()
        else:
            keys = zip(*(run.table[key].to_pylist() for key in ("scene", "subset", "nav_id")), strict=True)
            column = [released.value(breakdown.table, scene, side, nav_id, name) for scene, side, nav_id in keys]
        if all(value is None for value in column):
            return None
        columns.append(column)
    if len(columns) == 1:
        return columns[0]
    return [None if None in row else row for row in zip(*columns, strict=True)]


class _Released:
    """What a release says of navigation tasks, a scene at a time, nothing where there is no release."""

    def __init__(self, root: DataRoot) -> None:
        self._root = root
        self._columns: dict[tuple[str, str, str], dict[str, dict[str, Any]]] = {}

    def value(self, table: str, scene: str, subset: str, nav_id: str, name: str) -> Any:
        key = (table, scene, subset)
        if key not in self._columns:
            self._columns[key] = self._read(*key)
        return self._columns[key].get(name, {}).get(nav_id)

    def _read(self, table: str, scene: str, subset: str) -> dict[str, dict[str, Any]]:
        wanted = [name for b in _BREAKDOWNS if b.table == table for name in b.columns if name != "detour_ratio"]
        found = self._stored(table, scene, subset, wanted)
        if table == "tasks" and "target_seen_in_train" not in found:
            # An older release does not say it; the targets of its routes do.
            shown = self._stored("routes", scene, "train", ["target_object_id"]).get("target_object_id", {})
            asked = self._stored("routes", scene, subset, ["target_object_id"]).get("target_object_id", {})
            targets = set(shown.values())
            found["target_seen_in_train"] = {nav_id: target in targets for nav_id, target in asked.items()}
        return found

    def _stored(self, table: str, scene: str, subset: str, names: Sequence[str]) -> dict[str, dict[str, Any]]:
        if not store.shards(self._root, f"{table}/{subset}", scene):
            # No release, or not this scene: the log speaks for itself.
            return {}
        read = store.read_stored(self._root, f"{table}/{subset}", scene, ["nav_id", *names])
        ids = read["nav_id"].to_pylist()
        return {
            name: dict(zip(ids, read[name].to_pylist(), strict=True))
            for name in read.column_names
            if name != "nav_id"
        }
