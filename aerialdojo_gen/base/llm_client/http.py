"""An HTTP client for the client packages, bounded in size; a request counter; errors by HTTP status."""

from __future__ import annotations

import email.utils
import json
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError, AgentUnavailable, UsageError

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
    """Make an HTTP client that bounds what it reads, which the client packages do not, and follows no redirect."""
    # A redirect would carry the key elsewhere.

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
        message = body[:200].decode("utf-8", "replace").split("\n", 1)[0].strip()
        raise BodyBoundError(f"its answer is no JSON: is base_url right? It begins with {message[:80]!r}") from None


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


_RETRYABLE = {408: "time-out", 409: "conflict", 425: "too early", 429: "rate limit"}
# A wrong or missing key, no money, no permission, and redirects: the key must not go elsewhere.
_ALL_REQUESTS = (401, 402, 403, 407)
_NO_MONEY = ("insufficient_quota", "billing_", "credit balance", "insufficient credits", "insufficient balance")
_NO_KEY = ("api key not valid", "api_key_invalid", "invalid api key", "incorrect api key")
_FILTERED = ("content_filter", "content filter", "content_policy", "content policy", "responsibleai", "safety")
_TOO_LONG = ("context_length", "context length", "context window", "maximum context", "prompt is too long",
             "too many tokens", "max_model_len", "input is too long")  # fmt: skip
_PICTURE_WORDS = ("image", "picture", "media", "file")


def refusal(status: int, body: Any, text: str, name: str, model: str, retry_after_s: float | None) -> AerialDojoError:
    """Make the error for an HTTP status that is none of success."""
    message = f"{name}: HTTP {status}: {text}"
    words = f"{_codes(body)} {text}".lower()
    if status in _ALL_REQUESTS or 300 <= status < 400 or _has(words, _NO_MONEY) or _has(words, _NO_KEY):
        return UsageError(message)
    if status in _RETRYABLE or status >= 500:
        kind = _RETRYABLE.get(status, "server error")
        return AgentUnavailable(message, retry_after_s, kind=kind)
    if status == 404 and _concerns_all_requests(words, model):
        return UsageError(message)
    if _has(words, _FILTERED):
        kind = "content filter"
    elif status == 413 or _has(words, _TOO_LONG):
        kind = "context too long"
    else:
        kind = "not found" if status == 404 else "bad request"
    return AgentUnavailable(message, retry_after_s, kind=kind, again=False)


def _concerns_all_requests(words: str, model: str) -> bool:
    """Whether a 404 is the model's or the address's, rather than that of something in the request."""
    if "model_not_found" in words or (model and re.search(rf"(?<!\w){re.escape(model.lower())}(?!\w)", words)):
        return True
    return not _has(words, _PICTURE_WORDS)


def _has(words: str, any_of: tuple[str, ...]) -> bool:
    return any(word in words for word in any_of)


def _codes(body: Any) -> str:
    """Join the names that an error gives itself: ``code`` and ``type``, at the top and in ``error``."""
    inner = body.get("error") if isinstance(body, dict) else None
    return " ".join(
        str(part[name])
        for part in (body, inner)
        if isinstance(part, dict)
        for name in ("code", "type", "status")
        if isinstance(part.get(name), str)
    )
