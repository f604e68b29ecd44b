"""What a disk can refuse, in words."""

from __future__ import annotations

import errno
import stat
from pathlib import Path

from aerialdojo_gen.base.errors import StoreError, first_line

DISK_ERRORS = {
    errno.ENOSPC: "no space left on the disk",
    errno.EDQUOT: "the disk quota is used up",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EFBIG: "the file would exceed the allowed size",
    errno.ENOTDIR: "a part of the path is not a folder",
    errno.EISDIR: "a folder is in its place",
    errno.ENAMETOOLONG: "the name is too long",
    errno.EIO: "the disk reports an error",
    errno.EMFILE: "too few file descriptors (ulimit -n)",
    errno.ENFILE: "the machine has too few file descriptors",
    errno.ENOLCK: "the file system gives no locks (ENOLCK): use a folder on a local disk",
    errno.EOPNOTSUPP: "the file system knows no locks: use a folder on a local disk",
}
_KINDS = {
    stat.S_IFDIR: "is a folder", stat.S_IFIFO: "is a FIFO", stat.S_IFSOCK: "is a socket", stat.S_IFCHR: "is a device",
    stat.S_IFBLK: "is a device",
}  # fmt: skip


def check_regular(path: Path) -> None:
    """Raise OSError for what is no regular file: a FIFO does not answer, a device does not end."""
    kind = stat.S_IFMT(path.stat().st_mode)
    if kind != stat.S_IFREG:
        raise OSError(errno.EINVAL, f"{_KINDS.get(kind, 'is no file')}, a file is needed", str(path))


def disk_error(error: OSError, path: Path) -> StoreError:
    """Turn an operating-system error of writing into one line that names the file."""
    why = DISK_ERRORS.get(error.errno or 0, first_line(error))
    return StoreError(f"cannot write {path}: {why}; what was finished is kept, nothing half-written")
