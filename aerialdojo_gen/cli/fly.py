"""``fly``: a person flies released tasks in the browser."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from aerialdojo_gen.cli.common import (
    Data,
    Modality,
    Out,
    PipelineFile,
    Protocol,
    RendererName,
    Scene,
    Scenes,
    SelectionSeed,
    Setting,
    Split,
    SubmissionFile,
    TaskLimit,
    Tell,
    merge_scenes,
    open_pipeline,
)

app = typer.Typer()


@app.command("fly")
def fly(
    name: Annotated[
        str,
        typer.Option("--name", help="The pilot's name in the tables: small letters, digits and -; any name does."),
    ],
    scenes: Scenes = None,
    data: Data = "data",
    run: Annotated[str | None, typer.Option("--run", help="Name of the run.  (default: human-NAME)")] = None,
    split: Split = None,
    setting: Setting = None,
    modality: Modality = None,
    protocol: Protocol = None,
    scene: Scene = None,
    limit: TaskLimit = None,
    seed: SelectionSeed = 0,
    renderer: RendererName = "auto",
    tell: Tell = None,
    out: Out = None,
    submission: SubmissionFile = None,
    restart: Annotated[bool, typer.Option("--restart", help="Delete the run's earlier flights.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1.  (default: a free one)")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    pipeline: PipelineFile = None,
) -> None:
    """Fly released tasks yourself in the browser; finished flights are kept, as episodes of human:NAME."""
    from aerialdojo_gen.studio.web.serving import require_web

    require_web()
    from aerialdojo_gen.benchmark.evaluation import Evaluation
    from aerialdojo_gen.benchmark.tasks import Selection
    from aerialdojo_gen.studio.fly.server import serve_session
    from aerialdojo_gen.studio.fly.session import agent_name

    config, _ = open_pipeline(pipeline, data, reads=True)
    splits, settings, modalities = (tuple(names or ()) for names in (split, setting, modality))
    chosen = tuple(merge_scenes(scenes, scene) or ())
    evaluation = Evaluation(
        run or f"human-{name}",
        agent_name(name),
        selection=Selection(splits, settings, modalities, chosen, limit, seed, protocol or ""),
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
