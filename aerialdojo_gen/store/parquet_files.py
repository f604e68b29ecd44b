"""Parquet files by their path, whatever table they are: the only module that reads and writes them."""

from __future__ import annotations

import errno
import itertools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

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
