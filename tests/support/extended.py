"""What a release of this version has, added to one that lacks it: viewpoints, difficulty."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from support.planting import Planted

from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import decode, encode
from aerialdojo_gen.store.schemas import VIEWPOINTS
from aerialdojo_gen.store.tables import column_digests, content_digest, from_rows

KEYS = ("train", "test")


def write_viewpoints(data: Path, scene: str, rows: list[dict[str, Any]]) -> None:
    """Write `release/viewpoints` of a scene: rows of object_id, x_m, y_m, z_m, yaw_rad."""
    kept = ("object_id", "x_m", "y_m", "z_m", "yaw_rad")
    content = [
        {"scene": scene, "viewpoint_id": k, **{name: row[name] for name in kept}} for k, row in enumerate(rows)
    ]
    store.write_shard(data, "release/viewpoints", scene, 0, from_rows(VIEWPOINTS, content))


def with_column(table: pa.Table, name: str, values: pa.Array) -> pa.Table:
    """Put a column into a table, in place of one of that name where there is one."""
    if name in table.column_names:
        at = table.column_names.index(name)
        return table.set_column(at, table.schema.field(at), values)
    return table.append_column(pa.field(name, values.type), values)


def set_columns(planted: Planted, key: str, **columns: pa.Array) -> None:
    """Set columns of a part of the release, whether this version's schema knows them or not."""
    table = pq.read_table(planted.path(key), partitioning=None)
    for name, values in columns.items():
        table = with_column(table, name, values)
    planted.write_table(key, table)


def set_difficulty(planted: Planted) -> None:
    """Give routes and tasks made-up columns of difficulty and of what training shows, by the order of their rows."""
    for side in KEYS:
        routes, tasks = planted.rows(f"routes/{side}"), planted.rows(f"tasks/{side}")
        order = {row["nav_id"]: k for k, row in enumerate(routes)}
        n, k = np.arange(len(routes)), np.array([order[row["nav_id"]] for row in tasks], dtype=np.int64)
        shares = np.where(n % 4 == 0, 0.25, 0.0)
        set_columns(
            planted, f"routes/{side}", plan_detour=pa.array(1.0 + 0.07 * (n % 9)),
            straight_line_free=pa.array(n % 3 == 0), climb_m=pa.array(1.5 * (n % 6)),
            target_visible_at_start=pa.array(shares),
        )  # fmt: skip
        set_columns(
            planted, f"tasks/{side}", target_seen_in_train=pa.array(k % 2 == 0),
            start_seen_in_train=pa.array(k % 5 != 0), pair_seen_in_train=pa.array(k % 6 == 0),
            shape_seen_in_train=pa.array(k % 7 != 0),
            target_split=pa.array(np.where(k % 4 == 0, "test", "train")),
            target_held_out=pa.array(k % 4 == 0), start_held_out=pa.array(k % 8 == 0),
        )  # fmt: skip


def without_columns(path: Path, names: tuple[str, ...]) -> None:
    """Rewrite a shard as a version wrote it that did not know some columns."""
    table = pq.ParquetFile(path).read()
    info = decode(table.schema.metadata[store.META])
    table = table.drop_columns(list(names))
    told = dataclasses.replace(info, content=content_digest(table), columns=column_digests(table))
    pq.write_table(table.replace_schema_metadata({store.META: encode(told)}), path)
