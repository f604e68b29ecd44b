"""``annotate`` as functions: serve a session's page until Ctrl-C, or write its COCO export."""

from __future__ import annotations

import ipaddress
import secrets
import socket
from collections.abc import Callable
from pathlib import Path

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.studio.annotate.access import TokenGate
from aerialdojo_gen.studio.annotate.coco import coco_zip
from aerialdojo_gen.studio.annotate.session import AnnotationSession
from aerialdojo_gen.studio.web.serving import open_socket, serve, url_of


def serve_session(
    session: AnnotationSession, *, port: int, host: str, browser: bool, say: Callable[[str], None]
) -> None:
    """Serve the tool."""
    from aerialdojo_gen.studio.annotate.server import make_app

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


def write_coco(session: AnnotationSession, path: Path) -> Path:
    """Write `coco_zip` to a file atomically."""
    content = coco_zip(session)
    session.anchors.close()
    with atomic_file(path.parent, path.name) as temporary:
        temporary.write_bytes(content)
    return path
