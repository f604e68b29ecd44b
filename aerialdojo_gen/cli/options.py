"""The options that several commands have, and what a shell offers for them after a tab."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.dataset.build import DEFAULT_PIPELINE
from aerialdojo_gen.store.root import open_root


def shipped_pipelines() -> list[str]:
    """Return the names of the pipelines that come with the program."""
    return sorted(file.stem for file in (home() / "pipelines").glob("*.toml"))


def complete_pipelines(incomplete: str) -> list[str]:
    """Offer the names of the pipelines that come with the program, and files in reach of what is written."""
    return [name for name in [*shipped_pipelines(), *_files(incomplete)] if name.startswith(incomplete)]


def complete_scenes(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer the scenes of the pipeline that is named, else of the release in the data directory, else all recipes."""
    from aerialdojo_gen.base.errors import AerialDojoError

    known: list[str] = []
    # A tab is no place for an error's line.
    with contextlib.suppress(AerialDojoError, OSError):
        pipeline, data = ctx.params.get("pipeline"), str(ctx.params.get("data") or "data")
        if pipeline:
            from aerialdojo_gen.dataset.build import open_pipeline
            from aerialdojo_gen.pipeline.runner import known_scenes

            known = known_scenes(open_pipeline(pipeline, "data")[1].recipes)
        elif "://" not in data and Path(data).is_dir():
            from aerialdojo_gen.dataset.contents import existing_scenes

            known = [*existing_scenes(open_root(data))]
    known = known or sorted(file.stem for file in (home() / "scene_assets" / "scenes").glob("*.toml"))
    return [name for name in known if name.startswith(incomplete)]


def complete_agents(incomplete: str) -> list[str]:
    """Offer the agents that come with the program."""
    from aerialdojo_gen.benchmark.agents.load import BUILT_IN

    return [name for name in BUILT_IN if name.startswith(incomplete)]


def _files(incomplete: str) -> Iterator[str]:
    folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    with contextlib.suppress(OSError):
        for entry in sorted(folder.iterdir()):
            shown = str(entry) if folder != Path() or not incomplete.startswith("./") else f"./{entry}"
            if entry.suffix == ".toml":
                yield shown
            elif entry.is_dir() and any(entry.glob("*.toml")):
                yield f"{shown}/"


def is_typed(ctx: typer.Context, option: Any) -> bool:
    """Whether an option is from the command line, rather than from the environment or a default."""
    source = ctx.get_parameter_source(str(option.name))
    return source is not None and source.name == "COMMANDLINE"


def remember_option(ctx: typer.Context, param: typer.CallbackParam, value: Any) -> Any:
    """Keep the options of the command line (not the environment's) for commands in messages."""
    if is_typed(ctx, param):
        cli_context.update_context(**{str(param.name): value})
    return value


Data = Annotated[
    str,
    typer.Option(
        metavar="DIR|URL", envvar="AERIALDOJO_DATA", callback=remember_option,
        help="Data directory or s3://bucket/prefix, for tables, meshes and the release.",
    ),
]  # fmt: skip
Scene = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME|GLOB",
        autocompletion=complete_scenes,
        help="Scene or glob, repeatable: --scene 'U_*'.  (default: all)",
    ),
]
Scenes = Annotated[
    list[str] | None,
    typer.Argument(metavar="SCENE", autocompletion=complete_scenes, help="Scenes or globs; the same as --scene."),
]
# Which tasks are flown.
Split = Annotated[
    list[str] | None,
    typer.Option(
        help="id_train, id_test, ood_train, ood_test; train or test for both ID and OOD; repeatable.  (default: all)"
    ),
]
Setting = Annotated[
    list[str] | None, typer.Option(help="base, standard, long_horizon; repeatable.")
]  # fmt: skip
Modality = Annotated[list[str] | None, typer.Option(help="semantic or image.  (default: both)")]
TaskLimit = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Maximum number of tasks in total, spread evenly over scenes; semantic and image goals count "
        "separately.  (default: all)",
    ),
]
SelectionSeed = Annotated[int, typer.Option(min=0, help="Seed for the selection of tasks by --limit.")]
Hints = Annotated[
    list[str] | None,
    typer.Option(help="Give agents more than the goal: heading, the direction they face at the start."),
]
Out = Annotated[
    str | None, typer.Option(metavar="DIR|URL", help="Where to write the log.  (default: the data directory)")
]
SubmissionFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write the finished run into this file too, for score to replay.")
]
PipelineFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE|NAME",
        callback=remember_option,
        autocompletion=complete_pipelines,
        help="Pipeline file, or the name of a shipped one.  (default: that of the release in --data, "
        f"else {Path(DEFAULT_PIPELINE).stem})",
    ),
]
PipelineArgument = Annotated[
    Path,
    typer.Argument(
        metavar="PIPELINE",
        callback=remember_option,
        autocompletion=complete_pipelines,
        help=f"Pipeline file, or the name of a shipped one: {', '.join(shipped_pipelines())}.",
    ),
]
Workers = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=1024, help="Number of processes.  (default: one per core)")
]
ExecutorName = Annotated[str, typer.Option(metavar="local|ray", help="Run on this machine or on a Ray cluster.")]
Address = Annotated[
    str | None,
    typer.Option(metavar="HOST:PORT", help="Address of a running Ray cluster.  (default: start one on this machine)"),
]
Protocol = Annotated[
    Literal["paper"] | None, typer.Option(help="paper: the tasks of the paper's sample alone, two maps a family.")
]
Force = Annotated[bool, typer.Option("--force", help="Compute this stage again even where it is up to date.")]
Replace = Annotated[
    bool, typer.Option("--replace", help="Overwrite a release made by another pipeline; it is deleted.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON with unrounded figures.")]
OneScene = Annotated[
    str | None,
    typer.Argument(metavar="SCENE", autocompletion=complete_scenes, help="Scene, or a glob that matches one."),
]
SceneOption = Annotated[
    str | None, typer.Option(metavar="NAME|GLOB", autocompletion=complete_scenes, help="The same as SCENE.")
]
RendererName = Annotated[
    Literal["auto", "gl", "pybullet"],
    typer.Option(help="Renderer; auto takes the fastest that works on this machine."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no summary.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print a line also for stages that are up to date.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1.  (default: a free one)")]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")]
