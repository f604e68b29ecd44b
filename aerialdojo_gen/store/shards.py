"""The columnar task store: which tables there are, where their shards lie, and how a shard is written and read.

A table is a folder, a scene a folder in it, a shard a Parquet file. A shard is written under a temporary name,
checked against its schema, and renamed; its metadata carries the fingerprint of what it was made from and a digest
of its content, and no date, so that the same inputs give the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import pyarrow as pa

from aerialdojo_gen.common.names import choose_scenes
from aerialdojo_gen.errors import StoreError, brief
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.footers import ShardFile, ShardInfo, decode, encode
from aerialdojo_gen.store.parquet_files import read_file, read_footer, write_clustered
from aerialdojo_gen.store.tables import check_table, column_digests, content_digest

META = b"aerialdojo"
_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


@dataclass(frozen=True)
class Place:
    """Where a table's shards lie and which command writes them."""

    spec: schemas.TableSpec
    template: str
    command: str


_STAGED = "{table}/{scene}/part-{part:05d}.parquet"
_RUN = "{table}/{run}/part-{scene}.parquet"

LAYOUT: dict[str, Place] = {
    **{name: Place(spec, _STAGED, spec.command) for name, spec in schemas.TABLES.items()},
    "tasks/train": Place(schemas.TASKS, "release/tasks/{partition}_train/part-{scene}.parquet", "split"),
    "tasks/test": Place(schemas.TASKS, "release/tasks/{partition}_test/part-{scene}.parquet", "split"),
    "routes/train": Place(schemas.ROUTES, "release/routes/{partition}_train/part-{scene}.parquet", "split"),
    "routes/test": Place(schemas.ROUTES, "release/routes/{partition}_test/part-{scene}.parquet", "split"),
    "release/scenes": Place(schemas.SCENES, "release/scenes/part-{scene}.parquet", "split"),
    "release/landmarks": Place(schemas.LANDMARKS, "release/landmarks/part-{scene}.parquet", "split"),
    "release/objects": Place(schemas.RELEASE_OBJECTS, "release/objects/part-{scene}.parquet", "split"),
    "release/anchors": Place(schemas.RELEASE_ANCHORS, "release/anchors/part-{scene}.parquet", "split"),
    "episodes": Place(schemas.EPISODES, _RUN, "evaluate"),
    "steps": Place(schemas.STEPS, _RUN, "evaluate"),
    "timings": Place(schemas.TIMINGS, _RUN, "evaluate"),
    "failures": Place(schemas.FAILURES, _RUN, "evaluate"),
}


def partition(scene: str) -> str:
    """Return the partition of a scene: ``"ood"`` for the suffix ``_1``, else ``"id"``."""
    return "ood" if scene.endswith("_1") else "id"


def check_scene_name(scene: str) -> str:
    """Return the name if it is a plain one; it becomes part of paths, so StoreError for anything else."""
    if not _PLAIN.fullmatch(scene):
        raise StoreError(f"{brief(repr(scene), 60)} is not a scene name: use letters, digits, _ and - (64 at most)")
    return scene


def check_run_name(run: str) -> str:
    """Return the name if it is a plain one; it becomes part of paths, so StoreError for anything else."""
    if not _PLAIN.fullmatch(run):
        raise StoreError(f"{brief(repr(run), 60)} is no name of a run: use letters, digits, _ and - (64 at most)")
    return run


def shard_path(data: Path, table: str, scene: str, part: int = 0, run: str = "default") -> Path:
    """Return the path of a shard under the data directory; `run` names the run in tables of the benchmark."""
    return data / LAYOUT[table].template.format(
        table=table, scene=check_scene_name(scene), part=part, partition=partition(scene), run=check_run_name(run)
    )


def shards(data: Path, table: str, scene: str, run: str = "default") -> list[Path]:
    """List the existing shards of a scene, by part."""
    first = shard_path(data, table, scene, run=run)
    if "{part:" not in LAYOUT[table].template:
        return [first] if first.exists() else []
    return sorted(first.parent.glob("part-*.parquet"))


def write_shard(
    data: Path,
    table_name: str,
    scene: str,
    part: int,
    table: pa.Table,
    *,
    fingerprint: str = "",
    parts: int = 1,
    summary: Mapping[str, Any] | None = None,
    files: Mapping[str, ShardFile] | None = None,
    run: str = "default",
) -> Path:
    """Check a table, write it as a shard, and give it its name when it is whole.

    Returns
    -------
    Path
        The shard.

    Raises
    ------
    StoreError
        The table does not fit its schema, or the disk is full or read-only; nothing is left behind.
    """
    spec = LAYOUT[table_name].spec
    table = check_table(spec, table)
    info = ShardInfo(
        fingerprint,
        content_digest(table),
        column_digests(table),
        table.num_rows,
        parts,
        dict(summary or {}),
        dict(files or {}),
    )
    schema_meta = dict(table.schema.metadata or {})
    schema_meta[META] = encode(info)
    path = shard_path(data, table_name, scene, part, run)
    with atomic_file(data, str(path.relative_to(data))) as temporary:
        write_clustered(spec, table.replace_schema_metadata(schema_meta), temporary)
    return path


def read_info(path: Path) -> ShardInfo | None:
    """Read a shard's footer; None where it is not a shard of ours (no metadata).

    Raises
    ------
    StoreError
        The file is damaged (truncated, say), or has other rows than were written.
    """
    try:
        stat = path.stat()
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror}") from None
    return _read_info(path, stat.st_ino, stat.st_size, stat.st_mtime_ns)


@lru_cache(maxsize=8192)
def _read_info(path: Path, _inode: int, _size: int, _mtime_ns: int) -> ShardInfo | None:
    # A shard is never written to, only replaced; a run asks for the same footer half a dozen times.
    try:
        rows, metadata = read_footer(path)
    except StoreError as error:
        raise StoreError(f"{error}: delete it and run the command again") from None
    raw = metadata.get(META)
    if raw is None:
        return None
    try:
        info = decode(raw)
    except ValueError as error:
        raise StoreError(f"{path} is damaged ({error}): delete it and run the command again") from None
    if info.rows != rows:
        raise StoreError(
            f"{path} has {rows:,} rows where {info.rows:,} were written: delete it and run the command again"
        )
    return info


def count_rows(data: Path, table: str, scene: str) -> int:
    """Count a scene's rows from the footers of its shards."""
    return sum(info.rows for info in _infos(data, table, scene))


def content(data: Path, table: str, scene: str) -> list[str]:
    """Return the content digests of a scene's shards, by part."""
    return [info.content for info in _infos(data, table, scene)]


def _infos(data: Path, table: str, scene: str, run: str = "default") -> list[ShardInfo]:
    paths = shards(data, table, scene, run)
    infos = [read_info(path) for path in paths]
    if not infos or infos[0] is None or len(infos) != infos[0].parts:
        command = LAYOUT[table].command
        raise StoreError(f"{table} of {scene} is missing or incomplete in {data}: "
                         f"run aerialdojo-gen {command} --scene {scene}")  # fmt: skip
    return [info for info in infos if info is not None]


def read_scene(
    data: Path, table: str, scene: str, columns: Sequence[str] | None = None, run: str = "default"
) -> pa.Table:
    """Read all of a scene's rows of a table.

    Parameters
    ----------
    data : Path
        The data directory.
    table : str
        A key of `LAYOUT`.
    scene : str
        Name of the scene.
    columns : sequence of str, optional
        Read these columns alone.
    run : str
        Name of the run, for tables of the benchmark.

    Returns
    -------
    pyarrow.Table
        With the table's schema, parts in their order.

    Raises
    ------
    StoreError
        A shard is missing, damaged or of another schema; the message names it and what to run.
    """
    infos = _infos(data, table, scene, run)
    spec = LAYOUT[table].spec
    wanted = spec.schema if columns is None else pa.schema([spec.schema.field(name) for name in columns])
    mend = f"delete it and run aerialdojo-gen {LAYOUT[table].command} --scene {scene}"
    tables = []
    for path, info in zip(shards(data, table, scene, run), infos, strict=True):
        try:
            shard = read_file(path, columns)
        except StoreError as error:
            raise StoreError(f"{error}: {mend}") from None
        if not shard.schema.equals(wanted):
            raise StoreError(f"{path} has other columns than this version's {spec.name}: {mend}")
        # The checksums of Parquet's pages do not say which column a page is of, nor what its values mean.
        if info.columns and any(info.columns.get(name) != own for name, own in column_digests(shard).items()):
            raise StoreError(f"{path} is damaged (other rows than were written): {mend}")
        tables.append(pa.Table.from_arrays(shard.columns, schema=wanted.remove_metadata()))
    return pa.concat_tables(tables)


def prune(data: Path, table: str, scene: str, parts: int) -> None:
    """Remove shards of a scene beyond its number of parts (an earlier run had more)."""
    keep = {shard_path(data, table, scene, part) for part in range(parts)}
    for path in shards(data, table, scene):
        if path not in keep:
            path.unlink(missing_ok=True)


def release_scenes(data: Path) -> list[str]:
    """List the scenes that any table of the release has a part of, by name.

    A scene that lacks a part is listed too, so that whoever reads it is told.
    """
    patterns = [p.template.format(partition="*", scene="*") for p in LAYOUT.values() if p.template[:8] == "release/"]
    names = {path.stem.removeprefix("part-") for pattern in patterns for path in data.glob(pattern)}
    return sorted(name for name in names if _PLAIN.fullmatch(name))


def scenes_in_release(data: Path, patterns: Sequence[str] | None = None) -> list[str]:
    """Resolve names and globs to scenes of the release, by name; all of them where there are no patterns.

    Raises
    ------
    StoreError
        There is no release.
    UsageError
        A pattern matches nothing; the message gives the nearest names.
    """
    known = release_scenes(data)
    if not known:
        raise StoreError(f"there is no release in {data}: run aerialdojo-gen split, or give --data")
    return choose_scenes(patterns, known)


def prune_release(data: Path, scenes: Sequence[str]) -> list[str]:
    """Remove the parts of all other scenes from the release; returns the names of those removed."""
    gone = [scene for scene in release_scenes(data) if scene not in scenes]
    for scene in gone:
        for table, place in LAYOUT.items():
            if place.template.startswith("release/"):
                shard_path(data, table, scene).unlink(missing_ok=True)
    return gone
