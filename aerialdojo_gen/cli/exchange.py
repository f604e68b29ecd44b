"""Commands that exchange tasks with other formats, and share a release on the Hugging Face Hub."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.errors import UsageError, brief
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import interruptible, merge_scenes, print_json
from aerialdojo_gen.store.root import DataRoot, LocalRoot, open_root

app = typer.Typer()

# Formats with what the body sees on its way.
FOR_TRAINING = ("lerobot", "webdataset")
# Formats of meshes alone.
SHAPES = ("pointcloud", "occupancy")


Format = Annotated[
    str, typer.Option("--format", help="aerialdojo, habitat, lerobot, webdataset, pointcloud or occupancy.")
]
ExportFolder = Annotated[Path | None, typer.Option("--out", help="Folder to write.  (default: DATA/exports/FORMAT)")]
ReplaceExport = Annotated[bool, typer.Option("--force", help="Replace an earlier export there.")]
PictureSize = Annotated[
    int | None,
    typer.Option(help="aerialdojo: size of rendered pictures in pixels; 0: those of the release.  (default: 640)"),
]
Shards = Annotated[
    bool, typer.Option("--shards", help="aerialdojo: one tar file per scene instead of one file per trajectory.")
]
ExportSplit = Annotated[
    list[str] | None,
    typer.Option("--split", help="id_train, id_test, ood_train, ood_test, train, test; repeatable.  (default: all)"),
]
ExportLimit = Annotated[
    int | None,
    typer.Option(
        "--limit",
        min=0,
        help="Maximum number of trajectories per scene and setting, not in total.  (default: 0, all)",
    ),
]
ExportSeed = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed for the selection of trajectories by --limit.  (default: 0)"),
]
ExportView = Annotated[
    list[str] | None, typer.Option("--view", help="front, left, right, down; repeatable.  (default: front)")
]
ExportWidth = Annotated[
    int | None, typer.Option("--width", min=16, max=4096, help="Image width in pixels.  (default: 128)")
]
ExportHeight = Annotated[
    int | None, typer.Option("--height", min=16, max=4096, help="Image height in pixels.  (default: the width)")
]
NoDepth = Annotated[bool, typer.Option("--no-depth", help="Export colour images without depth.")]
GoalKind = Annotated[list[str] | None, typer.Option("--goal", help="text, image; repeatable.  (default: text)")]
Source = Annotated[
    str | None,
    typer.Option(
        "--source",
        help="render: render now; recordings: read those of the command render; auto: read where there are.  "
        "(default: render)",
    ),
]
ExportRenderer = Annotated[str | None, typer.Option("--renderer", help="auto, gl or pybullet.  (default: auto)")]
JpegQuality = Annotated[
    int | None,
    typer.Option("--jpeg-quality", min=1, max=100, help="webdataset: JPEG quality, instead of lossless PNG."),
]
FlownRun = Annotated[
    list[str] | None,
    typer.Option(
        "--run",
        help="Export the successful flights of this run of evaluate or fly in place of the references; repeatable.",
    ),
]
PointsPerM2 = Annotated[
    float | None,
    typer.Option("--points-per-m2", help="pointcloud: points per square metre of surface.  (default: 20)"),
]
VoxelM = Annotated[
    float | None, typer.Option("--voxel-m", help="occupancy: edge of a voxel in metres.  (default: 0.5)")
]
EstimateExport = Annotated[
    bool,
    typer.Option("--estimate", help="Measure a few trajectories and estimate time and size for all; write nothing."),
]


@app.command("export")
def export(
    form: Format,
    scenes: options.Scenes = None,
    data: options.Data = "data",
    out: ExportFolder = None,
    scene: options.Scene = None,
    force: ReplaceExport = False,
    picture_size: PictureSize = None,
    shards: Shards = False,
    split: ExportSplit = None,
    setting: options.Setting = None,
    limit: ExportLimit = None,
    seed: ExportSeed = None,
    view: ExportView = None,
    width: ExportWidth = None,
    height: ExportHeight = None,
    no_depth: NoDepth = False,
    goal: GoalKind = None,
    source: Source = None,
    renderer: ExportRenderer = None,
    jpeg_quality: JpegQuality = None,
    run: FlownRun = None,
    workers: options.Workers = None,
    points_per_m2: PointsPerM2 = None,
    voxel_m: VoxelM = None,
    estimate: EstimateExport = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Write the release in the layout of AerialDojo's authors, as Habitat's ObjectNav-v1, or for training.

    lerobot (LeRobotDataset v3) and webdataset (tar shards) contain images and actions of every step; only they
    take the options from --split to --workers, and --estimate. After an interruption the same command continues.
    pointcloud (PLY) and occupancy (NumPy's npz) are of all scenes whose meshes are there, and need no release.
    """
    from aerialdojo_gen.base.names import unknown
    from aerialdojo_gen.exchange import exporting
    from aerialdojo_gen.pipeline.progress import Reporter

    training = {
        "splits": split, "settings": setting, "limit": limit, "seed": seed, "views": view, "goal": goal,
        "source": source, "renderer": renderer, "jpeg_quality": jpeg_quality, "runs": run,
        "depth": False if no_depth else None,
        "size": (width or height or 128, height or width or 128) if width or height else None,
    }  # fmt: skip
    given = {name: value for name, value in training.items() if value is not None and value != []}
    if form not in (known := (*exporting.FORMATS, *FOR_TRAINING, *SHAPES)):
        raise UsageError(unknown("no format", form, known))
    _check_fits(form, FOR_TRAINING, {
        **{_WRITTEN.get(name, f"--{name}"): value for name, value in given.items()},
        "--estimate": estimate or None, "--workers": workers,
    })  # fmt: skip
    _check_fits(form, ("aerialdojo",), {"--picture-size": picture_size, "--shards": shards or None})
    _check_fits(form, SHAPES[:1], {"--points-per-m2": points_per_m2})
    _check_fits(form, SHAPES[1:], {"--voxel-m": voxel_m})
    root, chosen = open_root(data), merge_scenes(scenes, scene)
    if out is None and not isinstance(root, LocalRoot):
        raise UsageError("an export is a folder of this machine: name it with --out")
    target = out or Path(root.at(f"exports/{form}"))
    if form in FOR_TRAINING:
        _for_training(form, root, target, {**given, "scenes": chosen or ()}, force, workers, estimate, as_json, quiet)
        return
    reporter = Reporter(quiet=quiet or as_json)
    if form in SHAPES:
        counts = exporting.export_shapes(
            form, root, target, chosen, force=force, reporter=reporter,
            points_per_m2=exporting.POINTS_PER_M2 if points_per_m2 is None else points_per_m2,
            voxel_m=exporting.VOXEL_M if voxel_m is None else voxel_m,
        )  # fmt: skip
    else:
        counts = exporting.export_release(
            form, root, target, chosen, force=force, picture_px=picture_size, shards=shards, reporter=reporter
        )
    _print_export(target, counts, {}, as_json, quiet)


# Options by what they set, where two dashes before the name do not do.
_WRITTEN = {
    "splits": "--split", "settings": "--setting", "runs": "--run", "views": "--view", "size": "--width",
    "depth": "--no-depth", "jpeg_quality": "--jpeg-quality",
}  # fmt: skip


def _check_fits(form: str, formats: Sequence[str], given: dict[str, object]) -> None:
    """Refuse options of other formats; None is what was not given."""
    names = [name for name, value in given.items() if value is not None]
    if names and form not in formats:
        verb = "is" if len(names) == 1 else "are"
        raise UsageError(f"{', '.join(names)} {verb} for --format {' and '.join(formats)}, not for {form}")


def _print_export(target: Path, counts: dict[str, int], more: dict[str, Any], as_json: bool, quiet: bool) -> None:
    if as_json:
        print_json({"path": str(target), **(more or counts)})
    elif not quiet:
        print(f"{target}: " + ", ".join(f"{n:,} {name}" for name, n in counts.items()))


def _for_training(
    form: str,
    root: DataRoot,
    target: Path,
    chosen: dict[str, Any],
    force: bool,
    workers: int | None,
    estimate: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    from aerialdojo_gen.benchmark.agents.goal import Sensors
    from aerialdojo_gen.exchange.learning_export import estimate_for_learning, export_for_learning
    from aerialdojo_gen.exchange.samples import ExportOptions
    from aerialdojo_gen.pipeline.progress import Reporter

    width, height = chosen.pop("size", (128, 128))
    sensors = Sensors(tuple(chosen.pop("views", ("front",))), True, chosen.pop("depth", True), width, height)
    lists = {name: tuple(value) for name, value in chosen.items() if isinstance(value, list)}
    request = ExportOptions(sensors=sensors, **{**chosen, **lists})
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
    _print_export(target, made.counts, asdict(made), as_json, quiet)


@app.command("import-benchmark")
def import_benchmark(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Task files; aerialdojo: also a folder.")],
    form: Annotated[str, typer.Option("--format", help="aerialdojo, uav-on, cityavos, aerialvln or openfly.")],
    data: options.Data = "data",
    frame: Annotated[
        str | None,
        typer.Option(help="Axes of cityavos and openfly: enu, nwu, ned or esd (east, south, down)."),
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
    revision: Annotated[str | None, typer.Option("--revision", help="Branch to write to.  (default: main)")] = None,
    meshes: Annotated[bool, typer.Option("--meshes", help="Upload scene meshes too; evaluate needs them.")] = False,
    policy: Annotated[
        list[str] | None,
        typer.Option(
            "--policy", metavar="NAME", help="Upload the weights of this training too, such as imitation; repeatable."
        ),
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
    revision: Annotated[
        str | None, typer.Option("--revision", help="Branch, tag or commit.  (default: main)")
    ] = None,
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
