"""What several commands share: their options, where the sources lie, how a pipeline is opened and run.

Nothing heavy is imported before a command runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.errors import ConfigError

if TYPE_CHECKING:
    from aerialdojo_gen.config.pipeline import Pipeline
    from aerialdojo_gen.pipeline.freshness import Limits
    from aerialdojo_gen.pipeline.progress import Reporter
    from aerialdojo_gen.pipeline.stage import Roots, Stage

DEFAULT_PIPELINE = "aerialdojo-200k.toml"

Data = Annotated[
    Path, typer.Option("--data", envvar="AERIALDOJO_DATA", help="Data directory: tables, meshes, release.")
]
Scene = Annotated[
    list[str] | None, typer.Option("--scene", help="Scene or glob, repeatable: --scene 'U_*'.  (default: all)")
]
PipelineFile = Annotated[
    Path | None, typer.Option("--pipeline", help=f"Pipeline file.  (default: pipelines/{DEFAULT_PIPELINE})")
]
Workers = Annotated[int | None, typer.Option("--workers", min=1, max=1024, help="Processes.  (default: all cores)")]
ExecutorName = Annotated[
    str, typer.Option("--executor", metavar="local|ray", help="Processes of this machine, or of a Ray cluster.")
]
Address = Annotated[
    str | None,
    typer.Option("--address", metavar="HOST:PORT", help="Of a running Ray cluster.  (default: one on this machine)"),
]
Force = Annotated[bool, typer.Option("--force", help="Compute this stage's shards even where they are fresh.")]
Replace = Annotated[
    bool, typer.Option("--replace", help="Put this release in the place of another pipeline's, which is lost.")
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")]


def home() -> Path:
    """Return the folder that holds scene_assets/, annotations/ and pipelines/.

    A checkout's own folder where the package lies in one, else what the wheel carries.
    """
    package = Path(__file__).resolve().parents[1]
    return package.parent if (package.parent / "scene_assets").is_dir() else package / "_shipped"


def open_pipeline(path: Path | None, data: Path) -> tuple[Pipeline, Roots]:
    """Read the pipeline file and find the folders.

    Parameters
    ----------
    path : Path or None
        The pipeline file; None for the default one.
    data : Path
        The data directory.

    Returns
    -------
    Pipeline, Roots

    Raises
    ------
    ConfigError
        The file is missing or wrong.
    """
    from aerialdojo_gen.config.pipeline import load_pipeline
    from aerialdojo_gen.pipeline.stage import Roots

    pipeline = load_pipeline(path or home() / "pipelines" / DEFAULT_PIPELINE)
    roots = Roots(
        data=data.absolute(),
        scene_assets=(assets := pipeline.scene_assets or home() / "scene_assets"),
        recipes=pipeline.recipes or assets / "scenes",
        annotations=pipeline.annotations or home() / "annotations",
    )
    for key, folder in (("scene_assets", roots.scene_assets), ("recipes", roots.recipes)):
        if not folder.is_dir():
            raise ConfigError(f"no folder {folder}: set {key} in the pipeline file")
    return pipeline, roots


def run_until(
    stage: str,
    *,
    data: Path,
    scene: list[str] | None = None,
    pipeline: Path | None = None,
    workers: int | None = None,
    force: bool = False,
    quiet: bool = False,
    limits: Limits | None = None,
    replace: bool = False,
    executor: str = "local",
    address: str | None = None,
    **overrides: object,
) -> None:
    """Bring a stage's tables up to date, running what it needs upstream; the twin of a stage's command.

    Parameters
    ----------
    stage : str
        Name of the stage, e.g. ``"plan"``.
    data : Path
        The data directory.
    scene : list of str, optional
        Names or globs; the pipeline's scenes where absent.
    pipeline : Path, optional
        A pipeline file; the default one where absent.
    workers : int, optional
        Processes; all cores where absent.
    force : bool
        Compute this stage's shards even where they are fresh (not those of the stages upstream).
    quiet : bool
        No progress and no summary.
    limits : Limits, optional
        How much of the stage is computed now; all of it where absent.
    replace : bool
        Whether scenes of the release that another pipeline made may be lost.
    executor, address : str
        As for `aerialdojo_gen.pipeline.executors.make_executor`.
    **overrides
        Values of the stage's section that replace the file's; None leaves one as it is.

    Raises
    ------
    AerialDojoError
        An expected failure.
    """
    from aerialdojo_gen.config.pipeline import with_overrides
    from aerialdojo_gen.pipeline.registry import upstream

    config, roots = open_pipeline(pipeline, data)
    config = with_overrides(config, stage, **overrides)
    run_stages(
        list(upstream(stage)), config, roots, scene, workers, [stage] if force else [], quiet, limits, replace,
        executor, address,
    )  # fmt: skip


def run_stages(
    stages: list[Stage],
    config: Pipeline,
    roots: Roots,
    scene: list[str] | None,
    workers: int | None,
    force: list[str],
    quiet: bool,
    limits: Limits | None = None,
    replace: bool = False,
    executor: str = "local",
    address: str | None = None,
) -> None:
    """Run stages in their order over the chosen scenes; after `split`, write card and croissant.json.

    Raises
    ------
    UsageError
        The release would lose scenes that another pipeline made, and `replace` is not given; nothing was run.
    """
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.pipeline.progress import Reporter
    from aerialdojo_gen.release.provenance import check_replaced

    reporter = Reporter(quiet=quiet)
    scenes = runner.choose_scenes(scene or config.scenes, runner.known_scenes(roots.recipes))
    releases = any(stage.name == "split" for stage in stages)

    def prepare() -> None:
        if releases and not replace:
            check_replaced(roots.data, config, scenes, whole=scene is None)

    def finish() -> None:
        if releases:
            _finish_release(config, roots.data, scenes, scene is None, reporter)

    try:
        runner.run(
            stages, scenes, config, roots, workers=workers, executor=executor, address=address, force=force,
            reporter=reporter, limits=limits, prepare=prepare, finish=finish,
        )  # fmt: skip
    except KeyboardInterrupt:
        # Said here because Typer turns Ctrl-C into a silent exit.
        print("interrupted: finished shards are kept, the same command goes on from here", file=sys.stderr)
        raise SystemExit(130) from None


def _finish_release(config: Pipeline, data: Path, scenes: list[str], whole: bool, reporter: Reporter) -> None:
    """Bring what stands beside the tables of a release up to date with them."""
    from aerialdojo_gen.release.card import write_card
    from aerialdojo_gen.release.croissant import write_croissant
    from aerialdojo_gen.release.provenance import record_makers
    from aerialdojo_gen.store.shards import prune_release

    if whole:
        # The whole pipeline was asked for: the release holds its scenes and no others.
        for gone in prune_release(data, scenes):
            reporter.line(f"release: {gone} is no scene of this pipeline, removed")
    record_makers(data, config, scenes)
    write_croissant(data)
    reporter.line(f"release: {write_card(data).parent}")


def default_workers() -> int:
    """Count the cores that this process may use."""
    from aerialdojo_gen.pipeline.executors.local import own_cores

    return own_cores()
