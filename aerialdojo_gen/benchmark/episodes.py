"""The log of a run: `episodes`, `steps`, `timings` and `failures` under ``<folder>/<table>/<run>/``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.layout import shard_folder
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.tables import from_rows

TABLES = ("episodes", "steps", "timings", "failures")


def runs(data: Where) -> list[str]:
    """List the runs that have written episodes, by name."""
    return sorted({PurePosixPath(name).parent.name for name in open_root(data).list("episodes", "*/part-*.parquet")})


def run_scenes(data: Where, run: str) -> list[str]:
    """List the scenes that a run has written, by name."""
    names = open_root(data).list(shard_folder("episodes", "any", run), "part-*.parquet")
    return sorted(PurePosixPath(name).stem.removeprefix("part-") for name in names)


def read_run(data: Where, run: str, table: str = "episodes", columns: Sequence[str] | None = None) -> pa.Table:
    """Read a table of a run, all its scenes."""
    root = open_root(data)
    scenes = run_scenes(root, run)
    if not scenes:
        raise StoreError(f"{unknown(f'in {root} there is no run', run, runs(root))}; "
                         f"{command('evaluate', run=run)} makes it")  # fmt: skip
    return pa.concat_tables([store.read_scene(root, table, scene, columns, run=run) for scene in scenes])


def has_table(data: Where, run: str, table: str) -> bool:
    """Whether a run has a table for every scene with episodes."""
    return all(store.shards(data, table, scene, run) for scene in run_scenes(data, run))


def add_records(data: Where, run: str, scene: str, records: Sequence[dict[str, Any]], fingerprint: str) -> None:
    """Add finished episodes of a scene to a run's tables."""
    by_task = {record["task_id"]: record for record in records}
    ordered = [by_task[task_id] for task_id in sorted(by_task)]
    flown = [record for record in ordered if "episode" in record]
    new = {
        "episodes": from_rows(schemas.EPISODES, [record["episode"] for record in flown]),
        "steps": _steps(run, scene, flown),
        "timings": from_rows(schemas.TIMINGS, [record["timing"] for record in flown]),
        "failures": from_rows(schemas.FAILURES, [r["failure"] for r in ordered if "failure" in r]),
    }
    replaced = pa.array([record["task_id"] for record in flown], pa.string())
    for table in reversed(TABLES):
        rows = new[table]
        if store.shards(data, table, scene, run):
            # An episode or a newer failure replaces an older failure.
            gone = replaced if table != "failures" else pa.array(list(by_task), pa.string())
            kept = store.read_scene(data, table, scene, run=run)
            kept = kept.filter(pc.invert(pc.is_in(kept["task_id"], gone)))
            rows = pa.concat_tables([kept, rows.replace_schema_metadata(None).cast(kept.schema)])
            rows = rows.sort_by([(key, "ascending") for key in store.LAYOUT[table].spec.key])
        store.write_shard(data, table, scene, 0, rows, fingerprint=fingerprint, run=run)


def _steps(run: str, scene: str, flown: Sequence[dict[str, Any]]) -> pa.Table:
    """Join the columns of the episodes' steps."""
    parts = [schemas.STEPS.schema.empty_table()]
    for record in flown:
        own, n = {"run_id": run, "scene": scene, "task_id": record["task_id"]}, len(record["steps"]["action"])
        columns = {name: [value] * n for name, value in own.items()} | {"step": [*range(n)]} | record["steps"]
        parts.append(pa.table(columns, schema=schemas.STEPS.schema))
    return pa.concat_tables(parts)


def remove_run(data: Where, run: str) -> None:
    """Remove a run's tables."""
    root = open_root(data)
    for table in TABLES:
        for name in root.list(shard_folder(table, "any", run), "part-*.parquet"):
            root.delete(name)
