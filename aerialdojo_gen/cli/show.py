"""Commands that show the release to a person: one task as a picture or a page, one scene in the browser."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.cli.common import Data, Json, Scene, Scenes, print_json, together

app = typer.Typer()


@app.command("show")
def show(
    task_id: Annotated[str, typer.Argument(metavar="TASK_ID", help="A task_id or a nav_id of the release.")],
    data: Data = "data",
    out: Annotated[Path | None, typer.Option(help="PNG to write.  (default: TASK_ID.png)")] = None,
    html: Annotated[Path | None, typer.Option(help="HTML page to write, in one file.")] = None,
    frames: Annotated[int, typer.Option(min=0, max=12, help="Number of front views along the route.")] = 5,
    as_json: Json = False,
) -> None:
    """Draw one task: goal, route in its scene, clearance, reference image, views along the route."""
    from aerialdojo_gen.base.text_table import facts, terminal_width
    from aerialdojo_gen.dataset.lookup import find_task
    from aerialdojo_gen.studio.show.figure import write_png
    from aerialdojo_gen.studio.show.page import write_page
    from aerialdojo_gen.studio.show.pictured import picture_task

    found = find_task(data, task_id)
    if as_json:
        # The rows as they stand: nothing is drawn unless a file is asked for.
        print_json(found.as_json())
        if out is None and html is None:
            return
    pictured = picture_task(found, "image" if task_id.endswith("-i") else "semantic", frames)
    told = sys.stderr if as_json else sys.stdout
    if not as_json:
        print("\n".join([pictured.title, pictured.told, *facts(pictured.facts, terminal_width())]))
    if out is not None or html is None:
        print(write_png(pictured, out or Path(f"{task_id}.png")), file=told)
    if html is not None:
        print(write_page(pictured, html), file=told)


@app.command("view")
def view(
    scenes: Scenes = None,
    data: Data = "data",
    scene: Scene = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1.  (default: a free one)")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Browse the release in the browser: its scenes and tasks, each scene in 3D with objects and routes."""
    from aerialdojo_gen.studio.web.serving import open_socket, require_web, serve, url_of

    require_web()
    from aerialdojo_gen.studio.view.server import chosen_scenes, view_app

    names = chosen_scenes(data, together(scenes, scene))
    page = view_app(data, names)
    listener = open_socket(port)
    # One scene is shown at once; of several the start page lets one choose.
    path = f"scenes/{names[0]}/" if len(names) == 1 else ""
    called = names[0] if path else f"{len(names)} scenes"
    print(f"{called}: {url_of(listener)}{path}  (Ctrl-C ends it)", flush=True)
    serve(page, listener, browser, path)
