"""The tables of imported tasks: the release's columns, nullable where formats lack them, and where a row is from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa

from aerialdojo_gen.store.schemas import RELEASE_OBJECTS, ROUTES, TASKS, TableSpec
from aerialdojo_gen.store.tables import check_table, from_rows, write_file

_ROWS_A_PART = 8192
_POSES_A_PART = 1 << 17
_PICTURE_BYTES_A_PART = 16 << 20


def _field(name: str, kind: pa.DataType, meaning: str, unit: str = "", nullable: bool = True) -> pa.Field:
    return pa.field(name, kind, nullable, {"meaning": meaning} | ({"unit": unit} if unit else {}))


_SOURCE = (
    _field("source_file", pa.string(), "file that the row is from, relative to what was imported", nullable=False),
    _field("source_row", pa.int64(), "its place in that file's list, from 0", nullable=False),
    _field("source_id", pa.string(), "its id there", nullable=False),
)
_REPLAY = "metres between the recorded end and that of a replay of the file's actions; null without either"


def _imported(spec: TableSpec, required: Iterable[str], key: tuple[str, ...], *more: pa.Field) -> TableSpec:
    """The table as imports have it: all but the required columns may be null, and some stand beside them."""
    needed = {*required, *key}
    fields = [f.with_nullable(f.name not in needed) for f in spec.schema]
    return TableSpec(spec.name, pa.schema([*fields, *more]), key)


IMPORTED_TASKS = _imported(
    TASKS,
    ("task_id", "nav_id", "scene", "start_x_m", "start_y_m", "start_z_m", "start_yaw_rad"),
    ("source_file", "source_row", "modality"),
    *_SOURCE,
)
IMPORTED_ROUTES = _imported(
    ROUTES,
    ("nav_id", "scene"),
    ("source_file", "source_row"),
    _field("replay_error_m", pa.float64(), _REPLAY, "m"),
    _field(
        "source_action", pa.list_(pa.field("element", pa.string(), nullable=False)), "the file's own names of actions"
    ),
    _field("stated_length_m", pa.float64(), "length of the shortest way, as the file states it", "m"),
    *_SOURCE,
)
IMPORTED_OBJECTS = _imported(
    RELEASE_OBJECTS,
    (),
    ("scene", "object_id", "reference_image_id"),
    _field("landmark", pa.string(), "name of the landmark nearest to it"),
)


class Tables:
    """Writes rows as they come, a part when enough are there, so that memory does not grow with the files."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._rows: dict[str, list[dict[str, Any]]] = {}
        self._weight: Counter[str] = Counter()
        self._parts: Counter[str] = Counter()
        self.written: Counter[str] = Counter()
        self.nulls: Counter[str] = Counter()

    def add(self, spec: TableSpec, row: dict[str, Any]) -> None:
        """Add a row of one of the three tables; those of objects come in the order of the key."""
        if spec is IMPORTED_ROUTES:
            weight, most = len(row["x_m"] or "."), _POSES_A_PART
        elif spec is IMPORTED_OBJECTS:
            weight, most = len(row["reference_image"] or b"") + 1000, _PICTURE_BYTES_A_PART
        else:
            weight, most = 1, _ROWS_A_PART
        self._rows.setdefault(spec.name, []).append(row)
        self._weight[spec.name] += weight
        if self._weight[spec.name] >= most:
            self._flush(spec)

    def _flush(self, spec: TableSpec) -> None:
        rows = self._rows.pop(spec.name, [])
        self._weight[spec.name] = 0
        if not rows and self._parts[spec.name]:
            return
        table = check_table(spec, from_rows(spec, rows))
        for name in table.column_names:
            self.nulls[f"{spec.name}.{name}"] += table.column(name).null_count
        folder = self._root / spec.name
        folder.mkdir(exist_ok=True)
        write_file(folder / f"part-{self._parts[spec.name]:05d}.parquet", table)
        self._parts[spec.name] += 1
        self.written[spec.name] += table.num_rows

    def close(self) -> None:
        """Write what is left; every table has at least one part, if an empty one."""
        for spec in (IMPORTED_TASKS, IMPORTED_ROUTES, IMPORTED_OBJECTS):
            self._flush(spec)
