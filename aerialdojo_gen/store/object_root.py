"""The data root in an object store: ``s3://bucket/prefix``.

What holds there:

- A file is put in one request, or in parts that are completed when all are there: a reader sees the old one or the
  new one. It is read under the condition that it still has the tag that was looked up; where it has not, it is looked
  up anew.
- A folder (a trajectory's recording, say) has a manifest beside its files, ``.aerialdojo-folder.json``, with the tag
  of each. A first folder's manifest says ``writing`` until all files are put, and until then there is no folder. What
  replaces one is put under other keys, and the manifest names those in one put: that is the moment at which readers
  see the new one, all of it. Then the files are copied to their own keys, for readers of the plain files, and the
  manifest names these. Who reads plain files without manifests compares the digests in the table `recordings`. A
  folder that somebody uploaded has no manifest and is what lies there.
- The Parquet shard that names files is committed after them.
- What lies where is listed by table, once, and kept: until `refresh` in a run that holds the lock, else for a minute;
  what this process writes is known to it at once.
- The lock is a lease: `aerialdojo_gen.store.lease`. Uploads in parts that a killed run left are aborted by the next
  one that holds the lock.
"""

from __future__ import annotations

import hashlib
import io
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from fnmatch import translate
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO, TypeVar

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store.bucket import Bucket, Entry
from aerialdojo_gen.store.cloud_errors import Changed
from aerialdojo_gen.store.files import sha256_of
from aerialdojo_gen.store.lease import lease_lost, lease_s, leased, token_of
from aerialdojo_gen.store.object_folders import MANIFEST, ObjectFolders, state_of
from aerialdojo_gen.store.root import DataRoot, inside

LOCK = ".aerialdojo-lock.json"
_DIGEST = "sha256"
_T = TypeVar("_T")
# Readers of what somebody replaces ask again so often.
_TRIES = 5


class ObjectRoot(DataRoot):
    """A prefix of a bucket."""

    def __init__(self, bucket: str, prefix: str = "") -> None:
        self._name, self._prefix = bucket, prefix
        self.url = f"s3://{bucket}/{prefix}" if prefix else f"s3://{bucket}"
        # Of a run: when it last began to look anew, and the token of its lock. Workers get them with the root.
        self._epoch, self._token = 0, ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ObjectRoot) and other.url == self.url

    def __hash__(self) -> int:
        return hash(self.url)

    def __repr__(self) -> str:
        return f"ObjectRoot({self.url!r})"

    def at(self, relative: str) -> str:
        """Return the file's URL."""
        return f"{self.url}/{inside(relative)}"

    def below(self, folder: str) -> ObjectRoot:
        """Return a longer prefix."""
        root = ObjectRoot(self._name, self._key(folder).strip("/"))
        root._epoch = self._epoch
        return root

    def refresh(self) -> None:
        """Forget what was listed; also in the processes that get this root from now on."""
        self._epoch = time.time_ns()

    def local_copy(self, relative: str) -> Path:
        """Return a copy in the cache (`aerialdojo_gen.store.cache`)."""
        return self._of_one_version(relative, self._copied)

    def _of_one_version(self, relative: str, read: Callable[[str], _T]) -> _T:
        """Read a file or folder, anew where it was replaced meanwhile."""
        for _ in range(_TRIES):
            try:
                return read(relative)
            except Changed:
                self._state.forget()
        raise StoreError(f"{self.at(relative)} is being replaced repeatedly: run the command again")

    def _copied(self, relative: str) -> Path:
        files, name = self._files(relative), PurePosixPath(relative).name

        def fill(folder: Path) -> None:
            for inner, (key, entry) in files.items():
                path = folder / name / inner
                path.parent.mkdir(parents=True, exist_ok=True)
                with path.open("wb") as file:
                    self._state.bucket.download(key, file.write, entry)

        while True:
            path: Path = self._state.cache.make(self._item(files), fill) / name
            if files.keys() != {""} or path.stat().st_size == files[""][1].size:
                return path
            path.unlink()  # a copy that a power failure cut off
            path.parent.rmdir()

    def _item(self, files: dict[str, tuple[str, Entry]]) -> str:
        named = [self._state.bucket.endpoint, self._name]
        named += [f"{inner}\0{key}\0{entry.etag}\0{entry.size}" for inner, (key, entry) in sorted(files.items())]
        return hashlib.sha256("\n".join(named).encode("utf-8", "surrogateescape")).hexdigest()

    def size(self, relative: str) -> int:
        """Bytes of an object, or of those under a prefix."""
        return sum(entry.size for _, entry in self._files(relative).values())

    def digest(self, relative: str, *, reread: bool = False) -> str:
        """SHA-256 of a file's bytes: what was said when it was put, or read from the store."""
        return self._of_one_version(relative, partial(self._digest, reread=reread))

    def _digest(self, relative: str, *, reread: bool) -> str:
        files, state = self._files(relative), self._state
        if not reread and files.keys() == {""}:
            key, entry = files[""]
            if (known := state.digests.get((key, entry.etag))) is not None:
                return known
            found, metadata = state.bucket.head(key)
            if found.etag == entry.etag and len(metadata.get(_DIGEST, "")) == 64:
                state.digests[key, entry.etag] = metadata[_DIGEST]
                return metadata[_DIGEST]
        digest = hashlib.sha256()
        for _, (key, entry) in sorted(files.items()):
            state.bucket.download(key, digest.update, entry)
        if files.keys() == {""}:
            state.digests[files[""][0], files[""][1].etag] = digest.hexdigest()
        return digest.hexdigest()

    def version(self, relative: str) -> str:
        """Return the object's tag."""
        return self._file(relative)[1].etag

    def open(self, relative: str) -> BinaryIO:
        """Read ranges of the object; what is open stays the same version, or fails."""
        key, entry = self._file(relative)
        if (folder := self._state.cache.find(self._item({"": (key, entry)}))) is not None:
            return (folder / PurePosixPath(relative).name).open("rb")
        return io.BufferedReader(_Ranges(self._state.bucket, key, entry, self.at(relative)), 1 << 16)

    def list(self, folder: str, pattern: str = "*") -> list[str]:
        """Names under a prefix that match a glob; a folder is one as long as something is in it."""
        where = inside(folder).strip("/")
        where = "" if where == "." else where
        prefix = self._key(where + "/") if where else self._key("")
        state = self._state
        if "/" not in pattern and "**" not in pattern and (not where or where.startswith("media")):
            names = set(state.bucket.list_names(prefix))
        else:
            found = state.listing(self._group(where + "/")) if where else state.bucket.list(prefix)
            names = {key.removeprefix(prefix) for key in found if key.startswith(prefix)}
        matched = matching((name for name in names if not _is_ours(name)), pattern)
        return sorted(f"{where}/{name}" if where else name for name in matched)

    @contextmanager
    def commit(self, relative: str) -> Iterator[Path]:
        """Make a file in the cache and put it; the copy stays there for who reads it next."""
        key, state = self._key(inside(relative)), self._state
        name = PurePosixPath(relative).name
        with state.cache.scratch() as folder:
            yield folder / name
            self._may_write()
            digest = sha256_of(folder / name)
            entry = state.bucket.put(key, folder / name, {_DIGEST: digest})
            state.record_write(key, entry)
            state.digests[key, entry.etag] = digest
            state.cache.add(self._item({"": (key, entry)}), folder)

    @contextmanager
    def commit_folder(self, relative: str) -> Iterator[Path]:
        """Make a folder in the cache and put its files; see the module on what readers see meanwhile."""
        key = self._key(inside(relative).strip("/"))
        with self._state.cache.scratch() as folder:
            yield folder
            self._may_write()
            ObjectFolders(self._state).put(key, folder, self._may_write)

    def delete(self, relative: str) -> None:
        """Remove an object, and those under it as a folder."""
        self._may_write()
        state, key = self._state, self._key(inside(relative).strip("/"))
        known = state.listing(self._group(relative)) if "/" in relative else state.bucket.list(key)
        if f"{key}/{MANIFEST}" in known:
            ObjectFolders(state).delete(key)
            return
        gone = [name for name in known if name == key or name.startswith(f"{key}/")]
        if gone:
            state.bucket.delete(gone)
        for name in gone:
            state.record_write(name, None)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the prefix by a lease."""
        state = self._state
        with leased(state.bucket, self._key(LOCK), self.url) as lease:
            self._token = lease.token
            state.leases[self.url] = lease
            state.bucket.abort_uploads(self._key(""))
            self.refresh()
            try:
                yield
                lease.check()
            finally:
                self._token = ""
                del state.leases[self.url]
                self.refresh()

    def _may_write(self) -> None:
        """Raise StoreError where the lock that this root was handed on with is another's by now."""
        state = self._state
        if not self._token:
            return
        if (lease := state.leases.get(self.url)) is not None:
            lease.check()
            return
        if time.monotonic() - state.checked_at.get(self._token, -1e9) < lease_s() / 4:
            return
        if token_of(state.bucket, self._key(LOCK)) != self._token:
            raise lease_lost(self.url, "another run has it now, or none")
        state.checked_at[self._token] = time.monotonic()

    @property
    def _state(self) -> Any:
        state = state_of(self._name)
        state.invalidate_before(self._epoch)
        return state

    def _key(self, relative: str) -> str:
        return f"{self._prefix}/{relative}" if self._prefix else relative

    def _group(self, relative: str) -> str:
        """Prefix that is listed at once for a file: its table's, or its trajectory's (in a run, its scene's)."""
        parts = PurePosixPath(relative).parts
        depth = 1 if not parts or parts[0] != "media" else 2 if self._epoch else 3
        return self._key("".join(f"{part}/" for part in parts[:depth]))

    def _file(self, relative: str) -> tuple[str, Entry]:
        """Find a file: its key and entry."""
        files = self._files(relative)
        if files.keys() != {""}:
            raise FileNotFoundError(2, "is a folder", self.at(relative))
        return files[""]

    def _files(self, relative: str) -> dict[str, tuple[str, Entry]]:
        """Find a file (under the name ``""``), or all files of a folder: keys and entries, by their names in it."""
        relative = inside(relative).strip("/")
        key, state = self._key(relative), self._state
        if "/" not in relative:
            files = ObjectFolders(state).find(key, state.bucket.list(key))
        else:
            group, parts = self._group(relative), PurePosixPath(relative).parts
            first = self._key("/".join(parts[:3])) if parts[0] == "media" and len(parts) > 2 else ""
            files = ObjectFolders(state).find(key, state.listing(group), first)
            if not files and state.is_stale(group):
                files = ObjectFolders(state).find(key, state.listing(group, reread=True), first)
        if not files:
            raise FileNotFoundError(2, "there is no such file or folder", self.at(relative))
        return files


def _is_ours(name: str) -> bool:
    return any(part.startswith(".aerialdojo-") for part in name.split("/"))


class _Ranges(io.RawIOBase):
    """An object as a file: every read is a request."""

    def __init__(self, bucket: Bucket, key: str, entry: Entry, url: str) -> None:
        self._bucket, self._key, self._entry, self._url, self._at = bucket, key, entry, url, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = 0) -> int:
        base = {0: 0, 1: self._at, 2: self._entry.size}[whence]
        self._at = max(0, base + offset)
        return self._at

    def readinto(self, buffer: Any) -> int:
        end = min(self._at + len(buffer), self._entry.size)
        if end <= self._at:
            return 0
        try:
            data = self._bucket.read(self._key, self._at, end, self._entry.etag)
        except Changed:
            raise StoreError(f"{self._url} was replaced while it was read: run the command again") from None
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)


def matching(names: Iterable[str], pattern: str) -> set[str]:
    """Return the names, and the folders that they lie in, that match a glob as `Path.glob` does."""
    words = [re.compile(translate(part)) if part != "**" else None for part in pattern.split("/")]
    every = {"/".join(parts[:n]) for name in names for parts in [name.split("/")] for n in range(1, len(parts) + 1)}
    return {name for name in every if _matches(name.split("/"), words)}


def _matches(parts: list[str], words: list[re.Pattern[str] | None]) -> bool:
    if not words:
        return not parts
    if words[0] is None:
        return any(_matches(parts[n:], words[1:]) for n in range(len(parts) + (len(words) > 1)))
    return bool(parts) and words[0].fullmatch(parts[0]) is not None and _matches(parts[1:], words[1:])
