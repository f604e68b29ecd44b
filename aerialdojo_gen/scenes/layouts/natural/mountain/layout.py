"""Mountains: ridges and peaks in benches of rock, a stream with boulders, switchback paths, a hut, alpine meadows.

The recipe says where ridges, water, paths and groups of things lie; the layout shapes the ground, shows rock where it
is steep, snow where it is high, and lets the wood end at the tree line.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import ribbon
from aerialdojo_gen.scenes.kit.mountains import Crag, Ridge, above, massif, put_up_crag, steep
from aerialdojo_gen.scenes.kit.natural_ground import blob, keep_clear
from aerialdojo_gen.scenes.layouts.natural.parts.groups import Group, level_ground, plan_groups, set_out
from aerialdojo_gen.scenes.layouts.natural.parts.woods import Field as PlantField
from aerialdojo_gen.scenes.layouts.natural.parts.woods import Species, near, patches, plant, strew
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound
from aerialdojo_gen.scenes.values import At, Bridge, Hill, Length, Line, LineOrNone, Metres

_CELL_M = 1.6


class Tarn(BaseModel):
    """A small lake: its middle and mean radius, metres."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: At
    radius_m: Length


class Parameters(BaseModel):
    """What a recipe may say of a mountain.

    Attributes
    ----------
    ridges : tuple of Ridge
        Crests and peaks.
    bench_m, rough_m : float
        Height of the steps of its flanks, and of gullies and spurs, metres.
    fall_m : float
        How much higher the northern border lies than the southern, metres.
    hills : tuple of (x, y, radius, rise)
        Knolls and hollows, metres.
    stream : points
        Middle line of the stream, downhill, metres; empty for none.
    stream_m, gully_m : float
        Width of its water, and depth of its bed, metres.
    tarn : Tarn, optional
        A small lake.
    paths : tuple of points
        Middle lines of paths, metres.
    bridges : tuple of (x, y, yaw, span)
        Footbridges, metres and degrees.
    crags : tuple of Crag
        Piles of rock.
    snow_z_m, trees_z_m : float
        Snow lies above the one height, trees grow below the other, metres.
    tree_spacing_m : float
        Least distance of trees, metres.
    boulders : int
        How many are strewn.
    stone : str
        Their colour, as a person would say it.
    groups : tuple of Group
        What stands where.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    ridges: tuple[Ridge, ...]
    bench_m: Annotated[float, Field(ge=0, le=12)] = 4.5
    rough_m: Annotated[float, Field(ge=0, le=8)] = 2.0
    fall_m: Annotated[float, Field(ge=0, le=30)] = 0.0
    hills: tuple[Hill, ...] = ()
    stream: LineOrNone = ()
    stream_m: Annotated[float, Field(gt=0, le=8)] = 2.2
    gully_m: Annotated[float, Field(ge=0, le=12)] = 1.2
    tarn: Tarn | None = None
    paths: tuple[Line, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    crags: tuple[Crag, ...] = ()
    snow_z_m: Metres = 1000.0
    trees_z_m: Metres = 8.0
    tree_spacing_m: Annotated[float, Field(ge=2, le=12)] = 4.6
    boulders: Annotated[int, Field(ge=0, le=1000)] = 60
    stone: str = "grey"
    groups: tuple[Group, ...] = ()


def build(site: Site) -> None:
    """Build the mountain."""
    p: Parameters = site.parameters
    stream, paths = smooth_path(p.stream) if p.stream else [], [smooth_path(path) for path in p.paths]
    pond = blob(*p.tarn.at, p.tarn.radius_m, site.recipe.seed, 0.22) if p.tarn else Polygon()
    water = shapely.union(ribbon(stream, p.stream_m) if stream else Polygon(), pond)
    crags = [c.area() for c in p.crags]
    ground = _ground(site, p, stream, paths)
    faces = steep(ground, 1.1)
    bridges = [LineString(_bridge_ends(*b)).buffer(1.8) for b in p.bridges]
    taken = [water.buffer(1.0), *(ribbon(path, 1.7) for path in paths), *(c.buffer(0.8) for c in crags), *bridges]
    planned = plan_groups(site, p.groups, [*taken, faces.buffer(-0.8)], {}, lambda x, y: float(ground.z(x, y)))
    ground = level_ground(ground, planned, blend_m=2.4)
    if p.tarn:
        level = float(ground.z(*p.tarn.at))
        ground = ground.flattened(pond.buffer(0.4), level, blend_m=4.0)
        ground = ground.flattened(pond.buffer(-1.0), level - 1.0, blend_m=2.0)
    site.set_ground(ground, site.material("meadow", "meadow:#7f9450"))
    _paint(site, p, ground, water, paths)
    rock = (site.material("rock", "rock:#8b8881"), site.material("rock_dark", "rock:#77756f"))
    for k, crag in enumerate(p.crags):
        put_up_crag(site, crag, k, rock)
    for path in paths:
        site.occupy(ribbon(path, 2.0))
    for x, y, yaw, span in p.bridges:
        z = max(site.ground_z(*end) for end in _bridge_ends(x, y, yaw, span)) - 0.28
        words = {"place": "over the stream"}
        keep_clear(site, site.place("footbridge", x, y, yaw, z=z, params={"span": span}, attributes=words), 1.6)
    set_out(site, planned, {}, 1.5)
    for group in p.groups:
        if group.level:
            site.occupy(Point(*group.at).buffer(group.radius_m * 0.85))
    bare = [*crags, steep(ground, 0.75), above(ground, p.snow_z_m, 0.7)]
    _grow(site, p, water, shapely.union_all(bare))


def _bridge_ends(x: float, y: float, yaw_deg: float, span: float) -> list[tuple[float, float]]:
    frame = Frame(x, y, yaw_deg)
    return [frame.at(-span / 2, 0.0), frame.at(span / 2, 0.0)]


def _ground(
    site: Site, p: Parameters, stream: list[tuple[float, float]], paths: list[list[tuple[float, float]]]
) -> Terrain:
    ground = massif(site.recipe.size_m, _CELL_M, site.recipe.seed, p.ridges, p.bench_m, p.rough_m)
    lean = p.fall_m * (ground.corners()[:, 1] / site.recipe.size_m[1] + 0.5)
    ground = replace(ground, heights_m=ground.heights_m + lean.reshape(ground.heights_m.shape))
    for x, y, radius, rise in p.hills:
        ground = mound(ground, (x, y), radius, rise)
    for group in p.groups:
        if group.level:
            ground = ground.flattened(Point(*group.at).buffer(group.radius_m * 0.75), blend_m=group.radius_m * 0.7)
    for path in paths:
        ground = ground.graded(path, 1.6, blend_m=2.6, smooth_m=12.0)
    if stream:
        ground = ground.graded(stream, p.stream_m + 1.5, blend_m=4.0, smooth_m=9.0)
        ground = ground.lowered(ribbon(stream, p.stream_m + 3.0 + p.gully_m), p.gully_m, 1.6 + 0.5 * p.gully_m)
    return ground


def _paint(
    site: Site, p: Parameters, ground: Terrain, water: BaseGeometry, paths: list[list[tuple[float, float]]]
) -> None:
    seed, rng = site.recipe.seed, site.rng_for("patches")
    half = [s / 2 for s in site.recipe.size_m]
    covers = (("grass", "grass:#71894a"), ("heath", "meadow:#95924f"), ("bloom", "meadow:#8b9a58"))
    for k in range(45):
        x, y = float(rng.uniform(-half[0], half[0])), float(rng.uniform(-half[1], half[1]))
        site.paint(blob(x, y, float(rng.uniform(2.5, 7.5)), seed + 300 + k, 0.55), site.material(*covers[k % 3]))
    for group in p.groups:
        if group.level:
            site.paint(blob(*group.at, group.radius_m, seed + len(group.name), 0.3), site.material(*covers[0]))
    if p.snow_z_m < 900.0:
        site.paint(above(ground, p.snow_z_m, 0.7), site.material("snow", "snow"))
    faces = steep(ground, 0.85)
    # At the feet of the faces lies what fell from them.
    site.paint(faces.buffer(1.1, quad_segs=2), site.material("scree", "gravel:#9a958a"))
    site.paint(faces, site.material("rock", "rock:#8b8881"))
    site.paint(steep(ground, 1.35), site.material("rock_dark", "rock:#77756f"))
    for crag in p.crags:
        site.paint(blob(*crag.at, crag.radius_m * 1.35, seed + 40, 0.35), site.material("scree", "gravel:#9a958a"))
    for path in paths:
        site.paint(ribbon(path, 1.5, round_ends=True), site.material("path", "dirt:#a08a68"))
    if not water.is_empty:
        shore = [water.boundary.interpolate(k / 60, normalized=True) for k in range(60)]
        wash = [blob(q.x, q.y, 1.4, seed + 700 + k, 0.4) for k, q in enumerate(shore)]
        stones = shapely.union_all([water.buffer(0.6, quad_segs=3), *wash])
        site.paint(stones, site.material("bank", "gravel:#a09c94"))
        site.paint(water, site.material("water", "water:#5f95a0"))


def _grow(site: Site, p: Parameters, water: BaseGeometry, bare: BaseGeometry) -> None:
    """Strew stones, and grow the wood below the tree line, dwarf spruces above it, flowers on the meadows."""
    seed = site.recipe.seed
    slope = site.extent.buffer(-1.2)
    green = slope.difference(water.buffer(0.8)).difference(bare)
    foot, glades = near(bare, 6.0), patches(seed + 11, 13.0, 1.2)

    def height(x: float, y: float) -> float:
        return site.ground_z(x, y)

    def wood(x: float, y: float) -> float:
        return float(np.clip((p.trees_z_m - height(x, y)) / 4.0, 0.0, 1.0)) * min(1.0, 0.6 * glades(x, y))

    def dwarf(x: float, y: float) -> float:
        return 0.45 * float(np.clip(1.0 - abs(height(x, y) - p.trees_z_m) / 7.0, 0.0, 1.0)) * min(1.0, glades(x, y))

    groves = [patches(seed + k, 15.0) for k in (21, 22)]
    trees = [
        Species("spruce_tree", lambda x, y: 2.0 * groves[0](x, y)),
        Species("pine_tree", lambda x, y: 0.7 * groves[1](x, y), variant="low"),
        Species("dead_tree", lambda _x, _y: 0.08, variant="grey"),
    ]
    grey = {"rock": site.material("rock", "rock:#8b8881"), "top": site.material("boulder_top", "rock:#9a978f")}
    if not water.is_empty:
        bank = water.buffer(1.8).difference(water.buffer(-0.5))
        strew(site, "boulder", bank, 2.2, lambda _x, _y: 1.0, p.boulders // 2, scale=0.75, roles=grey,
              attributes={"place": "beside the stream", "colour": p.stone})  # fmt: skip
    plant(site, green, p.tree_spacing_m, wood, trees, {"place": "on the wooded slope"})
    words = {"place": "on the slope"}
    strew(site, "boulder", slope.difference(water.buffer(1.0)), 2.6, lambda x, y: 0.04 + 0.9 * foot(x, y), p.boulders,
          roles=grey, attributes=words | {"colour": p.stone})  # fmt: skip
    strew(site, "young_spruce", green, 2.6, dwarf, 40, attributes=words)
    strew(site, "bush", green, 3.0, dwarf, 24, scale=0.7, params={"berries": 2}, attributes=words)
    strew(site, "fern", green, 1.8, lambda x, y: 0.3 * glades(x, y), 40, attributes=words)
    meadow = {"place": "on the meadow"}
    for k, variant in enumerate(("pink", "yellow", "white", "purple")):
        share = patches(seed + 60 + k, 9.0, 2.0)
        strew(site, "wildflowers", green, 2.0, _thinned(share, 0.25), 9 * (k + 1), variant=variant, attributes=meadow)


def _thinned(field: PlantField, factor: float) -> PlantField:
    return lambda x, y: min(1.0, factor * field(x, y))
