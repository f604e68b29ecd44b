"""A lock in an object store: a small object that its holder renews, taken over when it was not for too long.

Whoever puts it first has it (a conditional put); a holder puts it anew, under the condition that nobody else did,
every quarter of the lease. Its age is measured by the store's clock alone. A holder that was killed leaves it to grow
old: the next one waits for that, and takes it under the condition that it is still the old one, so that of two takers
one gets it. A holder that could not renew it in time has lost it and writes nothing more; so do its workers, on
whatever machine, which look whose it is before they commit, at most a quarter of a lease ago. What such a worker is
putting in that moment still comes to stand; being made from the same inputs it is what the next holder would write.
"""

from __future__ import annotations

import getpass
import json
import logging
import os
import platform
import secrets
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from aerialdojo_gen.base.environment_errors import number_of
from aerialdojo_gen.base.errors import Malformed, StoreError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.store.bucket import Bucket, Changed

_DEFAULT_S = 60.0
_RENEWALS = 4
log = logging.getLogger(__name__)


class _LeaseRecord(NamedTuple):
    """What the object says: who holds it, in words and by a token; released when the lease is 0."""

    token: str
    holder: str
    lease_s: float


def lease_s() -> float:
    """Seconds that a lock is held without being renewed: ``$AERIALDOJO_LEASE_S``, or a minute."""
    return number_of("AERIALDOJO_LEASE_S", _DEFAULT_S, 1.0, 86400.0, "write a number of seconds, 1 or more")


class Lease:
    """A lock that is held, and renewed by a thread until `release`."""

    def __init__(self, bucket: Bucket, key: str, url: str) -> None:
        self._bucket, self._key, self._url = bucket, key, url
        self._lease_s = lease_s()
        self.token = secrets.token_hex(16)
        self._etag = self._take()
        self._renewed = time.monotonic()
        self._lost = ""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._renew, name="lease", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raise StoreError if the lock is no longer held."""
        if not self._lost and time.monotonic() - self._renewed > self._lease_s:
            self._lost = "it could not be renewed in time"
        if self._lost:
            raise lease_lost(self._url, self._lost)

    def release(self) -> None:
        """Give the lock back, where it is still held."""
        self._ended.set()
        self._thread.join()
        if not self._lost:
            with suppress(Changed, StoreError, FileNotFoundError):
                self._bucket.put_bytes(self._key, _encode(_LeaseRecord(self.token, "", 0.0)), etag=self._etag)

    def _put(self, *, new: bool = False, etag: str = "") -> str:
        note = _LeaseRecord(self.token, _holder_name(), self._lease_s)
        return self._bucket.put_bytes(self._key, _encode(note), new=new, etag=etag).etag

    def _take(self) -> str:
        seen = ""
        while True:
            try:
                found = self._bucket.read_small(self._key)
            except FileNotFoundError:
                with suppress(Changed):
                    return self._put(new=True)
                continue
            note = _decode(found.data)
            left = (note.lease_s if note else self._lease_s) - found.age_s
            if left <= 0.0:
                with suppress(Changed):
                    return self._put(etag=found.etag)
                continue
            message = _held_message(self._url, note, left)
            if seen and found.etag != seen:
                raise StoreError(f"{message}: wait for it, or use another --data")
            if not seen and left > 1.0:
                log.warning("%s; waiting whether it is renewed", message)
            seen = found.etag
            time.sleep(min(left + 0.05, self._lease_s / _RENEWALS / 2, 2.0))

    def _renew(self) -> None:
        while not self._lost and not self._ended.wait(self._lease_s / _RENEWALS):
            begun = time.monotonic()
            try:
                try:
                    self._etag = self._put(etag=self._etag)
                except (Changed, FileNotFoundError):
                    self._find_whose_it_is()
                self._renewed = begun
            except StoreError as error:
                # It may answer again before the lease is over: `check` says when it is too late.
                log.warning("the lock of %s is not renewed: %s", self._url, error)

    def _find_whose_it_is(self) -> None:
        """Ask whether the put that renewed it was done after all, its answer being lost on the way."""
        try:
            found = self._bucket.read_small(self._key)
        except FileNotFoundError:
            self._lost = "somebody removed it"
            return
        note = _decode(found.data)
        if note is not None and note.token == self.token:
            self._etag = found.etag
        else:
            self._lost = f"{note.holder or 'another run'} has it now" if note else "somebody changed it"


def token_of(bucket: Bucket, key: str) -> str:
    """Return the token of who holds a lock; empty where nobody does."""
    try:
        note = _decode(bucket.read_small(key).data)
    except FileNotFoundError:
        return ""
    return note.token if note and note.lease_s else ""


def lease_lost(url: str, why: str) -> StoreError:
    """Make the error of a run that holds its lock no longer."""
    return StoreError(
        f"this run has lost the lock of {url} ({why}): nothing more is written; what was finished is kept"
    )


def _held_message(url: str, note: _LeaseRecord | None, left_s: float) -> str:
    until = (datetime.now(UTC) + timedelta(seconds=left_s)).strftime("%H:%M:%S UTC")
    holder = note.holder if note else "somebody"
    return f"another run is writing to {url}: {holder} holds it until {until}, longer if it is renewed"


def _holder_name() -> str:
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user} on {platform.node() or 'a machine'} (process {os.getpid()})"


def _encode(note: _LeaseRecord) -> bytes:
    # The time makes each one another object: a tag is of the bytes.
    return json.dumps(note._asdict() | {"put": secrets.token_hex(4)}).encode()


def _decode(data: bytes) -> _LeaseRecord | None:
    """Read what a holder put; None for what nobody here put."""
    try:
        fields = loads_json(data)
        lease_s = min(max(float(fields["lease_s"]), 0.0), 86400.0)
        return _LeaseRecord(str(fields["token"]), str(fields["holder"])[:200], lease_s)
    except (Malformed, KeyError, TypeError, ValueError):
        return None
