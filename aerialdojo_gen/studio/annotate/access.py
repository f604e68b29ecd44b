"""Who may reach the tool from other machines: those that have the token, which the command prints."""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import time
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from aerialdojo_gen.studio.web.serving import Asgi, Message, Receive, Send

COOKIE = "aerialdojo-annotate"
# Wrong tokens per address: this many at once, then one per interval.
MOST_GUESSES, SECONDS_A_GUESS = 10, 6.0
_MOST_ADDRESSES = 4096


class TokenGate:
    """ASGI middleware: rejects requests without the token.

    The printed address contains the token; the response stores it in an HttpOnly, SameSite cookie and redirects to
    the address without it. Requests whose ``Origin`` does not match their ``Host`` are rejected. An address that sent
    `MOST_GUESSES` wrong tokens is blocked for a while, unless it has logged in before: a neighbour behind the same
    router must not lock it out.
    """

    def __init__(self, app: Asgi, token: str) -> None:
        self._app, self._token = app, token
        self._guesses: OrderedDict[str, _Guesses] = OrderedDict()
        self._known: set[str] = set()

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer 401, 403, 429 or 303 itself, or hand the request on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        address = (scope.get("client") or ("", 0))[0]
        guesses = self._guesses.get(address)
        wait = 0.0 if guesses is None else guesses.wait(time.monotonic())
        if wait > 0.0 and address not in self._known:
            after = [(b"retry-after", str(int(wait) + 1).encode())]
            await _respond(send, 429, f"too many wrong tokens: try again in {int(wait) + 1} seconds", after)
            return
        token = cookie = ""
        with contextlib.suppress(ValueError):
            query = parse_qs(scope.get("query_string", b"").decode("latin-1"), max_num_fields=8)
            token = query.get("token", [""])[0]
        with contextlib.suppress(CookieError):
            morsel = SimpleCookie(headers.get(b"cookie", "")).get(COOKIE)
            cookie = morsel.value if morsel else ""
        if scope["path"] == "/" and self._is_token(token):
            self._known.add(address)
            kept = f"{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
            await _respond(send, 303, "", [(b"location", b"/"), (b"set-cookie", kept.encode())])
            return
        if not self._is_token(cookie):
            for given in filter(None, (token, cookie)):
                self._record_guess(address, given)
            await _respond(send, 401, "open the address that the command printed; it contains the token")
            return
        origin = headers.get(b"origin")
        if origin is not None and origin != f"http://{headers.get(b'host', '')}":
            await _respond(send, 403, "requests from other sites are not allowed")
            return
        await self._app(scope, receive, send)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "replace"), self._token.encode())

    def _record_guess(self, address: str, given: str) -> None:
        guesses = self._guesses.pop(address, None) or _Guesses()
        guesses.add(given, time.monotonic())
        self._guesses[address] = guesses
        while len(self._guesses) > _MOST_ADDRESSES:
            self._guesses.popitem(last=False)


@dataclass
class _Guesses:
    """An address's wrong tokens: a bucket that drains one every `SECONDS_A_GUESS`."""

    level: float = 0.0
    since: float = 0.0
    # A tab from before a restart keeps sending its old token: that is no guess.
    seen: set[str] = field(default_factory=set)

    def wait(self, now: float) -> float:
        return (self.level - MOST_GUESSES + 1) * SECONDS_A_GUESS - (now - self.since)

    def add(self, given: str, now: float) -> None:
        digest = hashlib.sha256(given.encode("utf-8", "replace")).hexdigest()
        left = max(0.0, self.level - (now - self.since) / SECONDS_A_GUESS)
        self.seen = self.seen if left > 0.0 else set()
        self.level, self.since = left + (digest not in self.seen), now
        self.seen.add(digest)


async def _respond(send: Send, status: int, text: str, headers: Sequence[tuple[bytes, bytes]] = ()) -> None:
    plain = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": status, "headers": [plain, *headers]})
    await send({"type": "http.response.body", "body": text.encode()})
