"""The annotation tool's command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.cli.common import Data, OneScene, PipelineFile, SceneOption, open_pipeline

app = typer.Typer()


@app.command("annotate")
def annotate(
    name: OneScene = None,
    data: Data = "data",
    scene: SceneOption = None,
    pipeline: PipelineFile = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on.  (default: a free one)")] = 0,
    host: Annotated[
        str, typer.Option(help="IPv4 address to listen on; except on loopback, visitors need a token.")
    ] = "127.0.0.1",
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    coco: Annotated[
        Path | None, typer.Option("--coco", help="Write boxes and pictures to this COCO archive (ZIP) and exit.")
    ] = None,
) -> None:
    """Annotate a scene in the browser: landmarks, objects and their anchors."""
    from aerialdojo_gen.cli.picking import given_scene, pick_scene
    from aerialdojo_gen.pipeline.runner import chosen_scenes, known_scenes
    from aerialdojo_gen.studio.annotate.serve import serve_session, write_coco
    from aerialdojo_gen.studio.annotate.session import open_session
    from aerialdojo_gen.studio.web.serving import require_web

    if coco is None:
        require_web()
    config, roots = open_pipeline(pipeline, data)
    given = given_scene(name, scene)
    scene = pick_scene(given, known_scenes(roots.recipes) if given else chosen_scenes(config, roots))
    desk = open_session(scene, config, roots)
    if coco is not None:
        print(write_coco(desk, coco))
    else:
        serve_session(desk, port=port, host=host, browser=browser, say=lambda line: print(line, flush=True))
