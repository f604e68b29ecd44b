"""Requests spaced out over all worker processes, so that a service's limit is kept."""

from __future__ import annotations

import time

from aerialdojo_gen.pipeline.executors.link import WorkerChannel


class Pace:
    """Lets requests go at even intervals."""

    def __init__(self, per_minute: float, link: WorkerChannel) -> None:
        self._interval_s, self._link = 60.0 / per_minute, link

    def wait(self) -> None:
        """Wait until the next request may be sent."""
        time.sleep(self._link.turn(self._interval_s))
