"""Local web pages: an app that only this machine's browser can use, and the loop that serves it.

Pages of other sites are rejected by ``Origin`` and ``Host`` (DNS rebinding), and a page may load nothing but what the
app serves (``Content-Security-Policy``).
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import re
import signal
import socket
import threading
import webbrowser
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError, no_package

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

STATIC = Path(__file__).resolve().parent / "static"
_LOCAL = ("127.0.0.1", "localhost")
_IMPORT_MAP = re.compile(rb'<script type="importmap">(.*?)</script>', re.DOTALL)


class _LocalOnly:
    """ASGI middleware: rejects foreign hosts, origins and large bodies, and sets security headers."""

    def __init__(self, app: ASGIApp, policy: str, max_body_bytes: int, any_host: bool = False) -> None:
        self._app, self._max_body_bytes, self._any_host = app, max_body_bytes, any_host
        self._headers = [
            (b"content-security-policy", policy.encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
            (b"cross-origin-resource-policy", b"same-origin"),
            (b"cross-origin-opener-policy", b"same-origin"),
            (b"cache-control", b"no-cache"),
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *self._headers]
            await send(message)

        if refusal is None:
            await self._app(scope, receive, send_with_headers)
            return
        status, why = refusal
        await send_with_headers(
            {"type": "http.response.start", "status": status, "headers": [(b"content-type", b"text/plain")]}
        )
        await send({"type": "http.response.body", "body": why.encode()})

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        if scope["type"] != "http":
            return 400, "plain HTTP only"
        headers: dict[bytes, list[bytes]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.lower(), []).append(value)
        port = scope["server"][1]
        hosts = {f"{name}:{port}".encode() for name in _LOCAL}
        if port == 80:
            hosts |= {name.encode() for name in _LOCAL}
        found = headers.get(b"host", [])
        if self._any_host:
            hosts |= {host.lower() for host in found}
        if len(found) != 1 or found[0].lower() not in hosts:
            return 403, "only 127.0.0.1 and localhost are allowed"
        if any(origin.lower() not in {b"http://" + host for host in hosts} for origin in headers.get(b"origin", [])):
            return 403, "requests from other sites are not allowed"
        if headers.get(b"sec-fetch-site", [b"none"])[0] in (b"cross-site", b"same-site"):
            return 403, "requests from other sites are not allowed"
        if b"transfer-encoding" in headers:
            return 411, "send a Content-Length"
        length = headers.get(b"content-length", [b"0"])[0]
        if not length.isdigit() or len(length) > 18 or int(length) > self._max_body_bytes:
            return 413, f"at most {self._max_body_bytes} bytes"
        return None


def require_web() -> None:
    """Raise `MissingPackage` if the web packages are missing."""
    try:
        import fastapi  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise MissingPackage(no_package("the page", error.name, "web")) from None


def one_line(text: str) -> str:
    """Make a printable single line of a text that may come from a client."""
    shown = "".join(c if c.isprintable() else f"\\u{ord(c):04x}" if c not in "\t\n\r" else " " for c in text)
    return shown if len(shown) <= 500 else f"{shown[:496]} ..."


def local_app(
    page: str, title: str, max_body_bytes: int = 1 << 20, *, any_host: bool = False, also: Sequence[str] = ()
) -> FastAPI:
    """Make an app that serves a page of ``static/`` at ``/``, and that folder under ``/static/``."""
    require_web()
    from fastapi import FastAPI, Request
    from fastapi.exceptions import RequestValidationError
    from fastapi.responses import JSONResponse, Response
    from fastapi.staticfiles import StaticFiles
    from starlette.exceptions import HTTPException

    html = (STATIC / page).read_bytes()
    texts = b"".join([html, *((STATIC / name).read_bytes() for name in also)])
    maps = [base64.b64encode(hashlib.sha256(text).digest()).decode() for text in _IMPORT_MAP.findall(texts)]
    scripts = " ".join(["'self'", *(f"'sha256-{digest}'" for digest in maps)])
    policy = (
        f"default-src 'none'; script-src {scripts}; style-src 'self'; img-src 'self' data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    app = FastAPI(title=title, docs_url=None, redoc_url=None, openapi_url=None)
    app.add_middleware(_LocalOnly, policy=policy, max_body_bytes=max_body_bytes, any_host=any_host)

    @app.get("/", include_in_schema=False, response_model=None)
    def index() -> Response:
        return Response(html, media_type="text/html")

    @app.get("/favicon.ico", include_in_schema=False, response_model=None)
    def favicon() -> Response:
        return Response(status_code=204)

    @app.exception_handler(AerialDojoError)
    def expected(_: Request, error: Exception) -> JSONResponse:
        return error_response(error, 404 if isinstance(error, UsageError) else 400)

    @app.exception_handler(RequestValidationError)
    def malformed(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, RequestValidationError)
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        return error_response(f"malformed request: {where}: {first['msg']}", 422)

    @app.exception_handler(HTTPException)
    def refused(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, HTTPException)
        return error_response(error.detail, error.status_code)

    def error_response(what: object, status: int) -> JSONResponse:
        return JSONResponse({"error": one_line(str(what))}, status_code=status)

    app.mount("/static", StaticFiles(directory=STATIC, follow_symlink=False), name="static")
    return app


def open_socket(port: int, host: str = "127.0.0.1") -> socket.socket:
    """Listen on loopback or another IPv4 address; port 0 chooses a free one."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(64)
    except (OSError, OverflowError) as error:
        listener.close()
        why = getattr(error, "strerror", None) or str(error)
        at = "" if host == "127.0.0.1" else f"{host}, "
        raise UsageError(f"{at}port {port}: {why}; leave --port out for a free one") from None
    return listener


def serve(app: FastAPI, listener: socket.socket, browser: bool = False, path: str = "") -> None:
    """Serve until Ctrl-C."""
    import uvicorn

    from aerialdojo_gen.studio.web.limits import LimitedProtocol, bound_log

    class Server(uvicorn.Server):
        @contextlib.contextmanager
        def capture_signals(self) -> Iterator[None]:
            """Keep SIGINT ignored if it was, as in a script's background job."""
            ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            with super().capture_signals():
                if ignored:
                    signal.signal(signal.SIGINT, signal.SIG_IGN)
                yield

    url = url_of(listener) + path
    config = uvicorn.Config(
        app, log_level="warning", access_log=False, lifespan="off", timeout_graceful_shutdown=1, proxy_headers=False,
        server_header=False, use_colors=False, http=LimitedProtocol, ws="none", backlog=128, timeout_keep_alive=5,
    )  # fmt: skip
    # uvicorn's limit_concurrency is not set: it counts all connections, and half requests would lock out all others.
    server = Server(config)
    bound_log()
    if browser:
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
    try:
        server.run(sockets=[listener])
    except KeyboardInterrupt:
        pass  # uvicorn has shut down and re-raises the signal
    finally:
        listener.close()


def url_of(listener: socket.socket) -> str:
    """Return the page's address, e.g. ``http://127.0.0.1:8765/``."""
    host, port = listener.getsockname()
    return f"http://{host}:{port}/"
