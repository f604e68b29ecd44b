"""What floods are made of: standing water at z = 0, dykes with a breach, houses up to their sills, things adrift.

The water is the ground itself, level at z = 0; what stands in it is let down by the flood's depth, and its lower part
is hidden.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import shapely
from shapely.affinity import rotate, translate
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, blob, poisson_disc
from aerialdojo_gen.scenes.ground import edge_strip, rectangle, ribbon
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.kit.houses import HouseStyle, house, window_parts
from aerialdojo_gen.scenes.kit.steelwork import plates
from aerialdojo_gen.scenes.kit.structures import block, letters
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, translated
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Box, Line, Material, Number
from aerialdojo_gen.scenes.shapes import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

DEPTH_M = 1.25
CELL_M = 1.0
_SLOPE_M = 6.0


@ground_builder
def water_level(site: Site, _terrain: Terrain | None = None) -> Terrain:
    """Make the level water that everything else rises from."""
    return rolling_terrain(site.head.size_m, CELL_M, 1, 0.0, 50.0, 1)


@ground_builder
def raise_bank(_site: Site, terrain: Terrain, *, area: Area, to_m: Number, slope_m: Number = _SLOPE_M) -> Terrain:
    """Raise a bank: level on its crest, with slopes of `slope_m` down to the water."""
    return terrain.flattened(area, to_m, slope_m)


def dry(crest: BaseGeometry, slope_m: float = _SLOPE_M) -> BaseGeometry:
    """Give the area of a bank that stands out of the water."""
    return crest.buffer(1.5 * CELL_M + 0.82 * slope_m, quad_segs=4)


@site_builder
def paint_bank(site: Site, crests: list[Area], way: Material, slope_m: Number = _SLOPE_M) -> None:
    """Paint banks: mud at the waterline, grass on the slopes, and a track on the crest."""
    area = shapely.union_all([dry(c, slope_m) for c in crests])
    rim = [area.boundary.interpolate(s) for s in np.arange(0.0, area.length, 3.4)]
    lobes = [blob(p.x, p.y, 1.3, site.head.seed + k, 0.5, 14) for k, p in enumerate(rim)]
    site.paint(shapely.union_all([area.buffer(0.7), *lobes]), site.material("mud", "mud"))
    site.paint(area.buffer(-0.5), site.material("bank", "grass"))
    site.paint(shapely.union_all([c.buffer(0.9) for c in crests]), way)


@site_builder
def paint_island(site: Site, area: Area, slope_m: Number, way: Material) -> None:
    """Paint a bank about a level place: mud at the waterline, grass on the slopes, and the place itself."""
    site.paint(dry(area, slope_m).buffer(0.6), site.material("mud", "mud"))
    site.paint(dry(area, slope_m).buffer(-0.4), site.material("bank", "grass"))
    site.paint(area, way)


@site_builder
def streaks(site: Site, paths: list[Line], width_m: Number) -> None:
    """Paint lighter streaks of fast water along paths."""
    rng = site.rng_for("streaks")
    for path in paths:
        line = shapely.LineString(path)
        for _ in range(int(line.length * width_m / 9.0)):
            s, v = float(rng.uniform(0, line.length)), float(rng.uniform(-width_m / 2, width_m / 2))
            long, thin = float(rng.uniform(1.2, 4.0)), float(rng.uniform(0.05, 0.16))
            a, b = line.interpolate(s), line.interpolate(min(s + 0.5, line.length))
            yaw = math.degrees(math.atan2(b.y - a.y, b.x - a.x))
            x, y = a.x - v * np.sin(np.radians(yaw)), a.y + v * np.cos(np.radians(yaw))
            lens = Polygon([(-long, 0), (-long / 3, thin), (long / 2, thin), (long, 0), (0, -thin)])
            site.paint(translate(rotate(lens, yaw, origin=(0, 0)), x, y), site.material("foam", "water:#a8947a"))


@site_builder
def flooded_house(site: Site, at: At, yaw_deg: Number, style: HouseStyle) -> None:
    """Put up a house that stands in water up to its lower window sills, with a line of dirt above it."""
    frame = Frame(*at, yaw_deg)
    house(site, frame, style, z=-DEPTH_M)
    d, w = style.depth_m / 2 + 0.03, style.width_m / 2 + 0.03
    ring = rectangle(-d, -w, d, w).difference(rectangle(-d + 0.05, -w + 0.05, d - 0.05, w - 0.05))
    stain = frame.area(ring)
    parts: Parts = [(site.material("stain", "mud:#8a7152"), _band(stain))]
    site.add(None, "water_mark", parts)


@site_builder
def flat_house(
    site: Site, box: Box, *, storeys: int, wall: Material, name: str = "",
    facing_deg: Number = -90.0, trim: Material = "#f2efe6", roof: Material = "gravel", door: Material = "wood",
    parapet_m: Number = 0.35,
) -> float:  # fmt: skip
    """Put up a building with a flat roof that people can flee to; gives the height of its roof, metres.

    Storeys are 3.1 m high; the front faces a multiple of 90 degrees, with the name over its door.
    """
    x0, y0, x1, y1 = box
    plan, top = rectangle(x0, y0, x1, y1), storeys * 3.1 - DEPTH_M + 0.3
    parts: Parts = [
        (wall, block(x0, y0, x1, y1, -DEPTH_M, top - 0.02)),
        (roof, block(x0 + 0.05, y0 + 0.05, x1 - 0.05, y1 - 0.05, top - 0.02, top)),
        ("concrete", plates(edge_strip(plan, 0.25, 0.12), top - 0.3, top + parapet_m)),
        (site.material("stain", "mud:#8a7152"), _band(edge_strip(plan, 0.02, 0.03))),
    ]  # fmt: skip
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    for yaw in (0.0, 90.0, 180.0, 270.0):
        out, middles = _windows_of(box, yaw)
        for storey in range(storeys):
            z = storey * 3.1 - DEPTH_M + 1.25
            for k, v in enumerate(middles):
                if storey or yaw != facing_deg % 360.0 or k != len(middles) // 2:
                    opening = [(m, translated(b, (out, v, z))) for m, b in window_parts(1.5, 1.4, trim)]
                    parts += Frame(*middle, yaw).parts(opening)
    out, middles = _windows_of(box, facing_deg)
    frame, v = Frame(*middle, facing_deg), middles[len(middles) // 2]
    panel = block(out, v - 0.6, out + 0.1, v + 0.6, 0.2 - DEPTH_M, 2.5 - DEPTH_M)
    hood = block(out, v - 1.0, out + 0.9, v + 1.0, 2.75 - DEPTH_M, 2.9 - DEPTH_M)
    parts += frame.parts([(door, panel), (trim, hood)])
    if name:
        at = (*frame.at(out + 0.02, 0.0), storeys * 3.1 - DEPTH_M - 0.72)
        parts.append((site.material("lettering", "#3a332c"), letters(name, 0.5, at, facing_deg, 0.06)))
    site.add(None, "flat_house", parts, footprint=plan)
    return top


def _windows_of(box: tuple[float, float, float, float], yaw_deg: float) -> tuple[float, list[float]]:
    """Give how far from its middle a side of a house is, and where its windows stand along it."""
    x0, y0, x1, y1 = box
    deep, wide = (y1 - y0, x1 - x0) if yaw_deg % 180.0 == 90.0 else (x1 - x0, y1 - y0)
    count = max(int((wide - 1.0) // 2.6), 1)
    return deep / 2, [(k - (count - 1) / 2) * (wide - 1.0) / count for k in range(count)]


@site_builder
def drift(site: Site, area: Area, categories: list[str], spacing_m: Number, limit: int, place: str) -> None:
    """Let things drift about an area, a category after the other."""
    rng = site.rng_for("drift", place)
    count = 0
    for x, y, yaw in poisson_disc(area, spacing_m, rng, limit=limit * 4):
        if count >= limit:
            return
        category = categories[count % len(categories)]
        if site.is_free(x, y, 2.0):
            site.place(Placement(category, x, y, yaw, z=-0.12, place=place))
            count += 1


@site_builder
def wires(site: Site, heads: list[tuple[Number, Number, Number]], sag_m: Number = 0.7) -> None:
    """Hang a power line of two wires between the heads of poles, with the poles themselves."""
    parts: Parts = []
    for x, y, z in heads:
        pole = block(x - 0.11, y - 0.11, x + 0.11, y + 0.11, -DEPTH_M, z + 0.25)
        arm = block(x - 0.07, y - 0.75, x + 0.07, y + 0.75, z - 0.12, z)
        parts += [("bark:#5a4a3a", merge([pole, arm]))]
        parts += [("#e8e4da", merge([block(x - 0.05, y + s - 0.05, x + 0.05, y + s + 0.05, z, z + 0.2)
                                     for s in (-0.6, 0.6)]))]  # fmt: skip
    for (xa, ya, za), (xb, yb, zb) in pairwise(heads):
        for s in (-0.6, 0.6):
            t = np.linspace(0.0, 1.0, 7)
            path = [(xa + (xb - xa) * u, ya + (yb - ya) * u + s, za + (zb - za) * u + 0.2 - sag_m * 4 * u * (1 - u))
                    for u in t]  # fmt: skip
            parts.append(("iron", sweep(path=path, radius=0.025, sides=4)))
    site.add(None, "power_line", parts)
    for x, y, _ in heads:
        site.occupy(ribbon([(x - 0.3, y), (x + 0.3, y)], 0.6))


def _band(area: BaseGeometry) -> Mesh:
    """Make the strip of dirt that the water left on walls."""
    return plates(area, -0.1, 0.35)
