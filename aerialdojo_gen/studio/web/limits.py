"""Limits on clients of the local server: connections, time per request, log lines.

uvicorn has none of them: half requests stay open for ever, use up all file descriptors, and then fill the log.
"""

from __future__ import annotations

import asyncio
import logging
import resource
import time

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

# Time limits for a request's head and body.
HEAD_S, BODY_S = 10.0, 60.0
# A response that the client stops reading is aborted after this time.
STALL_S = 30.0
MAX_CONNECTIONS, MAX_PER_CLIENT = 256, 64
MAX_LINES, WINDOW_S = 20, 60.0

_TOO_LATE = b"HTTP/1.1 408 Request Timeout\r\nconnection: close\r\ncontent-length: 0\r\n\r\n"


class LimitedProtocol(H11Protocol):
    """A connection that is closed when it is too slow, or when its place is needed.

    With too many connections, in total or from one address, the one that has waited longest for the rest of a request
    is closed: half requests displace each other, whole ones are served.
    """

    transport: asyncio.Transport

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Register the connection, and close another one if there are too many."""
        super().connection_made(transport)
        self._phase = ""
        self._timer: asyncio.TimerHandle | None = None
        self._stall: asyncio.TimerHandle | None = None
        self._waits_since = time.monotonic()
        self._follow()
        # Connections closed in the same batch are still in the set.
        others = [c for c in self.connections if isinstance(c, LimitedProtocol) and not c.transport.is_closing()]
        mine = [c for c in others if c.host == self.host]
        if len(mine) > MAX_PER_CLIENT:
            self._make_room(mine)
        else:
            # At most half the process's file limit.
            files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
            half = MAX_CONNECTIONS if files == resource.RLIM_INFINITY else max(8, files // 2)
            if len(others) > min(MAX_CONNECTIONS, half):
                self._make_room(others)

    def _make_room(self, others: list[LimitedProtocol]) -> None:
        waiting = [c for c in others if c._phase and c is not self]
        victim = min(waiting, key=lambda c: (c._idle, c._waits_since), default=self)
        victim.transport.abort()

    @property
    def _idle(self) -> bool:
        """Whether it has been served and has not begun another request."""
        return self._phase == "head" and self.cycle is not None and not self.conn.trailing_data[0]

    @property
    def host(self) -> str:
        """Address of the client."""
        return self.client[0] if self.client else ""

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timers."""
        super().connection_lost(exc)
        for timer in (self._timer, self._stall):
            if timer is not None:
                timer.cancel()

    def data_received(self, data: bytes) -> None:
        """Read on, and update what is awaited."""
        super().data_received(data)
        self._follow()

    def on_response_complete(self) -> None:
        """Start the time limit of the next request."""
        super().on_response_complete()
        self._follow()

    def _follow(self) -> None:
        # A response may be complete before its request: a refused body is still awaited.
        answered = self.cycle is None or self.cycle.response_complete
        phase = "body" if self.conn.their_state is h11.SEND_BODY else "head" if answered else ""
        if phase == self._phase:
            return
        self._phase, self._waits_since = phase, time.monotonic()
        if self._timer is not None:
            self._timer.cancel()
        seconds = {"head": HEAD_S, "body": BODY_S}.get(phase)
        self._timer = self.loop.call_later(seconds, self._late) if seconds else None

    def _late(self) -> None:
        begun = self.cycle is not None and not self.cycle.response_complete and self.cycle.response_started
        if not begun and not self.transport.is_closing() and (self._phase == "body" or self.conn.trailing_data[0]):
            self.transport.write(_TOO_LATE)
        self.transport.close()

    def pause_writing(self) -> None:
        """Wait for the client to read, as long as it makes progress."""
        super().pause_writing()
        self._watch(self.transport.get_write_buffer_size())

    def resume_writing(self) -> None:
        """Stop watching."""
        super().resume_writing()
        if self._stall is not None:
            self._stall.cancel()

    def _watch(self, left: int) -> None:
        self._stall = self.loop.call_later(STALL_S, self._stalled, left)

    def _stalled(self, left: int) -> None:
        now = self.transport.get_write_buffer_size()
        if now < left:
            self._watch(now)
        else:
            self.transport.abort()


class BoundedLog(logging.Filter):
    """Limits log lines per minute, and reports how many were dropped."""

    def __init__(self) -> None:
        super().__init__()
        self._since, self._passed, self._kept = -WINDOW_S, 0, 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the line is written."""
        now = time.monotonic()
        if now - self._since >= WINDOW_S:
            if self._kept:
                record.msg = f"({self._kept} messages left out) {record.getMessage()}"
                record.args = None
            self._since, self._passed, self._kept = now, 0, 0
        if self._passed >= MAX_LINES:
            self._kept += 1
            return False
        self._passed += 1
        return True
