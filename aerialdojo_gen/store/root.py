"""The data root: where tables, meshes, pictures and recordings lie, a directory or an object store.

Everything that a stage or a reader touches below the data root goes through `DataRoot`, by paths relative to it with
forward slashes. Libraries that want a file of this machine (PyArrow, OpenCV, FFmpeg, our GLB reader) get one from
`DataRoot.local_copy`; what is written is made in a local file or folder and committed whole, or not at all.
"""

from __future__ import annotations

import fcntl
import fnmatch
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO, TypeAlias

from aerialdojo_gen.base.errors import StoreError, UsageError, disk_error
from aerialdojo_gen.store import files
from aerialdojo_gen.store.atomic import atomic_file, atomic_folder
from aerialdojo_gen.store.staging import remove, staged, sweep


class DataRoot(ABC):
    """A place for tables and files; picklable, cheap to make, without an open connection until it is used.

    `url` is the place as it is said in messages and to other processes: an absolute path, or ``s3://bucket/prefix``.
    """

    url: str

    def __str__(self) -> str:
        return self.url

    @abstractmethod
    def local_copy(self, relative: str) -> Path:
        """Return a file, or a folder with all that is in it, on this machine; its bytes must not be changed.

        FileNotFoundError where there is none; StoreError where the store does not answer, or refuses.
        """

    @abstractmethod
    def size(self, relative: str) -> int:
        """Bytes of a file, or of a folder's files together; FileNotFoundError where there is none."""

    @abstractmethod
    def digest(self, relative: str, *, reread: bool = False) -> str:
        """SHA-256 of a file's bytes, or of a folder's files one after the other by name; hexadecimal.

        `reread` reads the bytes also where their digest is known; FileNotFoundError where there are none.
        """

    @abstractmethod
    def version(self, relative: str) -> str:
        """Return what distinguishes a file from any other of its name; FileNotFoundError where there is none.

        It says nothing by itself, and nothing on another root.
        """

    @abstractmethod
    def open(self, relative: str) -> BinaryIO:
        """Open a file for reading, from any place of it; FileNotFoundError where there is none."""

    @abstractmethod
    def at(self, relative: str) -> str:
        """Return where a file lies, as messages say it: an absolute path or a URL."""

    @abstractmethod
    def below(self, folder: str) -> DataRoot:
        """Return a folder as a root of its own, with a lock of its own; it need not be there yet."""

    @abstractmethod
    def list(self, folder: str, pattern: str = "*") -> list[str]:
        """Paths, relative to the root and sorted, of what in a folder matches a glob; none where it is not there."""

    @abstractmethod
    def commit(self, relative: str) -> AbstractContextManager[Path]:
        """Yield an empty local path to write a file to; at the end it is there whole, on an error not at all.

        StoreError where the path points outside the root, or the store is full, read-only or does not answer.
        """

    @abstractmethod
    def commit_folder(self, relative: str) -> AbstractContextManager[Path]:
        """Yield an empty local folder to fill; at the end it takes the place of what was there."""

    @abstractmethod
    def delete(self, relative: str) -> None:
        """Remove a file, or a folder with all that is in it; one that is not there is no error."""

    @abstractmethod
    def lock(self) -> AbstractContextManager[None]:
        """Hold the root: one run at a time writes to it. StoreError where somebody else holds it.

        What killed runs left half-made in it is removed.
        """

    def refresh(self) -> None:  # noqa: B027 - a directory remembers nothing
        """Forget what was found where; a root that is pickled afterwards makes other processes forget it too."""

    def is_whole(self, relative: str, size: int, sha256: str = "", *, reread: bool = False) -> bool:
        """Whether a file or folder is there, of a size, and of a digest where one is given (see `digest`)."""
        try:
            return self.size(relative) == size and (not sha256 or self.digest(relative, reread=reread) == sha256)
        except OSError:
            return False

    def exists(self, relative: str) -> bool:
        """Whether there is a file or a folder of that name."""
        try:
            self.size(relative)
        except FileNotFoundError:
            return False
        return True


@dataclass(frozen=True)
class LocalRoot(DataRoot):
    """A directory of this machine, or of a file system that several machines mount."""

    path: Path  # Absolute

    @property
    def url(self) -> str:  # type: ignore[override]
        """The directory's absolute path."""
        return str(self.path)

    def local_copy(self, relative: str) -> Path:
        """Return the file itself."""
        path = self._at(relative)
        if not path.exists():
            raise FileNotFoundError(2, os.strerror(2), str(path))
        return path

    def size(self, relative: str) -> int:
        """Bytes of a file, or of a folder's files together."""
        return files.size_of(self._path_text(relative))

    def digest(self, relative: str, *, reread: bool = False) -> str:
        """SHA-256 of a file's bytes, read once in a process as long as it is not written to."""
        path = self._at(relative)
        return files.sha256_of(path) if reread or path.is_dir() else files.file_digest(path)

    def version(self, relative: str) -> str:
        """Inode, size and times of the file: one that is replaced or written to is another."""
        stat = os.stat(self._path_text(relative))
        return f"{stat.st_ino}-{stat.st_size}-{stat.st_mtime_ns}-{stat.st_ctime_ns}"

    def open(self, relative: str) -> BinaryIO:
        """Open the file itself."""
        return self._at(relative).open("rb")

    def at(self, relative: str) -> str:
        """Return the file's absolute path."""
        return str(self._at(relative))

    def below(self, folder: str) -> LocalRoot:
        """Return a directory in this one."""
        return LocalRoot(self._at(folder))

    def list(self, folder: str, pattern: str = "*") -> list[str]:
        """Paths of what in a folder matches a glob."""
        if "/" not in pattern and "**" not in pattern:
            # A run asks some thousand times what shards a scene has: pathlib takes five times as long.
            place = PurePosixPath(folder).as_posix()
            prefix = "" if place == "." else f"{place}/"
            try:
                names = os.listdir(self._path_text(folder))
            except (FileNotFoundError, NotADirectoryError, PermissionError):
                return []
            return sorted(prefix + name for name in fnmatch.filter(names, pattern))
        return sorted(path.relative_to(self.path).as_posix() for path in self._at(folder).glob(pattern))

    def commit(self, relative: str) -> AbstractContextManager[Path]:
        """Make a file in the staging folder and rename it."""
        return atomic_file(self.path, relative)

    @contextmanager
    def commit_folder(self, relative: str) -> Iterator[Path]:
        """Make a folder in the staging folder and exchange it with what is there."""
        with atomic_folder(self._at(relative), self.path) as folder:
            yield folder

    def delete(self, relative: str) -> None:
        """Remove a file or a folder."""
        remove(self._at(relative))

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the directory by flock: a killed run's lock is gone with it."""
        path = self.path / ".lock"
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            file = path.open("a+")
        except OSError as error:
            raise disk_error(error, path) from None
        with file, ExitStack() as stack:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise StoreError(
                    f"another run is writing to {self.path}: wait for it, or use another --data"
                ) from None
            except OSError as error:
                raise disk_error(error, path) from None
            sweep(self.path)
            # At the end, after this run's own item: what workers were at when an error or Ctrl-C ended them.
            stack.callback(sweep, self.path)
            # An item of this run keeps the staging folder there until its end: workers need not make it anew for each
            # file. On a full disk a run that has nothing to write goes on without.
            with suppress(OSError):
                stack.enter_context(staged(self.path, path))
            yield

    def _at(self, relative: str) -> Path:
        return self.path / inside(relative)

    def _path_text(self, relative: str) -> str:
        # What a run asks of thousands of files is asked by their names: making a Path takes longer than the answer.
        return f"{self.path}/{inside(relative)}"


def is_outside(root: DataRoot, path_text: str) -> bool:
    """Whether a path that a table names points outside the data root, by dots or by a symbolic link."""
    path = PurePosixPath(path_text)
    if path.is_absolute() or ".." in path.parts:
        return True
    return isinstance(root, LocalRoot) and not (root.path / path_text).resolve().is_relative_to(root.path.resolve())


def inside(relative: str) -> str:
    """Return a path if it stays below the root; StoreError otherwise."""
    if relative.startswith("/") or ".." in relative.split("/"):
        raise StoreError(f"{relative!r} points outside the data directory")
    return relative


Where: TypeAlias = DataRoot | Path | str


def open_root(where: Where) -> DataRoot:
    """Open a data root: a directory, which need not be there yet, or a URL, ``s3://bucket/prefix``."""
    if isinstance(where, DataRoot):
        return where
    scheme, separator, rest = str(where).partition("://")
    if isinstance(where, Path) or not separator:
        return LocalRoot(Path(where).absolute())
    bucket, _, prefix = rest.partition("/")
    if "@" in bucket:
        raise UsageError(
            f"credentials do not belong in a URL (that of bucket {bucket.rpartition('@')[2]}): set AWS_ACCESS_KEY_ID "
            "and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE"
        )
    if scheme == "file":
        if not rest.startswith("/"):
            raise UsageError(f"{where} names no directory of this machine: write file:///path, or the path alone")
        return LocalRoot(Path(rest))
    if scheme not in ("s3", "s3a"):
        raise UsageError(f"--data {where}: write a directory, or s3://bucket/prefix")
    if not bucket or "?" in rest or "#" in rest:
        raise UsageError(f"--data {where} is no URL of a bucket: write s3://bucket/prefix")
    # Nothing of it is imported where data lie in a directory.
    from aerialdojo_gen.store.object_root import ObjectRoot

    return ObjectRoot(bucket, inside("/".join(part for part in prefix.split("/") if part not in ("", "."))))
