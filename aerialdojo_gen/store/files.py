"""Sizes and digests of what a row or a footer names: a file, or a folder of files."""

from __future__ import annotations

import hashlib
import os
from functools import lru_cache
from pathlib import Path


def size_of(path: Path) -> int:
    """Bytes of a file, or of a folder's files; OSError where it is missing."""
    if not path.is_dir():
        return path.stat().st_size
    with os.scandir(path) as found:
        return sum(entry.stat().st_size for entry in found)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files one after the other by name; OSError where it is missing."""
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        with file.open("rb") as opened:
            while block := opened.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def is_whole(path: Path, size: int, sha256: str | None = None) -> bool:
    """Whether a file or folder is there, of a size, and of a digest where one is given."""
    try:
        return size_of(path) == size and (sha256 is None or sha256_of(path) == sha256)
    except OSError:
        return False


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal; OSError where it cannot be read.

    A file is read once in a process, and again when it is another one or has been written to.
    """
    stat = path.stat()
    # The time of the last change of the inode goes on also where somebody sets that of the bytes back.
    return _digest(path, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino)


@lru_cache(maxsize=8192)
def _digest(path: Path, _size: int, _mtime_ns: int, _ctime_ns: int, _inode: int) -> str:
    return sha256_of(path)
