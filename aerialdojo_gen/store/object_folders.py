"""What a process knows of a bucket; folders that appear, and are replaced, all at once (manifests: `object_root`)."""

from __future__ import annotations

import json
import math
import os
import secrets
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

from aerialdojo_gen.base.errors import Malformed, StoreError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.store.bucket import AT_ONCE, Bucket, Entry
from aerialdojo_gen.store.cache import Cache
from aerialdojo_gen.store.files import sha256_of
from aerialdojo_gen.store.lease import Lease

MANIFEST = ".aerialdojo-folder.json"
_NEW = ".aerialdojo-new-"
# A reader that holds no lock believes a listing for so long.
_LISTING_TTL_S = 60.0
# Keys and entries by name.
Files: TypeAlias = dict[str, tuple[str, Entry]]


@dataclass
class State:
    """Shared by all roots of a bucket in this process."""

    bucket: Bucket  # The client; the copies on this machine
    cache: Cache
    leases: dict[str, Lease] = field(default_factory=dict)  # Locks that this process holds, by the root's URL
    checked_at: dict[str, float] = field(default_factory=dict)  # When locks of other processes were last looked at
    _listings: dict[str, tuple[float, dict[str, Entry]]] = field(default_factory=dict)  # With when they were made
    _epoch: int = 0
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def invalidate_before(self, epoch: int) -> None:
        """Forget what was listed before a run last began to look anew."""
        if epoch > self._epoch:
            self._epoch = epoch
            self.forget()

    def forget(self) -> None:
        """Forget all listings."""
        with self._lock:
            self._listings.clear()

    def listing(self, group: str, believed_s: float | None = None) -> dict[str, Entry]:
        """Return the objects under a prefix by key, as listed at most so many seconds ago; not to be changed."""
        if believed_s is None:
            believed_s = math.inf if self._epoch else _LISTING_TTL_S
        with self._lock:
            if group not in self._listings or time.monotonic() - self._listings[group][0] > believed_s:
                self._listings[group] = time.monotonic(), self.bucket.list(group)
            return self._listings[group][1]

    def put(self, key: str, path: Path) -> Entry:
        """Put a file, and its SHA-256 with it."""
        entry = self.bucket.put(key, path, {"sha256": sha256_of(path)})
        self.record_write(key, entry)
        return entry

    def delete(self, keys: list[str]) -> None:
        """Remove objects."""
        self.bucket.delete(keys)
        for key in keys:
            self.record_write(key, None)

    def record_write(self, key: str, entry: Entry | None) -> None:
        """Take note of what this process put, or deleted."""
        with self._lock:
            for group, (_, objects) in self._listings.items():
                if key.startswith(group):
                    if entry is None:
                        objects.pop(key, None)
                    else:
                        objects[key] = entry


def state_of(bucket: str) -> State:
    """Return what this process knows of a bucket."""
    return _made(bucket, os.getpid())


@lru_cache(maxsize=8)
def _made(bucket: str, _process: int) -> State:
    return State(Bucket(bucket), Cache())


def find(state: State, key: str, objects: dict[str, Entry]) -> Files:
    """Find an object (under the name ``""``), or all that a folder holds, as its manifest says where it has one."""
    above = key
    while above and f"{above}/{MANIFEST}" not in objects:
        above = above.rpartition("/")[0]
    if above:
        found = _manifest(state.bucket, f"{above}/{MANIFEST}", objects[f"{above}/{MANIFEST}"].etag)
    elif key in objects:
        found = {key: (key, objects[key])}
    else:
        found = {name: (name, entry) for name, entry in objects.items() if not is_ours(name)}
    if key in found:
        return {"": found[key]}
    return {name[len(key) + 1 :]: at for name, at in found.items() if name.startswith(f"{key}/")}


def is_ours(name: str) -> bool:
    """Whether an object is a manifest, a lock, or of a folder that is not in its place yet."""
    return any(part.startswith(".aerialdojo-") for part in name.split("/"))


def put_folder(state: State, key: str, folder: Path, may_write: Callable[[], None]) -> None:
    """Put a folder's files under a key, in the place of what is there."""
    paths = {p.relative_to(folder).as_posix(): p for p in sorted(folder.rglob("*")) if p.is_file()}

    def put_all(base: str) -> Files:
        return _each(lambda name: (f"{base}/{name}", state.put(f"{base}/{name}", paths[name])), paths)

    if find(state, key, state.bucket.list(f"{key}/")):
        new = put_all(f"{key}/{_NEW}{secrets.token_hex(8)}")
        may_write()
        _write_manifest(state, key, new)

        def to_its_place(name: str) -> tuple[str, Entry]:
            entry = state.bucket.copy(new[name][0], f"{key}/{name}")
            state.record_write(f"{key}/{name}", entry)
            return f"{key}/{name}", entry

        files = _each(to_its_place, paths)
    else:
        _write_manifest(state, key, None)
        files = put_all(key)
        may_write()
    _write_manifest(state, key, files)
    kept = {at for at, _ in files.values()} | {f"{key}/{MANIFEST}"}
    state.delete([name for name in state.bucket.list(f"{key}/") if name not in kept])


def delete_folder(state: State, key: str) -> None:
    """Remove a folder that has a manifest."""
    _write_manifest(state, key, None)
    state.delete([name for name in state.bucket.list(f"{key}/") if name != f"{key}/{MANIFEST}"])
    state.delete([f"{key}/{MANIFEST}"])


def _each(put: Callable[[str], tuple[str, Entry]], names: dict[str, Path]) -> Files:
    with ThreadPoolExecutor(AT_ONCE) as pool:
        return dict(zip(names, pool.map(put, names), strict=True))


def _write_manifest(state: State, key: str, files: Files | None) -> None:
    """Say which files a folder has; None while they are being put."""
    # Relative to the folder: a whole prefix may be copied elsewhere.
    entries = {name: [at.removeprefix(f"{key}/"), e.size, e.etag] for name, (at, e) in (files or {}).items()}
    fields = {"state": "writing" if files is None else "whole", "files": entries, "put": secrets.token_hex(4)}
    text = json.dumps(fields, sort_keys=True)
    state.record_write(f"{key}/{MANIFEST}", state.bucket.put_bytes(f"{key}/{MANIFEST}", text.encode()))


@lru_cache(maxsize=8192)
def _manifest(bucket: Bucket, key: str, _etag: str) -> Files:
    """Read the files of a folder, by their keys in its place; none where they are being put, or it was removed."""
    try:
        fields = loads_json(bucket.read_small(key).data)
        if fields["state"] != "whole":
            return {}
        folder = key.rpartition("/")[0]
        return {
            f"{folder}/{name}": (f"{folder}/{at}", Entry(int(size), str(etag)))
            for name, (at, size, etag) in fields["files"].items()
        }
    except FileNotFoundError:
        return {}
    except (Malformed, KeyError, TypeError, ValueError, AttributeError):
        raise StoreError(
            f"the manifest {key} is damaged: delete it, and the folder counts as what lies in it"
        ) from None
