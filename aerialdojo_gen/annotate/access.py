"""Who may reach the tool from other machines: those that have the token, which the command prints."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

COOKIE = "aerialdojo-annotate"

_Message = MutableMapping[str, Any]
_Asgi = Callable[
    [_Message, Callable[[], Awaitable[_Message]], Callable[[_Message], Awaitable[None]]], Awaitable[None]
]


class TokenGate:
    """ASGI middleware: lets nothing through without the token.

    The address that the command prints carries it; the answer moves it into a cookie that no script and no other
    site sees, and leads to the address without it. A request whose ``Origin`` is not the ``Host`` that it is sent to
    is refused: the page's own scripts always have both alike.

    Parameters
    ----------
    app : ASGI application
    token : str
    """

    def __init__(self, app: _Asgi, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(
        self, scope: _Message, receive: Callable[[], Awaitable[_Message]], send: Callable[[_Message], Awaitable[None]]
    ) -> None:
        """Answer 401, 403 or 303 itself, or hand the request on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        if scope["path"] == "/" and self._right(query.get("token", [""])[0]):
            cookie = f"{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
            await _answer(send, 303, "", [(b"location", b"/"), (b"set-cookie", cookie.encode())])
            return
        if not self._right(_cookie(headers.get(b"cookie", ""))):
            await _answer(send, 401, "open the address that the command printed: it carries the token")
            return
        origin = headers.get(b"origin")
        if origin is not None and origin != f"http://{headers.get(b'host', '')}":
            await _answer(send, 403, "this page takes no requests from other sites")
            return
        await self._app(scope, receive, send)

    def _right(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "replace"), self._token.encode())


def _cookie(header: str) -> str:
    try:
        morsel = SimpleCookie(header).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


async def _answer(
    send: Callable[[_Message], Awaitable[None]],
    status: int,
    text: str,
    headers: list[tuple[bytes, bytes]] | None = None,
) -> None:
    plain = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": status, "headers": [plain, *(headers or [])]})
    await send({"type": "http.response.body", "body": text.encode()})
