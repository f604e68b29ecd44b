"""``validate``: check a whole release again."""

from __future__ import annotations

import contextlib
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.base.text_table import terminal_width
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import merge_scenes, print_json
from aerialdojo_gen.dataset.build import pipeline_file

if TYPE_CHECKING:
    from aerialdojo_gen.dataset.validate.parts import Release
    from aerialdojo_gen.pipeline.progress import Reporter

app = typer.Typer()
_MANY_DIGITS = 10


@app.command("validate")
def validate(
    scenes: options.Scenes = None,
    data: options.Data = "data",
    elsewhere: Annotated[
        str | None,
        typer.Option("--release", metavar="DIR|URL", help="Another release to check.  (default: the one in --data)"),
    ] = None,
    scene: options.Scene = None,
    sample: Annotated[
        int | None, typer.Option(min=0, help="Number of routes per scene to check again with FCL.  (default: all)")
    ] = None,
    pictures: Annotated[
        str, typer.Option(metavar="N|all", help="Number of reference images per scene to render again and compare.")
    ] = "all",
    meshes: Annotated[
        Path | None, typer.Option(help="Folder of the meshes.  (default: meshes/ next to the release)")
    ] = None,
    no_meshes: Annotated[
        bool, typer.Option("--no-meshes", help="Skip the checks that need meshes; they are reported as not checked.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write every fault to a .jsonl, .json, .csv or .parquet file.")
    ] = None,
    max_faults: Annotated[int, typer.Option(min=0, help="Maximum number of faults printed per check.")] = 10,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print one line per check instead of one per table.")
    ] = False,
    pipeline: options.PipelineFile = None,
    workers: options.Workers = None,
    executor: options.ExecutorName = "local",
    address: options.Address = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Check a release independently, from its Parquet files and meshes, and name every faulty row."""
    from aerialdojo_gen.base.config.pipeline import load_pipeline
    from aerialdojo_gen.dataset import validate as validation
    from aerialdojo_gen.dataset.build import release_pipeline
    from aerialdojo_gen.dataset.provenance import pipeline_names
    from aerialdojo_gen.dataset.validate.parts import release_of
    from aerialdojo_gen.dataset.validate.report import check_format
    from aerialdojo_gen.pipeline.progress import Reporter

    for name in scenes or ():
        if "/" in name or Path(name).is_dir():
            raise UsageError(f"{name} is no scene: name another release with --release {shlex.quote(name)}")
    if report is not None:
        check_format(report)
    if pictures != "all" and not (pictures.isascii() and pictures.isdigit() and len(pictures) < _MANY_DIGITS):
        raise UsageError(f"--pictures {pictures}: a number, or all")
    release = release_of(elsewhere or data)
    file = pipeline or release_pipeline(release.root, release.folder, reads=True)
    definitions = load_pipeline(pipeline_file(file))
    if definitions.scene_assets is None:
        definitions = definitions.model_copy(update={"scene_assets": home() / "scene_assets"})
    requested = validation.ValidationOptions(
        release=release,
        scenes=tuple(merge_scenes(scenes, scene) or ()),
        meshes=meshes.absolute() if meshes else None,
        use_meshes=not no_meshes,
        sample=sample,
        pictures=None if pictures == "all" else int(pictures),
        pipeline=definitions,
    )
    reporter = Reporter(quiet=quiet)
    names = pipeline_names(release.root, release.folder)
    if names and definitions.name not in names:
        is_of = f"which is --pipeline {' or '.join(names)}: {definitions.name}"
        reporter.line(f"not the pipeline of the release, {is_of}")
    _name_orphans(release, reporter)
    outcome = validation.validate(requested, workers=workers, executor=executor, address=address, reporter=reporter)
    if report is not None:
        validation.write_report(outcome.faults, report)
    if as_json:
        print_json(outcome.as_json())
    else:
        if not quiet:
            print("\n".join(outcome.table_lines(terminal_width(), verbose=verbose)))
        print("\n".join([*outcome.fault_lines(max_faults), outcome.verdict()]))
    if outcome.faults:
        raise SystemExit(1)


def _name_orphans(release: Release, reporter: Reporter) -> None:
    """Warn of recordings beside the release whose trajectories it does not have."""
    from aerialdojo_gen.dataset.contents import orphan_recordings

    # Of a release that stands alone nobody knows the recordings; a damaged part is a fault that the checks name.
    with contextlib.suppress(StoreError):
        if release.folder and (gone := orphan_recordings(release.root)):
            hint = command("render", "--prune", data=release.root.url)
            reporter.line(
                f"media/ has {len(gone):,} recordings of trajectories that the release does not have: {hint}"
            )
