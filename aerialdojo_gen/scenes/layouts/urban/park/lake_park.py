"""A larger amusement park round a lake: rides on low hills, a boardwalk, a midway, a walkway on stilts.

The gate lies in the west, the roller coaster in the north, the playground in the south-east.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc, slab, smooth_path
from aerialdojo_gen.scenes.grammar_streets import crossing, streets
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, deck, railing, spaced, stairs
from aerialdojo_gen.scenes.layouts.urban.park.rides import (
    booths,
    entrance_gate,
    flume,
    light_strings,
    pavilion,
    queue_rails,
)
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

# Round levels: x, y, radius, height over the lake's shore, all metres.
_HILLS = (
    (31.0, -36.4, 7.0, 0.8),
    (-11.0, -36.0, 5.5, 1.4), (19.0, -38.0, 6.0, 2.0), (38.4, -26.8, 6.0, 0.6), (-24.4, -28.6, 7.0, -1.6),
    (-24.0, 23.0, 9.0, 4.2), (25.0, 20.0, 11.0, 3.0), (27.0, -17.0, 10.0, 2.2), (-30.0, -20.0, 12.0, -1.6),
    (0.0, 38.0, 13.0, 1.6), (-44.0, 4.0, 9.0, 1.0), (4.0, -36.0, 9.0, 3.4), (46.0, 0.0, 9.0, 4.6),
)  # fmt: skip
_LAKE = blob(0.0, 0.0, 15.0, 8, ragged=0.3, corners=36)
WATER_Z, SHORE_Z = -0.9, 0.0
WALK_Z = 3.4
_WALK = [(-20.0, 12.0), (-8.0, 19.5), (6.0, 19.5), (16.0, 13.0)]


def build_lake_park(site: Site) -> None:
    """Build the relief, the lake, paths, halls and booths, the flume, the walkway, and trees."""
    site.set_ground(_terrain(site.recipe.size_m), site.material("lawn", "grass:#5f9450"))
    _paint(site)
    _walkway(site)
    _lakeside(site)
    _structures(site)
    _trees(site)


def _terrain(size_m: tuple[float, float]) -> Terrain:
    rolling = rolling_terrain(size_m, 1.5, 23, 0.9, 38.0, octaves=3)
    corners = rolling.corners()
    heights = rolling.heights_m.copy()
    x, y = (corners[:, k].reshape(heights.shape) for k in (0, 1))
    for hx, hy, radius, rise in _HILLS:
        away = np.hypot(x - hx, y - hy)
        t = _smooth(1.0 - (away - radius) / 7.0)
        heights = heights * (1.0 - t) + rise * t
    away = shapely.distance(_LAKE, shapely.points(corners[:, :2])).reshape(heights.shape)
    flat = _smooth(1.0 - (away - 2.5) / 6.0)
    heights = heights * (1.0 - flat) + SHORE_Z * flat
    inside = np.where(shapely.contains_xy(_LAKE, corners[:, 0], corners[:, 1]).reshape(heights.shape), 1.0, 0.0)
    depth = shapely.distance(_LAKE.boundary, shapely.points(corners[:, :2])).reshape(heights.shape)
    heights = heights + inside * WATER_Z * _smooth(depth / 1.4)
    return Terrain(rolling.x0_m, rolling.y0_m, rolling.cell_m, heights)


def _smooth(t: np.ndarray) -> np.ndarray:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _paths() -> list[list[tuple[float, float]]]:
    ring = [(19.5 * float(np.cos(a)), 19.0 * float(np.sin(a))) for a in np.linspace(0.0, 2 * np.pi, 25)]
    spokes = [
        [(-57, 4), (-44, 4), (-30, 3), (-19, 2)], [(-14, 13), (-20, 19), (-24, 23)], [(13, 14), (19, 18), (25, 20)],
        [(15, -12), (21, -15), (27, -17)], [(-13, -14), (-21, -18), (-30, -20)], [(0, 19), (-2, 28), (0, 38)],
        [(3, -19), (2, -28), (4, -36)], [(19, 2), (32, 4), (46, 0)],
        [(-30, -20), (-14, -31), (4, -36), (20, -30), (27, -17)],
        [(25, 20), (12, 32), (0, 38), (-14, 34), (-24, 23)],
    ]  # fmt: skip
    return [smooth_path(ring, 1), *(smooth_path(s, 2) for s in spokes)]


def _paint(site: Site) -> None:
    paving, path = site.material("plaza", "paving:#cdb9a0"), site.material("path", "#c9a27c")
    site.paint(shapely.unary_union([ribbon(p, 3.0, round_ends=True) for p in _paths()]), path)
    for hx, hy, radius, _ in _HILLS:
        site.paint(disc(hx, hy, radius - 0.5, 32), paving)
    site.paint(disc(-24, 23, 4.2, 24), site.material("inlay", "checker:#8fa6b0"))
    site.paint(disc(-30, -20, 6.4, 28), site.material("inlay", "checker:#b07a6a"))
    site.paint(blob(31, -36.4, 8.0, 4), "sand:#dcc48c")
    site.paint(_LAKE.buffer(0.8), "sand")
    site.paint(_LAKE.buffer(-1.5), "water")
    streets(site, [[(-56.4, -54), (-56.4, 54)]], lane_m=2.7, pavement_m=1.2)
    crossing(site, -56.4, 4.0, 0.0, 5.4)


def _walkway(site: Site) -> None:
    """Lead a walkway on stilts along the north shore, from stair to stair."""
    line = LineString(_WALK)
    plan = line.buffer(1.6, cap_style="flat", join_style="mitre")
    posts = [(float(p.x), float(p.y)) for p in (line.interpolate(s) for s in np.arange(1.0, line.length, 5.0))]
    parts: Parts = []
    for x, y in posts:
        parts.append(
            (site.material("stilts", "wood"), columns([(x, y)], site.ground_z(x, y) - 0.2, WALK_Z - 0.3, 0.2))
        )
    parts += deck(plan, WALK_Z, floor="boards:#a98a62", under="planks:#7d6446")
    for side in (-1, 1):
        rim = line.offset_curve(side * 1.5, join_style="mitre")
        parts += railing([(float(x), float(y)) for x, y in rim.coords], WALK_Z, pane="iron", height_m=0.95)
    for (x, y), yaw in ((_WALK[0], 32.0), (_WALK[-1], 138.0)):
        back = (x - 5.4 * float(np.cos(np.radians(yaw))), y - 5.4 * float(np.sin(np.radians(yaw))))
        foot = site.ground_z(*back)
        parts += stairs(back, yaw, 2.6, WALK_Z - foot, 5.4, z_m=foot, tread="planks:#7d6446")
    site.add("walkway", "raised_walkway", parts, {"material": "wooden"})


def _lakeside(site: Site) -> None:
    """Build the boardwalk over the south of the lake and the landing stage in the east."""
    walk: BaseGeometry = ribbon(smooth_path([(-14.5, -9.0), (-6.0, -4.0), (4.0, -5.0), (13.5, -10.5)], 2), 2.8)
    parts: Parts = [("boards:#b0946a", slab(_polygon(walk), 0.15, 0.4))]
    piles = [
        (float(p.x), float(p.y))
        for p in (
            Point(c) for c in LineString([(-11, -6.6), (-5, -3.8), (3, -4.6), (10, -8.2)]).segmentize(3.0).coords
        )
    ]
    parts.append(("wood", columns(piles, WATER_Z - 0.4, 0.2, 0.16)))
    stage = rectangle(8.0, 1.2, 16.5, 4.0)
    parts += [
        ("boards:#b0946a", slab(stage, 0.15, 0.4)),
        ("wood", columns(spaced((8.4, 1.6), (12.0, 1.6), 1.8), WATER_Z - 0.4, 0.7, 0.14)),
    ]
    site.add("boardwalk", "boardwalk", parts, {"material": "wooden"})
    island = blob(-2.0, 4.5, 3.4, 3)
    rocks: Parts = [("rock", slab(island, WATER_Z - 0.3, -0.55)), ("grass", slab(island.buffer(-0.5), -0.55, -0.3))]
    site.add("island", "island", rocks)
    site.occupy(_LAKE.buffer(1.0))


def _polygon(area: BaseGeometry) -> BaseGeometry:
    return max(getattr(area, "geoms", [area]), key=lambda p: p.area)


def _structures(site: Site) -> None:
    trim = site.material("trim", "#f3ead6")
    pavilion(site, "dodgem_hall", Frame(-33.6, -20.4, 40.0), (9.0, 8.0), sign="BUMPER", roof="sheet_metal:#2f5f8a",
             trim=trim, floor="checker:#7a6a8a")  # fmt: skip
    pavilion(site, "grill_hall", Frame(29.6, -19.4, 140.0), (7.0, 6.0), sign="GRILL", roof="sheet_metal:#c98a2e",
             trim=trim, floor="tiles:#d8cdb8")  # fmt: skip
    colours = ("#7a4a8f", "#2f8f8a", "#d9772b", "#c93860")
    booths(site, "midway_north", Frame(-38.0, 12.6, -90.0), 5, colours, ("DUCKS", "DARTS", "RINGS", "PRIZES", "CANS"))
    booths(site, "midway_south", Frame(-37.4, -4.8, 90.0), 4, colours[1:], ("NUTS", "HOOPLA", "MASKS", "TOYS"))
    booths(site, "hill_booths", Frame(24.6, 28.6, -100.0), 3, colours[2:], ("CREPES", "JUICE", "FRIES"))
    queue_rails(site, "coaster_queue", Frame(-8.6, 41.0, 0.0), 3, 6.0)
    queue_rails(site, "tower_queue", Frame(39.0, -5.6, 60.0), 2, 5.0)
    light_strings(site, "midway_lights", [(-47, 9.6), (-40, -1.6), (-33, 9.6), (-26, -1.0)])
    light_strings(site, "shore_lights", [(-3, -20.8), (6.5, -20.6), (14.4, -16.6)])
    entrance_gate(site, Frame(-50.6, 4.0, 180.0), "LAKELAND", 6.0, wall=site.material("gate", "plaster:#cfd8c4"),
                  roof="shingles:#4f6f8a", sign="#7a4a8f")  # fmt: skip
    for path in ([(-50.6, 10.0), (-50.6, 53.4), (59, 53.4)], [(-50.6, -2.0), (-50.6, -53.4), (59, -53.4)]):
        for a, b in pairwise(path):
            steps = np.linspace(0.0, 1.0, max(int(np.hypot(b[0] - a[0], b[1] - a[1]) / 8.0), 1) + 1)
            points = [(a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t) for t in steps]
            for p, q in pairwise(points):
                fence(site, [p, q], "hedge")
    _log_ride(site)


def _log_ride(site: Site) -> None:
    """Lay the log flume in the north-east: up a ramp to a row of trestles, down a chute, and home on the ground."""
    base = max(site.ground_z(x, y) for x, y in ((40, 30), (52, 42), (34, 44))) + 0.5
    path = [(34, 44, base), (42, 46, base + 0.1), (50, 45, base + 2.2), (54, 40, base + 5.0), (54, 35, base + 5.2),
            (51, 30, base + 4.8),
            (46, 27.5, base + 2.4), (40, 27, base + 0.3), (35.4, 30, base), (33, 36, base)]  # fmt: skip
    xy = smooth_path([(x, y) for x, y, _ in path], 1)
    line = LineString([(x, y) for x, y, _ in path])
    stations = [line.project(Point(p)) for p in xy]
    heights = np.interp(stations, [line.project(Point(x, y)) for x, y, _ in path], [z for _, _, z in path])
    flume(
        site,
        "log_flume",
        [(x, y, float(z)) for (x, y), z in zip(xy, heights, strict=True)],
        trough="sheet_metal:#5f8fa0",
        leg="wood",
    )
    site.place(
        "log_flume_boat", 37.6, 44.9, 194.0, z=base + 0.12, variant="brown", attributes={"place": "in the log flume"}
    )
    site.occupy(LineString(xy).buffer(2.0))
    house: Parts = [
        ("planks:#9a6f44", block(30.6, 38.6, 35.6, 42.4, base - 1.6, base + 0.4)),
        ("wood", columns([(31, 39), (35.2, 39), (31, 42), (35.2, 42)], base + 0.4, base + 3.2, 0.14)),
        ("shingles:#7a4f3a", block(30.2, 38.2, 36.0, 42.8, base + 3.2, base + 3.45)),
    ]
    site.add(
        "flume_station", "flume_station", house, {"material": "wooden"}, footprint=rectangle(30.4, 38.4, 35.8, 42.6)
    )


def _trees(site: Site) -> None:
    rng = site.rng_for("trees")
    keep = shapely.unary_union([ribbon(p, 5.0) for p in _paths()] + [disc(x, y, r + 1.0) for x, y, r, _ in _HILLS])
    keep = (
        keep.union(rectangle(-60, -54, -48, 54))
        .union(disc(31, -36, 10))
        .union(disc(0, 0, 22))
        .union(rectangle(-48, -10, -22, 21))
        .union(LineString(_WALK).buffer(5.5))
    )
    keep = keep.union(rectangle(28, 24, 58, 50)).union(rectangle(-20, 34, 22, 52))
    area = site.extent.buffer(-6.0).difference(keep)
    for k, spot in enumerate(poisson_disc(area, 6.2, rng)):
        site.try_place(("urban_tree", "birch_tree", "urban_tree", "oak_tree")[k % 4], *spot)
    for k, (x, y) in enumerate(((-21, -8), (-24, 9.6), (22.6, 7.4), (22, -6.4), (9, 22.6), (-8, -22.6))):
        site.try_place("urban_tree", float(x), float(y), 40.0 * k, variant=("blossom", "yellow", "red")[k % 3])
