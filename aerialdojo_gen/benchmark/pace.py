"""Requests spaced out over all worker processes, so that a service's limit is kept."""

from __future__ import annotations

import multiprocessing
import time
from typing import Any


class Pace:
    """Lets requests go at even intervals.

    Parameters
    ----------
    per_minute : float
        How many requests, all processes together.
    context : multiprocessing context, optional
        In which the processes are started.
    """

    def __init__(self, per_minute: float, context: Any = None) -> None:
        self._interval_s = 60.0 / per_minute
        # Of the monotonic clock, which all processes of a machine share.
        self._next = (context or multiprocessing.get_context("spawn")).Value("d", 0.0)

    @classmethod
    def of(cls, per_minute: float | None, context: Any = None) -> Pace | None:
        """Make one; None without a limit."""
        return None if per_minute is None else cls(per_minute, context)

    def wait(self) -> None:
        """Wait until the next request may be sent."""
        with self._next.get_lock():
            now = time.monotonic()
            at = max(now, self._next.value)
            self._next.value = at + self._interval_s
        time.sleep(at - now)
