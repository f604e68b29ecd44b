"""A birch wood in autumn: a creek in its ravine, a ruined abbey, footpaths, and places that a recipe sets out."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import wall_with_openings
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab, smooth_path
from aerialdojo_gen.scenes.ground import ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob, keep_clear
from aerialdojo_gen.scenes.layouts.natural.parts.groups import Group, level_ground, plan_groups, set_out
from aerialdojo_gen.scenes.layouts.natural.parts.woods import Species, near, patches, plant, strew
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound, rolling_terrain
from aerialdojo_gen.scenes.values import Bridge, Degrees, Hill, Line, Metres

_CELL_M = 1.7
_WALL_M = 0.7

# The abbey's walls in its own frame: from, to, height at both ends, and openings (from, to, sill, head).
_ABBEY: list[tuple[tuple[float, float], tuple[float, float], float, list[tuple[float, float, float, float]]]] = [
    ((-7.0, -4.5), (-1.5, -4.5), 5.2, [(1.2, 2.3, 1.2, 3.9), (3.6, 4.7, 1.2, 3.9)]),
    ((-1.5, -4.5), (2.0, -4.5), 2.4, [(0.9, 2.2, 0.0, 2.1)]),
    ((4.4, -4.5), (7.0, -4.5), 1.3, []),
    ((7.0, -4.5), (7.0, 4.5), 6.4, [(1.2, 2.4, 1.4, 4.6), (3.5, 5.5, 0.8, 5.3), (6.6, 7.8, 1.4, 4.6)]),
    ((7.0, 4.5), (1.0, 4.5), 3.6, [(1.4, 2.5, 1.2, 3.2), (3.7, 4.8, 1.2, 3.2)]),
    ((-2.2, 4.5), (-7.0, 4.5), 1.6, []),
    ((-7.0, 4.5), (-7.0, 1.6), 4.4, []),
    ((-7.0, -1.6), (-7.0, -4.5), 4.8, []),
]


class BirchWood(BaseModel):
    """What a recipe may say of a birch wood.

    Attributes
    ----------
    creek : points
        Its middle line, metres; the water is `creek_m` wide and lies `ravine_m` below its banks.
    paths : tuple of points
        Middle lines of footpaths, metres.
    hills : tuple of (x, y, radius, rise)
        Swells and hollows of the ground, metres.
    bridges : tuple of (x, y, yaw, span)
        Footbridges, metres and degrees.
    abbey : (x, y, yaw) or None
        Where the ruined abbey stands.
    groups : tuple of Group
        What else stands where.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    creek: Line
    creek_m: Annotated[float, Field(gt=0, le=8)] = 2.4
    ravine_m: Annotated[float, Field(ge=0, le=5)] = 1.8
    paths: tuple[Line, ...] = ()
    hills: tuple[Hill, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    abbey: tuple[Metres, Metres, Degrees] | None = None
    groups: tuple[Group, ...] = ()


def build_birch_wood(site: Site, p: BirchWood, relief_m: float, spacing_m: float, undergrowth: float) -> None:
    """Build the wood.

    Parameters
    ----------
    site : Site
        Empty.
    p : BirchWood
        What stands where.
    relief_m, spacing_m : float
        Height of the hills, and least distance of trees where they stand closest, metres.
    undergrowth : float
        Factor on the number of shrubs, ferns and stones.
    """
    creek, paths = smooth_path(p.creek), [smooth_path(path) for path in p.paths]
    water = ribbon(creek, p.creek_m)
    abbey = _abbey_area(p)
    ground = _ground(site, p, relief_m, creek, paths)
    bridges = [LineString(_bridge_ends(*b)).buffer(1.6) for b in p.bridges]
    taken = [water.buffer(1.2), *(ribbon(path, 1.6) for path in paths), *bridges, *_abbey_walls(p)]
    planned = plan_groups(site, p.groups, taken, {}, lambda x, y: float(ground.z(x, y)))
    ground = level_ground(ground, planned)
    if p.abbey:
        ground = ground.flattened(abbey.buffer(1.0), blend_m=5.0)
    site.set_ground(ground, site.material("floor", "leaf_litter"))
    _paint(site, p, water, paths, abbey)
    for path in paths:
        site.occupy(ribbon(path, 1.7))
    if p.abbey:
        _abbey(site, p)
    for x, y, yaw, span in p.bridges:
        ends = _bridge_ends(x, y, yaw, span)
        z = max(site.ground_z(*end) for end in ends) - 0.28
        words = {"place": "over the creek"}
        keep_clear(site, site.place("footbridge", x, y, yaw, z=z, params={"span": span}, attributes=words), 1.6)
    set_out(site, planned, {}, 1.4)
    for group in p.groups:
        if group.level:
            site.occupy(Point(*group.at).buffer(group.radius_m * 0.85))
    _woods(site, water, paths, abbey, spacing_m, undergrowth)


def _bridge_ends(x: float, y: float, yaw_deg: float, span: float) -> list[tuple[float, float]]:
    frame = Frame(x, y, yaw_deg)
    return [frame.at(-span / 2, 0.0), frame.at(span / 2, 0.0)]


def _ground(
    site: Site,
    p: BirchWood,
    relief_m: float,
    creek: list[tuple[float, float]],
    paths: list[list[tuple[float, float]]],
) -> Terrain:
    ground = rolling_terrain(site.recipe.size_m, _CELL_M, site.recipe.seed, relief_m, 40.0, octaves=3)
    for x, y, radius, rise in p.hills:
        ground = mound(ground, (x, y), radius, rise)
    for path in paths:
        ground = ground.graded(path, 1.2, blend_m=3.0, smooth_m=10.0)
    ground = ground.graded(creek, p.creek_m + 3.0, blend_m=5.0, smooth_m=40.0)
    return ground.lowered(ribbon(creek, p.creek_m + 5.0), p.ravine_m, blend_m=2.4)


def _paint(
    site: Site, p: BirchWood, water: BaseGeometry, paths: list[list[tuple[float, float]]], abbey: BaseGeometry
) -> None:
    seed, rng = site.recipe.seed, site.rng_for("patches")
    half = [s / 2 for s in site.recipe.size_m]
    covers = (("gold", "leaf_litter:#b98f3f"), ("moss", "moss:#7a7a3c"), ("heath", "meadow:#8f7f4a"))
    for k in range(48):
        x, y = float(rng.uniform(-half[0], half[0])), float(rng.uniform(-half[1], half[1]))
        site.paint(blob(x, y, float(rng.uniform(2.0, 6.0)), seed + 300 + k, 0.55), site.material(*covers[k % 3]))
    if not abbey.is_empty:
        site.paint(abbey.buffer(2.6), site.material("meadow", "meadow:#8c8c4c"))
        site.paint(abbey.buffer(-_WALL_M / 2), site.material("flags", "cobbles:#8b8577"))
        for k in range(9):
            x, y = (float(v) for v in np.array(p.abbey or (0, 0, 0))[:2] + rng.uniform(-6, 6, size=2))
            site.paint(
                blob(x, y, float(rng.uniform(0.8, 2.0)), seed + 500 + k, 0.5), site.material("gold", covers[0][1])
            )
    for group in p.groups:
        if group.level:
            glade = blob(*group.at, group.radius_m * 0.95, seed + len(group.name), 0.3)
            site.paint(glade.buffer(1.4), site.material("moss", covers[1][1]))
            site.paint(glade, site.material("meadow", "meadow:#8c8c4c"))
    for path in paths:
        site.paint(ribbon(path, 1.4, round_ends=True), site.material("path", "dirt:#8c7050"))
    shore = [water.boundary.interpolate(k / 60, normalized=True) for k in range(60)]
    wash = [blob(q.x, q.y, 1.3, seed + 700 + k, 0.4) for k, q in enumerate(shore)]
    site.paint(shapely.union_all([water.buffer(0.6, quad_segs=3), *wash]), site.material("bank", "gravel:#8f887c"))
    site.paint(water, site.material("water", "water:#4f6f72"))


def _abbey_area(p: BirchWood) -> BaseGeometry:
    if p.abbey is None:
        return Polygon()
    frame = Frame(*p.abbey)
    return Polygon([frame.at(*xy) for xy in ((-7.0, -4.5), (7.0, -4.5), (7.0, 4.5), (-7.0, 4.5))])


def _abbey_walls(p: BirchWood) -> list[BaseGeometry]:
    if p.abbey is None:
        return []
    frame = Frame(*p.abbey)
    return [LineString([frame.at(*a), frame.at(*b)]).buffer(_WALL_M) for a, b, _, _ in _ABBEY]


def _abbey(site: Site, p: BirchWood) -> None:
    """Put up the ruin: broken walls with pointed rests on top, and the stumps of its columns."""
    assert p.abbey is not None
    frame, rng = Frame(*p.abbey), site.rng_for("abbey")
    base = min(site.ground_z(*frame.at(x, y)) for x in (-7.0, 7.0) for y in (-4.5, 4.5)) - 0.3
    stone = site.material("abbey", "blocks:#9a917f")
    walls: list[Mesh] = []
    for a, b, height, openings in _ABBEY:
        walls.append(wall_with_openings(frame.at(*a), frame.at(*b), base, base + height + 0.3, openings, _WALL_M))
        # What is left of the courses above: shorter and shorter pieces, so that no top is level.
        start, along = np.array(a), np.array(b) - np.array(a)
        u0, u1 = 0.0, 1.0
        for course in range(3):
            u0 += float(rng.uniform(0.05, 0.3)) * (u1 - u0)
            u1 -= float(rng.uniform(0.05, 0.3)) * (u1 - u0)
            # Each piece is set in a little, and starts inside the course below.
            ends = [frame.at(*(start + along * u)) for u in (u0, u1)]
            plan = LineString(ends).buffer(_WALL_M / 2 - 0.02, cap_style="flat")
            z = base + height + 0.3 + 0.45 * course
            walls.append(slab(plan, z - 0.05, z + 0.45))
    for x in (-3.6, 0.0, 3.6):
        for y in (-2.0, 2.0):
            cx, cy = frame.at(x, y)
            walls.append(slab(Point(cx, cy).buffer(0.42, quad_segs=3), base, base + float(rng.uniform(0.7, 1.6))))
            site.occupy(Point(cx, cy).buffer(0.6))
    area = shapely.union_all(_abbey_walls(p))
    site.add("abbey_ruin", "abbey_ruin", [(stone, merge(walls))], footprint=area)


def _woods(
    site: Site,
    water: BaseGeometry,
    paths: list[list[tuple[float, float]]],
    abbey: BaseGeometry,
    spacing_m: float,
    undergrowth: float,
) -> None:
    seed, words = site.recipe.seed, {"place": "in the wood"}
    site.occupy(abbey.buffer(0.5))
    wood = site.extent.buffer(-1.0).difference(water.buffer(0.9))
    wet, glades, thicket = near(water, 9.0), patches(seed + 11, 14.0, 1.0), patches(seed + 12, 8.0, 1.6)
    groves = {k: patches(seed + n, 16.0) for n, k in enumerate(("gold", "russet", "dark", "fresh"), 21)}
    trees = [
        Species("birch_tree", lambda x, y: 2.6 * groves["gold"](x, y), variant="golden"),
        Species("birch_tree", lambda x, y: 0.3 * groves["fresh"](x, y) + wet(x, y), variant="green"),
        Species("oak_tree", lambda x, y: 0.5 * groves["russet"](x, y), 0.7, "russet"),
        Species("spruce_tree", lambda x, y: 0.25 * groves["dark"](x, y)),
        Species("dead_tree", lambda _x, _y: 0.06),
    ]
    plant(site, wood, spacing_m, lambda x, y: min(1.0, 0.75 * glades(x, y)), trees, words)
    trail, n = shapely.union_all([LineString(path) for path in paths]), undergrowth
    bank = water.buffer(1.6).difference(water.buffer(0.1))

    def shade(x: float, y: float) -> float:
        return min(1.0, 0.5 * thicket(x, y))

    def way(x: float, y: float) -> float:
        return max(0.05, 1.0 - float(trail.distance(Point(x, y))) / 6.0)

    by_creek = {"place": "beside the creek"}
    strew(site, "boulder", bank, 2.4, lambda _x, _y: 1.0, round(26 * n), scale=0.6, attributes=by_creek)
    strew(site, "mossy_rock", bank, 3.0, lambda _x, _y: 1.0, round(16 * n), scale=0.7, attributes=by_creek)
    edge = water.buffer(0.3).difference(water.buffer(-0.4))
    strew(site, "reed_clump", edge, 2.6, wet, round(16 * n), variant="dry", attributes=by_creek)
    strew(site, "sapling", wood, 4.0, shade, round(22 * n), variant="red", attributes=words)
    strew(
        site, "bush", wood, 3.6, shade, round(26 * n), params={"berries": 3}, variant="red_berries", attributes=words
    )
    strew(site, "young_spruce", wood, 4.0, shade, round(12 * n), attributes=words)
    strew(site, "fern", wood, 1.6, shade, round(110 * n), variant="rusty", attributes=words)
    strew(site, "wildflowers", wood, 3.0, way, round(10 * n), variant="purple", attributes={"place": "beside a path"})
