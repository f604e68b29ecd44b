"""Sizes and digests of what a row or a footer names: a file, or a folder of files."""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
from collections.abc import Iterable
from concurrent.futures import Future
from functools import lru_cache
from pathlib import Path
from threading import Thread
from typing import TypeAlias

_Version: TypeAlias = tuple[Path, int, int, int, int]

# Files that a thread reads, or is to read.
_ahead: dict[_Version, Future[str]] = {}
# So much at once that a thread that reads seldom waits for its turn.
_BLOCK = 8 << 20


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
            while block := opened.read(_BLOCK):
                digest.update(block)
    return digest.hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal, read once in a process while it stays as it is; OSError where it cannot be."""
    version = _version(path)
    started = _ahead.pop(version, None)
    # What the thread has not come to yet is read here, while it goes on with the next.
    return _digest(*version) if started is None or started.cancel() else started.result()


def prefetch_files(paths: Iterable[Path]) -> None:
    """Read files in a thread whose digests `file_digest` will be asked for; those that are not there are left out."""
    pending = []
    for path in paths:
        with contextlib.suppress(OSError):
            version = _version(path)
            if version not in _ahead:
                pending.append((version, _ahead.setdefault(version, Future())))

    def read() -> None:
        for version, digest in pending:
            if digest.set_running_or_notify_cancel():
                try:
                    digest.set_result(_digest(*version))
                except OSError as error:
                    digest.set_exception(error)

    Thread(target=read, name="digests", daemon=True).start()


def _version(path: Path) -> _Version:
    status = os.stat(path)
    # The time of the last change of the inode goes on also where somebody sets that of the bytes back.
    return path, status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino


@lru_cache(maxsize=8192)
def _digest(path: Path, _size: int, _mtime_ns: int, _ctime_ns: int, _inode: int) -> str:
    return sha256_of(path)
