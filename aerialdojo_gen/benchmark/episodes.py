"""The log of a run, read: `episodes`, `steps`, `timings` and `failures` under ``<data>/<table>/<run>/``."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa

from aerialdojo_gen import store
from aerialdojo_gen.errors import StoreError

TABLES = ("episodes", "steps", "timings", "failures")


def runs(data: Path) -> list[str]:
    """List the runs that have finished at least one episode, by name."""
    return sorted({path.parent.name for path in (data / "episodes").glob("*/part-*.parquet")})


def run_scenes(data: Path, run: str) -> list[str]:
    """List the scenes that a run has episodes of, by name."""
    folder = store.shard_path(data, "episodes", "any", run=run).parent
    return sorted(path.stem.removeprefix("part-") for path in folder.glob("part-*.parquet"))


def read_run(data: Path, run: str, table: str = "episodes") -> pa.Table:
    """Read a table of a run, all its scenes.

    Parameters
    ----------
    data : Path
        The directory that `evaluate` wrote to.
    run : str
        Name of the run.
    table : str
        One of `TABLES`.

    Returns
    -------
    pyarrow.Table
        Scenes in the order of their names, rows in the order of the table's key.

    Raises
    ------
    StoreError
        There is no such run, or a part of it is damaged.
    """
    scenes = run_scenes(data, run)
    if not scenes:
        known = ", ".join(runs(data)) or "none"
        raise StoreError(f"no run {run!r} in {data} (there are: {known}): run aerialdojo-gen evaluate --run {run}")
    return pa.concat_tables([store.read_scene(data, table, scene, run=run) for scene in scenes])
