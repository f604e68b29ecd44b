"""Commands that make scenes of real places: maps and height models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.common import advice

if TYPE_CHECKING:
    from aerialdojo_gen.imports.places import Place

app = typer.Typer()

Project = Annotated[Path, typer.Option(help="Folder for your scenes and their pipeline.")]
Cell = Annotated[
    float | None, typer.Option(help="Distance of the ground's heights, metres.  (default: the model's own)")
]
Ceiling = Annotated[float | None, typer.Option(help="Highest z to fly at, metres.  (default: a little over all)")]
Seed = Annotated[int, typer.Option(min=0, help="Of what is added by rule.")]
Attribution = Annotated[str, typer.Option(help="Whose heights they are, for the card.")]
Force = Annotated[bool, typer.Option("--force", help="Replace a scene of this name.")]


@app.command("add-map")
def add_map(
    name: Annotated[str, typer.Argument(help="Name of the scene; of several, what their names begin with.")],
    extract: Annotated[Path, typer.Argument(help="Extract of OpenStreetMap: .osm.pbf or .osm.")],
    bbox: Annotated[list[str], typer.Option(help="WEST,SOUTH,EAST,NORTH in degrees; repeatable, a scene each.")],
    tiles: Annotated[float | None, typer.Option(help="Cut every box into squares of so many metres.")] = None,
    dem: Annotated[Path | None, typer.Option(help="Height model that the ground is of: .tif, .asc or .npz.")] = None,
    cell: Cell = None,
    drive_on: Annotated[str, typer.Option(help="Side of the street that is driven on: right or left.")] = "right",
    attribution: Attribution = "",
    ceiling: Ceiling = None,
    seed: Seed = 0,
    project: Project = Path("my-scenes"),
    force: Force = False,
) -> None:
    """Make scenes of a map: streets, buildings and what stands about them."""
    from aerialdojo_gen.imports import places

    added = places.add_map(
        name, extract, project, bbox=[_box(text) for text in bbox], tile_m=tiles, dem=dem, cell_m=cell,
        attribution=attribution, seed=seed, ceiling_m=ceiling, drive_on=drive_on, force=force,
    )  # fmt: skip
    _say(added, project)


@app.command("add-terrain")
def add_terrain(
    name: Annotated[str, typer.Argument(help="Name of the scene; the suffix _1 makes it out-of-distribution.")],
    dem: Annotated[Path, typer.Argument(help="Height model: .tif (GeoTIFF), .asc or .npz.")],
    bbox: Annotated[str | None, typer.Option(help="Part of it: WEST,SOUTH,EAST,NORTH in degrees.")] = None,
    size: Annotated[tuple[float, float] | None, typer.Option(help="Extent about the middle: x y, metres.")] = None,
    cell: Cell = None,
    water: Annotated[
        float | None, typer.Option(help="There is water up to this height, metres as in the model.")
    ] = None,
    sand: Annotated[float | None, typer.Option(help="There is sand up to this height.")] = None,
    snow: Annotated[float | None, typer.Option(help="There is snow from this height on.")] = None,
    bare: Annotated[bool, typer.Option("--bare", help="Nothing grows or lies about.")] = False,
    attribution: Attribution = "",
    ceiling: Ceiling = None,
    seed: Seed = 0,
    project: Project = Path("my-scenes"),
    force: Force = False,
) -> None:
    """Make open country of a height model."""
    from aerialdojo_gen.imports import places

    added = places.add_terrain(
        name, dem, project, bbox=None if bbox is None else _box(bbox), size_m=size, cell_m=cell, water_m=water,
        snow_m=snow, sand_m=sand, bare=bare, attribution=attribution, seed=seed, ceiling_m=ceiling, force=force,
    )  # fmt: skip
    _say([added], project)


def _box(text: str) -> tuple[float, float, float, float]:
    try:
        west, south, east, north = (float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise typer.BadParameter(
            f"--bbox {text[:60]!r}: must be WEST,SOUTH,EAST,NORTH, four numbers in degrees"
        ) from None
    return west, south, east, north


def _say(added: list[Place], project: Path) -> None:
    for place in added:
        size = place.scene.bounds[1] - place.scene.bounds[0]
        print(
            f"{place.name}: {len(place.scene.instances):,} instances, {place.scene.n_triangles:,} triangles, "
            f"{size[0]:.0f} x {size[1]:.0f} m, ceiling {place.scene.ceiling_m:.0f} m"
        )
        for line in place.said:
            print(f"  {line}")
    first = added[0]
    print(f"next: {advice.command('annotate-draft', first.name, pipeline=first.pipeline)}")
    print(f"then: {advice.command('run', first.pipeline, data=project / 'data')}")
