"""Commands that show the release to a person: one task as a picture or a page, one scene in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.commands.common import Data

app = typer.Typer()


@app.command("view")
def view(
    scene: Annotated[str, typer.Option("--scene", help="Scene of the release, e.g. U_Mall_0.")],
    data: Data = Path("data"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page.")] = True,
) -> None:
    """Show a scene in the browser: landmarks, objects, anchors, routes."""
    from aerialdojo_gen.web.serving import open_socket, serve, url_of
    from aerialdojo_gen.web.view import view_app

    page = view_app(data, scene)
    listener = open_socket(port)
    print(f"{scene}: {url_of(listener)}  (Ctrl-C ends it)", flush=True)
    serve(page, listener, browser)
