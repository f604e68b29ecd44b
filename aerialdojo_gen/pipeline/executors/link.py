"""What a worker process has of its parent while it works, and what it does at its end.

Nothing heavy is imported: every worker process begins with this.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Protocol


class WorkerChannel(Protocol):
    """A worker's way to the process that gave it its task."""

    every_s: float  # How far messages should be apart, seconds; 0 where each costs nothing

    def tell(self, message: object) -> None:
        """Send a small message; the parent hears it while the task goes on."""

    def stopped(self) -> bool:
        """Whether the parent wants nothing more to be begun."""

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn; turns of all workers are at least `interval_s` apart."""


class RateLimiter:
    """Turns at even intervals, seconds of one clock that all who ask share; `next` is when the next one is."""

    def __init__(self, following: float = 0.0) -> None:
        self.next = following

    def take(self, interval_s: float, now: float) -> float:
        """Return how many seconds to wait for the next turn."""
        at = max(now, self.next)
        self.next = at + interval_s
        return at - now


class InProcessChannel:
    """The link of a worker that is its own parent."""

    every_s = 0.0

    def __init__(self, hear: Callable[[object], None], stopped: Callable[[], bool]) -> None:
        self.tell, self.stopped = hear, stopped
        self._turns = RateLimiter()

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn."""
        return self._turns.take(interval_s, time.monotonic())


_closers: list[Callable[[], object]] = []


def at_end(close: Callable[[], object]) -> None:
    """Have something called when this process has done its last task for its executor."""
    _closers.append(close)


def end() -> None:
    """Call what waits for the end, the last first; what it raises now is of no task."""
    while _closers:
        with contextlib.suppress(Exception):
            _closers.pop()()
