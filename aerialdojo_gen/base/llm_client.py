"""Talk to a service over HTTP within bounds of size, time and retries; classify failures, never write its key."""

from __future__ import annotations

import asyncio
import email.utils
import importlib
import json
import os
import re
import threading
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar
from urllib.parse import urlsplit

from tenacity import RetryCallState, Retrying, retry_if_exception, stop_after_attempt

from aerialdojo_gen.base.errors import (
    AerialDojoError,
    AgentUnavailable,
    MissingPackage,
    ServiceDown,
    UsageError,
    no_package,
)
from aerialdojo_gen.base.secrets import Secrets

# A service may say when to come back; beyond this the runner's own schedule is the better one.
MAX_WAIT_S = 60.0
# Longest wait for a connection: a service that listens accepts one long before it has an answer.
_CONNECT_S = 10.0

_CLIENTS = {"openai": "OpenAI", "anthropic": "Anthropic"}
# By name, for the packages bring one of two generations of httpx with them.
_NO_ROUTE = ("ConnectError", "ConnectTimeout", "ProxyError", "UnsupportedProtocol", "InvalidURL")

Result = TypeVar("Result")


def check_url(url: str) -> None:
    """Refuse a URL that no service has, or that holds a key."""
    try:
        parts = urlsplit(url)
        wrong = parts.scheme not in ("http", "https") or not parts.hostname or parts.port == 0
    except ValueError:
        wrong = True
    if wrong:
        raise ValueError("not a URL like http://127.0.0.1:8000/v1")
    # Options are written to the log of the run. Not a ValueError: its message would quote the URL.
    if parts.username or parts.password or parts.query:
        raise UsageError("base_url holds a name, a password or a query: keys come from the environment only")


def api_key(variable: str, base_url: str | None) -> str:
    """Read a key from the environment; a service of one's own may do without."""
    key = os.environ.get(variable, "").strip()
    if not key and base_url is None:
        raise UsageError(f"no API key: set {variable} in the environment (or base_url, for a service without keys)")
    if not (key.isascii() and key.isprintable()):
        raise UsageError(f"{variable} has characters that no key has: copy it again")
    return key or "none"


class Connection:
    """A client of a service, with its key."""

    def __init__(
        self,
        package: str,
        base_url: str | None,
        timeout_s: float,
        retries: int,
        *,
        secrets: Secrets | None = None,
        key_variable: str | None = None,
        model: str = "",
        pace: Callable[[], object] = lambda: None,
    ) -> None:
        try:
            self._package = importlib.import_module(package)
        except ImportError:
            raise MissingPackage(no_package(f"agent {package!r}", package, "llm")) from None
        variable = f"{package.upper()}_BASE_URL"
        self.base_url = base_url or os.environ.get(variable) or None
        if self.base_url:
            try:
                check_url(self.base_url)
            except ValueError as error:
                raise UsageError(f"{'base_url' if base_url else variable} is {error}") from None
        self._key = api_key(key_variable or f"{package.upper()}_API_KEY", self.base_url if not key_variable else None)
        self._secrets = secrets or Secrets()
        self._timeout_s, self._retries, self._model = timeout_s, retries, model
        self._pace = pace  # Called before each request; waits until one may be sent
        self.name = self.base_url or _CLIENTS[package]
        self.meter = Meter()
        # Less than the deadline, so that an address where nobody listens is not taken for a slow answer.
        timeout = self._package.Timeout(None, connect=min(timeout_s / 2, _CONNECT_S))
        self.client = getattr(self._package, f"Async{_CLIENTS[package]}")(
            api_key=self._key,
            base_url=self.base_url,
            max_retries=0,
            timeout=timeout,
            http_client=bounded_client(self._package.DefaultAsyncHttpxClient, timeout),
        )
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=_run, args=(self._loop,), name=f"requests to {package}", daemon=True).start()

    def call(self, ask: Callable[[Any], Awaitable[Result]], retries: int | None = None) -> Result:
        """Send a request; send it again where that may help."""
        retrying = Retrying(
            stop=stop_after_attempt(1 + (self._retries if retries is None else retries)),
            wait=_wait_s,
            retry=retry_if_exception(_is_retryable),
            sleep=lambda seconds: time.sleep(seconds),
            reraise=True,
        )
        return retrying(self._once, ask)

    def _once(self, ask: Callable[[Any], Awaitable[Result]]) -> Result:
        self._pace()
        began = time.monotonic()
        future = asyncio.run_coroutine_threadsafe(self._within_deadline(ask), self._loop)
        try:
            return future.result()
        except self._package.APIError as error:
            failure = self._failure(error)
        except TimeoutError:
            message = f"{self.name}: no complete answer within {self._timeout_s:g} s"
            failure = AgentUnavailable(message, kind="time-out")
        except BodyBoundError as error:
            # One of the packages wraps what its client raises, the other lets it through.
            failure = self.unusable(self.clean(str(error)))
        finally:
            # Ctrl-C leaves the request unfinished.
            future.cancel()
            self.meter.add(time.monotonic() - began)
        raise failure from None

    async def _within_deadline(self, ask: Callable[[Any], Awaitable[Result]]) -> Result:
        async with asyncio.timeout(self._timeout_s):
            return await ask(self.client)

    def not_understood(self, what: str) -> AgentUnavailable:
        """Make the error for an answer that is not what the protocol says."""
        return self.unusable(f"its answer is no {what}: is base_url right?")

    def unusable(self, why: str, kind: str = "malformed answer") -> AgentUnavailable:
        """Make the error for an answer that would be the same if it was asked for again."""
        return AgentUnavailable(f"{self.name}: {why}", kind=kind, again=False)

    def clean(self, text: str) -> str:
        """Return a text without keys, should the service have sent one back, and without lone surrogates."""
        # No file and no request can hold half of a surrogate pair.
        text = text.encode("utf-8", "replace").decode("utf-8")
        text = text.replace(self._key, "[key]") if len(self._key) > 4 else text
        return self._secrets.text(text)

    def close(self) -> None:
        """Close the connections."""
        if self._loop.is_running():
            closing = asyncio.run_coroutine_threadsafe(self.client.close(), self._loop)
            closing.add_done_callback(lambda _: self._loop.stop())

    def _failure(self, error: Any) -> AerialDojoError:
        if isinstance(error, self._package.APIStatusError):
            return self._refusal(error)
        cause = error.__cause__ or error
        if isinstance(cause, BodyBoundError):
            return self.unusable(self.clean(str(cause)))
        message = self._line(str(cause) or type(cause).__name__)
        if type(cause).__name__ in _NO_ROUTE:
            message = _system_error(cause) or message
            return ServiceDown(f"{self.name}: {message}: is the service there, and is base_url right?")
        return AgentUnavailable(f"{self.name}: {message}", kind="connection lost")

    def _refusal(self, error: Any) -> AerialDojoError:
        """Make the error for an HTTP status that is none of success."""
        status, body = error.status_code, getattr(error, "body", None)
        text = self._line(body or error.message)
        message = f"{self.name}: HTTP {status}: {text}"
        words = f"{_codes(body)} {text}".lower()
        after_s = retry_after_s(error.response.headers)
        # No key, money or permission, or a redirect: the key must not go elsewhere.
        if status in (401, 402, 403, 407) or 300 <= status < 400 or _ALL_REQUESTS.search(words):
            return UsageError(message)
        if status in _RETRYABLE or status >= 500:
            return AgentUnavailable(message, after_s, kind=_RETRYABLE.get(status, "server error"))
        # A 404 may be the model's or the address's, or that of something in the request.
        named = self._model and re.search(rf"(?<!\w){re.escape(self._model.lower())}(?!\w)", words)
        if status == 404 and (named or "model_not_found" in words or not _PICTURE_WORDS.search(words)):
            return UsageError(message)
        if _FILTERED.search(words):
            kind = "content filter"
        elif status == 413 or _TOO_LONG.search(words):
            kind = "context too long"
        else:
            kind = "not found" if status == 404 else "bad request"
        return AgentUnavailable(message, after_s, kind=kind, again=False)

    def _line(self, value: Any) -> str:
        if isinstance(value, dict):
            inner = value.get("error", value)
            value = inner.get("message", inner) if isinstance(inner, dict) else inner
        # The key goes before the text is cut: half a key is too much as well.
        lines = self.clean(str(value)).strip().splitlines()
        return " ".join((lines[0] if lines else "").split())[:300]


def _system_error(error: BaseException | None) -> str | None:
    """Find the system's error under the HTTP client's, which says "All connection attempts failed" alone."""
    while error is not None:
        if isinstance(error, OSError) and error.errno and error.errno > 0:
            return f"[Errno {error.errno}] {os.strerror(error.errno)}"
        several = error.exceptions if isinstance(error, BaseExceptionGroup) else (None,)
        error = several[0] or error.__cause__ or error.__context__
    return None


def _run(loop: asyncio.AbstractEventLoop) -> None:
    loop.run_forever()
    loop.close()


def _is_retryable(error: BaseException) -> bool:
    if isinstance(error, AgentUnavailable):
        # An answer cut on its way may come whole the next time; a refusal is one for good.
        worth = error.again or error.kind == "malformed answer"
        return worth and (error.retry_after_s or 0.0) <= MAX_WAIT_S
    return isinstance(error, ServiceDown)


def _wait_s(state: RetryCallState) -> float:
    error = state.outcome.exception() if state.outcome is not None else None
    retry_after = error.retry_after_s if isinstance(error, AgentUnavailable) else None
    return retry_after if retry_after is not None else min(2.0 ** (state.attempt_number - 1), MAX_WAIT_S)


MAX_BODY_BYTES = 4 << 20


class BodyBoundError(Exception):
    """A service sent more than it may, or something that is no JSON."""


@dataclass
class Meter:
    """Counts requests, and the time that they take."""

    requests: int = 0  # Sent, repeated ones too
    seconds: float = 0.0  # From sending a request to having its answer whole: of all together, and of the longest
    longest_s: float = 0.0

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
# No money, or a wrong or missing key: no other request will fare better.
_ALL_REQUESTS = re.compile(
    "insufficient_quota|billing_|credit balance|insufficient credits|insufficient balance|"
    "api key not valid|api_key_invalid|invalid api key|incorrect api key"
)
_FILTERED = re.compile("content_filter|content filter|content_policy|content policy|responsibleai|safety")
_TOO_LONG = re.compile(
    "context_length|context length|context window|maximum context|prompt is too long|too many tokens|max_model_len|"
    "input is too long"
)
_PICTURE_WORDS = re.compile("image|picture|media|file")


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
