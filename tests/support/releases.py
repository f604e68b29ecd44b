"""Copies of a release that tests may change, and comparisons of what came back."""

import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import from_rows

LISTS = ("x_m", "y_m", "z_m", "yaw_rad", "action")


def copy_release(data: Path, to: Path, scenes: list[str]) -> Path:
    """A data directory with nothing but the release of some scenes."""
    for scene in scenes:
        for table, place in store.LAYOUT.items():
            if place.template.startswith("release/"):
                source = data / store.shard_name(table, scene)
                target = to / store.shard_name(table, scene)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, target)
    return to


def replace_rows(data: Path, table: str, scene: str, rows: list[dict]) -> None:
    """Write other rows in place of a scene's."""
    spec = store.LAYOUT[table].spec
    store.write_shard(data, table, scene, 0, from_rows(spec, rows))


def files_of(folder: Path) -> dict[str, bytes]:
    """All files of a folder, by their place in it."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def released(data: Path, table: str) -> pd.DataFrame:
    """All rows of tasks or routes of a release, by their id."""
    parts = [pd.read_parquet(path) for path in sorted((data / "release" / table).glob("*/*.parquet"))]
    return pd.concat(parts).set_index(f"{'task' if table == 'tasks' else 'nav'}_id").sort_index()


def imported(data: Path, table: str, name: str = "aerialdojo") -> pd.DataFrame:
    """All rows of tasks or routes of an import, by their id."""
    frame = pd.read_parquet(data / "imported" / name / table)
    return frame.set_index(f"{'task' if table == 'tasks' else 'nav'}_id").sort_index()


def assert_same(column: str, ours: pd.Series, theirs: pd.Series, tolerance: float = 0.0) -> None:
    """Values agree: exactly, angles as directions to 1e-9, floats to the tolerance; nulls where nulls were."""
    assert len(ours) == len(theirs)
    if column in LISTS:
        lengths = [len(v) for v in ours]
        assert [len(v) for v in theirs] == lengths, column
        a, b = (np.concatenate([np.asarray(v, float) for v in s] or [np.zeros(0)]) for s in (ours, theirs))
    elif pd.api.types.is_float_dtype(ours):
        a, b = ours.to_numpy(), theirs.to_numpy(float)
    else:
        assert ours.isna().tolist() == theirs.isna().tolist(), column
        assert ours.dropna().tolist() == theirs.dropna().tolist(), column
        return
    difference = np.remainder(a - b + math.pi, 2 * math.pi) - math.pi if column.endswith("yaw_rad") else a - b
    allowed = 1e-9 if column.endswith("yaw_rad") else tolerance
    assert np.all(np.abs(difference) <= allowed), f"{column}: off by {np.abs(difference).max()}"


def schema_of(path: Path) -> pa.Schema:
    """The schema of a table's first part."""
    return pq.read_schema(sorted(path.glob("*.parquet"))[0])
