"""Parquet files by their path, whatever table they are: the store's ground floor."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.store import atomic_file


def read_file(path: Path) -> pa.Table:
    """Read one Parquet file as it is, its page checksums verified.

    Parameters
    ----------
    path : Path
        The file; whatever folders are named, no column is made of them.

    Returns
    -------
    pyarrow.Table
        With the schema and the metadata that the file has.

    Raises
    ------
    StoreError
        The file is damaged.
    """
    try:
        return pq.read_table(path, partitioning=None, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        line = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise StoreError(f"{path} is damaged ({line[:160]})") from None


def write_file(path: Path, table: pa.Table) -> None:
    """Write a table that is no shard (a report, say) as one Parquet file, whole or not at all.

    Raises
    ------
    StoreError
        The disk is full, read-only or not ours to write.
    """
    with atomic_file(path.parent, path.name) as temporary:
        pq.write_table(table, temporary, compression="zstd")
