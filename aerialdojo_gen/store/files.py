"""Sizes and digests of what a row or a footer names: a file, or a folder of files."""

from __future__ import annotations

import hashlib
import os
import stat
from functools import lru_cache
from pathlib import Path


def size_of(path: Path | str) -> int:
    """Bytes of a file, or of a folder's files; OSError where it is missing."""
    status = os.stat(path)
    if not stat.S_ISDIR(status.st_mode):
        return status.st_size
    with os.scandir(path) as found:
        return sum(entry.stat().st_size for entry in found)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files one after the other by name; OSError where it is missing."""
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        with file.open("rb") as opened:
            hashlib.file_digest(opened, lambda: digest)  # Goes on with the same digest
    return digest.hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal, read once in a process while it stays as it is; OSError where it cannot be."""
    status = os.stat(path)
    # The time of the last change of the inode goes on also where somebody sets that of the bytes back.
    return _digest(path, (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino))


@lru_cache(maxsize=8192)
def _digest(path: Path, _version: tuple[int, ...]) -> str:
    return sha256_of(path)
