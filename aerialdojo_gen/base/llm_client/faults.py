"""What an error of a service concerns: one request, so that one episode fails, or all, so that the run ends."""

from __future__ import annotations

import re
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError, AgentUnavailable, UsageError

_WORTH_ANOTHER_TRY = {408: "time-out", 409: "conflict", 425: "too early", 429: "rate limit"}
# A wrong or missing key, no money, no permission, and redirects: the key must not go elsewhere.
_ALL_REQUESTS = (401, 402, 403, 407)
_NO_MONEY = ("insufficient_quota", "billing_", "credit balance", "insufficient credits", "insufficient balance")
_NO_KEY = ("api key not valid", "api_key_invalid", "invalid api key", "incorrect api key")
_FILTERED = ("content_filter", "content filter", "content_policy", "content policy", "responsibleai", "safety")
_TOO_LONG = ("context_length", "context length", "context window", "maximum context", "prompt is too long",
             "too many tokens", "max_model_len", "input is too long")  # fmt: skip
_OF_A_PICTURE = ("image", "picture", "media", "file")


def refusal(status: int, body: Any, said: str, name: str, model: str, retry_after_s: float | None) -> AerialDojoError:
    """Make the error for an HTTP status that is none of success."""
    message = f"{name}: HTTP {status}: {said}"
    words = f"{_codes(body)} {said}".lower()
    if status in _ALL_REQUESTS or 300 <= status < 400 or _has(words, _NO_MONEY) or _has(words, _NO_KEY):
        return UsageError(message)
    if status in _WORTH_ANOTHER_TRY or status >= 500:
        kind = _WORTH_ANOTHER_TRY.get(status, "server error")
        return AgentUnavailable(message, retry_after_s, kind=kind)
    if status == 404 and _is_of_all(words, model):
        return UsageError(message)
    if _has(words, _FILTERED):
        kind = "content filter"
    elif status == 413 or _has(words, _TOO_LONG):
        kind = "context too long"
    else:
        kind = "not found" if status == 404 else "bad request"
    return AgentUnavailable(message, retry_after_s, kind=kind, again=False)


def _is_of_all(words: str, model: str) -> bool:
    """Whether a 404 is the model's or the address's, rather than that of something in the request."""
    if "model_not_found" in words or (model and re.search(rf"(?<!\w){re.escape(model.lower())}(?!\w)", words)):
        return True
    return not _has(words, _OF_A_PICTURE)


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
