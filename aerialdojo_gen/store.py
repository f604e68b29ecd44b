"""The columnar task store: the only module that touches Parquet.

A table is a folder, a scene a folder in it, a shard a Parquet file. A shard is written under a temporary name,
checked against its schema, and renamed; its metadata carries the fingerprint of what it was made from and a digest
of its content, and no date, so that the same inputs give the same bytes.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import itertools
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from aerialdojo_gen import schemas
from aerialdojo_gen.errors import StoreError

_META = b"aerialdojo"
_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_ROW_GROUP = 65536
# For what is written without a dictionary; levels above cost five times the time for 2 % (docs/release-format.md).
_PLAIN_LEVEL = 15
_TEMPORARY = re.compile(r"^\..*\.(\d+)\.tmp(\.[A-Za-z0-9]+)?$")


@dataclass(frozen=True)
class Place:
    """Where a table's shards lie and which command writes them."""

    spec: schemas.TableSpec
    template: str
    command: str


_STAGED = "{table}/{scene}/part-{part:05d}.parquet"
_RELEASE = "release/{table}/part-{scene}.parquet"
_RUN = "{table}/{run}/part-{scene}.parquet"

LAYOUT: dict[str, Place] = {
    "scenes": Place(schemas.SCENES, _STAGED, "build-scenes"),
    "landmarks": Place(schemas.LANDMARKS, _STAGED, "annotate-import"),
    "objects": Place(schemas.OBJECTS, _STAGED, "annotate-import"),
    "chosen_anchors": Place(schemas.CHOSEN_ANCHORS, _STAGED, "annotate-import"),
    "anchors": Place(schemas.ANCHORS, _STAGED, "anchor-sample"),
    "references": Place(schemas.REFERENCES, _STAGED, "reference-images"),
    "pairs": Place(schemas.PAIRS, _STAGED, "pair-objects"),
    "plans": Place(schemas.PLANS, _STAGED, "plan"),
    "verdicts": Place(schemas.VERDICTS, _STAGED, "filter"),
    "recordings": Place(schemas.RECORDINGS, _STAGED, "render"),
    "frames": Place(schemas.FRAMES, _STAGED, "render"),
    "tasks/train": Place(schemas.TASKS, "release/tasks/{partition}_train/part-{scene}.parquet", "split"),
    "tasks/test": Place(schemas.TASKS, "release/tasks/{partition}_test/part-{scene}.parquet", "split"),
    "routes/train": Place(schemas.ROUTES, "release/routes/{partition}_train/part-{scene}.parquet", "split"),
    "routes/test": Place(schemas.ROUTES, "release/routes/{partition}_test/part-{scene}.parquet", "split"),
    "release/scenes": Place(schemas.SCENES, "release/scenes/part-{scene}.parquet", "split"),
    "release/landmarks": Place(schemas.LANDMARKS, "release/landmarks/part-{scene}.parquet", "split"),
    "release/objects": Place(schemas.RELEASE_OBJECTS, "release/objects/part-{scene}.parquet", "split"),
    "release/anchors": Place(schemas.ANCHORS, "release/anchors/part-{scene}.parquet", "split"),
    "episodes": Place(schemas.EPISODES, _RUN, "evaluate"),
    "steps": Place(schemas.STEPS, _RUN, "evaluate"),
    "timings": Place(schemas.TIMINGS, _RUN, "evaluate"),
    "failures": Place(schemas.FAILURES, _RUN, "evaluate"),
}


@dataclass(frozen=True)
class ShardInfo:
    """What a shard's footer says.

    Attributes
    ----------
    fingerprint : str
        Of the stage's version, config, inputs and assets that it was made from.
    content : str
        SHA-256 of the rows.
    rows, parts : int
        Rows in the shard; shards of the scene.
    summary : dict
        The stage's ``rows_in``, ``rows_out`` and ``counts`` of the shard.
    files : dict of str to int
        Files that were written with it, relative to the data directory, and their sizes in bytes.
    """

    fingerprint: str
    content: str
    rows: int
    parts: int
    summary: dict[str, Any]
    files: dict[str, int]


def partition(scene: str) -> str:
    """Return the partition of a scene: ``"ood"`` for the suffix ``_1``, else ``"id"``."""
    return "ood" if scene.endswith("_1") else "id"


def check_scene_name(scene: str) -> str:
    """Return the name if it is a plain one; it becomes part of paths, so StoreError for anything else."""
    if not _PLAIN.fullmatch(scene):
        raise StoreError(f"{scene!r} is not a scene name: use letters, digits, _ and - (64 at most)")
    return scene


def check_run_name(run: str) -> str:
    """Return the name if it is a plain one; it becomes part of paths, so StoreError for anything else."""
    if not _PLAIN.fullmatch(run):
        raise StoreError(f"{run!r} is no name of a run: use letters, digits, _ and - (64 at most)")
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


def from_rows(spec: schemas.TableSpec, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Make a table of rows whose keys are exactly the schema's columns.

    Parameters
    ----------
    spec : TableSpec
        The table.
    rows : sequence of mapping
        One mapping a row, column name to value; sorted here into the table's order.

    Returns
    -------
    pyarrow.Table

    Raises
    ------
    StoreError
        A row lacks a column or has one that the schema does not know: pyarrow would fill or drop it silently.
    """
    names = set(spec.schema.names)
    for row in rows:
        if row.keys() != names:
            missing, unknown = sorted(names - row.keys()), sorted(row.keys() - names)
            raise StoreError(f"a row of {spec.name} lacks {missing} and has unknown {unknown}")
    ordered = sorted(rows, key=lambda row: tuple(row[k] for k in spec.order))
    return pa.Table.from_pylist(ordered, schema=spec.schema)


def check_table(spec: schemas.TableSpec, table: pa.Table) -> pa.Table:
    """Check a table against its schema and attach the schema's metadata.

    Raises
    ------
    StoreError
        Names, types, a null in a column without nulls, rows out of the table's order, or a key that stands twice.
    """
    if (table.schema.names, table.schema.types) != (spec.schema.names, spec.schema.types):
        raise StoreError(f"{spec.name}: columns {table.schema.names} are not those of its schema, or types differ")
    # Not a cast: that fails with an error of its own on nulls, before they can be counted and named.
    table = pa.Table.from_arrays(table.columns, schema=spec.schema).combine_chunks()
    for name in spec.schema.names:
        column = table.column(name)
        nulls = column.null_count
        if pa.types.is_list(column.type):
            nulls += pc.list_flatten(column).null_count
        if nulls and not spec.schema.field(name).nullable:
            raise StoreError(f"{spec.name}: {nulls} nulls in column {name}, which has none by its schema")
    if table.num_rows > 1:
        ordered = table.select(list(spec.order))
        if not ordered.equals(ordered.sort_by([(k, "ascending") for k in spec.order])):
            raise StoreError(f"{spec.name}: rows are not sorted by {', '.join(spec.order)}")
        keys = table.select(list(spec.key))
        if keys.group_by(list(spec.key)).aggregate([]).num_rows != keys.num_rows:
            raise StoreError(f"{spec.name}: a key ({', '.join(spec.key)}) stands twice")
    return table


def content_digest(table: pa.Table) -> str:
    """Digest a table's rows (SHA-256, hexadecimal), whatever its metadata and chunks."""
    digest = hashlib.sha256(str(table.num_rows).encode())
    for name in table.column_names:
        column = table.column(name)
        # What lies under a null is nobody's business: hash where the nulls are, and the values that are there.
        pieces = [column.is_valid(), column.drop_null()] if column.null_count else [column]
        for piece in pieces:
            plain = pa.table([piece], schema=pa.schema([pa.field(name, piece.type)])).combine_chunks()
            sink = pa.BufferOutputStream()
            with pa.ipc.new_stream(sink, plain.schema) as writer:
                writer.write_table(plain)
            digest.update(sink.getvalue())
    return digest.hexdigest()


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
    files: Mapping[str, int] | None = None,
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
    meta = {
        "fingerprint": fingerprint,
        "content": content_digest(table),
        "rows": table.num_rows,
        "parts": parts,
        "summary": summary or {},
        "files": dict(files or {}),
    }
    schema_meta = dict(table.schema.metadata or {})
    schema_meta[_META] = json.dumps(meta, sort_keys=True).encode()
    path = shard_path(data, table_name, scene, part, run)
    with atomic_file(data, str(path.relative_to(data))) as temporary:
        _write(spec, table.replace_schema_metadata(schema_meta), temporary)
    return path


def _write(spec: schemas.TableSpec, table: pa.Table, path: Path) -> None:
    """Write a Parquet file with the encodings of docs/release-format.md, a row group a cluster."""
    plain = [field for field in spec.schema if field.name in spec.plain]
    leaves = {f.name: f"{f.name}.list.element" if pa.types.is_list(f.type) else f.name for f in spec.schema}
    # A picture is compressed already; all else gains.
    codec = {leaves[f.name]: "NONE" if pa.types.is_binary(f.type) else "ZSTD" for f in spec.schema}
    with pq.ParquetWriter(
        path,
        table.schema,
        compression=codec,
        compression_level={leaves[f.name]: _PLAIN_LEVEL for f in plain if not pa.types.is_binary(f.type)} or None,
        use_dictionary=[leaf for name, leaf in leaves.items() if name not in spec.plain],
        # The bounds of a list's elements bound nothing that a reader filters by.
        write_statistics=[f.name for f in spec.schema if not pa.types.is_list(f.type)],
        write_page_checksum=True,
    ) as writer:
        for begin, end in itertools.pairwise(_cluster_edges(spec, table)):
            writer.write_table(table.slice(begin, end - begin), row_group_size=_ROW_GROUP)


def _cluster_edges(spec: schemas.TableSpec, table: pa.Table) -> list[int]:
    """Rows at which a cluster begins, and the number of rows; a table without rows has one empty cluster."""
    changes = pa.array([False] * max(table.num_rows - 1, 0), pa.bool_())
    for name in spec.clusters:
        column = table.column(name).combine_chunks()
        changes = pc.or_(changes, pc.not_equal(column.slice(1), column.slice(0, max(table.num_rows - 1, 0))))
    return [0, *(i + 1 for i in pc.indices_nonzero(changes).to_pylist()), table.num_rows]


def read_info(path: Path) -> ShardInfo | None:
    """Read a shard's footer; None where it is not a shard of ours (no metadata).

    Raises
    ------
    StoreError
        The file is damaged (truncated, say), or has other rows than were written.
    """
    try:
        footer = pq.read_metadata(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise StoreError(f"{path} is damaged ({_first_line(error)}): delete it and run the command again") from None
    raw = (footer.metadata or {}).get(_META)
    if raw is None:
        return None
    meta = json.loads(raw)
    # A shard of an earlier version does not say how many rows were written.
    if meta.get("rows", footer.num_rows) != footer.num_rows:
        raise StoreError(
            f"{path} has {footer.num_rows:,} rows where {meta['rows']:,} were written: "
            "delete it and run the command again"
        )
    return ShardInfo(
        meta["fingerprint"], meta["content"], footer.num_rows, meta["parts"], meta["summary"], meta["files"]
    )


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
    _infos(data, table, scene, run)
    spec = LAYOUT[table].spec
    tables = []
    for path in shards(data, table, scene, run):
        try:
            shard = pq.read_table(
                path,
                partitioning=None,
                page_checksum_verification=True,
                columns=None if columns is None else [*columns],
            )
        except (pa.ArrowInvalid, OSError) as error:
            raise StoreError(
                f"{path} is damaged ({_first_line(error)}): delete it and run "
                f"aerialdojo-gen {LAYOUT[table].command} --scene {scene}"
            ) from None
        wanted = spec.schema if columns is None else pa.schema([spec.schema.field(name) for name in columns])
        if not shard.schema.equals(wanted):
            raise StoreError(
                f"{path} has other columns than this version's {spec.name}: delete it and run "
                f"aerialdojo-gen {LAYOUT[table].command} --scene {scene}"
            )
        tables.append(shard.replace_schema_metadata(None))
    return pa.concat_tables(tables)


@contextlib.contextmanager
def atomic_file(data: Path, relative: str) -> Iterator[Path]:
    """Write a file under the data directory: whole or not at all.

    Parameters
    ----------
    data : Path
        The data directory.
    relative : str
        Path below it; StoreError if it leads out of it.

    Yields
    ------
    Path
        A temporary path in the same folder, with the same suffix; renamed at the end, removed on an error.

    Raises
    ------
    StoreError
        The disk is full, read-only or not ours to write.
    """
    path = data / relative
    root = data.resolve()
    if not path.resolve().is_relative_to(root):
        raise StoreError(f"{relative!r} leads out of the data directory {data}")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise disk_error(error, path) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


_DISK = {
    errno.ENOSPC: "no space left on the disk",
    errno.EDQUOT: "the disk quota is used up",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EFBIG: "the file would exceed the allowed size",
    errno.ENOTDIR: "a part of the path is not a folder",
}


def disk_error(error: OSError, path: Path) -> StoreError:
    """Turn an operating-system error of writing into one line that names the file."""
    why = _DISK.get(error.errno or 0, _first_line(error))
    return StoreError(f"cannot write {path}: {why}; what was finished is kept, nothing half-written")


def sweep(folder: Path) -> None:
    """Remove temporary files that a killed run left in a folder; those of a living process stay."""
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        match = _TEMPORARY.match(path.name)
        if match and not process_alive(int(match[1])):
            path.unlink(missing_ok=True)


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


def prune_release(data: Path, scenes: Sequence[str]) -> list[str]:
    """Remove the parts of all other scenes from the release; returns the names of those removed."""
    gone = [scene for scene in release_scenes(data) if scene not in scenes]
    for scene in gone:
        for table, place in LAYOUT.items():
            if place.template.startswith("release/"):
                shard_path(data, table, scene).unlink(missing_ok=True)
    return gone


def process_alive(pid: int) -> bool:
    """Whether a process of that number runs."""
    if pid == os.getpid():
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _first_line(error: BaseException) -> str:
    text = str(error).strip().splitlines()
    return text[0][:160] if text else type(error).__name__
