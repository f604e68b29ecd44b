"""One command a stage, and ``run``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import terminal_width
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import merge_scenes, open_pipeline, print_json, run_chosen, run_until
from aerialdojo_gen.pipeline.options import RunOptions
from aerialdojo_gen.pipeline.registry import BY_NAME, STAGES

app = typer.Typer()

# Stages whose command has options of its own.
_WITH_OPTIONS = ("build-scenes", "plan", "split", "render")


def _stage_command(name: str) -> Callable[..., None]:
    def command(
        scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
        pipeline: options.PipelineFile = None, workers: options.Workers = None, force: options.Force = False,
        quiet: options.Quiet = False, verbose: options.Verbose = False,
        executor: options.ExecutorName = "local", address: options.Address = None,
    ) -> None:  # fmt: skip
        run_until(
            name, data=data, scene=merge_scenes(scenes, scene), pipeline=pipeline, force=force, quiet=quiet,
            verbose=verbose, options=RunOptions(workers, executor, address),
        )  # fmt: skip

    return command


for _stage in STAGES:
    if _stage.name not in _WITH_OPTIONS:
        app.command(_stage.name, help=_stage.help)(_stage_command(_stage.name))


@app.command("build-scenes", help=BY_NAME["build-scenes"].help)
def build_scenes(
    scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
    pipeline: options.PipelineFile = None, workers: options.Workers = None, force: options.Force = False,
    quiet: options.Quiet = False, verbose: options.Verbose = False,
    executor: options.ExecutorName = "local", address: options.Address = None,
    watch: Annotated[
        Path | None, typer.Option("--watch", help="Show this plan in the browser, built again when it is saved.")
    ] = None,
    port: options.Port = 0,
    browser: options.Browser = True,
) -> None:  # fmt: skip
    """Build meshes from plans."""
    if watch is not None:
        _watch(watch, pipeline, port, browser)
        return
    run_until(
        "build-scenes", data=data, scene=merge_scenes(scenes, scene), pipeline=pipeline, force=force, quiet=quiet,
        verbose=verbose, options=RunOptions(workers, executor, address),
    )  # fmt: skip


def _watch(plan: Path, pipeline: Path | None, port: int, browser: bool) -> None:
    from aerialdojo_gen.studio.web.serving import open_socket, require_web, serve, url_of

    require_web()
    from aerialdojo_gen.studio.view.plan_page import plan_app

    if not plan.is_file():
        raise UsageError(f"no file {plan}: --watch takes a scene's TOML")
    _, roots = open_pipeline(pipeline, "data")
    page, listener = plan_app(plan, roots.scene_assets), open_socket(port)
    print(f"{plan}: {url_of(listener)}  (Ctrl-C ends it)", flush=True)
    serve(page, listener, browser)


@app.command("plan", help=BY_NAME["plan"].help)
def plan(
    scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
    pipeline: options.PipelineFile = None, workers: options.Workers = None, force: options.Force = False,
    quiet: options.Quiet = False, verbose: options.Verbose = False,
    every: Annotated[
        bool, typer.Option("--all", help="Plan all candidates, including those that the release does not need.")
    ] = False,
    executor: options.ExecutorName = "local", address: options.Address = None,
) -> None:  # fmt: skip
    """Plan reference trajectories, with what they need upstream."""
    run_until(
        "plan", data=data, scene=merge_scenes(scenes, scene), pipeline=pipeline, force=force, quiet=quiet,
        verbose=verbose, options=RunOptions(workers, executor, address), search="all" if every else None,
    )  # fmt: skip


@app.command("split", help=BY_NAME["split"].help)
def split(
    scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
    pipeline: options.PipelineFile = None, workers: options.Workers = None, force: options.Force = False,
    quiet: options.Quiet = False, verbose: options.Verbose = False, replace: options.Replace = False,
    executor: options.ExecutorName = "local", address: options.Address = None,
) -> None:  # fmt: skip
    """Write the release, with what it needs upstream."""
    run_until(
        "split", data=data, scene=merge_scenes(scenes, scene), pipeline=pipeline, force=force, quiet=quiet,
        verbose=verbose, options=RunOptions(workers, executor, address, replace=replace),
    )  # fmt: skip


@app.command("status")
def status(
    scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
    pipeline: options.PipelineFile = None, as_json: options.Json = False,
) -> None:  # fmt: skip
    """Say which scenes of each stage are fresh, stale or missing; run and write nothing."""
    from aerialdojo_gen.dataset.build import pipeline_status, status_table

    found = pipeline_status(pipeline, data, scenes=merge_scenes(scenes, scene))
    if as_json:
        print_json([asdict(one) for one in found])
    else:
        print("\n".join(status_table(found).lines(terminal_width())))


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
