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
    """Gives out turns at even intervals; `next` is the time of the next one, seconds of a shared clock."""

    def __init__(self, following: float = 0.0) -> None:
        self.next = following

    def take(self, interval_s: float, now: float) -> float:
        """Return how many seconds to wait for the next turn."""
        at = max(now, self.next)
        self.next = at + interval_s
        return at - now


class InProcessChannel:
    """The channel of a worker that runs in the parent's process."""

    every_s = 0.0

    def __init__(self, on_message: Callable[[object], None], stopped: Callable[[], bool]) -> None:
        self.send, self.stopped = on_message, stopped
        self._turns = RateLimiter()

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn."""
        return self._turns.take(interval_s, time.monotonic())


_closers: list[Callable[[], object]] = []


def at_end(close: Callable[[], object]) -> None:
    """Register a callback for the end of this process's work for its executor."""
    _closers.append(close)


def end() -> None:
    """Call the registered callbacks, the last first; their errors are ignored."""
    while _closers:
        with contextlib.suppress(Exception):
            _closers.pop()()
