"""Errors that a user can cause or must know of, and the messages of disk errors.

Everything raised on purpose is an `AerialDojoError`: the command line prints its message as one line and exits
with `exit_code`; anything else is a defect of ours and shows its traceback.
"""

from __future__ import annotations

import errno
import stat
from pathlib import Path


class AerialDojoError(Exception):
    """An expected failure; the message names the thing and the mend.

    Attributes
    ----------
    exit_code : int
        What the command line exits with: 2 for something wrong in what was asked, 1 otherwise.
    traceback : str
        Of an agent of the user's that raised; empty otherwise.
    """

    exit_code = 1
    traceback = ""


class UsageError(AerialDojoError):
    """What was asked for does not exist or makes no sense (unknown scene, bad option)."""

    exit_code = 2


class ConfigError(UsageError):
    """A pipeline file or one of its values is wrong."""


class MissingPackage(AerialDojoError):  # noqa: N818 - it says what is missing
    """A package of an extra is not installed; `no_package` words the message."""


class AssetError(AerialDojoError):
    """A recipe, a prop or a mesh is missing or wrong."""


class ShapeError(AssetError, ValueError):
    """Sizes or counts of a shape make no body, or one that is too large; who knows its file names that too."""


class AnnotationError(AerialDojoError):
    """An annotation file is wrong; the message lists every error in it."""


class StoreError(AerialDojoError):
    """A table is missing, damaged, or does not fit its schema."""


class DamagedFile(StoreError):  # noqa: N818 - it says what the file is
    """A table's file can be read, and its bytes are not those that were written: to delete it is the mend."""


class SceneNameError(UsageError, StoreError):
    """A scene's name is not a plain one."""


class PoolError(AerialDojoError):
    """Scenes have fewer kept candidates than are to be released."""


class BudgetSpent(AerialDojoError):  # noqa: N818 - no fault: it says where a run ended
    """The time that a run was given is over; what is finished is kept."""


class RenderError(AerialDojoError):
    """Rendering or encoding failed."""


class ImportRefused(AerialDojoError):  # noqa: N818 - named for what is done with the file
    """A task file of another benchmark is damaged or has rows that make no sense; the message names each."""


class Malformed(AerialDojoError, ValueError):  # noqa: N818 - it says what the text is
    """A text is not TOML or JSON; the message names the place."""


class BeyondBounds(Malformed):
    """A text is TOML or JSON, but larger, deeper or with other numbers or characters than anything here can use."""


def no_package(who: str, package: str | None, extra: str) -> str:
    """Word that what needs a package, in the user's terms, lacks it, and which extra to install."""
    return f"{who} lacks the package {package or extra}: pip install 'aerialdojo-gen[{extra}]'"


def first_line(error: BaseException) -> str:
    """Return the first line of an error's text, cut to 160 characters; its type where it has none."""
    text = str(error).strip().splitlines()
    return text[0][:160] if text else type(error).__name__


def brief(text: str, most: int = 300) -> str:
    """Cut a text that may be of any length, being a file's, to what a message has room for."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


class AgentUnavailable(AerialDojoError):  # noqa: N818 (it says what is the matter)
    """Something that the agent needs is not there now: a time-out, 429, 5xx, a lost connection, a refused request.

    Never the agent's failure: the runner begins the episode again after a pause where that may help, and logs it
    apart in `failures` if it does not. The message must hold no key.

    Parameters
    ----------
    message : str
        One line.
    retry_after_s : float, optional
        How long to wait, where the service said so, seconds.
    kind : str
        What failed, in a word or two; the runner ends a run after several failures of one kind in a row.
    again : bool
        Whether the episode may succeed if it is begun again. False where the same request would be refused again
        (a content filter, a context that is too long), though the next episode's may pass.
    """

    def __init__(
        self, message: str, retry_after_s: float | None = None, *, kind: str = "unavailable", again: bool = True
    ) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s
        self.kind = kind
        self.again = again


class ServiceDown(AerialDojoError):  # noqa: N818
    """A service will answer no request of the run: there is no route to it, or no connection. The run ends."""


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
