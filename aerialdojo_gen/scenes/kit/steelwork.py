"""Steel and timber members, guard rails, galleries, in world coordinates; process plant of pipes and vessels."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, leg, plates
from aerialdojo_gen.scenes.ground import edge_strip, rectangle, without
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.structures import Point, block, rail_legs, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, translated
from aerialdojo_gen.scenes.plans.values import (
    Area,
    Areas,
    At,
    Box,
    Line,
    Material,
    Materials,
    Number,
    Point3,
    Spacing,
)
from aerialdojo_gen.scenes.shapes import box, lathe, sweep
from aerialdojo_gen.scenes.site import Site


@part_builder
def square_posts(*, at: list[At], z: tuple[Number, Number], width_m: Number, material: Material) -> Parts:
    """Make square posts at points, between two heights."""
    return [(material, posts(at, *z, width_m))]


@part_builder
def guard_rail(
    *, z_m: Number, line: Line | None = None, around: Area | None = None, gaps: Areas = [],  # noqa: B006
    inset_m: Number = 0.15, material: Material = "marking_yellow", toe: Material | None = None,
    post_m: Annotated[Number, Field(ge=0.2)] = 2.4,
) -> Parts:  # fmt: skip
    """Make a guard rail along a line, or around a floor a little inside of its edge, open in the gaps.

    The floor is at `z_m`; posts stand about `post_m` apart; without a `toe` there is no toe board.
    """
    path: BaseGeometry = LineString(line) if around is None else rim(around, gaps, inset_m)
    return guard_rails(path, z_m, material=material, toe=toe, post_m=post_m)


@part_builder
def lattice_beams(
    *, x: tuple[Number, Number], rows: tuple[Number, Number], z: tuple[Number, Number], material: Material,
    panels: Annotated[int, Field(ge=1, le=200)] = 14, width_m: Number = 0.26,
    free: tuple[Number, Number] = (0.0, 0.0),
) -> Parts:  # fmt: skip
    """Make two lattice beams along x in rows (y), tied at the top at every second panel but on a `free` stretch."""
    (x0, x1), (low, high), step = x, z, (x[1] - x[0]) / panels
    lines: list[tuple[Point3, Point3]] = []
    for y in rows:
        lines += [((x0, y, w), (x1, y, w)) for w in z]
        for k in range(panels):
            a, b = x0 + k * step, x0 + (k + 1) * step
            lines.append(((a, y, low), (b, y, high)) if k % 2 else ((a, y, high), (b, y, low)))
            lines.append(((a, y, low), (a, y, high)))
    ties = [x0 + k * step for k in range(0, panels + 1, 2)]
    lines += [((a, rows[0], high), (a, rows[1], high)) for a in ties if not free[0] <= a <= free[1]]
    return [(material, bars(lines, width_m))]


@site_builder
def conveyor_gallery(
    site: Site, *, start: Point3, end: Point3, wall: Material, wide_m: Number = 2.4, high_m: Number = 2.4,
    legs: Sequence[Number] = (),
) -> None:  # fmt: skip
    """Carry a closed conveyor from a point up to another, the middles of its floor, on trestles at shares of it."""
    (xa, ya, za), (xb, yb, zb) = start, end
    (length, yaw_deg), rise = leg((xa, ya), (xb, yb)), zb - za
    tube = sweep(path=[(0.0, 0.0, high_m / 2), (length, 0.0, rise + high_m / 2)], section=(wide_m, high_m))
    n = max(int(length // 3.0), 1)
    at = [length * (k + 0.5) / n for k in range(n)]
    panes = [translated(box(size=[1.3, wide_m + 0.1, 0.7]), (u, 0.0, rise * u / length + high_m * 0.5)) for u in at]
    lid = sweep(path=[(0.0, 0.0, high_m + 0.1), (length, 0.0, rise + high_m + 0.1)], section=(wide_m + 0.3, 0.16))
    raw: Parts = [(wall, tube), ("glass:#7f95a0", merge(panes)), ("iron", lid)]
    parts = Frame(xa, ya, yaw_deg).parts(raw, za)
    for t in legs:
        x, y = xa + (xb - xa) * t, ya + (yb - ya) * t
        foot = site.ground_z(x, y)
        parts.append(("steel", trestle(x, y, foot, za + rise * t + 0.1, 1.0)))
        site.occupy(rectangle(x - 1.2, y - 1.2, x + 1.2, y + 1.2), foot, za + rise * t)
    site.add(None, "conveyor_gallery", parts)
    below = LineString([(xa, ya), (xb, yb)]).buffer(wide_m / 2, cap_style="flat")
    site.occupy(below, min(za, zb), max(za, zb) + high_m)


def guard_rails(
    path: BaseGeometry, z_m: float, *, material: str = "marking_yellow", toe: str | None = None, post_m: float = 2.4
) -> Parts:
    """Make a guard rail along lines on a floor at `z_m`: posts, a knee rail, a handrail, and a toe board if any."""
    steel: list[Mesh] = []
    boards: list[Mesh] = []
    for line in getattr(path, "geoms", [path]):
        for length, turn, middle, spots in rail_legs(line.coords, post_m):
            if length < 0.4:
                continue
            rail = box(size=[length, 0.06, 0.06])
            steel += [posed(rail, turn, (*middle, z_m + level)) for level in (0.52, 1.04)]
            boards.append(posed(box(size=[length, 0.04, 0.2]), turn, (*middle, z_m)))
            steel += [translated(box(size=[0.07, 0.07, 1.1]), (*spot, z_m)) for spot in spots]
    parts: Parts = [(material, merge(steel))]
    return parts if toe is None else [*parts, (toe, merge(boards))]


def rim(plan: BaseGeometry, gaps: Sequence[BaseGeometry] = (), inset_m: float = 0.15) -> BaseGeometry:
    """Give the lines along a floor's edges, a little inside of them, without what lies in the gaps."""
    return without(plan.buffer(-inset_m, join_style="mitre").boundary, gaps)


def posts(points: Sequence[tuple[float, float]], z0: float, z1: float, width_m: float) -> Mesh:
    """Make square posts at points from `z0` to `z1`, metres."""
    h = width_m / 2
    return merge([block(x - h, y - h, x + h, y + h, z0, z1) for x, y in points])


def bars(lines: Sequence[tuple[Point3, Point3]], width_m: float) -> Mesh:
    """Make straight members of a square section between pairs of points, metres."""
    return merge([sweep(path=[a, b], section=(width_m, width_m)) for a, b in lines])


def trestle(x: float, y: float, z0: float, z1: float, half_m: float, width_m: float = 0.18) -> Mesh:
    """Make a braced steel tower of four legs about (x, y)."""
    corners = [(x - half_m, y - half_m), (x + half_m, y - half_m), (x + half_m, y + half_m), (x - half_m, y + half_m)]
    lines: list[tuple[Point3, Point3]] = [((u, v, z0), (u, v, z1)) for u, v in corners]
    bays = max(round((z1 - z0) / 3.0), 1)
    for k in range(bays):
        low, high = z0 + (z1 - z0) * k / bays, z0 + (z1 - z0) * (k + 1) / bays
        for a, b in pairwise([*corners, corners[0]]):
            lines.append(((*a, low), (*b, high)) if k % 2 else ((*b, low), (*a, high)))
            lines.append(((*a, high - 0.1), (*b, high - 0.1)))
    return bars(lines, width_m)


# Of the pipes: to the left of the middle, above the bearing, radius
_PIPES = (
    (-0.8, 0.36, 0.26), (-0.15, 0.28, 0.18), (0.7, 0.44, 0.34),
    (-0.6, 1.84, 0.24), (0.1, 1.76, 0.16), (0.75, 1.82, 0.22),
)  # fmt: skip


@site_builder
def pipe_bridge(
    site: Site, *, line: Line, z_m: Number, pipes: Materials, steel: Material = "steel", bay_m: Spacing = 8.0
) -> None:
    """Lay a bridge of six pipes on two decks along a line of axis-parallel legs; the lower ones lie at `z_m`.

    The pipes take the materials in turn; trestles stand about `bay_m` apart and take their ground.
    """
    feet: list[Point] = []
    girders: list[tuple[Point3, Point3]] = []
    for a, b in pairwise(line):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        dx, dy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
        count = max(round(length / bay_m), 1)
        for k in range(count + 1):
            x, y = a[0] + dx * length * k / count, a[1] + dy * length * k / count
            ends = [(x - dy * s * 1.3, y + dx * s * 1.3) for s in (-1, 1)]
            if all(np.hypot(x - u, y - v) > 0.5 for u, v in feet[::2]):
                feet += ends
                girders += [((*ends[0], z_m + up), (*ends[1], z_m + up)) for up in (0.0, 1.5)]
        for s in (-1, 1):
            p, q = (a[0] - dy * s * 1.3, a[1] + dx * s * 1.3), (b[0] - dy * s * 1.3, b[1] + dx * s * 1.3)
            girders += [((*p, z_m + up), (*q, z_m + up)) for up in (-0.05, 1.45)]
    parts: Parts = [(steel, posts(feet, 0.0, z_m + 1.6, 0.26)), (steel, bars(girders, 0.2))]
    for k, (side, up, radius) in enumerate(_PIPES):
        path = [(x, y, z_m + up) for x, y in LineString(line).offset_curve(side, join_style="mitre").coords]
        parts.append((pipes[k % len(pipes)], sweep(path=path, radius=radius, sides=8)))
    site.add(None, "pipe_bridge", parts)
    site.occupy_about(feet, 0.35, 0.0, z_m)


@site_builder
def bund(
    site: Site, *, box: Box, height_m: Number = 0.9, floor: Material = "concrete:#a7a297",
    wall: Material = "concrete:#8e8a80",
) -> None:  # fmt: skip
    """Wall a tank farm in, and pave it; steps lead over the wall on the south side."""
    plan = rectangle(*box)
    site.paint(plan, floor)
    ring = edge_strip(plan, 0.3)
    x, y = (box[0] + box[2]) / 2, box[1]
    steps = [block(x - 0.7, y - 0.4 * k, x + 0.7, y + 0.3 + 0.4 * k, 0.0, height_m - 0.3 * k) for k in (1, 2)]
    parts: Parts = [(wall, plates(ring, 0.0, height_m)), ("marking_yellow", merge(steps))]
    site.add(None, "bund_wall", parts, footprint=ring)


@site_builder
def process_tower(
    site: Site, *, box: Box, levels: Annotated[list[Number], Field(min_length=1, max_length=20)],
    vessels: list[tuple[Number, Number, Number, Number, Material]], steel: Material = "#5f7f8f",
    floor: Material = "sheet_metal:#7d8488",
) -> None:  # fmt: skip
    """Put up a steel structure with platforms, vessels that rise through them, and stairs at its west side.

    The box is the outline of its columns, `levels` the heights of the platforms; vessels are (x, y, radius, top,
    material) and stand on the ground. Columns, vessels and stairs take their ground.
    """
    x0, y0, x1, y1 = box
    nx, ny = (max(round(d / 5.5), 1) for d in (x1 - x0, y1 - y0))
    xs = [x0 + (x1 - x0) * k / nx for k in range(nx + 1)]
    ys = [y0 + (y1 - y0) * k / ny for k in range(ny + 1)]
    feet = [(x, y) for x in xs for y in ys if all(np.hypot(x - v[0], y - v[1]) > v[2] + 0.4 for v in vessels)]
    parts: Parts = [(steel, posts(feet, 0.0, levels[-1] + 0.1, 0.3))]
    beams: list[tuple[Point3, Point3]] = []
    for k, (low, z) in enumerate(pairwise([0.0, *levels])):
        plan = deck = rectangle(x0 - 0.3, y0 - 0.3, x1 + 0.3, y1 + 0.3)
        for x, y, r, top, _ in vessels:
            if top > z:
                deck = deck.difference(rectangle(x - r - 0.25, y - r - 0.25, x + r + 0.25, y + r + 0.25))
        parts.append((floor, plates(deck, z - 0.12, z)))
        landings = [rectangle(x0 - 1.0, y, x0 + 0.2, y + 1.4) for y in (y0 - 0.2, y1 - 1.2)]
        parts += guard_rails(rim(plan, landings), z)
        beams += [((x, ys[0], z - 0.3), (x, ys[-1], z - 0.3)) for x in xs]
        beams += [((xs[0], y, z - 0.3), (xs[-1], y, z - 0.3)) for y in ys]
        beams += [((xs[0], ys[0], low), (xs[0], ys[1], z - 0.4)), ((xs[-1], ys[-1], low), (xs[-1], ys[-2], z - 0.4))]
        # Flights climb to and fro along the west side.
        foot, yaw = ((x0 - 0.95, y0 + 0.2), 90.0) if k % 2 == 0 else ((x0 - 0.95, y1 - 0.2), -90.0)
        parts += stairs(foot, yaw, 1.0, z - low, y1 - y0 - 0.4, z_m=low, tread="sheet_metal")
    parts.append((steel, bars(beams, 0.18)))
    for x, y, r, top, material in vessels:
        parts += _vessel(x, y, r, top, material)
        site.occupy(rectangle(x - r - 0.1, y - r - 0.1, x + r + 0.1, y + r + 0.1), 0.0, top)
    site.add(None, "process_structure", parts)
    site.occupy_about(feet, 0.25, 0.0, levels[-1])
    site.occupy(rectangle(x0 - 1.6, y0 - 0.8, x0 - 0.3, y1 + 0.8), 0.0, levels[-1] + 1.0)


def _vessel(x: float, y: float, r: float, top: float, material: str) -> Parts:
    skirt, dome = 1.2, r * 0.5
    shell = [(r * 0.75, 0.0), (r * 0.75, skirt - 0.3), (r, skirt), (r, top - dome), (r * 0.7, top - dome * 0.3),
             (0.0, top)]  # fmt: skip
    band = lathe(points=[(r + 0.05, 0.0), (r + 0.05, 0.18)], segments=16)
    bands = [translated(band, (x, y, z)) for z in np.linspace(skirt + 0.6, top - dome - 0.6, 3)]
    out = x + r + 0.6
    stub = [(x, y, top - 0.2), (x, y, top + 0.7), (out, y, top + 0.7), (out, y, top - 1.8)]
    return [(material, translated(lathe(points=shell, segments=16), (x, y, 0.0))), ("metal", merge(bands)),
            ("metal", sweep(path=stub, radius=0.14))]  # fmt: skip
