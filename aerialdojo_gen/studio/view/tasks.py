"""The tasks of a release on the start page: filtered, sorted, paged."""

from __future__ import annotations

import re
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.dataset.release import Release

_ROUTES = ["nav_id", "scene", "setting", "target_object_id", "length_m", "detour_ratio", "min_clearance_m",
           "n_actions", "split"]  # fmt: skip
_OBJECTS = ["scene", "object_id", "name", "category", "description", "direction", "landmark_id"]
_BEGINS = r"(?:^|[^\pL\pN])"
ORDERS = ("nav_id", "length_m", "detour_ratio", "min_clearance_m", "n_actions")


class TaskList:
    """Navigation tasks with their targets, read per scene on demand."""

    def __init__(self, release: Release, names: Sequence[str]) -> None:
        self._release, self._names = release, tuple(names)
        self._read: dict[str, pa.Table] = {}
        self._lock = threading.Lock()

    def _table(self, scene: str) -> pa.Table:
        with self._lock:
            if scene not in self._read:
                routes = self._release.table("routes", scene=scene, columns=_ROUTES)
                there = self._release.table("objects", scene=scene, columns=_OBJECTS).to_pylist()
                objects = {row["object_id"]: row for row in there}
                landmarks = self._release.table("landmarks", scene=scene, columns=["landmark_id", "name"]).to_pylist()
                marks = {row["landmark_id"]: row["name"] for row in landmarks}
                targets = [objects.get(k, {}) for k in routes["target_object_id"].to_pylist()]
                for key in ("name", "category", "description", "direction"):
                    words = pa.array([target.get(key) or "" for target in targets], pa.string())
                    routes = routes.append_column(key, words.dictionary_encode())
                where = pa.array([marks.get(target.get("landmark_id"), "") for target in targets], pa.string())
                self._read[scene] = routes.append_column("landmark", where.dictionary_encode())
            return self._read[scene]

    def find(
        self, scenes: Sequence[str], *, setting: str = "", split: str = "", words: str = "", order: str = "nav_id",
        descending: bool = False, offset: int = 0, most: int = 48,
    ) -> dict[str, Any]:  # fmt: skip
        """Return the matching tasks: ``total`` and the rows of one page."""
        if order not in ORDERS:
            raise UsageError(f"tasks are ordered by {', '.join(ORDERS)}")
        parts = [
            _filter(self._table(scene), setting, split, words.lower().split()) for scene in scenes or self._names
        ]
        found = pa.concat_tables(parts, promote_options="default").unify_dictionaries()
        key = pc.utf8_slice_codeunits(found[order], -12) if order == "nav_id" else found[order]
        sort = pa.table({"key": key, "id": found["nav_id"]})
        rank = pc.sort_indices(sort, [("key", "descending" if descending else "ascending"), ("id", "ascending")])
        rows = found.take(rank.slice(offset, most)).to_pylist()
        return {"total": found.num_rows, "tasks": [_to_json(row) for row in rows]}


def _filter(table: pa.Table, setting: str, split: str, words: Sequence[str]) -> pa.Table:
    keep = np.ones(table.num_rows, dtype=np.bool_)
    for column, value in (("setting", setting), ("split", split)):
        if value:
            keep &= pc.equal(table[column], value).to_numpy(zero_copy_only=False)
    for word in words:
        # A task id is its route's id plus a suffix.
        holds = pc.match_substring(table["nav_id"], re.sub("-[si]$", "", word), ignore_case=True)
        for column in ("name", "category", "description", "landmark"):
            begins = pc.match_substring_regex(
                table[column].cast(pa.string()), _BEGINS + re.escape(word), ignore_case=True
            )
            holds = pc.or_(holds, begins)
        keep &= holds.to_numpy(zero_copy_only=False)
    return table.filter(pa.array(keep))


def _to_json(row: dict[str, Any]) -> dict[str, Any]:
    rounded = {key: round(value, 3) if isinstance(value, float) else value for key, value in row.items()}
    return {"object_id" if key == "target_object_id" else key: value for key, value in rounded.items()}
