"""A desert: a sand sea or a canyon, layered rocks, tracks, an oasis, mud-brick houses, ruins, and people's camps.

The recipe says what stands where; the layout shapes the ground, makes room, and grows what grows in dry country.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import shapely
from pydantic import BaseModel, ConfigDict, Field, model_validator
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.natural.desert.mudbrick import House, Wall, build_house, build_wall, wall_area
from aerialdojo_gen.scenes.layouts.natural.desert.sands import dunes, wash
from aerialdojo_gen.scenes.layouts.natural.parts.groups import (
    Deck,
    Group,
    Planned,
    gentle,
    level_ground,
    plan_groups,
    set_out,
)
from aerialdojo_gen.scenes.layouts.natural.parts.strata import Rock, put_up, raise_foot
from aerialdojo_gen.scenes.layouts.natural.parts.woods import near, strew
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound
from aerialdojo_gen.scenes.values import At, Degrees, Hill, Length, Line, LineOrNone, Size2, Step

_CELL_M = 1.4


class Pond(BaseModel):
    """The water of an oasis: its middle and mean radius, metres, and how much lower than the ground it lies."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: At
    radius_m: Length
    green_m: Annotated[float, Field(ge=0, le=500)] = 5.0
    palms: Annotated[int, Field(ge=0, le=1000)] = 24


class Crop(BaseModel):
    """A field in rows: middle, extent along x and y, metres, and the number of rows."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: At
    size_m: Size2
    rows: Annotated[int, Field(ge=1, le=1000)] = 6


class Parameters(BaseModel):
    """What a recipe may say of a desert.

    Attributes
    ----------
    ground : str
        ``"dunes"``, or ``"wash"``: a dry river bed between steps.
    height_m, wavelength_m, wind_deg : float
        Of the dunes; of a wash, the first is the roughness of its banks.
    hills : tuple of (x, y, radius, rise)
        Swells of the ground under it all, or hollows, metres.
    bed : points
        Middle line of the dry river, metres; dunes have none.
    bed_m : float
        Width of that bed, metres.
    steps : tuple of (from, to, rise)
        How the ground climbs away from the bed, metres.
    tracks : tuple of points
        Middle lines of tracks, metres.
    pond, crops, rocks, houses, walls, groups
        What stands where.
    stones, shrubs, trees : int
        How many are strewn.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    ground: Literal["dunes", "wash"] = "dunes"
    height_m: Annotated[float, Field(ge=0, le=9)] = 4.0
    wavelength_m: Annotated[float, Field(ge=8, le=80)] = 24.0
    wind_deg: Degrees = 20.0
    hills: tuple[Hill, ...] = ()
    bed: LineOrNone = ()
    bed_m: Annotated[float, Field(ge=1, le=30)] = 7.0
    steps: tuple[Step, ...] = ()
    tracks: tuple[Line, ...] = ()
    track_m: Annotated[float, Field(ge=1, le=8)] = 3.2
    pond: Pond | None = None
    crops: tuple[Crop, ...] = ()
    rocks: tuple[Rock, ...] = ()
    houses: tuple[House, ...] = ()
    walls: tuple[Wall, ...] = ()
    groups: tuple[Group, ...] = ()
    stones: Annotated[int, Field(ge=0, le=1000)] = 40
    shrubs: Annotated[int, Field(ge=0, le=1000)] = 30
    trees: Annotated[int, Field(ge=0, le=1000)] = 6

    @model_validator(mode="after")
    def _wash_has_a_bed(self) -> Self:
        if self.ground == "wash" and not self.bed:
            raise ValueError("a wash needs the middle line of its bed: bed = [[x, y], ...]")
        return self


def build(site: Site) -> None:
    """Build the desert."""
    p: Parameters = site.parameters
    seed = site.recipe.seed
    tracks = [smooth_path(path) for path in p.tracks]
    water = blob(*p.pond.at, p.pond.radius_m, seed, 0.2) if p.pond else shapely.Polygon()
    rocks = {r.name: r.area(seed) for r in p.rocks}
    crops = [rectangle(c.at[0] - c.size_m[0] / 2, c.at[1] - c.size_m[1] / 2, c.at[0] + c.size_m[0] / 2,
                       c.at[1] + c.size_m[1] / 2) for c in p.crops]  # fmt: skip
    ground = _ground(site, p, tracks, rocks, crops)
    taken = [*rocks.values(), *(h.area().buffer(1.2) for h in p.houses), *map(wall_area, p.walls),
             *(ribbon(t, p.track_m) for t in tracks), water.buffer(0.6)]  # fmt: skip
    tops = {r.name: r.top(seed) for r in p.rocks} | {h.name: h.roof() for h in p.houses}
    planned = plan_groups(site, p.groups, taken, tops, lambda x, y: float(ground.z(x, y)))
    ground = level_ground(ground, planned)
    for house in p.houses:
        ground = ground.flattened(house.area(), blend_m=3.0)
    if p.pond:
        level = float(ground.z(*p.pond.at))
        ground = ground.flattened(water.buffer(0.6), level, blend_m=4.0)
        ground = ground.flattened(water.buffer(-1.2), level - 0.5, blend_m=1.5)
    site.set_ground(ground, site.material("sand", "sand"))
    _paint(site, p, tracks, rocks, crops, water)
    decks: dict[str, Deck] = {}
    bands = tuple(site.material(f"band_{k}", "rock:#c07a48") for k in range(3))
    for rock in p.rocks:
        decks[rock.name] = put_up(site, rock, bands)
    for house in p.houses:
        decks[house.name] = build_house(site, house)
    for k, wall in enumerate(p.walls):
        build_wall(site, wall, site.material("ruin", "blocks:#c9a872"), k)
    set_out(site, planned, decks)
    _grow(site, p, tracks, water, planned)


def _ground(
    site: Site,
    p: Parameters,
    tracks: list[list[tuple[float, float]]],
    rocks: dict[str, shapely.Polygon],
    crops: list[shapely.Polygon],
) -> Terrain:
    size, seed = site.recipe.size_m, site.recipe.seed
    if p.ground == "dunes":
        ground = dunes(size, _CELL_M, seed, p.height_m, p.wavelength_m, p.wind_deg)
    else:
        ground = wash(size, _CELL_M, seed, p.bed, p.steps, p.height_m)
    for x, y, radius, rise in p.hills:
        ground = mound(ground, (x, y), radius, rise)
    for area in rocks.values():
        ground = raise_foot(ground, area, 0.9, 4.0)
    for crop in crops:
        ground = ground.flattened(crop, blend_m=3.0)
    if p.pond:
        ground = ground.flattened(disc(*p.pond.at, p.pond.radius_m + 1.5), blend_m=p.pond.green_m + 3.0)
    for track in tracks:
        ground = ground.graded(track, p.track_m * 0.7, blend_m=3.5, smooth_m=10.0)
    return ground


def _paint(
    site: Site,
    p: Parameters,
    tracks: list[list[tuple[float, float]]],
    rocks: dict[str, shapely.Polygon],
    crops: list[shapely.Polygon],
    water: BaseGeometry,
) -> None:
    seed, rng = site.recipe.seed, site.rng_for("patches")
    half = [s / 2 for s in site.recipe.size_m]
    for k in range(26):
        x, y = float(rng.uniform(-half[0], half[0])), float(rng.uniform(-half[1], half[1]))
        patch = "patch_a" if k % 2 else "patch_b"
        site.paint(
            blob(x, y, float(rng.uniform(2.5, 7.0)), seed + 300 + k, 0.55), site.material(patch, "sand:#cdb07c")
        )
    if p.bed:
        bed = smooth_path(p.bed)
        site.paint(ribbon(bed, p.bed_m), site.material("bed", "gravel:#c9a883"))
        site.paint(ribbon(bed, p.bed_m * 0.45), site.material("bed_sand", "sand:#d9c09a"))
    for area in rocks.values():
        scree = shapely.union_all([area.buffer(1.1), *(blob(float(x), float(y), 1.5, seed + k, 0.4)
                                   for k, (x, y) in enumerate(shapely.get_coordinates(area)[::3]))])  # fmt: skip
        site.paint(scree, site.material("scree", "gravel:#b98c5c"))
    for track in tracks:
        site.paint(ribbon(track, p.track_m, round_ends=True), site.material("track", "dirt:#b39468"))
        for side in (-0.75, 0.75):
            rut = LineString(track).offset_curve(side).buffer(0.22, cap_style="flat", quad_segs=2)
            site.paint(rut, site.material("rut", "dirt:#9c7f58"))
    for group in p.groups:
        if group.level and not group.on:
            trodden = blob(*group.at, group.radius_m * 0.75, seed + len(group.name), 0.3)
            site.paint(trodden.difference(water), site.material("trodden", "dirt:#c2a473"))
    if p.pond:
        green = blob(*p.pond.at, p.pond.radius_m + p.pond.green_m, seed + 3, 0.3)
        site.paint(green, site.material("fringe", "meadow:#a89c58"))
        site.paint(
            blob(*p.pond.at, p.pond.radius_m + p.pond.green_m * 0.6, seed + 4, 0.25),
            site.material("grass", "grass:#7f9148"),
        )
        site.paint(water.buffer(0.5), site.material("bank", "mud:#8a7650"))
        site.paint(water, site.material("water", "water"))
    for crop, area in zip(p.crops, crops, strict=True):
        x0, y0, x1, y1 = area.bounds
        site.paint(area, site.material("soil", "dirt:#7d6244"))
        step = (y1 - y0) / crop.rows
        for k in range(crop.rows):
            y = y0 + step * (k + 0.5)
            site.paint(
                rectangle(x0 + 0.4, y - step * 0.25, x1 - 0.4, y + step * 0.25),
                site.material("crop", "grass:#6f8f3c"),
            )


def _grow(
    site: Site, p: Parameters, tracks: list[list[tuple[float, float]]], water: BaseGeometry, planned: list[Planned]
) -> None:
    """Grow palms round the water, shrubs where a little of it is, and strew stones at the rocks' feet."""
    for track in tracks:
        site.occupy(ribbon(track, p.track_m))
    if not water.is_empty:
        site.occupy(water.buffer(0.2))
    open_ = site.extent.buffer(-1.5)
    rocks = shapely.union_all([r.area(site.recipe.seed) for r in p.rocks])
    foot = near(rocks, 7.0)

    if p.pond:
        shore = water.buffer(p.pond.green_m * 0.9).difference(water.buffer(0.6))
        strew(site, "palm_tree", shore, 2.6, lambda _x, _y: 1.0, p.pond.palms, attributes={"place": "at the oasis"})
        edge = water.buffer(0.5).difference(water.buffer(-0.5))
        strew(
            site,
            "reed_clump",
            edge,
            1.3,
            lambda _x, _y: 0.8,
            p.pond.palms,
            attributes={"place": "at the oasis"},
            solid=False,
        )
        strew(
            site,
            "bush",
            shore,
            2.2,
            lambda _x, _y: 0.7,
            p.pond.palms // 2,
            params={"berries": 3},
            attributes={"place": "at the oasis"},
        )
    sandstone = {
        "rock": site.material("boulder", "rock:#b98c5c"),
        "top": site.material("boulder_top", "rock:#c49a68"),
    }
    strew(site, "acacia_tree", open_, 11.0, lambda _x, _y: 0.7, p.trees)
    strew(
        site,
        "boulder",
        open_,
        2.4,
        lambda x, y: (0.03 + foot(x, y)) * gentle(site, x, y),
        p.stones,
        variant="sandstone",
        roles=sandstone,
    )
    dry = {"leaves": site.material("shrub", "foliage:#9a9458")}
    thirsty = near(shapely.union_all([Point(q.x, q.y) for q in planned]) if planned else Point(0, 0), 16.0)
    strew(
        site,
        "bush",
        open_,
        4.0,
        lambda x, y: 0.1 + 0.5 * thirsty(x, y),
        p.shrubs,
        scale=0.6,
        roles=dry,
        params={"berries": 0},
        attributes={"pattern": "dry leaves"},
    )
    strew(
        site,
        "grass_tuft",
        open_,
        2.4,
        lambda x, y: 0.15 + 0.5 * foot(x, y),
        p.shrubs,
    )
