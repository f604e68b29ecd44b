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
_OBJECTS = ["object_id", "name", "category", "description", "direction", "landmark_id"]
_SHOWN = ("name", "category", "description", "direction", "landmark")
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
                objects = self._release.table("objects", scene=scene, columns=_OBJECTS)
                landmarks = self._release.table("landmarks", scene=scene, columns=["landmark_id", "name"])
                at = _rows_of(objects["landmark_id"], landmarks["landmark_id"])
                objects = objects.append_column("landmark", landmarks["name"].take(at))
                at = _rows_of(routes["target_object_id"], objects["object_id"])
                for key in _SHOWN:
                    words = pc.fill_null(objects[key].cast(pa.string()).take(at), "")
                    routes = routes.append_column(key, words.dictionary_encode())
                self._read[scene] = routes
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
        matches = pa.concat_tables(parts, promote_options="default").unify_dictionaries()
        key = pc.utf8_slice_codeunits(matches[order], -12) if order == "nav_id" else matches[order]
        sort = pa.table({"key": key, "id": matches["nav_id"]})
        rank = pc.sort_indices(sort, [("key", "descending" if descending else "ascending"), ("id", "ascending")])
        rows = matches.take(rank.slice(offset, most)).to_pylist()
        return {"total": matches.num_rows, "tasks": [_to_json(row) for row in rows]}


def _rows_of(values: pa.ChunkedArray, keys: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return the row of each value among keys; null where it is none of them."""
    return pc.index_in(values, value_set=keys.combine_chunks())


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
