"""Local web pages: an app that only this machine's browser can use, and the loop that serves it.

Pages of other sites are rejected by ``Origin`` and ``Host`` (DNS rebinding), and a page may load nothing but what the
app serves (``Content-Security-Policy``).
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import logging
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
    from fastapi import FastAPI, Request
    from starlette.middleware.base import RequestResponseEndpoint

STATIC = Path(__file__).resolve().parent / "static"
_LOCAL = ("127.0.0.1", "localhost")
_IMPORT_MAP = re.compile(rb'<script type="importmap">(.*?)</script>', re.DOTALL)


# What every answer says; the policy is the page's.
_HEADERS = {
    "x-content-type-options": "nosniff", "referrer-policy": "no-referrer", "cache-control": "no-cache",
    "cross-origin-resource-policy": "same-origin", "cross-origin-opener-policy": "same-origin",
}  # fmt: skip


def _refusal(request: Request, max_body_bytes: int, any_host: bool) -> tuple[str, int] | None:
    """Say why a request of a foreign host or origin, or with a large body, is refused, and by which status."""
    headers, port = request.headers, request.scope["server"][1]
    hosts = {f"{name}:{port}" for name in _LOCAL} | (set(_LOCAL) if port == 80 else set())
    asked_for = [host.lower() for host in headers.getlist("host")]
    if any_host:
        hosts |= set(asked_for)
    if len(asked_for) != 1 or asked_for[0] not in hosts:
        return "only 127.0.0.1 and localhost are allowed", 403
    foreign = any(origin.lower() not in {f"http://{host}" for host in hosts} for origin in headers.getlist("origin"))
    if foreign or headers.get("sec-fetch-site", "none") in ("cross-site", "same-site"):
        return "requests from other sites are not allowed", 403
    if "transfer-encoding" in headers:
        return "send a Content-Length", 411
    length = headers.get("content-length", "0")
    if not (length.isascii() and length.isdigit()) or len(length) > 18 or int(length) > max_body_bytes:
        return f"at most {max_body_bytes} bytes", 413
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
    from fastapi import FastAPI
    from fastapi.exceptions import RequestValidationError
    from fastapi.responses import JSONResponse, PlainTextResponse, Response
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

    @app.middleware("http")
    async def local_only(request: Request, call_next: RequestResponseEndpoint) -> Response:
        refusal = _refusal(request, max_body_bytes, any_host)
        answer = await call_next(request) if refusal is None else PlainTextResponse(*refusal)
        answer.headers.update(_HEADERS | {"content-security-policy": policy})
        return answer

    @app.get("/", include_in_schema=False, response_model=None)
    def index() -> Response:
        return Response(html, media_type="text/html")

    @app.get("/favicon.ico", include_in_schema=False, response_model=None)
    def favicon() -> Response:
        return Response(status_code=204)

    @app.exception_handler(AerialDojoError)
    @app.exception_handler(RequestValidationError)
    @app.exception_handler(HTTPException)
    def refused(_: Request, error: Exception) -> JSONResponse:
        message, status = str(error), 404 if isinstance(error, UsageError) else 400
        if isinstance(error, RequestValidationError):
            first = error.errors()[0]
            message, status = f"malformed request: {'.'.join(map(str, first['loc']))}: {first['msg']}", 422
        elif isinstance(error, HTTPException):
            message, status = error.detail, error.status_code
        return JSONResponse({"error": one_line(message)}, status)

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

    from aerialdojo_gen.studio.web.limits import BoundedLog, LimitedProtocol

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
    for name in ("uvicorn.error", "asyncio"):
        logging.getLogger(name).addFilter(BoundedLog())
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
