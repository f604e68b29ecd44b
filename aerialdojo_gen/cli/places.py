"""Commands that make scenes of real places: maps and height models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import print_next, print_scene

if TYPE_CHECKING:
    from aerialdojo_gen.imports.places import AddedPlace

app = typer.Typer()

Project = Annotated[Path, typer.Option(help="Folder for your scenes and their pipeline.")]
Cell = Annotated[
    float | None, typer.Option(help="Grid spacing of the ground, metres.  (default: that of the height model)")
]
Ceiling = Annotated[
    float | None, typer.Option(help="Maximum flying height z, metres.  (default: a little above the highest point)")
]
Seed = Annotated[int, typer.Option(min=0, help="Seed for procedurally added objects.")]
Attribution = Annotated[str, typer.Option(help="Attribution of the height data, for the dataset card.")]
Force = Annotated[bool, typer.Option("--force", help="Replace a scene of this name.")]


@app.command("add-map")
def add_map(
    name: Annotated[str, typer.Argument(help="Name of the scene; the prefix of the names if there are several.")],
    extract: Annotated[Path, typer.Argument(help="OpenStreetMap extract: .osm.pbf or .osm.")],
    bbox: Annotated[list[str], typer.Option(help="WEST,SOUTH,EAST,NORTH in degrees; repeatable, one scene each.")],
    tiles: Annotated[
        float | None, typer.Option(help="Cut every box into squares of this edge length, metres.")
    ] = None,
    dem: Annotated[Path | None, typer.Option(help="Height model for the ground: .tif, .asc or .npz.")] = None,
    cell: Cell = None,
    drive_on: Annotated[str, typer.Option(help="Side of the road that traffic drives on: right or left.")] = "right",
    attribution: Attribution = "",
    ceiling: Ceiling = None,
    seed: Seed = 0,
    project: Project = Path("my-scenes"),
    force: Force = False,
) -> None:
    """Make scenes from a map: streets, buildings, trees and street furniture."""
    from aerialdojo_gen.imports import places
    from aerialdojo_gen.imports.map_plan import TownOptions

    options = TownOptions(cell, attribution, seed, ceiling, drive_on)
    boxes = [_box(text) for text in bbox]
    added = places.add_map(name, extract, project, boxes, options, tile_m=tiles, dem=dem, force=force)
    _print_scenes(added, project)


@app.command("add-terrain")
def add_terrain(
    name: Annotated[str, typer.Argument(help="Name of the scene; with the suffix _1 it is out-of-distribution.")],
    dem: Annotated[Path, typer.Argument(help="Height model: .tif (GeoTIFF), .asc or .npz.")],
    bbox: Annotated[
        str | None, typer.Option(help="Part of the model to use: WEST,SOUTH,EAST,NORTH in degrees.")
    ] = None,
    size: Annotated[
        tuple[float, float] | None, typer.Option(help="Size of the part to use around the centre: x y, metres.")
    ] = None,
    cell: Cell = None,
    water: Annotated[
        float | None, typer.Option(help="Water up to this height, metres in the model's heights.")
    ] = None,
    sand: Annotated[float | None, typer.Option(help="Sand up to this height, metres.")] = None,
    snow: Annotated[float | None, typer.Option(help="Snow above this height, metres.")] = None,
    bare: Annotated[bool, typer.Option("--bare", help="Add no plants, rocks or other objects.")] = False,
    attribution: Attribution = "",
    ceiling: Ceiling = None,
    seed: Seed = 0,
    project: Project = Path("my-scenes"),
    force: Force = False,
) -> None:
    """Make an open landscape from a height model."""
    from aerialdojo_gen.imports import places
    from aerialdojo_gen.imports.relief import ReliefOptions

    box = None if bbox is None else _box(bbox)
    options = ReliefOptions(box, size, cell, water, sand, snow, bare, seed, ceiling, attribution)
    _print_scenes([places.add_terrain(name, dem, project, options, force=force)], project)


@app.command("vary")
def vary(
    types: Annotated[list[str], typer.Argument(help="Scene types or globs: U_ParkingLot, 'U_*'.")],
    seeds: Annotated[
        str, typer.Option(help="FIRST:END; 0 to 199 are test worlds, 200 to 999 validation, from 1000 training.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the plans, annotations and pipeline.")],
    knob: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Set a quantity that is drawn otherwise; repeatable."),
    ] = None,
    held_out: Annotated[
        bool, typer.Option("--held-out", help="Use the topologies, palettes and things that no other world has.")
    ] = False,
    objects: Annotated[int, typer.Option(min=2, max=500, help="Maximum annotated objects of a world.")] = 40,
    workers: options.Workers = None, executor: options.ExecutorName = "local", address: options.Address = None,
    quiet: options.Quiet = False,
) -> None:  # fmt: skip
    """Make worlds of a scene type from seeds: plans to read and edit, with annotations."""
    from aerialdojo_gen.dataset.build import default_workers
    from aerialdojo_gen.imports import worlds
    from aerialdojo_gen.pipeline.progress import Reporter

    options = worlds.VaryOptions(dict(_knob(one) for one in knob or ()), held_out, objects)
    chosen = _seeds(seeds)
    reporter = Reporter(quiet=quiet)
    with reporter.bar("vary", worlds.count(types, chosen), unit="worlds") as bar:
        done = worlds.vary(
            types, chosen, out, options, workers=workers or (default_workers() if executor == "local" else None),
            executor=executor, address=address, on_done=lambda _: bar.advance(),
        )  # fmt: skip
    made, refused = sum(one.made for one in done), sum(len(one.refused) for one in done)
    kept = f", {len(done) - made:,} there already" if made < len(done) else ""
    print(f"{out}: {made:,} worlds made{kept}, {refused:,} draws refused ({out / worlds.DRAWS})")
    print(f"next: {cli_context.command('run', out / 'pipeline.toml', data=out / 'data')}")


def _seeds(text: str) -> range:
    first, _, end = text.partition(":")
    if not (first.isdecimal() and (end or first).isdecimal()):
        raise typer.BadParameter(f"--seeds {text[:60]!r}: expected FIRST:END, two whole numbers, such as 1000:1010")
    return range(int(first), int(end) if end else int(first) + 1)


def _knob(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise typer.BadParameter(f"--knob {text[:60]!r}: expected NAME=NUMBER, such as storeys=3") from None


def _box(text: str) -> tuple[float, float, float, float]:
    try:
        west, south, east, north = (float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise typer.BadParameter(
            f"--bbox {text[:60]!r}: must be WEST,SOUTH,EAST,NORTH, four numbers in degrees"
        ) from None
    return west, south, east, north


def _print_scenes(added: list[AddedPlace], project: Path) -> None:
    for place in added:
        print_scene(place.scene, place.notes)
    print_next(added[0].name, added[0].pipeline, project)
