"""A forest with a lived-in heart: a cabin, a camp, a fire tower, a pond, a ruin, and paths between them.

Everything worth searching for stands within about 22 m of the origin, at many heights; the wood goes on around it to
the borders. The plan is fixed, the wood, the ground and the small things follow the recipe's seed and parameters. A
recipe that sets out groups of its own gets another forest, a birch wood along a creek (`birchwood`).
"""

from __future__ import annotations

from typing import Annotated

import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_scatter import place_along, smooth_path
from aerialdojo_gen.scenes.ground import disc, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import Spot, Thing, blob, keep_clear, place_near
from aerialdojo_gen.scenes.layouts.natural.forest.birchwood import BirchWood, build_birch_wood
from aerialdojo_gen.scenes.layouts.natural.forest.forest_things import (
    APIARY,
    CABIN,
    CAMP,
    CROSSROADS,
    PICNIC,
    POND_SIDE,
    RUIN,
    STRAYS,
    TOWER,
)
from aerialdojo_gen.scenes.layouts.natural.parts.woods import Species, near, patches, plant, strew
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound, rolling_terrain

_SPOTS = {
    "cabin": Spot(-11.0, 10.0, -48.0, "by the log cabin"),
    "tower": Spot(10.5, 14.5, -110.0, "on the fire tower's knoll"),
    "camp": Spot(-8.0, -15.5, 70.0, "at the camp site"),
    "picnic": Spot(15.5, 2.5, 165.0, "at the picnic place"),
    "pond": Spot(13.0, -9.5, 120.0, "at the pond"),
    "ruin": Spot(-20.0, -3.5, 15.0, "in the ruin"),
    "apiary": Spot(-0.5, 18.5, -80.0, "in the bee yard"),
    "crossroads": Spot(1.0, 3.0, 0.0, "where the paths meet"),
}
_CLEARINGS = {"cabin": 8.0, "tower": 6.5, "camp": 7.0, "picnic": 5.5, "ruin": 6.0, "apiary": 3.5, "crossroads": 4.0}
_STREAM: list[tuple[float, float]] = [
    (-46, -7), (-34, -11), (-24, -10), (-14, -6.5), (-5, -4.5), (3, -5.5),
    (9, -8.5), (16, -9.5), (25, -7), (34, -12), (46, -10),
]  # fmt: skip
_PATHS: list[list[tuple[float, float]]] = [
    [(3, -44), (1, -30), (3.5, -20), (-0.5, -12), (-0.8, -5), (1, 3)],
    [(-0.5, -12), (-4.5, -14), (-8, -15.5)],
    [(1, 3), (-3, 5), (-6, 6)],
    [(1, 3), (4, 8), (8.5, 10)],
    [(1, 3), (8, 3.5), (14, 2.5), (28, 6), (46, 3)],
    [(1, 3), (-7, -0.5), (-14, -1.5), (-19, -3)],
    [(-6, 6), (-2, 13), (-1, 18), (-4, 29), (-2, 44)],
    [(-19, -3), (-30, 1), (-46, -1)],
]


class Parameters(BaseModel):
    """What a recipe may say of a forest.

    Attributes
    ----------
    relief_m : float
        Hills rise and fall by about this, metres.
    tree_spacing_m : float
        Least distance of trees in the densest wood, metres.
    undergrowth : float
        Factor on the number of shrubs, ferns and stones.
    birch_wood : BirchWood, optional
        A birch wood with places of its own, in place of the mixed forest.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    relief_m: Annotated[float, Field(ge=0, le=6)] = 3.2
    tree_spacing_m: Annotated[float, Field(ge=2.5, le=10)] = 3.9
    undergrowth: Annotated[float, Field(ge=0, le=3)] = 1.0
    birch_wood: BirchWood | None = None


def build(site: Site) -> None:
    """Build the forest."""
    p: Parameters = site.parameters
    if p.birch_wood:
        build_birch_wood(site, p.birch_wood, p.relief_m, p.tree_spacing_m, p.undergrowth)
        return
    stream, pond = smooth_path(_STREAM), blob(14.5, -10.0, 5.2, site.recipe.seed, 0.16)
    water = shapely.union(ribbon(stream, 2.2), pond)
    paths = [smooth_path(points) for points in _PATHS]
    clearings = {
        k: blob(_SPOTS[k].x, _SPOTS[k].y, r, site.recipe.seed + i) for i, (k, r) in enumerate(_CLEARINGS.items())
    }
    site.set_ground(_terrain(site, p, stream, pond, paths), site.material("floor", "leaf_litter"))
    _paint(site, water, paths, clearings)
    for path in paths:
        site.occupy(ribbon(path, 1.7))
    _bridge(site)
    _furnish(site)
    for area in clearings.values():
        site.occupy(area.buffer(-0.8), -100.0, 100.0)
    _water_side(site, water, pond)
    _woods(site, p, water, paths)


def _terrain(
    site: Site,
    p: Parameters,
    stream: list[tuple[float, float]],
    pond: BaseGeometry,
    paths: list[list[tuple[float, float]]],
) -> Terrain:
    ground = rolling_terrain(site.recipe.size_m, 1.6, site.recipe.seed, p.relief_m, 38.0, octaves=3)
    tower = _SPOTS["tower"]
    ground = mound(ground, (tower.x, tower.y), 13.0, 3.2)
    for path in paths:
        ground = ground.graded(path, 1.2, blend_m=3.0, smooth_m=9.0)
    for key, radius in _CLEARINGS.items():
        spot = _SPOTS[key]
        ground = ground.flattened(disc(spot.x, spot.y, radius * 0.6), blend_m=radius * 0.8)
    for t in (t for things in STRAYS.values() for t in things):
        ground = ground.flattened(Point(t.x, t.y), blend_m=2.5)
    ground = ground.graded(stream, 2.0, blend_m=4.5, smooth_m=40.0)
    level = float(ground.z(14.0, -9.8))
    ground = ground.flattened(pond.buffer(0.5), level, blend_m=4.0)
    ground = ground.lowered(ribbon(stream, 5.5), 0.8, blend_m=2.0)
    return ground.flattened(pond.buffer(-0.8), level - 0.9, blend_m=2.6)


def _paint(
    site: Site, water: BaseGeometry, paths: list[list[tuple[float, float]]], clearings: dict[str, BaseGeometry]
) -> None:
    grass, path, moss = site.material("grass", "grass"), site.material("path", "dirt"), site.material("moss", "moss")
    seed, rng = site.recipe.seed, site.rng_for("moss")
    for first, cover in ((100, site.material("clover", "grass")), (120, moss)):
        for k in range(17):
            x, y = rng.uniform((-42, -40), (42, 40))
            site.paint(blob(float(x), float(y), float(rng.uniform(2.0, 5.5)), seed + first + k, 0.5), cover)
    for i, (key, radius) in enumerate(_CLEARINGS.items()):
        fringe = blob(_SPOTS[key].x, _SPOTS[key].y, radius * 1.18, seed + 50 + i, 0.3)
        site.paint(fringe, site.material("fringe", "moss"))
    for key, area in clearings.items():
        if key != "camp":
            site.paint(area, grass)
    site.paint(clearings["camp"], site.material("camp", "meadow"))
    for k, line in enumerate(paths):
        site.paint(ribbon(line, 1.5 if k in (0, 4) else 1.2, round_ends=True), path)
    for key, radius in (("camp", 2.6), ("cabin", 2.0)):
        x, y = _SPOTS[key].world(*((0.0, 0.0) if key == "camp" else (7.0, 0.0)))
        site.paint(blob(x, y, radius, seed + 7, 0.3), path)
    shore = [water.boundary.interpolate(i / 44, normalized=True) for i in range(44)]
    wash = [blob(p.x, p.y, 1.6, seed + 200 + k, 0.4) for k, p in enumerate(shore)]
    site.paint(shapely.union_all([water.buffer(0.5, quad_segs=3), *wash]), site.material("bank", "gravel"))
    site.paint(water, site.material("water", "water"))


def _bridge(site: Site) -> None:
    x, y = -0.75, -5.0
    banks = [site.ground_z(x, y - 3.4), site.ground_z(x, y + 3.4)]
    bridge = site.place("footbridge", x, y, 90.0, z=max(banks) - 0.25, attributes={"place": "over the stream"})
    keep_clear(site, bridge, 1.5)


def _furnish(site: Site) -> None:
    groups: dict[str, tuple[Thing, ...]] = {
        "cabin": CABIN, "tower": TOWER, "camp": CAMP, "picnic": PICNIC, "pond": POND_SIDE, "ruin": RUIN,
        "apiary": APIARY, "crossroads": CROSSROADS,
    }  # fmt: skip
    for key, things in groups.items():
        place_near(site, _SPOTS[key], things)
    for place, things in STRAYS.items():
        place_near(site, Spot(0.0, 0.0, 0.0, place), things)
    corner = [_SPOTS["cabin"].world(*xy) for xy in ((-6.8, -4.5), (-6.8, 4.8), (-1.0, 7.4))]
    words = {"place": "behind the log cabin"}
    fence = place_along(site, "wooden_fence", corner, 2.4, turn_deg=90.0, variant="brown", attributes=words)
    for panel in fence:
        keep_clear(site, panel, 0.6)


def _water_side(site: Site, water: BaseGeometry, pond: BaseGeometry) -> None:
    bank = water.buffer(1.5).difference(water.buffer(0.1))
    edge = pond.buffer(0.5).difference(pond.buffer(-0.7))
    strew(site, "reed_clump", edge, 1.3, lambda _x, _y: 1.0, 11, attributes={"place": "at the pond"})
    strew(site, "boulder", bank, 3.6, lambda _x, _y: 1.0, 16, scale=0.55, attributes={"place": "beside the stream"})
    strew(site, "mossy_rock", bank, 4.0, lambda _x, _y: 1.0, 12, scale=0.6, attributes={"place": "beside the stream"})


def _woods(site: Site, p: Parameters, water: BaseGeometry, paths: list[list[tuple[float, float]]]) -> None:
    seed = site.recipe.seed
    wood = site.extent.buffer(-1.0).difference(water.buffer(0.8))
    wet, heart = near(water, 12.0), Point(0.0, 1.0)
    trail = shapely.union_all([LineString(line) for line in paths])
    glades, thicket = patches(seed + 11, 15.0, 1.0), patches(seed + 12, 9.0, 1.6)
    pines, oaks, spruces, birches = (patches(seed + k, 17.0) for k in (21, 22, 23, 24))

    def density(x: float, y: float) -> float:
        # The heart is lighter, so that a drone finds its way between the trunks and sees what stands there.
        inner = 0.62 if heart.distance(Point(x, y)) < 22.0 else 1.0
        return min(1.0, inner * min(glades(x, y), 1.3))

    def height(x: float, y: float) -> float:
        return site.ground_z(x, y)

    trees = [
        Species("spruce_tree", lambda x, y: 2.2 * spruces(x, y)),
        Species("birch_tree", lambda x, y: (0.35 + 1.6 * wet(x, y)) * birches(x, y)),
        Species("pine_tree", lambda x, y: max(0.05, 0.5 + 0.35 * height(x, y)) * pines(x, y)),
        Species("oak_tree", lambda x, y: 0.55 * (1.0 - 0.7 * wet(x, y)) * oaks(x, y), 0.7),
        Species("dead_tree", lambda _x, _y: 0.09),
    ]
    words = {"place": "in the wood"}
    plant(site, wood, p.tree_spacing_m, density, trees, words)

    def shade(x: float, y: float) -> float:
        return min(1.0, 0.5 * thicket(x, y))

    def way(x: float, y: float) -> float:
        return max(0.05, 1.0 - float(trail.distance(Point(x, y))) / 6.0)

    n = p.undergrowth
    strew(site, "fallen_log", wood, 8.0, shade, round(9 * n), attributes=words)
    strew(site, "tree_stump", wood, 7.0, shade, round(12 * n), attributes=words)
    strew(site, "boulder", wood, 6.0, shade, round(18 * n), scale=0.8, attributes=words)
    strew(site, "young_spruce", wood, 2.2, shade, round(34 * n), attributes=words)
    strew(site, "sapling", wood, 4.5, shade, round(12 * n), attributes=words)
    strew(site, "bush", wood, 3.6, shade, round(26 * n), params={"berries": 3}, attributes=words)
    strew(site, "fern", wood, 1.5, shade, round(130 * n), attributes=words)
    strew(site, "wildflowers", wood, 3.0, way, round(7 * n), attributes={"place": "beside a path"})
    strew(site, "mushroom_cluster", wood, 7.0, shade, round(2 * n), scale=0.6, attributes=words)
