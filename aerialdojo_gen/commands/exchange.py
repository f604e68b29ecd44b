"""Commands that bring tasks into and out of the formats of other benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.commands.common import Data, Quiet, Scene, Scenes, together

app = typer.Typer()


@app.command("export")
def export(
    form: Annotated[str, typer.Option("--format", help="aerialdojo or habitat.")],
    scenes: Scenes = None,
    data: Data = "data",
    out: Annotated[Path | None, typer.Option("--out", help="Folder to make.  (default: DATA/exports/FORMAT)")] = None,
    scene: Scene = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export there.")] = False,
    picture_size: Annotated[
        int | None,
        typer.Option(
            help="Pixels of aerialdojo's pictures, drawn from the meshes; 0: the release's own.  (default: 640)"
        ),
    ] = None,
    shards: Annotated[
        bool, typer.Option("--shards", help="One tar a scene in place of aerialdojo's file a trajectory.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write the release in the layout of AerialDojo's authors, or as Habitat's ObjectNav-v1."""
    from aerialdojo_gen.errors import UsageError
    from aerialdojo_gen.exchange.exporting import export_release
    from aerialdojo_gen.pipeline.progress import Reporter
    from aerialdojo_gen.store.root import LocalRoot, open_root

    root = open_root(data)
    if out is None and not isinstance(root, LocalRoot):
        raise UsageError("an export is a folder of this machine: name it with --out")
    target = out or Path(root.at(f"exports/{form}"))
    counts = export_release(
        form, root, target, together(scenes, scene), force=force, picture_px=picture_size, shards=shards,
        reporter=Reporter(quiet=quiet),
    )  # fmt: skip
    print(f"{target}: " + ", ".join(f"{n:,} {name}" for name, n in counts.items()))


@app.command("import-benchmark")
def import_benchmark(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Task files; for aerialdojo also a folder.")],
    form: Annotated[str, typer.Option("--format", help="aerialdojo, uav-on, cityavos, aerialvln or openfly.")],
    data: Data = "data",
    frame: Annotated[
        str | None,
        typer.Option(help="Where x, y, z point, for cityavos and openfly: enu, nwu, ned or esd (east, south, down)."),
    ] = None,
    angles: Annotated[str, typer.Option(help="Unit of cityavos's yaws: radians, degrees or mixed.")] = "radians",
    images: Annotated[
        Path | None, typer.Option(help="Folder of cityavos's pictures.  (default: the file's own)")
    ] = None,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Read the goals' pictures.")] = True,
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Keep the good records of a file with bad ones.")
    ] = False,
    name: Annotated[str | None, typer.Option(help="Name of the import.  (default: the format)")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an import of that name.")] = False,
) -> None:
    """Read another benchmark's task files into tables like the release's, under DATA/imported/NAME."""
    from aerialdojo_gen.exchange import importing
    from aerialdojo_gen.store.root import open_root

    options = importing.Options(
        frame=frame, angles=angles, pictures=images, with_pictures=pictures, skip_bad=skip_bad
    )
    root = open_root(data)
    report = importing.import_benchmark(form, files, root, options, name=name, force=force)
    print("\n".join([root.at(f"imported/{name or form}"), *(f"  {line}" for line in report.lines())]))
