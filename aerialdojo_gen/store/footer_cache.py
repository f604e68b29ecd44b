"""What the footers of a data directory's shards said, kept in the user's cache for the next run.

A run asks what its shards were made from before it does anything, and on a finished dataset that is all it does. What
is kept of a shard counts as long as it is the same version (`DataRoot.version`): its inode, its size, and its times,
that of the inode's last change among them, which goes on also where somebody sets that of the bytes back. A change
could hide behind times that do not tell it from the one before: so of a shard that was changed less than two seconds
before its footer was read nothing is kept. Digests of files are not kept: who compares one reads the file.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from aerialdojo_gen.store import footers
from aerialdojo_gen.store.cache import cache_folder
from aerialdojo_gen.store.footers import ShardFile, ShardInfo
from aerialdojo_gen.store.root import DataRoot, LocalRoot, changed_ns

# No file system has coarser times.
_TIME_RESOLUTION_NS = 2 * 10**9


class FooterCache:
    """The footers of a data directory, in a file; one that is damaged, or cannot be written, is none."""

    def __init__(self, root: LocalRoot) -> None:
        self._root = root
        name = hashlib.sha256(os.fsencode(root.path)).hexdigest()
        self._path = cache_folder() / "footers" / f"{name}.json"
        # What another reader of footers made of them would be something else.
        self._reader = hashlib.sha256(Path(footers.__file__).read_bytes()).digest()
        self._entries: dict[str, Any] = {}
        self._used: set[str] = set()
        self._changed = False
        with contextlib.suppress(OSError, ValueError):
            checksum, text = self._path.read_bytes().split(b"\n", 1)
            if checksum == self._checksum(text):
                self._entries = json.loads(text)

    def find(self, root: DataRoot, name: str, version: str) -> ShardInfo | None:
        """Return what the footer of a shard says that has this version; None where that is not known."""
        entry = self._entries.get(name) if root == self._root else None
        if entry is None or entry["version"] != version:
            return None
        self._used.add(name)
        fields = entry["facts"]
        return ShardInfo(**fields | {"files": {file: ShardFile(*pair) for file, pair in fields["files"].items()}})

    def record(self, root: DataRoot, name: str, version: str, read_ns: int, info: ShardInfo) -> None:
        """Keep what the footer of a shard says; `read_ns` is when its version was read."""
        if root == self._root and read_ns - changed_ns(version) > _TIME_RESOLUTION_NS:
            self._used.add(name)
            self._entries[name] = {"version": version, "facts": vars(info)}
            self._changed = True

    def save(self) -> None:
        """Write the file, where something came to it; shards that are gone are left out."""
        if not self._changed:
            return
        self._changed = False
        kept = {name: e for name, e in self._entries.items() if name in self._used or self._root.exists(name)}
        text = json.dumps(kept).encode()
        temporary = self._path.with_name(f".{self._path.name}.{os.getpid()}.tmp")
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            temporary.write_bytes(self._checksum(text) + b"\n" + text)
            temporary.replace(self._path)

    def _checksum(self, text: bytes) -> bytes:
        return hashlib.sha256(self._reader + text).hexdigest().encode()


_current: ContextVar[FooterCache | None] = ContextVar("known footers", default=None)


@contextlib.contextmanager
def cached_footers(root: DataRoot) -> Iterator[None]:
    """Read footers of a data directory no more than once while they stay as they are, here and in later processes.

    On any other data root nothing is kept.
    """
    if not isinstance(root, LocalRoot):
        yield
        return
    known = FooterCache(root)
    token = _current.set(known)
    try:
        yield
    finally:
        _current.reset(token)
        known.save()


def footer_cache() -> FooterCache | None:
    """Return what `cached_footers` keeps footers in; None outside of it."""
    return _current.get()
