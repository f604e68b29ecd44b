"""The columnar task store: how a shard is written to a data root and read from it.

A shard is checked against its schema, made in a file of this machine, and committed whole or not at all; its metadata
carries the fingerprint of what it was made from and a digest of its content, and no date, so that the same inputs
give the same bytes. Where shards lie is said by `aerialdojo_gen.store.layout`, whose names stand here too.

Every function takes a data root, or a directory or URL to open as one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import pyarrow as pa

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import DamagedFile, StoreError, first_line
from aerialdojo_gen.store.footers import ShardFile, ShardInfo, decode, encode
from aerialdojo_gen.store.layout import (
    LAYOUT,
    Place,
    check_run_name,
    check_scene_name,
    partition,
    shard_folder,
    shard_name,
)
from aerialdojo_gen.store.root import DataRoot, Where, open_root

META = b"aerialdojo"


def shards(data: Where, table: str, scene: str, run: str = "default") -> list[str]:
    """List the existing shards of a scene, by part: their names, relative to the data root."""
    name = shard_name(table, scene, run=run)
    pattern = name.rpartition("/")[2] if LAYOUT[table].one_part else "part-*.parquet"
    return open_root(data).list(shard_folder(table, scene, run), pattern)


def write_shard(
    data: Where, table_name: str, scene: str, part: int, table: pa.Table, *, fingerprint: str = "", parts: int = 1,
    summary: Mapping[str, Any] | None = None, files: Mapping[str, ShardFile] | None = None, run: str = "default",
) -> Path:  # fmt: skip
    """Check a table, write it as a shard, and give it its name when it is whole."""
    # Here alone, as in the other functions: half of what importing Arrow takes is what works on rows.
    from aerialdojo_gen.store.tables import check_table, column_digests, content_digest, write_clustered

    spec = LAYOUT[table_name].spec
    table = check_table(spec, table)
    info = ShardInfo(
        fingerprint, content_digest(table), column_digests(table), table.num_rows, parts, dict(summary or {}),
        dict(files or {}),
    )  # fmt: skip
    schema_meta = dict(table.schema.metadata or {})
    schema_meta[META] = encode(info)
    root, name = open_root(data), shard_name(table_name, scene, part, run)
    with root.commit(name) as temporary:
        write_clustered(spec, table.replace_schema_metadata(schema_meta), temporary)
    return root.local_copy(name)


def read_info(data: Where, name: str) -> ShardInfo:
    """Read a shard's footer."""
    root = open_root(data)
    try:
        version = root.version(name)
    except FileNotFoundError:
        raise StoreError(f"cannot read {root.at(name)}: No such file or directory") from None
    except OSError as error:
        raise StoreError(f"cannot read {root.at(name)}: {error.strerror or first_line(error)}") from None
    return _read_info(root, name, version)


@lru_cache(maxsize=8192)
def _read_info(root: DataRoot, name: str, version: str) -> ShardInfo:
    # A shard is never written to, only replaced; a run asks for the same footer half a dozen times.
    from aerialdojo_gen.store.tables import read_footer

    where, hint = root.at(name), "delete it and run the command again"
    try:
        with root.open(name) as file:
            rows, metadata = read_footer(file, where)
    except FileNotFoundError:
        raise StoreError(f"cannot read {where}: No such file or directory") from None
    except DamagedFile as error:
        raise DamagedFile(f"{error}: {hint}") from None
    if META not in metadata:
        raise DamagedFile(f"{where} is damaged (not written by aerialdojo-gen): {hint}")
    try:
        info = decode(metadata[META])
    except ValueError as error:
        raise DamagedFile(f"{where} is damaged ({error}): {hint}") from None
    if info.rows != rows:
        raise DamagedFile(f"{where} has {rows:,} rows where {info.rows:,} were written: {hint}")
    return info


def count_rows(data: Where, table: str, scene: str) -> int:
    """Count a scene's rows from the footers of its shards."""
    return sum(info.rows for info in _parts(data, table, scene).values())


def content(data: Where, table: str, scene: str) -> list[str]:
    """Return the content digests of a scene's shards, by part."""
    return [info.content for info in _parts(data, table, scene).values()]


def _parts(data: Where, table: str, scene: str, run: str = "default") -> dict[str, ShardInfo]:
    """Read the footers of all of a scene's shards, by name; StoreError where one is missing, or is one too many."""
    root = open_root(data)
    infos = {name: read_info(root, name) for name in shards(root, table, scene, run)}
    whole = [shard_name(table, scene, part, run) for part in range(len(infos))]
    if not infos or [*infos] != whole or any(info.parts != len(infos) for info in infos.values()):
        raise StoreError(f"{table} of {scene} is missing or incomplete in {root}: "
                         f"run {command(LAYOUT[table].command, scene=scene)}")  # fmt: skip
    return infos


def read_scene(
    data: Where, table: str, scene: str, columns: Sequence[str] | None = None, run: str = "default"
) -> pa.Table:
    """Read all of a scene's rows of a table, with nulls for columns that its shards lack and may lack."""
    root, spec = open_root(data), LAYOUT[table].spec
    schema = spec.schema if columns is None else pa.schema([spec.schema.field(name) for name in columns])
    tables = []
    for name, info in _parts(root, table, scene, run).items():
        stored = pa.schema([field for field in schema if field.name in info.columns or not field.nullable])
        foreign = info.columns.keys() - set(spec.schema.names) if columns is None else set()
        fits = not foreign and set(stored.names) <= info.columns.keys()
        shard = _read_shard(root, table, scene, name, info, stored.names) if fits else None
        if shard is None or not shard.schema.equals(stored):
            raise StoreError(
                f"{root.at(name)} has other columns than this version's {spec.name}: {_hint(table, scene)}"
            )
        arrays = [shard[f.name] if f.name in stored.names else pa.nulls(shard.num_rows, f.type) for f in schema]
        tables.append(pa.Table.from_arrays(arrays, schema=schema.remove_metadata()))
    return pa.concat_tables(tables)


def read_stored(data: Where, table: str, scene: str, columns: Sequence[str]) -> pa.Table:
    """Read those of some columns that a scene's shards have, whatever version wrote them."""
    root = open_root(data)
    parts = _parts(root, table, scene)
    stored = [name for name in columns if all(name in info.columns for info in parts.values())]
    shards = [_read_shard(root, table, scene, name, info, stored) for name, info in parts.items()]
    return pa.concat_tables([shard.replace_schema_metadata(None) for shard in shards])


def _read_shard(
    root: DataRoot, table: str, scene: str, name: str, info: ShardInfo, columns: Sequence[str]
) -> pa.Table:
    """Read columns of a shard, and compare them with the digests in its footer."""
    from aerialdojo_gen.store.tables import column_digests, read_file

    where, hint = root.at(name), _hint(table, scene)
    try:
        shard = read_file(root.local_copy(name), columns, where)
    except FileNotFoundError:
        raise StoreError(f"{where} was removed while it was read: run the command again") from None
    except DamagedFile as error:
        raise DamagedFile(f"{error}: {hint}") from None
    # The checksums of Parquet's pages do not say which column a page is of, nor what its values mean.
    if any(info.columns[column] != digest for column, digest in column_digests(shard).items()):
        raise DamagedFile(f"{where} is damaged (other rows than were written): {hint}")
    return shard


def _hint(table: str, scene: str) -> str:
    return f"delete it and run {command(LAYOUT[table].command, scene=scene)}"


def prune(data: Where, table: str, scene: str, parts: int) -> None:
    """Remove shards of a scene beyond its number of parts (an earlier run had more)."""
    root = open_root(data)
    keep = {shard_name(table, scene, part) for part in range(parts)}
    for name in shards(root, table, scene):
        if name not in keep:
            root.delete(name)
