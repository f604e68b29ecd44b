"""Files and folders that are whole or not there: made under a temporary name, renamed; errors of the disk in a line.

A temporary name holds the number of the process that writes, so that what a killed run left behind can be told from
what a living one is about to finish.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from aerialdojo_gen.errors import StoreError, first_line

_TEMPORARY = re.compile(r"^\..*\.(\d+)\.tmp(\.[A-Za-z0-9]+)?$")


@contextlib.contextmanager
def atomic_file(data: Path, relative: str) -> Iterator[Path]:
    """Write a file under the data directory: whole or not at all.

    Parameters
    ----------
    data : Path
        The data directory.
    relative : str
        Path below it; StoreError if it leads out of it.

    Yields
    ------
    Path
        A temporary path in the same folder, with the same suffix; renamed at the end, removed on an error.

    Raises
    ------
    StoreError
        The disk is full, read-only or not ours to write.
    """
    path = data / relative
    root = data.resolve()
    if not path.resolve().is_relative_to(root):
        raise StoreError(f"{relative!r} leads out of the data directory {data}")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise disk_error(error, path) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Fill a folder: whole or not at all; one that is there stays until the new one is whole.

    Parameters
    ----------
    path : Path
        The folder.

    Yields
    ------
    Path
        An empty temporary folder beside it; renamed at the end, removed on an error.

    Raises
    ------
    StoreError
        The disk is full, read-only or not ours to write.
    """
    temporary, old = (path.with_name(f".{path.name}.{os.getpid()}.{end}") for end in ("tmp", "old"))
    try:
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        yield temporary
        if path.exists():
            path.rename(old)
        temporary.rename(path)
    except OSError as error:
        if old.exists() and not path.exists():
            old.rename(path)
        raise disk_error(error, path) from error
    finally:
        for gone in (temporary, old):
            shutil.rmtree(gone, ignore_errors=True)


_DISK = {
    errno.ENOSPC: "no space left on the disk",
    errno.EDQUOT: "the disk quota is used up",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EFBIG: "the file would exceed the allowed size",
    errno.ENOTDIR: "a part of the path is not a folder",
}


def disk_error(error: OSError, path: Path) -> StoreError:
    """Turn an operating-system error of writing into one line that names the file."""
    why = _DISK.get(error.errno or 0, first_line(error))
    return StoreError(f"cannot write {path}: {why}; what was finished is kept, nothing half-written")


def sweep(folder: Path, name: str = "*") -> None:
    """Remove what killed runs left under temporary names in a folder; what a living process makes stays.

    Parameters
    ----------
    folder : Path
        Where to look, not below it.
    name : str
        What was being made, a pattern of `pathlib.Path.glob`.
    """
    for path in folder.glob(f".{name}.tmp*"):
        match = _TEMPORARY.match(path.name)
        if match and not process_alive(int(match[1])):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


def process_alive(pid: int) -> bool:
    """Whether a process of that number runs."""
    if pid == os.getpid():
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
