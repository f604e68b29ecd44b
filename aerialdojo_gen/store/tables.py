"""Tables in memory: made of rows, checked by their schema, identified by a digest of their content."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.errors import StoreError, first_line
from aerialdojo_gen.store.schemas import TableSpec


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
