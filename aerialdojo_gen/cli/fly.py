"""``fly``: a person flies released tasks in the browser."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import merge_scenes, open_pipeline, selection

app = typer.Typer()


@app.command("fly")
def fly(
    name: Annotated[
        str,
        typer.Option("--name", help="The pilot's name in the tables: small letters, digits and -; any name does."),
    ],
    scenes: options.Scenes = None,
    data: options.Data = "data",
    run: Annotated[str | None, typer.Option("--run", help="Name of the run.  (default: human-NAME)")] = None,
    split: options.Split = None,
    setting: options.Setting = None,
    modality: options.Modality = None,
    protocol: options.Protocol = None,
    scene: options.Scene = None,
    limit: options.TaskLimit = None,
    seed: options.SelectionSeed = 0,
    renderer: options.RendererName = "auto",
    tell: options.Tell = None,
    out: options.Out = None,
    submission: options.SubmissionFile = None,
    restart: Annotated[bool, typer.Option("--restart", help="Delete the run's earlier flights.")] = False,
    port: options.Port = 0,
    browser: options.Browser = True,
    pipeline: options.PipelineFile = None,
) -> None:
    """Fly released tasks yourself in the browser; finished flights are kept, as episodes of human:NAME."""
    from aerialdojo_gen.studio.web.serving import require_web

    require_web()
    from aerialdojo_gen.benchmark.evaluation import Evaluation
    from aerialdojo_gen.studio.fly.server import serve_session
    from aerialdojo_gen.studio.fly.session import agent_name

    config, _ = open_pipeline(pipeline, data, reads=True)
    chosen = selection(
        merge_scenes(scenes, scene), split=split, setting=setting, modality=modality, protocol=protocol,
        limit=limit, seed=seed,
    )  # fmt: skip
    evaluation = Evaluation(
        run or f"human-{name}",
        agent_name(name),
        selection=chosen,
        embodiment=config.embodiment,
        renderer=renderer,
        tell=tuple(tell or ()),
    )
    say = partial(print, flush=True)
    serve_session(data, evaluation, out=out, restart=restart, port=port, browser=browser, say=say)
    if submission is not None:
        from aerialdojo_gen.benchmark.submission import write_submission

        size = write_submission(data, out or data, evaluation.run, submission)
        say(f"{submission}: {size:,} bytes")
