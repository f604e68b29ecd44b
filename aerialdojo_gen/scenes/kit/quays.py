"""What stands at the water's edge, at z = 0: quays, fenders, mooring lines, breakwaters, jetties, piers, sea walls.

The water is the ground itself, level at z = 0; quays are painted with a rise, so that their walls stand upright.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes import shapes
from aerialdojo_gen.scenes.grammar import Frame, slab
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Point, block, columns, leg, rail_legs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, At, Box, Line, Material, Number, Point3
from aerialdojo_gen.scenes.shapes import box, crown, cylinder, sweep
from aerialdojo_gen.scenes.site import Site


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
                parts = [translated(box(size=(0.08, 0.08, 2.2)), (0.06, v, 0.0)) for v in (-0.25, 0.25)]
                parts += [translated(box(size=(0.06, 0.5, 0.06)), (0.06, 0.0, 0.2 + 0.35 * j)) for j in range(6)]
                rungs.append(posed(merge(parts), turn, (a.x, a.y, 0.0)))
            else:
                tyre = rotated(cylinder(radius=0.55, height=0.3, segments=10), rotation(0.0, 90.0, 0.0))
                tyres.append(posed(translated(tyre, (0.02, 0.0, 1.0)), turn, (a.x, a.y, 0.0)))
    parts_of: Parts = [("rubber", merge(tyres))]
    if rungs:
        parts_of.append(("marking_yellow", merge(rungs)))
    site.add(None, "fenders", parts_of)


@site_builder
def mooring_lines(
    site: Site, *, ropes: list[tuple[Point3, Point3]], sag_m: Number = 0.3, material: Material = "#c9a96a"
) -> None:
    """Stretch ropes from ships to the quay, each from a point to another, with a sag below the lower one."""
    bodies = []
    for a, b in ropes:
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, min(a[2], b[2]) - sag_m)
        bodies.append(sweep(path=[a, middle, b], radius=0.06, sides=4))
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
    site: Site, *, at: At, yaw_deg: Number, length_m: Number, width_m: Number, z: Number,
    bay_m: Annotated[Number, Field(ge=0.5)] = 5.0, floor: Material = "boards:#9a8462",
    pile: Material = "logs:#6f5a44", rail: Material | None = None,
    gates: list[tuple[Number, Number]] = [], category: str = "pier",  # noqa: B006
) -> None:  # fmt: skip
    """Build a pier on rows of piles that one can fly between; its ground stays free.

    It runs from `at`, the middle of its landward end, along `yaw_deg`, its floor at `z`; `gates` are the stretches,
    metres from there, where the rails at its sides are open.
    """
    frame, w = Frame(*at, yaw_deg), width_m / 2
    parts: Parts = [(floor, translated(box(size=(length_m, width_m, 0.14)), (length_m / 2, 0.0, z - 0.14)))]
    wood: list[Mesh] = [
        translated(box(size=(length_m, 0.22, 0.3)), (length_m / 2, v, z - 0.44)) for v in (-w + 0.2, 0.0, w - 0.2)
    ]
    count = max(round((length_m - 0.8) / bay_m), 1)
    for k in range(count + 1):
        u = 0.4 + (length_m - 0.8) * k / count
        ground = site.ground_z(*frame.at(u, 0.0))
        foot = min(ground, 0.0) - 1.0
        for v in (-w + 0.3, w - 0.3):
            wood.append(translated(cylinder(radius=0.17, height=z - 0.2 - foot, segments=8), (u, v, foot)))
        wood.append(translated(box(size=(0.24, width_m, 0.26)), (u, 0.0, z - 0.68)))
        if z - ground > 2.4:
            for s in (-1, 1):
                brace = [(u, s * (w - 0.3), ground + 0.4), (u, -s * (w - 0.3), z - 0.7)]
                wood.append(sweep(path=brace, radius=0.07, sides=4))
    parts.append((pile, merge(wood)))
    if rail:
        for side in (-w + 0.08, w - 0.08):
            for u0, u1 in _gaps(0.0, length_m, gates):
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
            bar = rotated(box(size=(length, thick, thick)), turn)
            bodies.append(translated(bar, (*middle, z_m + share * height_m - thick)))
        bodies += [posed(box(size=(0.08, 0.08, height_m)), turn, (*spot, z_m)) for spot in spots]
    return [(material, merge(bodies))]


@site_builder
def sea_wall(
    site: Site, *, box: Box, z: tuple[Number, Number],
    wall: Material = "blocks:#a79f92", cap: Material = "concrete", rail: Material | None = "#e8ecec",
    gates: list[tuple[Number, Number]] = [],  # noqa: B006
) -> None:  # fmt: skip
    """Put up a wall along x that holds a terrace and looks to -y: body, coping, buttresses, a railing along its edge.

    `gates` are stretches along x without railing, where steps arrive.
    """
    (x0, y0, x1, y1), (low, high) = box, z
    parts: Parts = [
        (wall, slab(rectangle(x0, y0, x1, y1), low, high - 0.25)),
        (cap, slab(rectangle(x0 - 0.02, y0 - 0.15, x1 + 0.02, y1), high - 0.25, high + 0.04)),
    ]
    for x in np.arange(x0 + 4.0, x1 - 1.0, 8.0):
        foot = shapes.box(size=(0.7, 0.5, high - low - 0.3), taper=(1.0, 0.5))
        parts.append((wall, translated(foot, (float(x), y0 - 0.1, low))))
    if rail:
        for a, b in _gaps(x0, x1, gates):
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


def _gaps(start: float, end: float, gates: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """List the stretches between gates."""
    out, at = [], start
    for a, b in sorted(gates):
        if a - at > 0.3:
            out.append((at, a))
        at = max(at, b)
    if end - at > 0.3:
        out.append((at, end))
    return out
