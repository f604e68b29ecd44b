"""Where files and folders are made before they take their names, and whose they are.

What is being made for a place below ROOT lies in a folder of its own, ``ROOT/.aerialdojo-staging/<item>/``: ``new``
is the thing itself, ``lease`` a file that its writer holds locked and that says where the thing belongs. The kernel
lets go of the lock when the writer ends, however it ends, in whatever PID namespace or on whichever host it ran: an
item whose lease can be locked belongs to nobody and is removed, one whose lease cannot is being written. Where the
file system knows no locks that is unknown, and nothing is removed.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

AREA = ".aerialdojo-staging"
_LEASE, _OLD = "lease", "old"
# How long others may take the area away before an item is in it. A number of tries would be used up in a millisecond.
_PATIENCE_S = 30.0
NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)


@contextlib.contextmanager
def staged(root: Path, target: Path) -> Iterator[Path]:
    """Hold an item of a staging folder; what dead writers left there is removed first."""
    sweep(root)
    item, lease = _claim(root / AREA)
    try:
        with lease:
            try:
                lease.write(os.path.relpath(target, root))
                lease.flush()
                yield item
            finally:
                _discard(item)
    finally:
        with contextlib.suppress(OSError):
            item.parent.rmdir()


def _claim(area: Path) -> tuple[Path, TextIO]:
    """Make an item and lock its lease; whoever sweeps in between takes it away, and another one is made."""
    end = time.monotonic() + _PATIENCE_S
    while True:
        item = area / secrets.token_hex(8)
        try:
            area.mkdir(parents=True, exist_ok=True)
            item.mkdir()
            lease = (item / _LEASE).open("x+", encoding="utf-8", errors="surrogateescape")
        except (FileNotFoundError, FileExistsError) as error:
            # Another process removed the area: pathlib reports the second where that came while it made it. Where the
            # area itself was not made though its folder is there, nobody removed it: there nothing can be made.
            impossible = isinstance(error, FileNotFoundError) and error.filename == str(area) and area.parent.is_dir()
            if impossible or time.monotonic() > end:
                raise
            continue
        if _lock(lease, unknown=True) and _is_at(lease, item / _LEASE):
            return item, lease
        lease.close()
        if time.monotonic() > end:
            raise OSError(errno.EBUSY, "it is swept repeatedly", str(area))


def sweep(root: Path) -> None:
    """Remove what dead writers left in a folder's staging folder, or finish it; what a living one makes stays."""
    area = root / AREA
    try:
        items = sorted(area.iterdir())
    except OSError:
        return
    for item in items:
        with contextlib.suppress(OSError):
            _sweep_item(root, item)
    with contextlib.suppress(OSError):
        area.rmdir()


def _sweep_item(root: Path, item: Path) -> None:
    path = item / _LEASE
    try:
        lease = path.open("r+", encoding="utf-8", errors="surrogateescape")
    except FileNotFoundError:
        item.rmdir()  # killed before it had a lease, or after it had given it up: empty
        return
    with lease:
        if _lock(lease, unknown=False) and _is_at(lease, path):
            _recover(root, item, lease.read())
            _discard(item)


def _recover(root: Path, item: Path, relative: str) -> None:
    old, target = item / _OLD, root / relative
    if not os.path.lexists(old) or os.path.lexists(target) or not relative or ".." in Path(relative).parts:
        return
    # The old one is moved away only when the new one is whole and on the disk.
    new = next((path for path in item.iterdir() if path.name not in (_LEASE, _OLD)), old)
    new.rename(target)


def _discard(item: Path) -> None:
    """Remove an item; its lease last, so that a kill on the way leaves something that is known to be dead."""
    with contextlib.suppress(OSError):
        for path in item.iterdir():
            if path.name != _LEASE:
                remove(path)
        (item / _LEASE).unlink(missing_ok=True)
        item.rmdir()


def remove(path: Path) -> None:
    """Remove a file or a folder with all that is in it; one that is not there is no error."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _lock(file: TextIO, *, unknown: bool) -> bool:
    """Lock a file if nobody else has; `unknown` is returned where the file system knows no locks."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno in NO_LOCKS:
            return unknown
        raise
    return True


def _is_at(file: TextIO, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def replace_folder(new: Path, target: Path) -> None:
    """Give a folder its name; what has it goes to the item of the new one."""
    try:
        new.rename(target)
        return
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
            raise
    if exchange(new, target):
        return
    # What a kill between these two renames leaves is put right by the next `sweep`.
    old = new.with_name(_OLD)
    target.rename(old)
    try:
        new.rename(target)
    except OSError:
        old.rename(target)
        raise


def exchange(one: Path, other: Path) -> bool:
    """Exchange two names at once; False where the operating or the file system cannot."""
    import ctypes

    at_cwd, rename_exchange = -100, 2
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    paths = [ctypes.c_char_p(os.fsencode(path)) for path in (one, other)]
    if renameat2(at_cwd, paths[0], at_cwd, paths[1], ctypes.c_uint(rename_exchange)) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP):
        return False
    raise OSError(number, os.strerror(number), str(other))


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Hold an empty folder in the system's folder for temporary files; what killed runs left there is removed."""
    root = Path(tempfile.gettempdir()) / f"aerialdojo-gen-{os.getuid()}"
    root.mkdir(mode=0o700, exist_ok=True)
    if root.is_symlink() or root.stat().st_uid != os.getuid():
        # Somebody else made it: what stands there is not to be trusted.
        with tempfile.TemporaryDirectory(prefix="aerialdojo-") as own:
            yield Path(own)
        return
    with staged(root, root / "scratch") as item:
        folder = item / "scratch"
        folder.mkdir()
        yield folder
