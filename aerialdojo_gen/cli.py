"""The command line: one thin command a stage; the library does the work.

Nothing heavy is imported before a command runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.errors import AerialDojoError, ConfigError

if TYPE_CHECKING:
    from aerialdojo_gen.config import Pipeline
    from aerialdojo_gen.stage import Roots, Stage

app = typer.Typer(
    name="aerialdojo-gen",
    help="Generate aerial object-goal-search datasets: scenes, tasks, certified routes, RGB-D recordings.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

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
Workers = Annotated[int | None, typer.Option("--workers", min=1, help="Processes.  (default: all cores)")]
Force = Annotated[bool, typer.Option("--force", help="Compute this stage's shards even where they are fresh.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")]


def home() -> Path:
    """Return the folder that holds scene_assets/, annotations/ and pipelines/.

    A checkout's own folder where the package lies in one, else what the wheel carries.
    """
    package = Path(__file__).resolve().parent
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
    from aerialdojo_gen.config import load_pipeline
    from aerialdojo_gen.stage import Roots

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
    **overrides
        Values of the stage's section that replace the file's; None leaves one as it is.

    Raises
    ------
    AerialDojoError
        An expected failure.
    """
    from aerialdojo_gen.config import with_overrides
    from aerialdojo_gen.stage import upstream

    config, roots = open_pipeline(pipeline, data)
    config = with_overrides(config, stage, **overrides)
    _run(list(upstream(stage)), config, roots, scene, workers, [stage] if force else [], quiet)


def _run(
    stages: list[Stage],
    config: Pipeline,
    roots: Roots,
    scene: list[str] | None,
    workers: int | None,
    force: list[str],
    quiet: bool,
) -> None:
    from aerialdojo_gen import runner
    from aerialdojo_gen.progress import Reporter

    reporter = Reporter(quiet=quiet)
    scenes = runner.choose_scenes(scene or config.scenes, runner.known_scenes(roots.recipes))
    workers = workers or default_workers()
    try:
        runner.run(stages, scenes, config, roots, workers=workers, force=force, reporter=reporter)
    except KeyboardInterrupt:
        # Said here because Typer turns Ctrl-C into a silent exit.
        print("interrupted: finished shards are kept, the same command goes on from here", file=sys.stderr)
        raise SystemExit(130) from None
    if any(stage.name == "split" for stage in stages):
        from aerialdojo_gen.release.card import write_card
        from aerialdojo_gen.store import prune_release

        if scene is None:
            # The whole pipeline was asked for: the release holds its scenes and no others.
            for gone in prune_release(roots.data, scenes):
                reporter.line(f"release: {gone} is no scene of this pipeline, removed")

        reporter.line(f"release: {write_card(roots.data).parent}")


def default_workers() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


# The stages whose command has no option of its own; their texts are those of `aerialdojo_gen.stage`, which is
# not imported here because it brings pyarrow.
PLAIN_STAGES = {
    "build-scenes": "Build the scenes' meshes from their recipes.",
    "annotate-import": "Check the annotations against the scenes and import them.",
    "anchor-sample": "Find viewpoints 1 m from each object that see it.",
    "reference-images": "Render each object's picture from its selected anchor.",
    "pair-objects": "Pair start anchors with targets: the candidate tasks.",
    "plan": "Plan a collision-free reference trajectory for every candidate.",
    "filter": "Keep the candidates that make tasks, with a reason for every rejection.",
    "split": "Write the release: tasks, routes, objects, train and test.",
}


def _stage_command(name: str) -> Callable[..., None]:
    def command(
        data: Data = Path("data"), scene: Scene = None, pipeline: PipelineFile = None,
        workers: Workers = None, force: Force = False, quiet: Quiet = False,
    ) -> None:  # fmt: skip
        run_until(name, data=data, scene=scene, pipeline=pipeline, workers=workers, force=force, quiet=quiet)

    return command


for _name, _help in PLAIN_STAGES.items():
    app.command(_name, help=_help)(_stage_command(_name))


@app.command("render")
def render(
    data: Data = Path("data"), scene: Scene = None, pipeline: PipelineFile = None,
    workers: Workers = None, force: Force = False, quiet: Quiet = False,
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="Trajectories a scene and setting.")] = None,
    sampling: Annotated[
        str | None, typer.Option("--sampling", help="steps: a frame a pose; time: constant frame rate.")
    ] = None,
) -> None:  # fmt: skip
    """Record four RGB-D views along trajectories of the release."""
    run_until(
        "render", data=data, scene=scene, pipeline=pipeline, workers=workers, force=force, quiet=quiet,
        limit=limit, sampling=sampling,
    )  # fmt: skip


@app.command("run")
def run(
    pipeline: Annotated[Path, typer.Argument(help="Pipeline file, e.g. pipelines/smoke.toml.")],
    data: Data = Path("data"), scene: Scene = None,
    workers: Workers = None, force: Force = False, quiet: Quiet = False,
) -> None:  # fmt: skip
    """Run a pipeline's stages, from recipes and annotations to the release."""
    from aerialdojo_gen.runner import stages_named

    config, roots = open_pipeline(pipeline, data)
    stages = stages_named(config.stages)
    _run(stages, config, roots, scene, workers, [stage.name for stage in stages] if force else [], quiet)


@app.command("add-scene")
def add_scene(
    name: Annotated[str, typer.Argument(help="Name of the scene; the suffix _1 makes it out-of-distribution.")],
    mesh: Annotated[Path, typer.Argument(help="GLB, OBJ, STL, PLY or 3DS file.")],
    up: Annotated[str, typer.Option(help="The mesh's axis that points up: z or y.")],
    scale: Annotated[float, typer.Option(help="Metres a unit of the mesh: 0.01 for centimetres.")] = 1.0,
    annotations: Annotated[Path | None, typer.Option(help="Annotation file to go with it.")] = None,
    project: Annotated[Path, typer.Option(help="Folder for your scenes and their pipeline.")] = Path("my-scenes"),
    crop: Annotated[
        tuple[float, float, float] | None, typer.Option(help="Keep a circle: x y radius, metres.")
    ] = None,
    ceiling: Annotated[
        float | None, typer.Option(help="Highest z to fly at, metres.  (default: 6 m over all)")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a scene of this name.")] = False,
) -> None:
    """Make a scene of a mesh of your own."""
    from aerialdojo_gen.imports import command

    added = command.add_scene(
        name, mesh, project, up=up, scale=scale, annotations=annotations, crop_m=crop, ceiling_m=ceiling, force=force
    )
    size = added.scene.bounds[1] - added.scene.bounds[0]
    print(
        f"{name}: {len(added.scene.instances):,} instances, {added.scene.n_triangles:,} triangles, "
        f"{size[0]:.0f} x {size[1]:.0f} m, ceiling {added.scene.ceiling_m:.0f} m"
    )
    for line in added.repairs.lines:
        print(f"  {line}")
    if not added.annotations.exists():
        print(f"next: aerialdojo-gen annotate-draft {name} --pipeline {added.pipeline} --landmarks 2 --objects 20")
    print(f"then: aerialdojo-gen run {added.pipeline} --data {project / 'data'}")


@app.command("annotate-draft")
def annotate_draft(
    scene: Annotated[str, typer.Argument(help="Scene with a recipe, e.g. U_Mall_0.")],
    landmarks: Annotated[int | None, typer.Option(min=1, help="How many.  (default: the paper's number)")] = None,
    objects: Annotated[int | None, typer.Option(min=2, help="How many.  (default: the paper's number)")] = None,
    centre: Annotated[
        tuple[float, float] | None, typer.Option(help="Middle of the core, x y in metres.  (default: the landmarks')")
    ] = None,
    within: Annotated[float | None, typer.Option(min=1, help="Radius of the core, metres.")] = None,
    core_share: Annotated[float, typer.Option(min=0, max=1, help="Share of the objects that lie in the core.")] = 1.0,
    aloft: Annotated[float, typer.Option(min=0, max=1, help="Share of the core's objects from 3 m up.")] = 0.0,
    plants: Annotated[int, typer.Option(min=0, help="Most objects of one category of vegetation.")] = 3,
    most: Annotated[int, typer.Option(min=1, help="Most objects of any other category.")] = 5,
    landmark: Annotated[list[str] | None, typer.Option(help="Node that is to be a landmark, repeatable.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same draft.")] = 0,
    pipeline: PipelineFile = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Draft a scene's annotations, to be checked and owned as sources."""
    from aerialdojo_gen.annotations.command import draft_scene
    from aerialdojo_gen.annotations.draft import Choice
    from aerialdojo_gen.runner import choose_scenes, known_scenes

    config, roots = open_pipeline(pipeline, Path("data"))
    choose_scenes([scene], known_scenes(roots.recipes))
    choice = Choice(
        centre_m=centre, within_m=within, core_share=core_share, aloft_share=aloft, most_vegetation=plants, most=most
    )
    path = draft_scene(
        scene, config, roots, n_landmarks=landmarks, n_objects=objects, choice=choice,
        landmarks=tuple(landmark or ()), seed=seed, force=force,
    )  # fmt: skip
    print(path)


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


@app.command("gallery")
def gallery(
    out: Annotated[Path, typer.Option("--out", help="Folder for the pictures.")] = Path("docs/gallery"),
    scene: Scene = None, pipeline: PipelineFile = None,
    props: Annotated[bool, typer.Option("--props/--no-props", help="The sheets of all props too.")] = True,
    small: Annotated[bool, typer.Option("--small", help="JPEGs of 1280 columns, for pages.")] = False,
) -> None:  # fmt: skip
    """Picture every prop and every scene as contact sheets."""
    from aerialdojo_gen import runner
    from aerialdojo_gen.rendering.gallery import props_sheet, scene_sheet, write_picture
    from aerialdojo_gen.scenes.build import build_scene
    from aerialdojo_gen.scenes.catalogue import load_catalogue

    config, roots = open_pipeline(pipeline, out)
    catalogue = load_catalogue(roots.scene_assets)
    suffix, width = ("jpg", 1280) if small else ("png", None)
    for name in runner.choose_scenes(scene or config.scenes, runner.known_scenes(roots.recipes)):
        sheet = scene_sheet(build_scene(roots.recipes / f"{name}.toml", catalogue))
        print(write_picture(sheet, out, f"{name}.{suffix}", width))
    if props:
        landmarks = [name for name in catalogue if catalogue[name].kind == "landmark"]
        for title, names in (("props", catalogue.targets), ("landmarks", landmarks)):
            size = 120 if small else 200
            print(write_picture(props_sheet(catalogue, names, size), out, f"{title}.{suffix}"))


def main() -> None:
    """Run the command line; an expected error becomes one line and an exit code."""
    try:
        app(standalone_mode=True)
    except AerialDojoError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(error.exit_code) from None


if __name__ == "__main__":
    main()
