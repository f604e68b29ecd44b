"""Tables: made of rows, checked by their schema, identified by their content; and as Parquet files by their path.

No other module reads or writes Parquet.
"""

from __future__ import annotations

import errno
import hashlib
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from aerialdojo_gen.base.errors import DamagedFile, StoreError, first_line
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.schemas import TableSpec

_ROW_GROUP = 65536
# For what is written without a dictionary; level 15 takes three times as long for 2 % (docs/release-format.md).
_PLAIN_LEVEL = 12
# What reading a damaged file raises: a name may be no UTF-8, a count larger than the memory.
_DAMAGE = (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError)


def from_rows(spec: TableSpec, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Make a table of rows whose keys are exactly the schema's columns."""
    names = set(spec.schema.names)
    for row in rows:
        if not isinstance(row, Mapping):
            raise StoreError(f"a row of {spec.name} is no mapping of columns to values: {type(row).__name__}")
        if row.keys() != names:
            missing, unknown = sorted(names - row.keys()), sorted(row.keys() - names)
            raise StoreError(f"a row of {spec.name} lacks {missing} and has unknown {unknown}")
    try:
        ordered = sorted(rows, key=lambda row: tuple(row[k] for k in spec.order))
        return pa.Table.from_pylist(ordered, schema=spec.schema)
    except (pa.ArrowException, TypeError, ValueError, OverflowError) as error:
        raise StoreError(f"a row of {spec.name} has a value of another type: {first_line(error)}") from error


def check_table(spec: TableSpec, table: pa.Table) -> pa.Table:
    """Check a table against its schema and attach the schema's metadata."""
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
        if keys.group_by(list(spec.key), use_threads=False).aggregate([]).num_rows != keys.num_rows:
            raise StoreError(f"{spec.name}: duplicate key ({', '.join(spec.key)})")
    return table


def content_digest(table: pa.Table) -> str:
    """Digest a table's rows (SHA-256, hexadecimal), whatever its metadata and chunks."""
    return _digest(table, table.column_names)


def column_digests(table: pa.Table) -> dict[str, str]:
    """Digest every column by itself (SHA-256, its first 32 hexadecimal digits), whatever metadata and chunks."""
    # Half of it detects damage as well, and a footer has one for each column, twice.
    return {name: _digest(table, [name])[:32] for name in table.column_names}


def _digest(table: pa.Table, names: Sequence[str]) -> str:
    digest = hashlib.sha256(str(table.num_rows).encode())
    for name in names:
        for piece in _pieces(table, name):
            digest.update(piece)
    return digest.hexdigest()


def _pieces(table: pa.Table, name: str) -> Iterator[pa.Buffer]:
    column = table.column(name)
    # What lies under a null is nobody's business: hash where the nulls are, and the values that are there.
    for piece in [column.is_valid(), column.drop_null()] if column.null_count else [column]:
        plain = pa.table([piece], schema=pa.schema([pa.field(name, piece.type)])).combine_chunks()
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, plain.schema) as writer:
            writer.write_table(plain)
        yield sink.getvalue()


def read_file(path: Path, columns: Sequence[str] | None = None, label: str = "") -> pa.Table:
    """Read one Parquet file as it is, its page checksums verified."""
    names = None if columns is None else [*columns]
    try:
        # In this thread: where memory is short Arrow's pool gets no thread, and waits for one for ever. The processes
        # beside this one read meanwhile.
        with pq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False) as file:
            # Names are decoded when they are asked for; a column that is not there is left out unasked.
            missing = set(names or ()) - set(file.schema_arrow.names)
            if missing:
                raise pa.ArrowInvalid(f"no column {min(missing)}")
            table = file.read(names, use_threads=False)
            return table if names is None else table.select(names)
    except _DAMAGE as error:
        raise _unreadable(error, label or path) from None


def read_footer(file: Path | BinaryIO, label: str = "") -> tuple[int, dict[bytes, bytes]]:
    """Return how many rows a Parquet file says it has, and its metadata."""
    try:
        footer = pq.read_metadata(file)
    except _DAMAGE as error:
        raise _unreadable(error, label or file) from None
    return footer.num_rows, dict(footer.metadata or {})


def _unreadable(error: BaseException, where: object) -> StoreError:
    """Tell a file that the system does not let us read from one that is damaged, which messages advise to delete."""
    number = error.errno if isinstance(error, OSError) else None
    # Places that a damaged footer names may lie before the file's beginning: EINVAL.
    if number and number != errno.EINVAL:
        return StoreError(f"cannot read {where}: {os.strerror(number)}")
    return DamagedFile(f"{where} is damaged ({first_line(error)})")


def write_file(path: Path, table: pa.Table) -> None:
    """Write a table that is no shard (a report, say) as one Parquet file, whole or not at all."""
    with atomic_file(path.parent, path.name) as temporary:
        pq.write_table(table, temporary, compression="zstd")


def write_clustered(spec: TableSpec, table: pa.Table, path: Path) -> None:
    """Write a Parquet file with the encodings of docs/release-format.md, a row group a cluster."""
    plain = [field for field in spec.schema if field.name in spec.plain]
    leaves = {field.name: _leaves(field.name, field.type) for field in spec.schema}
    # A picture is compressed already; all else gains.
    codec = {leaf: "NONE" if pa.types.is_binary(f.type) else "ZSTD" for f in spec.schema for leaf in leaves[f.name]}
    with pq.ParquetWriter(
        path,
        table.schema,
        compression=codec,
        compression_level={
            leaf: _PLAIN_LEVEL for f in plain if not pa.types.is_binary(f.type) for leaf in leaves[f.name]
        }
        or None,
        use_dictionary=[leaf for name, own in leaves.items() if name not in spec.plain for leaf in own],
        # The bounds of a list's elements bound nothing that a reader filters by.
        write_statistics=[f.name for f in spec.schema if not pa.types.is_list(f.type)],
        write_page_checksum=True,
    ) as writer:
        for begin, end in itertools.pairwise(_cluster_edges(spec, table)):
            writer.write_table(table.slice(begin, end - begin), row_group_size=_ROW_GROUP)


def _leaves(name: str, kind: pa.DataType) -> list[str]:
    """Name the columns of the Parquet file that a column becomes."""
    if pa.types.is_list(kind):
        return _leaves(f"{name}.list.element", kind.value_type)
    if pa.types.is_struct(kind):
        return [leaf for field in kind for leaf in _leaves(f"{name}.{field.name}", field.type)]
    return [name]


def _cluster_edges(spec: TableSpec, table: pa.Table) -> list[int]:
    """Rows at which a cluster begins, and the number of rows; a table without rows has one empty cluster."""
    changes = pa.array([False] * max(table.num_rows - 1, 0), pa.bool_())
    for name in spec.clusters:
        column = table.column(name).combine_chunks()
        changes = pc.or_(changes, pc.not_equal(column.slice(1), column.slice(0, max(table.num_rows - 1, 0))))
    return [0, *(i + 1 for i in pc.indices_nonzero(changes).to_pylist()), table.num_rows]
