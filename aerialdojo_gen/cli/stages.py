"""One command a stage, ``run`` and ``status``; what a pipeline file may say, and one to begin with."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import terminal_width
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import StageOptions, merge_scenes, print_json, run_chosen, stage_command
from aerialdojo_gen.dataset.build import open_pipeline, pipeline_file
from aerialdojo_gen.pipeline.options import RunOptions
from aerialdojo_gen.pipeline.registry import STAGES

app = typer.Typer()

# Stages whose command has options of its own.
_WITH_OPTIONS = ("build-scenes", "plan", "split", "render")


def _add_command(stage: str) -> None:
    stage_command(app, stage)(lambda common: common.run_until(stage))


for _stage in STAGES:
    if _stage.name not in _WITH_OPTIONS:
        _add_command(_stage.name)


@stage_command(app, "build-scenes")
def build_scenes(
    common: StageOptions,
    watch: Annotated[
        Path | None, typer.Option("--watch", help="Show this plan in the browser, built again when it is saved.")
    ] = None,
    port: options.Port = 0,
    browser: options.Browser = True,
) -> None:
    """Build meshes from plans."""
    if watch is None:
        common.run_until("build-scenes")
        return
    from aerialdojo_gen.studio.web.serving import open_socket, require_web, serve, url_of

    require_web()
    from aerialdojo_gen.studio.view.plan_page import plan_app

    if not watch.is_file():
        raise UsageError(f"no file {watch}: --watch takes a scene's TOML")
    _, roots = open_pipeline(common.pipeline, "data")
    page, listener = plan_app(watch, roots.scene_assets), open_socket(port)
    print(f"{watch}: {url_of(listener)}  (Ctrl-C ends it)", flush=True)
    serve(page, listener, browser)


@stage_command(app, "plan")
def plan(
    common: StageOptions,
    every: Annotated[
        bool, typer.Option("--all", help="Plan all candidates, including those that the release does not need.")
    ] = False,
) -> None:
    """Plan reference trajectories, with what they need upstream."""
    common.run_until("plan", search="all" if every else None)


@stage_command(app, "split")
def split(common: StageOptions, replace: options.Replace = False) -> None:
    """Write the release, with what it needs upstream."""
    common.run_until("split", replace=replace)


@app.command("status")
def status(
    scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
    pipeline: options.PipelineFile = None, as_json: options.Json = False,
) -> None:  # fmt: skip
    """Say which scenes of each stage are fresh, stale or missing; run and write nothing."""
    from aerialdojo_gen.dataset.build import pipeline_status, status_table

    states = pipeline_status(pipeline, data, scenes=merge_scenes(scenes, scene))
    if as_json:
        print_json([asdict(one) for one in states])
    else:
        print("\n".join(status_table(states).lines(terminal_width())))


@app.command("run")
def run(
    pipeline: options.PipelineArgument, scenes: options.Scenes = None, data: options.Data = "data",
    scene: options.Scene = None, workers: options.Workers = None, force: options.Force = False,
    quiet: options.Quiet = False, verbose: options.Verbose = False, replace: options.Replace = False,
    stats: Annotated[bool, typer.Option("--stats", help="Print the tables of stats at the end.")] = False,
    executor: options.ExecutorName = "local", address: options.Address = None,
) -> None:  # fmt: skip
    """Run a pipeline's stages, from recipes and annotations to the release."""
    from aerialdojo_gen.pipeline.runner import stages_named

    config, roots = open_pipeline(pipeline, data)
    stages = stages_named(config.stages)
    forced = frozenset(stage.name for stage in stages if force)
    options = RunOptions(workers, executor, address, forced, replace)
    run_chosen(stages, config, roots, merge_scenes(scenes, scene), options, quiet, verbose)
    if stats:
        from aerialdojo_gen.cli import release

        # In this process: a second one would take a second to begin.
        release.stats(data=data, pipeline=pipeline)


config_app = typer.Typer(help="Show the keys of a pipeline file, or write one to start from.")


@config_app.command("show")
def show(
    stage: Annotated[
        str | None, typer.Argument(metavar="STAGE", help="Show the section of one stage, e.g. plan.  (default: all)")
    ] = None,
    pipeline: options.PipelineFile = None,
    as_json: options.Json = False,
) -> None:
    """Show every key of a pipeline: value, default, unit, bounds, meaning."""
    from aerialdojo_gen.base.config.keys import config_keys
    from aerialdojo_gen.pipeline.template import key_lines

    keys = config_keys(pipeline_file(pipeline), stage)
    if as_json:
        print_json([key.as_json() for key in keys])
        return
    print("\n".join(key_lines(keys, terminal_width())))


@config_app.command("init")
def init(
    path: Annotated[Path, typer.Argument(metavar="NAME.toml", help="File to write.")],
    pipeline: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="PIPELINE", help="Start from this pipeline's values.  (default: the defaults)"
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Write a commented pipeline file with every key, unit and default."""
    from aerialdojo_gen.pipeline.template import init_config

    print(init_config(path, pipeline and pipeline_file(pipeline), force=force))
    print(f"next: {cli_context.command('run', path, data=f'data-{path.stem}')}")
