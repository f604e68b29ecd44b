"""What a process knows of a bucket; folders that appear, and are replaced, all at once (manifests: `object_root`)."""

from __future__ import annotations

import json
import os
import secrets
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import Malformed, StoreError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.store.bucket import Bucket, Entry
from aerialdojo_gen.store.cache import Cache
from aerialdojo_gen.store.files import sha256_of

MANIFEST = ".aerialdojo-folder.json"
_NEW = ".aerialdojo-new-"
_AT_ONCE = 4
# A reader that holds no lock believes a listing for so long.
_LISTING_TTL_S = 60.0
# What is not in a listing is looked for once more if the listing is older.
_FRESH_S = 2.0
Files = dict[str, tuple[str, Entry]]


@dataclass
class _Listing:
    objects: dict[str, Entry]
    made: float


@dataclass
class State:
    """Shared by all roots of a bucket in this process."""

    bucket: Bucket  # The client; the copies on this machine
    cache: Cache
    digests: dict[tuple[str, str], str] = field(default_factory=dict)  # SHA-256 by key and tag
    manifests: dict[tuple[str, str], Any] = field(default_factory=dict)
    leases: dict[str, Any] = field(default_factory=dict)  # Locks that this process holds, by the root's URL
    checked_at: dict[str, float] = field(default_factory=dict)
    _listings: dict[str, _Listing] = field(default_factory=dict)
    _epoch: int = 0
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def invalidate_before(self, epoch: int) -> None:
        """Forget what was listed before a run last began to look anew."""
        if epoch > self._epoch:
            with self._lock:
                self._epoch = epoch
                self._listings.clear()

    def forget(self) -> None:
        """Forget all listings."""
        with self._lock:
            self._listings.clear()

    def listing(self, group: str, *, reread: bool = False) -> dict[str, Entry]:
        """Return the objects under a prefix by key, as they were listed before unless `reread`; not to be changed."""
        with self._lock:
            kept = self._listings.get(group)
            old = kept is not None and not self._epoch and time.monotonic() - kept.made > _LISTING_TTL_S
            if kept is None or old or reread:
                kept = self._listings[group] = _Listing(self.bucket.list(group), time.monotonic())
            return kept.objects

    def is_stale(self, group: str) -> bool:
        """Whether to look again may find more."""
        kept = self._listings.get(group)
        return kept is None or time.monotonic() - kept.made > _FRESH_S

    def record_write(self, key: str, entry: Entry | None) -> None:
        """Take note of what this process put, or deleted."""
        with self._lock:
            for group, kept in self._listings.items():
                if key.startswith(group):
                    if entry is None:
                        kept.objects.pop(key, None)
                    else:
                        kept.objects[key] = entry


def state_of(bucket: str) -> State:
    """Return what this process knows of a bucket."""
    return _made(bucket, os.getpid())


@lru_cache(maxsize=8)
def _made(bucket: str, _process: int) -> State:
    return State(Bucket(bucket), Cache())


class ObjectFolders:
    """Folders of a bucket."""

    def __init__(self, state: State) -> None:
        self._state, self._bucket = state, state.bucket

    def put(self, key: str, folder: Path, may_write: Callable[[], None]) -> None:
        """Put a folder's files under a key, in the place of what is there."""
        paths = {p.relative_to(folder).as_posix(): p for p in sorted(folder.rglob("*")) if p.is_file()}
        before = self._bucket.list(f"{key}/")
        own = before.get(f"{key}/{MANIFEST}")
        exists = self._manifest(f"{key}/{MANIFEST}", own) is not None if own else bool(before)
        if exists:
            base = f"{key}/{_NEW}{secrets.token_hex(8)}"
            new = self._put_all(base, paths)
            may_write()
            self._write_manifest(key, new)
            with ThreadPoolExecutor(_AT_ONCE) as pool:
                copied = pool.map(lambda name: (name, self._copied(new[name][0], f"{key}/{name}")), paths)
                new_plain = dict(copied)
            self._write_manifest(key, new_plain)
        else:
            self._write_manifest(key, None)
            new_plain = self._put_all(key, paths)
            may_write()
            self._write_manifest(key, new_plain)
        kept = {name for name, _ in new_plain.values()} | {f"{key}/{MANIFEST}"}
        self._remove([name for name in self._bucket.list(f"{key}/") if name not in kept])

    def delete(self, key: str) -> None:
        """Remove a folder that has a manifest."""
        self._write_manifest(key, None)
        names = list(self._bucket.list(f"{key}/"))
        self._remove([name for name in names if name != f"{key}/{MANIFEST}"])
        self._remove([f"{key}/{MANIFEST}"])

    def find(self, key: str, found: dict[str, Entry], first: str = "") -> Files:
        """Find a file, or all files of a folder, as the manifests say."""
        if first and f"{first}/{MANIFEST}" not in found:
            # What a listing has of a folder that is being written was put after the folder's manifest.
            found = found | self._bucket.list(f"{first}/{MANIFEST}")
        above = key
        while above:
            if (entry := found.get(f"{above}/{MANIFEST}")) is not None:
                files = self._manifest(f"{above}/{MANIFEST}", entry) or {}
                inner = key[len(above) + 1 :]
                if inner in files:
                    return {"": files[inner]}
                return {
                    n.removeprefix(f"{inner}/"): at
                    for n, at in files.items()
                    if not inner or n.startswith(f"{inner}/")
                }
            above = above.rpartition("/")[0]
        if key in found:
            return {"": (key, found[key])}
        plain = {name: at for name, at in found.items() if name.startswith(f"{key}/")}
        tops = [name.removesuffix(f"/{MANIFEST}") for name in plain if name.endswith(f"/{MANIFEST}")]
        files = {
            n[len(key) + 1 :]: (n, at) for n, at in plain.items() if not any(n.startswith(f"{t}/") for t in tops)
        }
        for top in tops:
            inside = self._manifest(f"{top}/{MANIFEST}", plain[f"{top}/{MANIFEST}"]) or {}
            files |= {f"{top[len(key) + 1 :]}/{name}": at for name, at in inside.items()}
        return files

    def _manifest(self, key: str, entry: Entry) -> Files | None:
        """Read which files a folder has, relative to it; None where it is being written."""
        known = self._state.manifests
        if (key, entry.etag) not in known:
            try:
                found = self._bucket.read_small(key)
            except FileNotFoundError:
                return None
            known[key, found.etag] = known[key, entry.etag] = _parsed(found.data, key)
        files: Files | None = known[key, entry.etag]
        return files

    def _write_manifest(self, key: str, files: Files | None) -> None:
        # Relative to the folder: a whole prefix may be copied elsewhere.
        entries = {name: [at.removeprefix(f"{key}/"), e.size, e.etag] for name, (at, e) in (files or {}).items()}
        fields = {"state": "writing" if files is None else "whole", "files": entries, "put": secrets.token_hex(4)}
        text = json.dumps(fields, sort_keys=True)
        entry = self._bucket.put_bytes(f"{key}/{MANIFEST}", text.encode())
        self._state.manifests[f"{key}/{MANIFEST}", entry.etag] = files
        self._state.record_write(f"{key}/{MANIFEST}", entry)

    def _put_all(self, base: str, paths: dict[str, Path]) -> Files:
        def put(name: str) -> tuple[str, tuple[str, Entry]]:
            entry = self._bucket.put(f"{base}/{name}", paths[name], {"sha256": sha256_of(paths[name])})
            self._state.record_write(f"{base}/{name}", entry)
            return name, (f"{base}/{name}", entry)

        with ThreadPoolExecutor(_AT_ONCE) as pool:
            return dict(pool.map(put, paths))

    def _copied(self, key: str, to: str) -> tuple[str, Entry]:
        entry = self._bucket.copy(key, to)
        self._state.record_write(to, entry)
        return to, entry

    def _remove(self, names: list[str]) -> None:
        self._bucket.delete(names)
        for name in names:
            self._state.record_write(name, None)


def _parsed(data: bytes, key: str) -> Files | None:
    try:
        fields = loads_json(data)
        if fields["state"] != "whole":
            return None
        folder = key.rpartition("/")[0]
        return {
            str(name): (f"{folder}/{at}", Entry(int(size), str(etag)))
            for name, (at, size, etag) in fields["files"].items()
        }
    except (Malformed, KeyError, TypeError, ValueError, AttributeError):
        raise StoreError(
            f"the manifest {key} is damaged: delete it, and the folder counts as what lies in it"
        ) from None
