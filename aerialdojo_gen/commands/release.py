"""Commands about what was made: statistics, checks, views, other formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.commands.common import Data, PipelineFile, Scene, open_pipeline

app = typer.Typer()


@app.command("stats")
def stats(
    data: Data = Path("data"), scene: Scene = None, pipeline: PipelineFile = None,
    pool: Annotated[bool, typer.Option("--pool", help="What filter kept, not the release.")] = False,
) -> None:  # fmt: skip
    """Set the release beside the paper's tables; before there is one, what filter kept."""
    from aerialdojo_gen import runner, store
    from aerialdojo_gen.release.pool import pool_lines, pool_of
    from aerialdojo_gen.release.stats import made_lines, made_of, split_lines

    config, roots = open_pipeline(pipeline, data)
    scenes = runner.choose_scenes(scene or config.scenes, runner.known_scenes(roots.recipes))
    released = set(store.release_scenes(roots.data))
    if pool or not released.issuperset(scenes):
        print("\n".join(pool_lines([pool_of(roots.data, name) for name in scenes])))
        return
    made = [made_of(roots.data, name) for name in scenes]
    print("\n".join([*made_lines(made), "", *split_lines(made)]))
