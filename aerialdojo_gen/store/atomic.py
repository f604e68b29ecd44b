"""Files and folders that are whole or not there: made in a staging folder, written to the disk, renamed.

A reader sees the old one or the new one, also after a power failure: what is renamed is on the disk before, and the
folder that it is renamed into afterwards.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from aerialdojo_gen.base.errors import StoreError, disk_error, first_line
from aerialdojo_gen.store.staging import replace_folder, staged

# Beyond so many files one sync of the file system is quicker than one of each.
_FEW_FILES = 32


@contextlib.contextmanager
def atomic_file(data: Path, relative: str) -> Iterator[Path]:
    """Write a file under a folder: whole or not at all."""
    path = data / relative
    try:
        inside = path.resolve().is_relative_to(data.resolve())
    except (OSError, RuntimeError) as error:
        raise StoreError(f"cannot write {path}: {first_line(error)}") from None
    if not inside:
        raise StoreError(f"{relative!r} points outside the data directory {data}")
    with _made(data, path, f"new{path.suffix}") as temporary:
        yield temporary


def atomic_write(data: Path, relative: str, content: str | bytes) -> None:
    """Write text, in UTF-8, or bytes as a file under a folder: whole or not at all."""
    with atomic_file(data, relative) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


@contextlib.contextmanager
def atomic_folder(path: Path, root: Path | None = None) -> Iterator[Path]:
    """Fill a folder: whole or not at all; one that is there stays until the new one is whole."""
    with _made(root or path.parent, path, "new") as temporary:
        temporary.mkdir()
        yield temporary


@contextlib.contextmanager
def _made(root: Path, path: Path, name: str) -> Iterator[Path]:
    """Hold a place below the root for what is to become a file or folder."""
    try:
        _make_folders(path.parent)
        # Unless the file's folder is of another disk (a mount).
        same_disk = root.stat().st_dev == path.parent.stat().st_dev
        with staged(root if same_disk else path.parent, path) as item:
            temporary = item / name
            yield temporary
            _sync_all(temporary)
            _place(temporary, path)
    except OSError as error:
        raise disk_error(error, path) from error


def make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing, on the disk; StoreError where that cannot be."""
    try:
        _make_folders(folder)
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "not a folder", str(folder))
    except OSError as error:
        raise disk_error(error, folder) from error


def _place(temporary: Path, path: Path) -> None:
    try:
        _rename(temporary, path)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        # The same disk, mounted twice, as containers do: no rename leads from one mount to the other.
        with staged(path.parent, path) as item:
            copy = item / temporary.name
            (shutil.copytree if temporary.is_dir() else shutil.copyfile)(temporary, copy)
            _sync_all(copy)
            _rename(copy, path)
    _sync(path.parent)


def _rename(new: Path, path: Path) -> None:
    if new.is_dir():
        replace_folder(new, path)
    else:
        new.replace(path)


def _make_folders(folder: Path) -> None:
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    for path in reversed(missing):
        path.mkdir(exist_ok=True)
        _sync(path.parent)


def _sync_all(made: Path) -> None:
    """Wait until a file, or a folder and all that is in it, is on the disk."""
    folders, files = [made], []
    for found, names, inside in os.walk(made):
        folders += [Path(found, name) for name in names]
        files += [Path(found, name) for name in inside]
    if len(files) > _FEW_FILES and _sync_file_system(made):
        return
    for path in (*files, *reversed(folders)):
        _sync(path)


def _sync_file_system(path: Path) -> bool:
    import ctypes

    syncfs = getattr(ctypes.CDLL(None, use_errno=True), "syncfs", None)
    if syncfs is None:
        return False
    with _opened(path) as number:
        return bool(syncfs(number) == 0)


def _sync(path: Path) -> None:
    with _opened(path) as number:
        try:
            os.fsync(number)
        except OSError as error:
            # Some network and FUSE file systems cannot sync a folder.
            if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF) or not path.is_dir():
                raise


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[int]:
    number = os.open(path, os.O_RDONLY)
    try:
        yield number
    finally:
        os.close(number)
