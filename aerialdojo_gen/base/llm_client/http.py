"""An HTTP client for the client packages, bounded in size; and a count of requests and their times."""

from __future__ import annotations

import email.utils
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

MAX_BODY_BYTES = 4 << 20


class BodyBoundError(Exception):
    """A service sent more than it may, or something that is no JSON."""


@dataclass
class Meter:
    """Counts requests, and the time that they take."""

    requests: int = 0  # Sent, repeated ones too
    seconds: float = 0.0  # From sending a request to having its answer whole: of all together, and of the longest
    longest_s: float = 0.0
    pace: Callable[[], None] | None = None  # Called before each request; waits until one may be sent

    def reset(self) -> None:
        """Begin to count anew."""
        self.requests, self.seconds, self.longest_s = 0, 0.0, 0.0

    def add(self, seconds: float) -> None:
        """Count a request."""
        self.requests += 1
        self.seconds += seconds
        self.longest_s = max(self.longest_s, seconds)


def bounded_client(base: Any, timeout: Any) -> Any:
    """Make an asynchronous HTTP client whose responses are bounded in size.

    The client packages read a body whole, an error's too, however long it is. Redirects are not followed: they would
    carry the key elsewhere.
    """

    class BoundedClient(base):  # type: ignore[misc]  # a class that is known at run time alone
        async def send(self, request: Any, *, stream: bool = False, **options: Any) -> Any:
            response = await super().send(request, stream=True, **options)
            body = await _whole(response)
            if response.status_code == 200:
                _check_json(body)
            framing = ("content-encoding", "content-length", "transfer-encoding")
            headers = [(k, v) for k, v in response.headers.items() if k.lower() not in framing]
            return type(response)(response.status_code, headers=headers, content=body, request=request)

    return BoundedClient(timeout=timeout, follow_redirects=False)


async def _whole(response: Any) -> bytes:
    body = bytearray()
    try:
        async for chunk in response.aiter_bytes():
            body += chunk
            if len(body) > MAX_BODY_BYTES:
                raise BodyBoundError(f"its answer is larger than {MAX_BODY_BYTES >> 20} MiB")
    finally:
        await response.aclose()
    return bytes(body)


def _check_json(body: bytes) -> None:
    # Here, so that the packages never parse what makes their parser raise: 5,000-digit numbers, deep nesting.
    try:
        json.loads(body)
    except (ValueError, RecursionError):
        said = body[:200].decode("utf-8", "replace").split("\n", 1)[0].strip()
        raise BodyBoundError(f"its answer is no JSON: is base_url right? It begins with {said[:80]!r}") from None


def retry_after_s(headers: Mapping[str, str]) -> float | None:
    """Read ``Retry-After``: seconds or an HTTP date; None where there is none that can be read."""
    value = headers.get("retry-after", "").strip()
    if not value:
        return None
    try:
        seconds = float(value)
    except ValueError:
        try:
            seconds = email.utils.parsedate_to_datetime(value).timestamp() - time.time()
        except (ValueError, TypeError, OverflowError):
            return None
    return max(0.0, seconds) if seconds < float("inf") else None
