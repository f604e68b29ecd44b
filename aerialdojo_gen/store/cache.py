"""The user's cache: copies of objects, and what was made of a release's files; bounded, shared by all processes.

``$AERIALDOJO_CACHE`` (default ``~/.cache/aerialdojo-gen``) holds at most ``$AERIALDOJO_CACHE_GB`` gigabytes
(default 20); what was used longest ago goes first, except for what a living process uses. An item is a folder under a
name that identifies what is in it (where an object lies and its tag, or what was computed from which files); it is
made in the staging folder and renamed, so that it is whole or not there, whoever is killed and however many processes
make the same one.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

from aerialdojo_gen.base.environment_errors import number_of
from aerialdojo_gen.base.errors import AerialDojoError, disk_error
from aerialdojo_gen.base.paper_figures import files
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.staging import remove, staged

_TEXT = "text"
_DEFAULT_GB = 20.0
# Items that this process keeps from being removed: the last ones it asked for.
_HELD = 256
# The cache is measured when so large a share of its bound came to it through this process.
_MEASURED_SHARE = 0.02


class Cache:
    """A folder of copies."""

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or cache_folder()
        hint = "write a number of gigabytes, e.g. 20"
        self._most = int(1e9 * number_of("AERIALDOJO_CACHE_GB", _DEFAULT_GB, 0.0, 1e9, hint))
        self._unmeasured = self._most  # measured at the first item
        self._held: OrderedDict[Path, int] = OrderedDict()
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def scratch(self) -> Iterator[Path]:
        """Hold an empty folder on the cache's disk; it is removed at the end, or when its process has died."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with staged(self.folder, self.folder / "item") as item:
                inner = item / "new"
                inner.mkdir()
                yield inner
        except OSError as error:
            raise disk_error(error, self.folder) from error

    def find(self, name: str) -> Path | None:
        """Return an item's folder and keep it; None where there is none."""
        path = self._place(name)
        try:
            number = os.open(path, os.O_RDONLY)
        except OSError:
            return None
        # Where the file system knows no locks, what is used lately is what stays.
        with contextlib.suppress(OSError):
            fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(number), path.stat()):
                os.utime(path)
                self._hold(path, number)
                return path
        os.close(number)
        return None

    def _hold(self, path: Path, number: int) -> None:
        with self._lock:
            dropped = [self._held.pop(path)] if path in self._held else []
            self._held[path] = number
            while len(self._held) > _HELD:
                dropped.append(self._held.popitem(last=False)[1])
        for number in dropped:
            os.close(number)

    def make(self, name: str, fill: Callable[[Path], None]) -> Path:
        """Return an item's folder; where there is none, one is filled first."""
        while (found := self.find(name)) is None:
            with self.scratch() as folder:
                fill(folder)
                self.add(name, folder)
        return found

    def add(self, name: str, folder: Path) -> None:
        """Let a folder of `scratch` become an item; where it is there already, nothing changes."""
        size, path = _size(folder), self._place(name)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileExistsError):
                if not path.exists():
                    folder.rename(path)
        except OSError as error:
            if not path.exists():
                raise disk_error(error, path) from error
        self._unmeasured += size
        if self._unmeasured >= _MEASURED_SHARE * self._most:
            self._unmeasured = 0
            self._shrink(path)

    def _shrink(self, latest: Path) -> None:
        """Remove what was used longest ago, until the rest fits."""
        items = []
        for path in self.folder.glob("[0-9a-f][0-9a-f]/*"):
            with contextlib.suppress(OSError):
                items.append((path.stat().st_mtime, _size(path), path))
        excess = sum(size for _, size, _ in items) - self._most
        for _, size, path in sorted(items):
            if excess > 0 and path != latest and self._remove(path):
                excess -= size

    def _remove(self, path: Path) -> bool:
        with contextlib.suppress(OSError):
            number = os.open(path, os.O_RDONLY)
            try:
                fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
                with self.scratch() as folder:
                    path.rename(folder / "old")
                    remove(folder / "old")
                return True
            finally:
                os.close(number)
        return False

    def _place(self, name: str) -> Path:
        return self.folder / name[:2] / name


def cache_folder() -> Path:
    """Return where copies are kept: ``$AERIALDOJO_CACHE``, or the user's cache folder."""
    if value := os.environ.get("AERIALDOJO_CACHE"):
        return Path(value).expanduser().absolute()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "aerialdojo-gen"


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def memo_key(root: DataRoot, files: Iterable[str], *parameters: object) -> str:
    """Identify a result by what was computed from which files by which code."""
    digest = hashlib.sha256(f"{_sources()}\n{root}\n{parameters!r}".encode())
    for name in sorted(files):
        try:
            version = root.version(name)
        except FileNotFoundError:
            version = ""
        digest.update(f"\n{name}\0{version}".encode())
    return digest.hexdigest()


def memo(key: str, make: Callable[[], str]) -> str:
    """Return the text that belongs to a key: as it was kept, or as it is made now."""
    with contextlib.suppress(AerialDojoError, OSError, UnicodeDecodeError):
        if (found := Cache().find(key)) is not None:
            return (found / _TEXT).read_text(encoding="utf-8")
    text = make()
    cache_text(key, text)
    return text


def is_cached(key: str) -> bool:
    """Whether something was kept under a key."""
    with contextlib.suppress(AerialDojoError, OSError):
        return Cache().find(key) is not None
    return False


def cache_text(key: str, text: str = "") -> None:
    """Keep a text under a key; nothing happens where the cache cannot be written."""

    def fill(folder: Path) -> None:
        (folder / _TEXT).write_text(text, encoding="utf-8")

    with contextlib.suppress(AerialDojoError, OSError):
        Cache().make(key, fill)


@cache
def _sources() -> str:
    """Return what identifies the package's sources and the paper's figures: others may say other things."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    kinds = ("*.py", "*.j2", "*.toml", "*.csv")
    for path in sorted([*(path for kind in kinds for path in package.rglob(kind)), *files()]):
        stat = path.stat()
        digest.update(f"{path}\0{stat.st_size}\0{stat.st_mtime_ns}\n".encode())
    return digest.hexdigest()
