"""Sizes and digests of what a row or a footer names: a file, or a folder of files."""

from __future__ import annotations

import hashlib
import os
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
