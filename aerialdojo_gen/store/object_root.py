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
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO, TypeVar

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store.bucket import Bucket, Changed, Entry
from aerialdojo_gen.store.lease import Lease, lease_lost, lease_s, token_of
from aerialdojo_gen.store.object_folders import (
    MANIFEST,
    Files,
    State,
    delete_folder,
    find,
    is_ours,
    put_folder,
    state_of,
)
from aerialdojo_gen.store.root import DataRoot, inside

LOCK = ".aerialdojo-lock.json"
_T = TypeVar("_T")
# Readers of what somebody replaces ask again so often.
_TRIES = 5
# What is not in a listing is looked for once more if the listing is older.
_FRESH_S = 2.0


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
            path = self._state.cache.make(self._item(files), fill) / name
            if files.keys() != {""} or path.stat().st_size == files[""][1].size:
                return path
            path.unlink()  # a copy that a power failure cut off
            path.parent.rmdir()

    def _item(self, files: Files) -> str:
        """Name what is copied in the cache."""
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
        files, bucket = self._files(relative), self._state.bucket
        if not reread and files.keys() == {""}:
            key, entry = files[""]
            found, metadata = bucket.head(key)
            if found.etag == entry.etag and len(metadata.get("sha256", "")) == 64:
                return metadata["sha256"]
        digest = hashlib.sha256()
        for _, (key, entry) in sorted(files.items()):
            bucket.download(key, digest.update, entry)
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
        where = "" if folder == "." else inside(folder).strip("/")
        prefix, state = self._key(f"{where}/" if where else ""), self._state
        if "/" not in pattern and "**" not in pattern and (not where or where.startswith("media")):
            names = set(state.bucket.list_names(prefix))
        else:
            found = state.listing(self._group(f"{where}/")) if where else state.bucket.list(prefix)
            names = {key.removeprefix(prefix) for key in found if key.startswith(prefix)}
        matched = matching((name for name in names if not is_ours(name)), pattern)
        return sorted(f"{where}/{name}" if where else name for name in matched)

    @contextmanager
    def commit(self, relative: str) -> Iterator[Path]:
        """Make a file in the cache and put it; the copy stays there for who reads it next."""
        key, state = self._key(inside(relative)), self._state
        with state.cache.scratch() as folder:
            path = folder / PurePosixPath(relative).name
            yield path
            self._may_write()
            state.cache.add(self._item({"": (key, state.put(key, path))}), folder)

    @contextmanager
    def commit_folder(self, relative: str) -> Iterator[Path]:
        """Make a folder in the cache and put its files; see the module on what readers see meanwhile."""
        with self._state.cache.scratch() as folder:
            yield folder
            self._may_write()
            put_folder(self._state, self._key(inside(relative).strip("/")), folder, self._may_write)

    def delete(self, relative: str) -> None:
        """Remove an object, and those under it as a folder."""
        self._may_write()
        state, key = self._state, self._key(inside(relative).strip("/"))
        known = state.listing(self._group(relative))
        if f"{key}/{MANIFEST}" in known:
            delete_folder(state, key)
        else:
            state.delete([name for name in known if name == key or name.startswith(f"{key}/")])

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the prefix by a lease."""
        state = self._state
        lease = state.leases[self.url] = Lease(state.bucket, self._key(LOCK), self.url)
        self._token = lease.token
        try:
            state.bucket.abort_uploads(self._key(""))
            self.refresh()
            yield
            lease.check()
        finally:
            self._token = ""
            del state.leases[self.url]
            lease.release()
            self.refresh()

    def _may_write(self) -> None:
        """Raise StoreError where the lock that this root was handed on with is another's by now."""
        state = self._state
        if (lease := state.leases.get(self.url)) is not None and self._token:
            lease.check()
        elif self._token and time.monotonic() - state.checked_at.get(self._token, -1e9) >= lease_s() / 4:
            if token_of(state.bucket, self._key(LOCK)) != self._token:
                raise lease_lost(self.url, "another run has it now, or none")
            state.checked_at[self._token] = time.monotonic()

    @property
    def _state(self) -> State:
        state = state_of(self._name)
        state.invalidate_before(self._epoch)
        return state

    def _key(self, relative: str) -> str:
        return f"{self._prefix}/{relative}" if self._prefix else relative

    def _group(self, relative: str) -> str:
        """Prefix that is listed at once for a file: its table's, or its trajectory's (in a run, its scene's)."""
        parts = relative.split("/")
        depth = 1 if parts[0] != "media" else 2 if self._epoch else 3
        return self._key("/".join(parts[:depth]) + "/" * (len(parts) > depth))

    def _file(self, relative: str) -> tuple[str, Entry]:
        """Find a file: its key and entry."""
        files = self._files(relative)
        if files.keys() != {""}:
            raise FileNotFoundError(2, "is a folder", self.at(relative))
        return files[""]

    def _files(self, relative: str) -> Files:
        """Find a file (under the name ``""``), or all files of a folder: keys and entries, by their names in it."""
        relative = inside(relative).strip("/")
        for believed_s in (None, _FRESH_S):
            objects = self._state.listing(self._group(relative), believed_s)
            parts = relative.split("/")
            if parts[0] == "media" and len(parts) > 2:
                manifest = self._key("/".join([*parts[:3], MANIFEST]))
                if manifest not in objects:
                    # What a listing has of a folder that is being written was put after the folder's manifest.
                    objects = objects | self._state.bucket.list(manifest)
            if files := find(self._state, self._key(relative), objects):
                return files
        raise FileNotFoundError(2, "there is no such file or folder", self.at(relative))


class _Ranges(io.RawIOBase):
    """An object as a file: every read is a request."""

    def __init__(self, bucket: Bucket, key: str, entry: Entry, url: str) -> None:
        self._bucket, self._key, self._entry, self._url, self._at = bucket, key, entry, url, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        self._at = max(0, offset + (0, self._at, self._entry.size)[whence])
        return self._at

    def readinto(self, buffer: Any) -> int:
        end = min(self._at + len(buffer), self._entry.size)
        if end <= self._at:
            return 0
        data = bytearray()
        try:
            self._bucket.download(self._key, data.extend, self._entry, self._at, end)
        except Changed:
            raise StoreError(f"{self._url} was replaced while it was read: run the command again") from None
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)


def matching(names: Iterable[str], pattern: str) -> set[str]:
    """Return the names, and the folders that they lie in, that match a glob part by part, or all by ``**/*``."""
    every = {"/".join(parts[:n]) for name in names for parts in [name.split("/")] for n in range(1, len(parts) + 1)}
    if pattern == "**/*":
        return every
    words = pattern.split("/")
    return {
        name for name in every if name.count("/") == len(words) - 1 and all(map(fnmatchcase, name.split("/"), words))
    }
