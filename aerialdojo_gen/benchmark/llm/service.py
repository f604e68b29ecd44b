"""Talk to a service over HTTP within bounds of size, time and retries; tell its failures apart, and never its key."""

from __future__ import annotations

import email.utils
import importlib
import json
import os
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from aerialdojo_gen.benchmark.agents.base import AgentUnavailable
from aerialdojo_gen.errors import AerialDojoError, UsageError

MAX_BODY_BYTES = 4 << 20
# A service may say when to come back; beyond this the runner's own schedule is the better one.
MAX_WAIT_S = 60.0
_WORTH_ANOTHER_TRY = (408, 409, 425, 429)

_CLIENTS = {"openai": "OpenAI", "anthropic": "Anthropic"}

Result = TypeVar("Result")


class BodyBoundError(Exception):
    """A service sent more, or took longer, than it may."""


def bounded_client(base: Any, timeout_s: float) -> Any:
    """Make an HTTP client whose responses are bounded.

    The client packages read a body whole, an error's too, however long it is; and their time-out is one a read, which
    a server that drips never exceeds. Redirects are not followed: they would carry the key elsewhere.

    Parameters
    ----------
    base : type
        The package's own ``DefaultHttpxClient``.
    timeout_s : float
        For connecting, for a read, and for a whole response.

    Returns
    -------
    object
        An instance of a subclass of `base`.
    """

    class BoundedClient(base):  # type: ignore[misc]  # a class that is known at run time alone
        def send(self, request: Any, *, stream: bool = False, **options: Any) -> Any:
            deadline = time.monotonic() + timeout_s
            response = super().send(request, stream=True, **options)
            body = bytearray()
            try:
                for chunk in response.iter_bytes():
                    body += chunk
                    if len(body) > MAX_BODY_BYTES:
                        raise BodyBoundError(f"its answer is larger than {MAX_BODY_BYTES >> 20} MiB")
                    if time.monotonic() > deadline:
                        raise BodyBoundError(f"its answer is not complete after {timeout_s:g} s")
            finally:
                response.close()
            framing = ("content-encoding", "content-length", "transfer-encoding")
            headers = [(k, v) for k, v in response.headers.items() if k.lower() not in framing]
            return type(response)(response.status_code, headers=headers, content=bytes(body), request=request)

    return BoundedClient(timeout=timeout_s, follow_redirects=False)


def api_key(variable: str, base_url: str | None) -> str:
    """Read a key from the environment; a service of one's own may do without.

    Raises
    ------
    UsageError
        There is none and the service is the provider's own, or it has characters that no header may have.
    """
    key = os.environ.get(variable, "").strip()
    if not key and base_url is None:
        raise UsageError(f"no API key: set {variable} in the environment (or base_url, for a service without keys)")
    if not (key.isascii() and key.isprintable()):
        raise UsageError(f"{variable} has characters that no key has: copy it again")
    return key or "none"


class Connection:
    """A client of a service, with its key.

    Parameters
    ----------
    package : str
        ``openai`` or ``anthropic``.
    base_url : str or None
        Where the service is; ``OPENAI_BASE_URL`` or ``ANTHROPIC_BASE_URL`` where absent, else the provider's own.
    timeout_s : float
        Longest wait for an answer.
    retries : int
        How often a failed request is sent again before the episode is given up.

    Attributes
    ----------
    client : object
        The package's client; its own retries are off, so that there is one place that tries again.
    base_url : str or None
        As found.
    name : str
        For messages.

    Raises
    ------
    UsageError
        The package is not installed, or there is no key.
    """

    def __init__(self, package: str, base_url: str | None, timeout_s: float, retries: int) -> None:
        try:
            self._package = importlib.import_module(package)
        except ImportError:
            extra = "pip install 'aerialdojo-gen[llm]'"
            raise UsageError(f"the {package} agent needs the package {package}: {extra}") from None
        self.base_url = base_url or os.environ.get(f"{package.upper()}_BASE_URL") or None
        self._key = api_key(f"{package.upper()}_API_KEY", self.base_url)
        self._timeout_s, self._retries = timeout_s, retries
        self.name = self.base_url or _CLIENTS[package]
        self.client = getattr(self._package, _CLIENTS[package])(
            api_key=self._key,
            base_url=self.base_url,
            max_retries=0,
            timeout=timeout_s,
            http_client=bounded_client(self._package.DefaultHttpxClient, timeout_s),
        )

    def call(self, ask: Callable[[Any], Result]) -> Result:
        """Send a request; send it again where that may help.

        Parameters
        ----------
        ask : callable
            Takes the client, returns what the package makes of the answer.

        Returns
        -------
        object
            What `ask` returns.

        Raises
        ------
        AgentUnavailable
            Time-out, 408, 409, 425, 429, 5xx, a lost connection, or an answer too large or of another protocol.
        UsageError
            The service refuses the request for good: a wrong key, no such model, an option it does not know.
        """
        for attempt in range(self._retries + 1):
            try:
                return ask(self.client)
            except self._package.APIError as error:
                failure = self._failure(error)
            except BodyBoundError as error:
                # One of the packages wraps what its client raises, the other lets it through.
                failure = AgentUnavailable(f"{self.name}: {error}")
            except json.JSONDecodeError:
                failure = self.not_understood("JSON")
            if not isinstance(failure, AgentUnavailable):
                raise failure from None
            wait_s = failure.retry_after_s if failure.retry_after_s is not None else 2.0**attempt
            if attempt == self._retries or wait_s > MAX_WAIT_S:
                raise failure from None
            time.sleep(wait_s)
        raise AssertionError("the last attempt either returns or raises")

    def not_understood(self, what: str) -> AgentUnavailable:
        """Make the error for an answer that is not what the protocol says."""
        return AgentUnavailable(f"{self.name}: its answer is no {what}: is base_url right?")

    def without_key(self, text: str) -> str:
        """Return a text without the key, should the service have sent it back."""
        return text.replace(self._key, "[key]") if len(self._key) > 4 else text

    def close(self) -> None:
        """Close the connections."""
        self.client.close()

    def _failure(self, error: Any) -> AerialDojoError:
        if isinstance(error, self._package.APIStatusError):
            said = self._line(getattr(error, "body", None) or error.message)
            message = f"{self.name}: HTTP {error.status_code}: {said}"
            if error.status_code in _WORTH_ANOTHER_TRY or error.status_code >= 500:
                return AgentUnavailable(message, retry_after_s(error.response.headers))
            return UsageError(message)
        if isinstance(error, self._package.APITimeoutError):
            return AgentUnavailable(f"{self.name}: no answer within {self._timeout_s:g} s")
        cause = error.__cause__ or error
        return AgentUnavailable(f"{self.name}: {self._line(str(cause) or type(cause).__name__)}")

    def _line(self, value: Any) -> str:
        if isinstance(value, dict):
            inner = value.get("error", value)
            value = inner.get("message", inner) if isinstance(inner, dict) else inner
        # The key goes before the text is cut: half a key is too much as well.
        return " ".join(self.without_key(str(value)).split())[:300]


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
