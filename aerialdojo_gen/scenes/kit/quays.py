"""The water's edge and floods: quays, piers, breakwaters, sea walls; dykes, houses in water, things adrift.

The water is the ground itself, level at z = 0. Quays are painted with a rise, so that their walls stand upright; what
stands in a flood is let down by its depth, and its lower part is hidden.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, between_gates, blob, leg, plates, poisson_disc, slab
from aerialdojo_gen.scenes.ground import edge_strip, rectangle, ribbon
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.kit.houses import HouseStyle, house, window_parts
from aerialdojo_gen.scenes.kit.structures import Point, block, columns, letters, rail_legs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotated, rotation, translated
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Box, Line, Material, Number, Point3, Spacing
from aerialdojo_gen.scenes.shapes import box as cuboid
from aerialdojo_gen.scenes.shapes import crown, cylinder, sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain


@site_builder
def quay(
    site: Site, *, area: Area, height_m: Number, material: Material = "concrete", edge: Material = "blocks:#8f8a80",
    coping: Material = "concrete:#bdb8ac",
) -> None:  # fmt: skip
    """Lay a quay with upright walls out of the water and a coping of dressed stone along its edge."""
    site.paint(area, coping, height_m, edge)
    site.paint(area.buffer(-0.6, join_style="mitre"), material, height_m, edge)


@site_builder
def fenders(site: Site, *, edges: list[Line], spacing_m: Number = 7.0) -> None:
    """Hang tyres and ladders on quay walls; every edge is walked with the water on its right."""
    tyres, rungs = [], []
    for edge in edges:
        whole = LineString(edge)
        count = max(int(whole.length // spacing_m), 1)
        for k in range(count):
            s = whole.length * (k + 0.5) / count
            a, b = whole.interpolate(s - 0.1), whole.interpolate(s + 0.1)
            yaw = math.degrees(math.atan2(b.y - a.y, b.x - a.x)) - 90.0
            turn = rotation(0.0, 0.0, yaw)
            if k % 4 == 2:
                parts = [translated(cuboid(size=(0.08, 0.08, 2.2)), (0.06, v, 0.0)) for v in (-0.25, 0.25)]
                parts += [translated(cuboid(size=(0.06, 0.5, 0.06)), (0.06, 0.0, 0.2 + 0.35 * j)) for j in range(6)]
                rungs.append(posed(merge(parts), turn, (a.x, a.y, 0.0)))
            else:
                tyre = rotated(cylinder(radius=0.55, height=0.3, segments=10), rotation(0.0, 90.0, 0.0))
                tyres.append(posed(translated(tyre, (0.02, 0.0, 1.0)), turn, (a.x, a.y, 0.0)))
    site.add(None, "fenders", [("rubber", merge(tyres)), ("marking_yellow", merge(rungs))])


@site_builder
def mooring_lines(
    site: Site, *, ropes: list[tuple[Point3, Point3]], sag_m: Number = 0.3, material: Material = "#c9a96a"
) -> None:
    """Stretch ropes from ships to the quay, each from a point to another, with a sag below the lower one."""
    lows = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, min(a[2], b[2]) - sag_m) for a, b in ropes]
    bodies = [sweep(path=[a, low, b], radius=0.06, sides=4) for (a, b), low in zip(ropes, lows, strict=True)]
    site.add(None, "mooring_lines", [(material, merge(bodies))])


@site_builder
def breakwater(
    site: Site, *, path: Line, top_m: Number = 2.6, core: Material = "rubble:#7f7a72", way: Material = "concrete",
    seed: int = 0,
) -> None:  # fmt: skip
    """Heap up a breakwater of rocks with a paved way at `top_m` along a path."""
    parts: Parts = [
        (core, slab(ribbon(path, 8.0), -0.3, top_m - 1.3)),
        (way, slab(ribbon(path, 4.0), top_m - 1.6, top_m)),
    ]
    rng = site.rng_for("breakwater", seed)
    rocks: list[list[Mesh]] = [[], []]
    whole = LineString(path)
    for side in (-1, 1):
        for offset, z, size in ((4.4, 0.15, 1.35), (3.2, top_m - 1.2, 1.0)):
            edge = whole.offset_curve(side * offset, join_style="mitre")
            for s in np.arange(0.5, edge.length, 2.3):
                p = edge.interpolate(s + float(rng.uniform(-0.5, 0.5)))
                radii = rng.uniform(0.65, 1.0, 3) * size
                body = crown(radii=tuple(radii), noise=0.35, subdivisions=1, seed=int(rng.integers(40)))
                rocks[int(rng.integers(2))].append(translated(body, (p.x, p.y, z)))
    parts += [("rock:#8d877c", merge(rocks[0])), ("rock:#6f6a64", merge(rocks[1]))]
    site.add(None, "breakwater", parts)


@site_builder
def jetties(
    site: Site, *, lines: list[Line], width_m: Number = 2.4, z: Number = 1.2, floor: Material = "planks:#9a8460",
    pile: Material = "bark:#5a4a3a",
) -> None:  # fmt: skip
    """Build wooden jetties on piles, each straight from the first point of a line to its last, the floor at `z`."""
    for line in lines:
        (x0, y0), (x1, y1) = line[0], line[-1]
        length, yaw_deg = leg((x0, y0), (x1, y1))
        count = max(round(length / 4.0), 1)
        piles = [(length * k / count, s * (width_m / 2 - 0.1)) for k in range(count + 1) for s in (-1, 1)]
        joists = [block(0.0, s - 0.08, length, s + 0.08, z - 0.36, z - 0.12) for s in (-0.8, 0.8)]
        local: Parts = [
            (floor, block(0.0, -width_m / 2, length, width_m / 2, z - 0.12, z)),
            ("wood", merge(joists)),
            (pile, columns(piles, -0.3, z + 0.55, 0.15, 6)),
        ]
        site.add(None, "jetty", Frame(x0, y0, yaw_deg).parts(local))


@site_builder
def mole(
    site: Site, *, path: Line, width_m: Number, z: Number, stone: Material = "blocks:#9a9488",
    way: Material = "paving:#a59c8c",
) -> None:  # fmt: skip
    """Build a solid breakwater of masonry along a path, its way at `z`, with a parapet on its left side."""
    line = LineString(path)
    body = line.buffer(width_m / 2, cap_style="flat", join_style="mitre")
    parapet = line.offset_curve(width_m / 2 - 0.3).buffer(0.3, cap_style="flat", join_style="mitre")
    parts: Parts = [
        (stone, slab(body, -1.0, z - 0.2)),
        (way, slab(body.buffer(0.08, join_style="mitre"), z - 0.2, z)),
        (stone, slab(parapet, z, z + 0.9)),
    ]
    site.add(None, "breakwater", parts, footprint=body)


@site_builder
def pier(
    site: Site, *, at: At, yaw_deg: Number, length_m: Number, width_m: Number, z: Number, bay_m: Spacing = 5.0,
    floor: Material = "boards:#9a8462", pile: Material = "logs:#6f5a44", rail: Material | None = None,
    gates: list[tuple[Number, Number]] = [], category: str = "pier",  # noqa: B006
) -> None:  # fmt: skip
    """Build a pier on rows of piles that one can fly between; its ground stays free.

    It runs from `at`, the middle of its landward end, along `yaw_deg`, its floor at `z`; `gates` are the stretches,
    metres from there, where the rails at its sides are open.
    """
    frame, w = Frame(*at, yaw_deg), width_m / 2
    parts: Parts = [(floor, translated(cuboid(size=(length_m, width_m, 0.14)), (length_m / 2, 0.0, z - 0.14)))]
    wood: list[Mesh] = [
        translated(cuboid(size=(length_m, 0.22, 0.3)), (length_m / 2, v, z - 0.44)) for v in (-w + 0.2, 0.0, w - 0.2)
    ]
    count = max(round((length_m - 0.8) / bay_m), 1)
    for k in range(count + 1):
        u = 0.4 + (length_m - 0.8) * k / count
        ground = site.ground_z(*frame.at(u, 0.0))
        foot = min(ground, 0.0) - 1.0
        wood.append(columns([(u, -w + 0.3), (u, w - 0.3)], foot, z - 0.2, 0.17))
        wood.append(translated(cuboid(size=(0.24, width_m, 0.26)), (u, 0.0, z - 0.68)))
        if z - ground > 2.4:
            braces = [[(u, s * (w - 0.3), ground + 0.4), (u, -s * (w - 0.3), z - 0.7)] for s in (-1, 1)]
            wood += [sweep(path=brace, radius=0.07, sides=4) for brace in braces]
    parts.append((pile, merge(wood)))
    if rail:
        for side in (-w + 0.08, w - 0.08):
            for u0, u1 in between_gates(0.0, length_m, gates, 0.3):
                parts += bars([(u0, side), (u1, side)], z, rail)
    site.add(None, category, frame.parts(parts))


@site_builder
def bar_railing(
    site: Site, *, line: Line, on: Number | None = None, height_m: Number = 1.0, material: Material = "#f1f0ea",
    sunk_m: Number = 0.0,
) -> None:  # fmt: skip
    """Put up a level railing of bars along a line, at a height or on the line's lowest ground."""
    z = min(site.ground_z(x, y) for x, y in line) if on is None else on
    site.add(None, "railing", bars(line, z - sunk_m, material, height_m))


def bars(path: Sequence[Point], z_m: float, material: str = "#f1f0ea", height_m: float = 1.0) -> Parts:
    """Make an open railing of posts every 2 m and three bars along a path on a floor at `z_m`."""
    bodies: list[Mesh] = []
    for length, turn, middle, spots in rail_legs(path, 2.0):
        for share, thick in ((0.35, 0.04), (0.68, 0.04), (1.0, 0.09)):
            bar = rotated(cuboid(size=(length, thick, thick)), turn)
            bodies.append(translated(bar, (*middle, z_m + share * height_m - thick)))
        bodies += [posed(cuboid(size=(0.08, 0.08, height_m)), turn, (*spot, z_m)) for spot in spots]
    return [(material, merge(bodies))]


@site_builder
def sea_wall(
    site: Site, *, box: Box, z: tuple[Number, Number], wall: Material = "blocks:#a79f92", cap: Material = "concrete",
    rail: Material | None = "#e8ecec", gates: list[tuple[Number, Number]] = [],  # noqa: B006
) -> None:  # fmt: skip
    """Put up a wall along x that holds a terrace and looks to -y: body, coping, buttresses, a railing along its edge.

    `gates` are stretches along x without railing, where steps arrive.
    """
    (x0, y0, x1, y1), (low, high) = box, z
    parts: Parts = [
        (wall, slab(rectangle(x0, y0, x1, y1), low, high - 0.25)),
        (cap, slab(rectangle(x0 - 0.02, y0 - 0.15, x1 + 0.02, y1), high - 0.25, high + 0.04)),
    ]
    foot = cuboid(size=(0.7, 0.5, high - low - 0.3), taper=(1.0, 0.5))
    parts += [(wall, translated(foot, (float(x), y0 - 0.1, low))) for x in np.arange(x0 + 4.0, x1 - 1.0, 8.0)]
    if rail:
        for a, b in between_gates(x0, x1, gates, 0.3):
            parts += bars([(a, y0 + 0.1), (b, y0 + 0.1)], high + 0.04, rail, 1.0)
    site.add(None, "sea_wall", parts, footprint=rectangle(x0, y0 - 0.4, x1, y1))


@site_builder
def groynes(
    site: Site, *, lines: list[Line], height_m: Number, material: Material = "planks:#6f5d47",
    post: Material = "logs:#5d4c3a",
) -> None:  # fmt: skip
    """Put up timber groynes along lines: close planks between posts that follow the beach's fall."""
    for path in lines:
        line = LineString(path)
        count = max(round(line.length / 2.5), 1)
        points = [line.interpolate(k / count, normalized=True) for k in range(count + 1)]
        xyz = [(p.x, p.y, max(site.ground_z(p.x, p.y), 0.0)) for p in points]
        planks = sweep(path=[(x, y, z + height_m / 2 - 0.3) for x, y, z in xyz], section=(0.14, height_m + 0.2))
        posts = [
            translated(cylinder(radius=0.16, height=height_m + 1.1, segments=8), (x, y, z - 0.8)) for x, y, z in xyz
        ]
        area = line.buffer(0.3, cap_style="flat")
        site.add(None, "groyne", [(material, planks), (post, merge(posts))], footprint=area)


DEPTH_M = 1.25
CELL_M = 1.0
_SLOPE_M = 6.0
_STAINED_M = (-0.1, 0.35)  # what the water left dirty of walls


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
            site.paint(Frame(x, y, yaw).area(lens), site.material("foam", "water:#a8947a"))


@site_builder
def flooded_house(site: Site, at: At, yaw_deg: Number, style: HouseStyle) -> None:
    """Put up a house that stands in water up to its lower window sills, with a line of dirt above it."""
    frame = Frame(*at, yaw_deg)
    house(site, frame, style, z=-DEPTH_M)
    d, w = style.depth_m / 2 + 0.03, style.width_m / 2 + 0.03
    ring = rectangle(-d, -w, d, w).difference(rectangle(-d + 0.05, -w + 0.05, d - 0.05, w - 0.05))
    site.add(None, "water_mark", [(site.material("stain", "mud:#8a7152"), plates(frame.area(ring), *_STAINED_M))])


@site_builder
def flat_house(
    site: Site, box: Box, *, storeys: int, wall: Material, name: str = "", facing_deg: Number = -90.0,
    trim: Material = "#f2efe6", roof: Material = "gravel", door: Material = "wood", parapet_m: Number = 0.35,
) -> float:  # fmt: skip
    """Put up a building with a flat roof that people can flee to; gives the height of its roof, metres.

    Storeys are 3.1 m high; the front faces a multiple of 90 degrees, with the name over its door.
    """
    x0, y0, x1, y1 = box
    plan, top = rectangle(*box), storeys * 3.1 - DEPTH_M + 0.3
    parts: Parts = [
        (wall, block(*box, -DEPTH_M, top - 0.02)),
        (roof, block(x0 + 0.05, y0 + 0.05, x1 - 0.05, y1 - 0.05, top - 0.02, top)),
        ("concrete", plates(edge_strip(plan, 0.25, 0.12), top - 0.3, top + parapet_m)),
        (site.material("stain", "mud:#8a7152"), plates(edge_strip(plan, 0.02, 0.03), *_STAINED_M)),
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
