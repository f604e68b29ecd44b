"""What several commands share: their options, where the sources lie, how a pipeline is opened and run.

Nothing heavy is imported before a command runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.cli import completion
from aerialdojo_gen.dataset.build import (
    DEFAULT_PIPELINE,
    default_workers,
    open_pipeline,
    pipeline_file,
    run_stages,
)

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline
    from aerialdojo_gen.pipeline.options import RunOptions
    from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
    from aerialdojo_gen.store.root import Where

__all__ = ["default_workers", "open_pipeline", "pipeline_file", "run_chosen", "run_until"]


def print_json(value: object) -> None:
    """Print JSON for ``--json``: without bytes, null for values that are not finite."""
    print(json_text(value))


def json_text(value: object) -> str:
    """Convert to the JSON values that `print_json` prints."""
    return json.dumps(_plain(value), ensure_ascii=False, indent=1, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items() if not isinstance(inner, bytes)}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def remember_option(ctx: typer.Context, param: typer.CallbackParam, value: Any) -> Any:
    """Keep the options of the command line (not the environment's) for commands in messages."""
    source = ctx.get_parameter_source(str(param.name))
    if source is not None and source.name == "COMMANDLINE":
        cli_context.update_context(**{str(param.name): value})
    return value


Data = Annotated[
    str,
    typer.Option(
        "--data", metavar="DIR|URL", envvar="AERIALDOJO_DATA", callback=remember_option,
        help="Data directory or s3://bucket/prefix, for tables, meshes and the release.",
    ),
]  # fmt: skip
Scene = Annotated[
    list[str] | None,
    typer.Option(
        "--scene",
        metavar="NAME|GLOB",
        autocompletion=completion.scenes,
        help="Scene or glob, repeatable: --scene 'U_*'.  (default: all)",
    ),
]
Scenes = Annotated[
    list[str] | None,
    typer.Argument(metavar="SCENE", autocompletion=completion.scenes, help="Scenes or globs; the same as --scene."),
]
# Which tasks are flown.
Split = Annotated[
    list[str] | None,
    typer.Option(
        "--split",
        help="id_train, id_test, ood_train, ood_test; train or test for both ID and OOD; repeatable.  (default: all)",
    ),
]
Setting = Annotated[
    list[str] | None, typer.Option("--setting", help="base, standard, long_horizon; repeatable.")
]  # fmt: skip
Modality = Annotated[list[str] | None, typer.Option("--modality", help="semantic or image.  (default: both)")]
TaskLimit = Annotated[
    int | None,
    typer.Option(
        "--limit",
        min=1,
        help="Maximum number of tasks in total, spread evenly over scenes; semantic and image goals count "
        "separately.  (default: all)",
    ),
]
SelectionSeed = Annotated[int, typer.Option("--seed", min=0, help="Seed for the selection of tasks by --limit.")]
Tell = Annotated[
    list[str] | None,
    typer.Option("--tell", help="Give agents more than the goal: heading, the direction they face at the start."),
]
Out = Annotated[
    str | None,
    typer.Option("--out", metavar="DIR|URL", help="Where to write the log.  (default: the data directory)"),
]
SubmissionFile = Annotated[
    Path | None,
    typer.Option(
        "--submission", metavar="FILE", help="Write the finished run into this file too, for score to replay."
    ),
]
PipelineFile = Annotated[
    Path | None,
    typer.Option(
        "--pipeline",
        metavar="FILE|NAME",
        callback=remember_option,
        autocompletion=completion.pipelines,
        help="Pipeline file, or the name of a shipped one.  (default: that of the release in --data, "
        f"else {Path(DEFAULT_PIPELINE).stem})",
    ),
]
PipelineArgument = Annotated[
    Path,
    typer.Argument(
        metavar="PIPELINE",
        callback=remember_option,
        autocompletion=completion.pipelines,
        help=f"Pipeline file, or the name of a shipped one: {', '.join(completion.shipped_pipelines())}.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", min=1, max=1024, help="Number of processes.  (default: one per core)"),
]
ExecutorName = Annotated[
    str, typer.Option("--executor", metavar="local|ray", help="Run on this machine or on a Ray cluster.")
]
Address = Annotated[
    str | None,
    typer.Option(
        "--address",
        metavar="HOST:PORT",
        help="Address of a running Ray cluster.  (default: start one on this machine)",
    ),
]
Protocol = Annotated[
    Literal["paper"] | None,
    typer.Option("--protocol", help="paper: the tasks of the paper's sample alone, two maps a family."),
]
Force = Annotated[bool, typer.Option("--force", help="Compute this stage again even where it is up to date.")]
Replace = Annotated[
    bool, typer.Option("--replace", help="Overwrite a release made by another pipeline; it is deleted.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON with unrounded figures.")]
OneScene = Annotated[
    str | None,
    typer.Argument(metavar="SCENE", autocompletion=completion.scenes, help="Scene, or a glob that matches one."),
]
SceneOption = Annotated[
    str | None,
    typer.Option("--scene", metavar="NAME|GLOB", autocompletion=completion.scenes, help="The same as SCENE."),
]
RendererName = Annotated[
    Literal["auto", "gl", "pybullet"],
    typer.Option("--renderer", help="Renderer; auto takes the fastest that works on this machine."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no summary.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print a line also for stages that are up to date.")]


def merge_scenes(scenes: list[str] | None, scene: list[str] | None) -> list[str] | None:
    """Join scenes that are given by position with those of ``--scene``; None where there is neither."""
    return [*(scenes or ()), *(scene or ())] or None


def run_until(
    stage: str,
    *,
    data: Where,
    scene: list[str] | None = None,
    pipeline: Path | None = None,
    options: RunOptions,
    force: bool = False,
    quiet: bool = False,
    verbose: bool = False,
    **overrides: object,
) -> None:
    """Bring a stage's tables up to date, running what it needs upstream; the twin of a stage's command."""
    from aerialdojo_gen.base.config.pipeline import with_overrides
    from aerialdojo_gen.pipeline.registry import upstream

    config, roots = open_pipeline(pipeline, data)
    config = with_overrides(config, stage, **overrides)
    options = replace(options, force=frozenset({stage} if force else ()))
    run_chosen(list(upstream(stage)), config, roots, scene, options, quiet, verbose)


def run_chosen(
    stages: list[Stage],
    config: Pipeline,
    roots: ProjectPaths,
    scene: list[str] | None,
    options: RunOptions,
    quiet: bool,
    verbose: bool = False,
) -> None:
    """Run stages with progress (`aerialdojo_gen.dataset.build.run_stages`), and say what an error or Ctrl-C left."""
    from aerialdojo_gen.base.errors import UsageError
    from aerialdojo_gen.pipeline.progress import Reporter

    kept = "finished shards are kept, " + (
        "and --force computes them again" if options.force else "the same command continues from where it stopped"
    )
    try:
        reporter = Reporter(quiet=quiet, verbose=verbose)
        run_stages(stages, config, roots, scene, options=options, reporter=reporter)
    except KeyboardInterrupt:
        # Said here because Typer turns Ctrl-C into a silent exit.
        print(f"interrupted: {kept}", file=sys.stderr)
        raise SystemExit(130) from None
    except Exception as error:
        # A wrong option or pipeline file ended it before anything was computed.
        if not isinstance(error, UsageError):
            error.add_note(kept)
        raise


def key_values(given: list[str]) -> dict[str, str]:
    """Read ``--option key=value``."""
    from aerialdojo_gen.base.errors import UsageError
    from aerialdojo_gen.base.secrets import Secrets

    options = {}
    for item in given:
        key, equals, options[key] = item.partition("=")
        if not equals or not key.isidentifier():
            raise UsageError(f"--option {Secrets().text(item)[:60]!r}: write key=value")
    return options
