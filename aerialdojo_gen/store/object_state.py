"""What a process knows of a bucket: its client, what was listed in it, digests and manifests by their tags."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from aerialdojo_gen.store.bucket import Bucket, Entry
from aerialdojo_gen.store.cache import Cache

# A reader that holds no lock believes a listing for so long.
_LISTING_TTL_S = 60.0
# What is not in a listing is looked for once more if the listing is older.
_FRESH_S = 2.0


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
