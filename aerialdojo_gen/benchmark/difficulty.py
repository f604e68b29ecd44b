"""Which tasks are hard, and which targets training shows: taken from the log, else from the release."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from aerialdojo_gen.benchmark.breakdowns import part_table
from aerialdojo_gen.benchmark.grid import Table
from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

# Columns that a release or a log may have; one that is in neither has no table.
_YES_NO = {
    "target_seen_in_train": ("Targets that training shows", "seen in training", "unseen"),
    "target_visible_at_start": ("Targets in view at the start", "in view", "out of view"),
    "straight_line_free": ("The straight way to the goal", "free", "blocked"),
}
_MEASURED = {
    "plan_detour": ("Detour of the route (plan_detour)", (1.05, 1.2, 1.5)),
    "detour_ratio": ("Detour of the route (κ)", (1.1, 1.25, 1.5)),
}


def difficulty_tables(root: DataRoot, runs: Sequence[Run], profile: Profile) -> list[Table]:
    """Make a table for every measure of difficulty that the release has, or the log.

    Parameters
    ----------
    root : DataRoot
        The data root. Without a release only what the log says is shown.
    runs : sequence of Run
    profile : Profile

    Returns
    -------
    list of Table
        Seen and unseen targets first. A measure by which all episodes are alike has none.
    """
    released = _Released(root)
    tables = []
    for name, (title, yes, no) in _YES_NO.items():
        values = [_values(run, name, released) for run in runs]
        if all(v is not None for v in values):
            parts = [(yes, [_is(v, True) for v in values]), (no, [_is(v, False) for v in values])]
            tables.append(part_table(title, runs, profile, parts))
    for name, (title, edges) in _MEASURED.items():
        values = [_values(run, name, released) for run in runs]
        if all(v is not None for v in values):
            bounds = [-np.inf, *edges, np.inf]
            parts = [(_range(low, high), [_within(v, low, high) for v in values]) for low, high in pairwise(bounds)]
            tables.append(part_table(title, runs, profile, parts))
    return [table for table in tables if table is not None]


def _is(values: Any, truth: bool) -> Any:
    return np.array([value is truth for value in values], dtype=np.bool_)


def _within(values: Any, low: float, high: float) -> Any:
    return np.array([value is not None and low <= value < high for value in values], dtype=np.bool_)


def _range(low: float, high: float) -> str:
    if np.isinf(low):
        return f"below {high:g}"
    return f"{low:g} and more" if np.isinf(high) else f"{low:g} to {high:g}"


def _values(run: Run, name: str, released: _Released) -> list[Any] | None:
    """Find a column's values for a run's episodes: in its log, else in the release; None where it is in neither."""
    if name in run.table.column_names:
        return list(run.table[name].to_pylist())
    keys = run.table.select(["scene", "subset", "nav_id"]).to_pylist()
    if name == "detour_ratio":
        straight, flown = run.episodes.euclidean_m, run.episodes.reference_length_m
        return list(np.divide(flown, straight, out=np.full_like(flown, np.inf), where=straight > 0.0).tolist())
    found = [released.value(row["scene"], row["subset"], row["nav_id"], name) for row in keys]
    return found if any(value is not None for value in found) else None


class _Released:
    """What a release says of navigation tasks, a scene at a time, nothing where there is no release."""

    def __init__(self, root: DataRoot) -> None:
        self._root = root
        self._columns: dict[tuple[str, str, str], dict[str, Any]] = {}

    def value(self, scene: str, subset: str, nav_id: str, name: str) -> Any:
        key = (scene, subset, name)
        if key not in self._columns:
            self._columns[key] = self._read(scene, subset, name)
        return self._columns[key].get(nav_id)

    def _read(self, scene: str, subset: str, name: str) -> dict[str, Any]:
        for table in ("routes", "tasks"):
            if name in store.LAYOUT[f"{table}/{subset}"].spec.schema.names:
                return self._column(table, scene, subset, name)
        if name != "target_seen_in_train":
            return {}
        # Not every release says it; the targets of its routes do.
        shown = set(self._column("routes", scene, "train", "target_object_id").values())
        asked = self._column("routes", scene, subset, "target_object_id")
        return {nav_id: target in shown for nav_id, target in asked.items()}

    def _column(self, table: str, scene: str, subset: str, name: str) -> dict[str, Any]:
        try:
            found = store.read_scene(self._root, f"{table}/{subset}", scene, ["nav_id", name])
        except StoreError:
            # No release, or one of another version: the log speaks for itself.
            return {}
        return dict(zip(found["nav_id"].to_pylist(), found[name].to_pylist(), strict=True))
