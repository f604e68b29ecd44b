"""Commands that exchange tasks with other formats, and share a release on the Hugging Face Hub."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.errors import UsageError, brief
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import interruptible, merge_scenes, print_json
from aerialdojo_gen.cli.options import is_typed
from aerialdojo_gen.store.root import LocalRoot, open_root

app = typer.Typer()

# Formats with what the body sees on its way.
_FOR_TRAINING = ("lerobot", "webdataset")
# Options that some formats alone have.
_FORMATS_OF = {
    **dict.fromkeys(("picture_size", "shards"), ("aerialdojo",)),
    **dict.fromkeys(
        ("split", "setting", "limit", "seed", "view", "width", "height", "no_depth", "goal", "source", "renderer",
         "jpeg_quality", "run", "workers", "estimate"), _FOR_TRAINING,
    ),
    "points_per_m2": ("pointcloud",), "voxel_m": ("occupancy",),
}  # fmt: skip


@app.command("export")
def export(
    ctx: typer.Context,
    form: Annotated[
        str, typer.Option("--format", help="aerialdojo, habitat, lerobot, webdataset, pointcloud or occupancy.")
    ],
    scenes: options.Scenes = None,
    data: options.Data = "data",
    out: Annotated[Path | None, typer.Option(help="Folder to write.  (default: DATA/exports/FORMAT)")] = None,
    scene: options.Scene = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export there.")] = False,
    picture_size: Annotated[
        int | None,
        typer.Option(
            help="aerialdojo: size of rendered pictures in pixels; 0: those of the release.  (default: 640)"
        ),
    ] = None,
    shards: Annotated[
        bool, typer.Option("--shards", help="aerialdojo: one tar file per scene instead of one file per trajectory.")
    ] = False,
    split: Annotated[
        list[str] | None,
        typer.Option(help="id_train, id_test, ood_train, ood_test, train, test; repeatable.  (default: all)"),
    ] = None,
    setting: options.Setting = None,
    limit: Annotated[
        int | None,
        typer.Option(
            min=0, help="Maximum number of trajectories per scene and setting, not in total.  (default: 0, all)"
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed for the selection of trajectories by --limit.  (default: 0)")
    ] = None,
    view: Annotated[
        list[str] | None, typer.Option(help="front, left, right, down; repeatable.  (default: front)")
    ] = None,
    width: Annotated[
        int | None, typer.Option(min=16, max=4096, help="Image width in pixels.  (default: 128)")
    ] = None,
    height: Annotated[
        int | None, typer.Option(min=16, max=4096, help="Image height in pixels.  (default: the width)")
    ] = None,
    no_depth: Annotated[bool, typer.Option("--no-depth", help="Export colour images without depth.")] = False,
    goal: Annotated[list[str] | None, typer.Option(help="text, image; repeatable.  (default: text)")] = None,
    source: Annotated[
        str | None,
        typer.Option(
            help="render: render now; recordings: read those of the command render; auto: read where there are.  "
            "(default: render)"
        ),
    ] = None,
    renderer: Annotated[str | None, typer.Option(help="auto, gl or pybullet.  (default: auto)")] = None,
    jpeg_quality: Annotated[
        int | None, typer.Option(min=1, max=100, help="webdataset: JPEG quality, instead of lossless PNG.")
    ] = None,
    run: Annotated[
        list[str] | None,
        typer.Option(
            help="Export the successful flights of this run of evaluate or fly in place of the references; "
            "repeatable."
        ),
    ] = None,
    workers: options.Workers = None,
    points_per_m2: Annotated[
        float | None, typer.Option(help="pointcloud: points per square metre of surface.  (default: 20)")
    ] = None,
    voxel_m: Annotated[
        float | None, typer.Option(help="occupancy: edge of a voxel in metres.  (default: 0.5)")
    ] = None,
    estimate: Annotated[
        bool,
        typer.Option(
            "--estimate", help="Measure a few trajectories and estimate time and size for all; write nothing."
        ),
    ] = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Write the release in the layout of AerialDojo's authors, as Habitat's ObjectNav-v1, or for training.

    lerobot (LeRobotDataset v3) and webdataset (tar shards) contain images and actions of every step; only they
    take the options from --split to --workers, and --estimate. After an interruption the same command continues.
    pointcloud (PLY) and occupancy (NumPy's npz) are of all scenes whose meshes are there, and need no release.
    """
    from aerialdojo_gen.base.names import unknown
    from aerialdojo_gen.exchange.exporting import (
        FORMATS,
        POINTS_PER_M2,
        SHAPES,
        VOXEL_M,
        export_release,
        export_shapes,
    )
    from aerialdojo_gen.pipeline.progress import Reporter

    if form not in (known := (*FORMATS, *_FOR_TRAINING, *SHAPES)):
        raise UsageError(unknown("no format", form, known))
    _check_fits(ctx, form)
    root, chosen = open_root(data), merge_scenes(scenes, scene)
    if out is None and not isinstance(root, LocalRoot):
        raise UsageError("an export is a folder of this machine: name it with --out")
    target = out or Path(root.at(f"exports/{form}"))
    if form in _FOR_TRAINING:
        from aerialdojo_gen.benchmark.agents.goal import Sensors
        from aerialdojo_gen.exchange.learning_export import estimate_for_learning, export_for_learning
        from aerialdojo_gen.exchange.samples import ExportOptions

        sensors = Sensors(
            tuple(view or ("front",)), depth=not no_depth, width=width or height or 128, height=height or width or 128
        )
        request = ExportOptions(
            splits=tuple(split or ()), settings=tuple(setting or ()), scenes=tuple(chosen or ()), limit=limit or 0,
            seed=seed or 0, sensors=sensors, goal=tuple(goal or ("text",)), source=source or "render",
            renderer=renderer or "auto", jpeg_quality=jpeg_quality or 0, runs=tuple(run or ()),
        )  # fmt: skip
        if estimate:
            estimated = estimate_for_learning(form, root, request, workers)
            if as_json:
                print_json(asdict(estimated))
            else:
                print(estimated)
            return
        with interruptible("finished parts are kept, the same command continues from here"):
            made = export_for_learning(
                form, root, target, request, force=force, workers=workers, reporter=Reporter(quiet=quiet)
            )
        counts, document = made.counts, asdict(made)
    elif form in SHAPES:
        counts = document = export_shapes(
            form, root, target, chosen, force=force, reporter=Reporter(quiet=quiet or as_json),
            points_per_m2=POINTS_PER_M2 if points_per_m2 is None else points_per_m2,
            voxel_m=VOXEL_M if voxel_m is None else voxel_m,
        )  # fmt: skip
    else:
        counts = document = export_release(
            form, root, target, chosen, force=force, picture_px=picture_size, shards=shards,
            reporter=Reporter(quiet=quiet or as_json),
        )  # fmt: skip
    if as_json:
        print_json({"path": str(target), **document})
    elif not quiet:
        print(f"{target}: " + ", ".join(f"{n:,} {name}" for name, n in counts.items()))


def _check_fits(ctx: typer.Context, form: str) -> None:
    """Refuse options of other formats."""
    given: dict[tuple[str, ...], list[str]] = {}
    for option in ctx.command.params:
        if is_typed(ctx, option) and form not in (formats := _FORMATS_OF.get(str(option.name), (form,))):
            given.setdefault(formats, []).append(option.opts[0])
    for formats, names in given.items():
        verb = "is" if len(names) == 1 else "are"
        raise UsageError(f"{', '.join(names)} {verb} for --format {' and '.join(formats)}, not for {form}")


@app.command("import-benchmark")
def import_benchmark(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Task files; aerialdojo: also a folder.")],
    form: Annotated[str, typer.Option("--format", help="aerialdojo, uav-on, cityavos, aerialvln or openfly.")],
    data: options.Data = "data",
    frame: Annotated[
        str | None, typer.Option(help="Axes of cityavos and openfly: enu, nwu, ned or esd (east, south, down).")
    ] = None,
    angles: Annotated[str, typer.Option(help="Unit of yaw in cityavos: radians, degrees or mixed.")] = "radians",
    images: Annotated[
        Path | None, typer.Option(help="Folder of the pictures of cityavos.  (default: that of the file)")
    ] = None,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Read the goal images.")] = True,
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Skip bad records and keep the good ones.")] = False,
    name: Annotated[str | None, typer.Option(help="Name of the import.  (default: the format)")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an import of the same name.")] = False,
) -> None:
    """Convert task files of another benchmark to tables like the release's, in DATA/imported/NAME."""
    from aerialdojo_gen.exchange import importing

    options = importing.Options(
        frame=frame, angles=angles, pictures=images, with_pictures=pictures, skip_bad=skip_bad
    )
    root = open_root(data)
    report = importing.import_benchmark(form, files, root, options, name=name, force=force)
    print("\n".join([root.at(f"imported/{name or form}"), *(f"  {line}" for line in report.lines())]))


Repo = Annotated[str, typer.Argument(metavar="USER/NAME", help="Dataset on the Hub, or at HF_ENDPOINT.")]


@app.command("push-to-hub")
def push_to_hub(
    repo: Repo,
    data: options.Data = "data",
    private: Annotated[bool, typer.Option("--private", help="If the dataset is new, make it private.")] = False,
    revision: Annotated[str | None, typer.Option(help="Branch to write to.  (default: main)")] = None,
    meshes: Annotated[bool, typer.Option("--meshes", help="Upload scene meshes too; evaluate needs them.")] = False,
    policy: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Upload the weights of this training too, such as imitation; repeatable."),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Upload the release to the Hugging Face Hub, with its card as README; the token is HF_TOKEN."""
    from aerialdojo_gen.exchange import hub
    from aerialdojo_gen.pipeline.progress import Reporter

    moved = hub.push_to_hub(
        repo, data, private=private, revision=revision, meshes=meshes, policies=policy or (),
        reporter=Reporter(quiet=quiet),
    )  # fmt: skip
    print(moved)


@app.command("pull")
def pull(
    repo: Repo,
    data: options.Data = "data",
    revision: Annotated[str | None, typer.Option(help="Branch, tag or commit.  (default: main)")] = None,
    meshes: Annotated[
        bool, typer.Option("--meshes/--no-meshes", help="Download the meshes too, if the dataset has them.")
    ] = True,
    replace: Annotated[
        bool, typer.Option("--replace", help="Overwrite the release and meshes in --data; they are deleted.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Download a release from the Hugging Face Hub and check it; after a failure the same command continues."""
    from aerialdojo_gen.exchange import hub
    from aerialdojo_gen.pipeline.progress import Reporter

    moved = hub.pull_release(
        repo, data, revision=revision, meshes=meshes, replace=replace, reporter=Reporter(quiet=quiet)
    )
    print(moved)
    if moved.left:
        # A new line in a name must not begin a line of ours.
        names = [brief(name, 100).replace("\n", r"\n") for name in moved.left[:5]]
        print(f"left there: {', '.join(names)}{' …' if len(moved.left) > 5 else ''}")
    print(f"next: {cli_context.command('validate', no_meshes=not moved.meshes)}")
