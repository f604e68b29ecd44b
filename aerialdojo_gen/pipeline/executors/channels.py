"""Channels from a worker to its parent, and callbacks for the end of a process.

Nothing heavy is imported: every worker process starts with this.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Protocol


class WorkerChannel(Protocol):
    """A worker's channel to its parent."""

    every_s: float  # Least interval of messages, seconds; 0 if they are free

    def send(self, message: object) -> None:
        """Send a small message to the parent while the task runs."""

    def stopped(self) -> bool:
        """Whether the parent has asked to start nothing more."""

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait; turns of all workers are at least `interval_s` apart."""


class RateLimiter:
    """Gives out turns at even intervals."""

    def __init__(self) -> None:
        self._next = 0.0

    def take(self, interval_s: float) -> float:
        """Return how many seconds to wait for the next turn."""
        now = time.monotonic()
        at = max(now, self._next)
        self._next = at + interval_s
        return at - now


_closers: list[Callable[[], object]] = []


def at_end(close: Callable[[], object]) -> None:
    """Register a callback for the end of this process's work for its executor."""
    _closers.append(close)


def end() -> None:
    """Call the registered callbacks, the last first; their errors are ignored."""
    while _closers:
        with contextlib.suppress(Exception):
            _closers.pop()()
