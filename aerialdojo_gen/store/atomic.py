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
    try:
        _make_folders(path.parent)
        with staged(_staging_root(data, path), path) as item:
            temporary = item / f"new{path.suffix}"
            yield temporary
            _sync(temporary)
            _place(temporary, path)
    except OSError as error:
        raise disk_error(error, path) from error


@contextlib.contextmanager
def atomic_folder(path: Path, root: Path | None = None) -> Iterator[Path]:
    """Fill a folder: whole or not at all; one that is there stays until the new one is whole."""
    try:
        _make_folders(path.parent)
        with staged(_staging_root(root or path.parent, path), path) as item:
            temporary = item / "new"
            temporary.mkdir()
            yield temporary
            _sync_folder(temporary)
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


def _staging_root(root: Path, path: Path) -> Path:
    """Where to stage: below the root, unless the file's folder is of another disk (a mount)."""
    return root if root.stat().st_dev == path.parent.stat().st_dev else path.parent


def _place(temporary: Path, path: Path) -> None:
    try:
        if temporary.is_dir():
            replace_folder(temporary, path)
        else:
            temporary.replace(path)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        # The same disk, mounted twice, as containers do: no rename leads from one mount to the other.
        with staged(path.parent, path) as item:
            copy = item / temporary.name
            if temporary.is_dir():
                shutil.copytree(temporary, copy)
                _sync_folder(copy)
                replace_folder(copy, path)
            else:
                shutil.copyfile(temporary, copy)
                _sync(copy)
                copy.replace(path)
    _sync(path.parent)


def _make_folders(folder: Path) -> None:
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    for path in reversed(missing):
        path.mkdir(exist_ok=True)
        _sync(path.parent)


def _sync_folder(folder: Path) -> None:
    """Wait until a folder and all that is in it is on the disk."""
    folders, files = [folder], []
    for found, names, inside in os.walk(folder):
        folders += [Path(found, name) for name in names]
        files += [Path(found, name) for name in inside]
    if len(files) > _FEW_FILES and _sync_file_system(folder):
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
