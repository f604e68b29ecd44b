"""The annotation tool's web server: HTTP routes that call an `AnnotationSession`."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import math
import secrets
import socket
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from fastapi import Depends, FastAPI, Header, Query, Request
from fastapi.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from fastapi.staticfiles import StaticFiles
from pydantic import Field, StrictFloat, StrictStr, field_validator
from starlette.middleware.base import BaseHTTPMiddleware, RequestResponseEndpoint
from starlette.types import ASGIApp

from aerialdojo_gen.annotations.format import Strict
from aerialdojo_gen.base.errors import AerialDojoError, AnnotationError, StoreError, UsageError
from aerialdojo_gen.studio.annotate.coco import coco_zip
from aerialdojo_gen.studio.annotate.document import ConflictError, Operation
from aerialdojo_gen.studio.annotate.session import AnnotationSession
from aerialdojo_gen.studio.annotate.storage import Author, StaleError
from aerialdojo_gen.studio.web.serving import local_app, one_line, open_socket, serve, url_of

COOKIE = "aerialdojo-annotate"
# Wrong tokens per address: this many at once, then one per interval.
MAX_FAILED_LOGINS, SECONDS_PER_FAILED_LOGIN = 10, 6.0
_MAX_ADDRESSES = 4096


class TokenGate(BaseHTTPMiddleware):
    """Middleware: rejects requests without the token.

    The printed address contains the token; the response stores it in an HttpOnly, SameSite cookie and redirects to
    the address without it. Requests whose ``Origin`` does not match their ``Host`` are rejected. An address that sent
    `MAX_FAILED_LOGINS` wrong tokens is blocked for a while, unless it has logged in before: a neighbour behind the
    same router must not lock it out.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        super().__init__(app)
        self._token = token
        self._failed_logins: OrderedDict[str, _FailedLogins] = OrderedDict()
        self._known: set[str] = set()

    async def dispatch(self, request: Request, call_next: RequestResponseEndpoint) -> Response:
        """Answer 401, 403, 429 or 303 itself, or hand the request on."""
        address = request.client.host if request.client else ""
        failed = self._failed_logins.get(address)
        wait = 0.0 if failed is None else failed.wait(time.monotonic())
        token, cookie = request.query_params.get("token", ""), request.cookies.get(COOKIE, "")
        if wait > 0.0 and address not in self._known:
            seconds = int(wait) + 1
            after = {"retry-after": str(seconds)}
            return PlainTextResponse(f"too many wrong tokens: try again in {seconds} seconds", 429, after)
        if request.scope["path"] == "/" and self._is_token(token):
            self._known.add(address)
            kept = f"{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
            return RedirectResponse("/", 303, {"set-cookie": kept})
        if not self._is_token(cookie):
            for secret in filter(None, (token, cookie)):
                self._record_failed_login(address, secret)
            return PlainTextResponse("open the address that the command printed; it contains the token", 401)
        if request.headers.get("origin") not in (None, f"http://{request.headers.get('host', '')}"):
            return PlainTextResponse("requests from other sites are not allowed", 403)
        return await call_next(request)

    def _is_token(self, secret: str) -> bool:
        return hmac.compare_digest(secret.encode("utf-8", "replace"), self._token.encode())

    def _record_failed_login(self, address: str, secret: str) -> None:
        failed = self._failed_logins.pop(address, None) or _FailedLogins()
        failed.add(secret, time.monotonic())
        self._failed_logins[address] = failed
        while len(self._failed_logins) > _MAX_ADDRESSES:
            self._failed_logins.popitem(last=False)


@dataclass
class _FailedLogins:
    """An address's wrong tokens: a bucket that drains one every `SECONDS_PER_FAILED_LOGIN`."""

    level: float = 0.0
    since: float = 0.0
    # A tab from before a restart keeps sending its old token: that is no guess.
    digests: set[str] = field(default_factory=set)

    def wait(self, now: float) -> float:
        return (self.level - MAX_FAILED_LOGINS + 1) * SECONDS_PER_FAILED_LOGIN - (now - self.since)

    def add(self, secret: str, now: float) -> None:
        digest = hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()
        left = max(0.0, self.level - (now - self.since) / SECONDS_PER_FAILED_LOGIN)
        self.digests = self.digests if left > 0.0 else set()
        self.level, self.since = left + (digest not in self.digests), now
        self.digests.add(digest)


STATIC = Path(__file__).resolve().parent / "static"
MAX_BYTES = 8 << 20

_Metres = Annotated[StrictFloat, Field(allow_inf_nan=False, ge=-1e5, le=1e5)]
_Triple = tuple[_Metres, _Metres, _Metres]
_Object = Annotated[int, Field(ge=0, le=2**31 - 1)]


def _version(header: str | None) -> str:
    return (header or "").removeprefix("W/").strip('"')


def _sent_version(if_match: Annotated[str | None, Header(max_length=80)] = None) -> str:
    if not if_match:
        raise AerialDojoError("the If-Match header with the version is missing")
    return _version(if_match)


_Version = Annotated[str, Depends(_sent_version)]


class AuthoredRequest(Strict):
    """A request for a change, with its author."""

    who: Annotated[StrictStr, Field(max_length=80)] = ""
    client: Annotated[StrictStr, Field(max_length=40, pattern=r"^[A-Za-z0-9-]*$")] = ""

    @field_validator("who")
    @classmethod
    def _readable(cls, who: str) -> str:
        return " ".join("".join(c if c.isprintable() else " " for c in who).split())

    @property
    def author(self) -> Author:
        """The author of the change."""
        return Author(self.who or "somebody", self.client)


class OperationRequest(AuthoredRequest):
    """An operation."""

    operation: Operation


class ImportRequest(AuthoredRequest):
    """The text of an annotation file."""

    text: StrictStr


class Ray(Strict):
    """A ray into the scene."""

    origin_m: _Triple
    direction: _Triple


class Box(Strict):
    """A box around a thing that has no node in the mesh."""

    low_m: _Triple
    high_m: _Triple
    category: Annotated[StrictStr, Field(min_length=1, max_length=60)]


class Viewpoint(Strict):
    """A viewpoint of an object; without a yaw it faces the object, with `snap` it is moved to the standoff."""

    position_m: _Triple
    yaw_deg: Annotated[StrictFloat, Field(allow_inf_nan=False, ge=-720, le=720)] | None = None
    snap: bool = False


def serve_session(
    session: AnnotationSession, *, port: int, host: str, browser: bool, say: Callable[[str], None]
) -> None:
    """Serve the tool."""
    try:
        loopback = ipaddress.IPv4Address(host) == ipaddress.IPv4Address("127.0.0.1")
    except ValueError:
        raise UsageError(f"--host {host}: give an IPv4 address of this machine, or 0.0.0.0 for all") from None
    listener = open_socket(port, host)
    app = make_app(session, any_host=not loopback)
    try:
        if loopback:
            say(f"annotating {session.scene.name} at {url_of(listener)}   (Ctrl-C stops; changes are saved at once)")
        else:
            token = secrets.token_urlsafe(24)
            app.add_middleware(TokenGate, token=token)
            shown = socket.gethostname() if host == "0.0.0.0" else host  # noqa: S104
            say(f"annotating {session.scene.name} at http://{shown}:{listener.getsockname()[1]}/?token={token}")
            say("anybody with this address can change the annotations; the traffic is not encrypted")
        say(f"annotations: {session.storage.path}")
        serve(app, listener, browser and loopback)
    finally:
        session.anchors.close()


def make_app(session: AnnotationSession, *, any_host: bool = False) -> FastAPI:
    """Make the tool's web application."""
    app = local_app(str(STATIC / "index.html"), f"annotate {session.scene.name}", MAX_BYTES, any_host=any_host)

    @app.exception_handler(ConflictError)
    def conflict(request: Request, error: Exception) -> JSONResponse:
        body: dict[str, Any] = {
            "error": one_line(str(error)),
            "state": session.document(request.query_params.get("client", "")[:40]),
        }
        if isinstance(error, StaleError):
            body["changes"] = session.changes_since(_version(request.headers.get("if-match")))
        return JSONResponse(body, status_code=412 if isinstance(error, StaleError) else 409)

    app.get("/api/facts")(session.facts)
    app.get("/api/history")(session.history)
    _add_document(app, session)
    _add_scene(app, session)
    app.mount("/annotate", StaticFiles(directory=STATIC, follow_symlink=False), name="annotate")
    return app


def _add_document(app: FastAPI, session: AnnotationSession) -> None:
    """Add the routes that read and change the annotations."""

    @app.get("/api/document")
    def document(request: Request, client: Annotated[str, Query(max_length=40)] = "") -> Response:
        if _version(request.headers.get("if-none-match")) == session.storage.load().version:
            return Response(status_code=304)
        return _with_version(session.document(client))

    @app.post("/api/operations")
    def operate(body: OperationRequest, version: _Version) -> Response:
        try:
            return _with_version(session.change(version, body.author, body.operation))
        except (StoreError, AnnotationError) as error:
            # A full disk or a half-written file is not the client's fault: it retries.
            return JSONResponse({"error": one_line(str(error))}, status_code=503)

    @app.post("/api/undo")
    def undo(body: AuthoredRequest, version: _Version) -> Response:
        return _with_version(session.saved(session.storage.undo(version, body.author), body.author))

    @app.post("/api/redo")
    def redo(body: AuthoredRequest, version: _Version) -> Response:
        return _with_version(session.saved(session.storage.redo(version, body.author), body.author))

    @app.post("/api/import")
    def import_file(body: ImportRequest, version: _Version) -> Response:
        content = body.text.encode("utf-8", "replace")
        return _with_version(session.saved(session.storage.replace(version, body.author, content), body.author))

    @app.post("/api/draft")
    def draft(body: OperationRequest) -> dict[str, Any]:
        return session.draft(body.operation)

    @app.get("/api/export")
    def export() -> Response:
        return _download(session.export(), "application/json", session.storage.path.name)

    @app.get("/api/coco")
    def coco() -> Response:
        return _download(coco_zip(session), "application/zip", f"{session.scene.name}-coco.zip")


def _add_scene(app: FastAPI, session: AnnotationSession) -> None:
    """Add the routes of the scene: its mesh, nodes, boxes, viewpoints and pictures."""

    @app.get("/api/scene")
    def scene() -> Response:
        return Response(session.payload, media_type="application/octet-stream")

    @app.post("/api/pick")
    def pick(body: Ray) -> dict[str, Any] | None:
        return session.pick(body.origin_m, body.direction)

    @app.get("/api/nodes/{node}")
    def about(node: str) -> dict[str, Any]:
        return session.about(node) if node in session.scene else {}

    @app.post("/api/boxes")
    def cut(body: Box) -> dict[str, Any]:
        return session.cut(body.low_m, body.high_m, body.category)

    @app.delete("/api/boxes/{node}")
    def uncut(node: str) -> dict[str, Any]:
        session.uncut(node)
        return {}

    @app.get("/api/objects/{object_id}/anchors")
    def anchors(object_id: _Object) -> list[dict[str, Any]]:
        entry = session.object(object_id)
        return [_viewpoint_json(session, entry.node, row, []) for row in session.anchors.candidates(entry)]

    @app.post("/api/objects/{object_id}/viewpoint")
    def viewpoint(object_id: _Object, body: Viewpoint) -> dict[str, Any]:
        entry = session.object(object_id)
        place = np.array(body.position_m)
        if body.snap:
            place = session.anchors.place(entry, place)
        yaw = None if body.yaw_deg is None else math.radians(body.yaw_deg)
        return _viewpoint_json(session, entry.node, *session.anchors.check_viewpoint(entry, place, yaw))

    @app.get("/api/picture")
    def picture(x: float, y: float, z: float, yaw_deg: float) -> Response:
        place, yaw = np.array([x, y, z]), math.radians(yaw_deg)
        if not (math.isfinite(yaw) and _near(session, place)):
            raise AerialDojoError("no picture from outside the scene")
        return Response(session.anchors.view(place, yaw).png, media_type="image/png")


def _viewpoint_json(session: AnnotationSession, node: str, row: dict[str, Any], faults: list[str]) -> dict[str, Any]:
    place = np.array([row["x_m"], row["y_m"], row["z_m"]])
    view = session.anchors.view(place, row["yaw_rad"]) if _near(session, place) else None
    box = view.boxes.get(node) if view else None
    return {
        "position_m": place.round(3).tolist(),
        "yaw_deg": round(math.degrees(row["yaw_rad"]), 2),
        "clearance_m": row["clearance_m"],
        "surface_distance_m": row["surface_distance_m"],
        "visible_fraction": row["visible_fraction"],
        "score": row["score"],
        "box_px": box,
        "share": (view.pixels.get(node, 0) / math.prod(session.anchors.size)) if view else 0.0,
        "faults": faults,
    }


def _near(session: AnnotationSession, place: Any) -> bool:
    low, high = session.scene.bounds
    return bool((place >= low - 5).all() and (place <= high + 5).all())


def _with_version(document: dict[str, Any]) -> JSONResponse:
    return JSONResponse(document, headers={"ETag": f'"{document["version"]}"'})


def _download(content: bytes, kind: str, name: str) -> Response:
    return Response(content, media_type=kind, headers={"Content-Disposition": f'attachment; filename="{name}"'})
