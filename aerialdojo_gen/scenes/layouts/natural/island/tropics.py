"""A tropical island: a volcano, a jungle with a temple, a village on a bay, huts on stilts over the lagoon.

The bay and the lagoon open to the south; the volcano rises in the north-east, the lighthouse stands on the east cape.
"""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.natural.island.huts import stilt_hut
from aerialdojo_gen.scenes.layouts.natural.island.tropics_things import GROUPS
from aerialdojo_gen.scenes.layouts.natural.parts.quays import pier
from aerialdojo_gen.scenes.layouts.natural.parts.shore import (
    above_area,
    boulders,
    broadleaves,
    inland_m,
    paint_sea,
    ragged,
    rise,
    settle,
    shaped,
    steep_area,
)
from aerialdojo_gen.scenes.layouts.natural.parts.woods import patches, strew
from aerialdojo_gen.scenes.mesh import Floats
from aerialdojo_gen.scenes.site import Site

_COAST = [
    (-62, 8), (-60, 30), (-44, 47), (-18, 53), (12, 55), (38, 48), (54, 30), (57, 8), (66, -4), (68, -18), (58, -24),
    (46, -22), (40, -34), (24, -43), (8, -42), (0, -34), (-8, -25), (-18, -24), (-26, -30), (-36, -42), (-52, -40),
    (-60, -24),
]  # fmt: skip
_VOLCANO = (20.0, 20.0)
_VOLCANO_M, _CRATER_M, _FOOT_M = 18.0, 6.5, 31.0
_TEMPLE, _TREEHOUSE, _LIGHTHOUSE, _SQUARE = (-32.0, 22.0), (-10.0, 8.0), (59.0, -13.0), (-9.0, -13.0)
_PATHS = [
    [(-9, -13), (-10, -4), (-12, 4), (-20, 12), (-28, 16)],
    [(-9, -13), (4, -14), (14, -12), (30, -14), (46, -12), (57, -12)],
    [(-9, -13), (-22, -16), (-34, -22), (-46, -28)],
    [(4, -14), (8, -4), (4, 6), (6, 14), (13, 19)],
    [(4, -14), (10, -26), (18, -36)],
    [(-20, 12), (-24, 28), (-20, 40), (-8, 47)],
]
_HUTS = ((-17.0, -9.0, -20.0), (-1.0, -4.5, -130.0), (6.0, -21.0, 120.0), (-20.0, -2.0, -60.0), (17.0, -20.0, 100.0))
_OVER_WATER = ((0.7, -50.0, 0.0), (13.3, -50.0, 180.0), (0.7, -58.5, 0.0), (13.3, -58.5, 180.0))
# Ground that long things stand on.
_LEVEL = ((0.4, 3.0, 1.8), (-13.6, 0.0, 1.3), (12.4, -6.0, 1.6), (-36.0, 36.4, 2.4), (31.4, 6.6, 1.6))
_JETTY = Frame(-13.0, -22.4, -90.0)


def build_tropics(site: Site) -> None:
    """Build the tropical island."""
    land = ragged(_COAST, site.recipe.seed, 1.5, 2.5)
    paths = [smooth_path(p) for p in _PATHS]
    _ground(site, land, paths)
    _paint(site, land, paths)
    for path in paths:
        site.occupy(ribbon(path, 1.6))
    _village(site)
    for place, things in GROUPS.items():
        settle(site, place, things)
    _rocks(site, land)
    _jungle(site, land)


def _ground(site: Site, land: BaseGeometry, paths: list[list[tuple[float, float]]]) -> None:
    def height(x: Floats, y: Floats, noise: Floats) -> Floats:
        inland = inland_m(land, x, y)
        z = 0.11 * np.clip(inland, 0.0, 13.0) + 2.0 * rise(inland, 12.0, 26.0) * (1.0 + 0.8 * noise)
        away = np.hypot(x - _VOLCANO[0], y - _VOLCANO[1])
        angle = np.arctan2(y - _VOLCANO[1], x - _VOLCANO[0])
        gullies = 1.0 + 0.07 * np.sin(7 * angle + 5 * noise) * rise(away, 5.0, 14.0)
        cone = _VOLCANO_M * np.clip(1.0 - away / (_FOOT_M * gullies), 0.0, 1.0) ** 1.25
        rim = _VOLCANO_M * (1.0 - _CRATER_M / _FOOT_M) ** 1.25
        bowl = rim - 5.0 * (1.0 - rise(away, 2.0, _CRATER_M))
        cone = np.where(away < _CRATER_M, bowl, cone)
        z = z + cone * rise(inland, 2.0, 14.0)
        cape = np.hypot((x - _LIGHTHOUSE[0]) / 1.1, y - _LIGHTHOUSE[1])
        z = z + 3.2 * (1.0 - rise(cape, 6.0, 11.0)) * rise(inland, 0.5, 5.0)
        return np.where(inland > 0.0, z, 0.0)

    ground = shaped(site, 1.5, 30.0, height)
    for path in paths:
        ground = ground.graded(path, 1.4, blend_m=2.5, smooth_m=8.0)
    ground = ground.flattened(disc(*_SQUARE, 6.5), blend_m=4.0)
    ground = ground.flattened(disc(*_TEMPLE, 11.0), blend_m=6.0)
    ground = ground.flattened(disc(*_TREEHOUSE, 3.0), blend_m=4.0)
    ground = ground.flattened(disc(*_LIGHTHOUSE, 5.5), blend_m=3.0)
    for x, y, _ in _HUTS:
        ground = ground.flattened(disc(x, y, 2.5), blend_m=3.5)
    for x, y, radius in _LEVEL:
        ground = ground.flattened(disc(x, y, radius), blend_m=2.5)
    site.set_ground(ground, site.material("jungle", "moss:#5f7a3a"))


def _paint(site: Site, land: BaseGeometry, paths: list[list[tuple[float, float]]]) -> None:
    seed = site.recipe.seed
    fringe = [blob(p.x, p.y, 3.2, seed + 40 + k, 0.5) for k, p in enumerate(_points(land.buffer(-9.0).boundary, 4.0))]
    beach = land.difference(land.buffer(-9.0)).union(shapely.union_all(fringe).intersection(land))
    site.paint(beach, site.material("beach", "sand:#ead7a6"))
    paint_sea(site, land, 13.0)
    slope = blob(*_VOLCANO, 21.0, seed + 3, 0.3)
    site.paint(slope, site.material("slope", "dirt:#7f7350"))
    site.paint(blob(*_VOLCANO, 14.0, seed + 4, 0.3), site.material("lava", "rock:#5f564e"))
    site.paint(above_area(site.terrain, 11.5), site.material("summit", "rock:#4b4440"))
    site.paint(steep_area(site.terrain, 44.0).intersection(land), site.material("cliff", "rock:#6a6058"))
    site.paint(disc(*_VOLCANO, 2.6), site.material("magma", "#e2602a"))
    cape = blob(*_LIGHTHOUSE, 9.5, seed + 5, 0.2).intersection(land)
    site.paint(cape, site.material("cape", "rock:#8a8074"))
    site.paint(blob(*_LIGHTHOUSE, 6.2, seed + 6, 0.2), site.material("lawn", "grass:#7f9a4c"))
    site.paint(blob(*_TEMPLE, 13.5, seed + 7, 0.15), site.material("glade", "grass:#73903f"))
    site.paint(blob(*_TEMPLE, 11.6, seed + 8, 0.12), site.material("temple_court", "dirt:#a08d63"))
    for path in paths:
        site.paint(ribbon(path, 1.5, round_ends=True), site.material("path", "dirt:#b79a68"))
    site.paint(blob(*_SQUARE, 8.2, seed + 9, 0.12), site.material("square", "sand:#d9bd86"))
    site.paint(disc(*_SQUARE, 4.6), site.material("plaza", "cobbles:#b3a58c"))


def _points(line: BaseGeometry, spacing_m: float) -> list[Point]:
    count = max(int(line.length / spacing_m), 1)
    return [line.interpolate(k / count, normalized=True) for k in range(count)]


def _village(site: Site) -> None:
    walls = ("planks:#a5804f", "planks:#8f9c6a", "planks:#b0683f", "planks:#7f95a0", "planks:#c0a060")
    for (x, y, yaw), wall in zip(_HUTS, walls, strict=True):
        floor = site.ground_z(x, y) + 0.9
        stilt_hut(site, Frame(x, y, yaw), floor, wall=wall)
    pier(site, _JETTY, 19.0, 2.6, 1.5, bay_m=3.8, rail=None, category="jetty")
    walk = Frame(7.0, -41.0, -90.0)
    pier(
        site,
        walk,
        22.5,
        3.2,
        1.7,
        bay_m=3.8,
        rail="wood:#9a8058",
        gates=[(7.6, 10.4), (16.1, 18.9)],
        category="jetty",
    )
    for (x, y, yaw), wall in zip(_OVER_WATER, walls[1:], strict=True):
        stilt_hut(site, Frame(x, y, yaw), 1.72, width_m=5.4, porch_m=2.1, wall=wall, steps=False)


def _rocks(site: Site, land: BaseGeometry) -> None:
    cape = Point(*_LIGHTHOUSE).buffer(13.0)
    shore = land.boundary.buffer(2.2).intersection(cape)
    boulders(site, shore, 2.1, (0.6, 1.5), site.material("boulder", "rock:#7d746a"), limit=45)
    north = land.boundary.buffer(2.0).intersection(rectangle(-66, 34, 70, 60))
    boulders(site, north, 3.4, (0.6, 1.7), site.material("boulder", "rock:#7d746a"), limit=45)
    reef = LineString([(-40, -56), (-26, -61), (-12, -62)]).buffer(1.4)
    boulders(site, reef, 2.4, (0.5, 1.1), site.material("reef", "rock:#8f8578"), category="reef", limit=16, flat=0.6)


def _jungle(site: Site, land: BaseGeometry) -> None:
    seed = site.recipe.seed
    wild, thicket = patches(seed + 11, 16.0, 1.2), patches(seed + 12, 9.0, 1.4)
    summit = Point(*_VOLCANO).buffer(15.0)
    kept = ((_TEMPLE, 12.5), (_SQUARE, 10.5), (_LIGHTHOUSE, 9.0))
    open_ground = [summit, *(Point(*at).buffer(r) for at, r in kept)]
    interior = land.buffer(-10.0).difference(shapely.union_all(open_ground))
    words = {"place": "in the jungle"}

    def grown(x: float, y: float) -> float:
        return min(1.0, wild(x, y))

    for k, (size, limit) in enumerate(((1.75, 34), (1.4, 40), (1.1, 30))):
        area = interior if k < 2 else land.buffer(-4.5).difference(summit).difference(Point(*_SQUARE).buffer(9.0))
        strew(site, "palm_tree", area, 3.6, grown, limit, scale=size, attributes=words if k < 2 else {})
    broadleaves(site, interior, 4.4, grown, 28, (6.0, 10.0))
    strew(site, "bush", interior, 3.4, lambda x, y: min(1.0, thicket(x, y)), 26, scale=1.4, attributes=words)
    strew(site, "fern", interior, 1.5, lambda x, y: min(1.0, thicket(x, y)), 130, scale=1.7, attributes=words)
    strew(site, "driftwood", land.buffer(-3.0).difference(land.buffer(-6.0)), 16.0, lambda _x, _y: 1.0, 6)
