"""Steel and timber members, guard rails and closed galleries, in world coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

from pydantic import Field
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of, rectangle
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block, leg, rail_legs
from aerialdojo_gen.scenes.mesh import Mesh, merge, posed, translated
from aerialdojo_gen.scenes.plans.values import Area, Areas, At, Line, Material, Number, Point3
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.shapes_extruded import sweep
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
            for level in (0.52, 1.04):
                steel.append(posed(box(size=[length, 0.06, 0.06]), turn, (*middle, z_m + level)))
            boards.append(posed(box(size=[length, 0.04, 0.2]), turn, (*middle, z_m)))
            steel += [translated(box(size=[0.07, 0.07, 1.1]), (*spot, z_m)) for spot in spots]
    parts: Parts = [(material, merge(steel))] if steel else []
    return [*parts, (toe, merge(boards))] if toe is not None and boards else parts


def rim(plan: BaseGeometry, gaps: Sequence[BaseGeometry] = (), inset_m: float = 0.15) -> BaseGeometry:
    """Give the lines along a floor's edges, a little inside of them, without what lies in the gaps."""
    lines: BaseGeometry = plan.buffer(-inset_m, join_style="mitre").boundary
    for gap in gaps:
        lines = lines.difference(gap)
    return lines


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


def plates(area: BaseGeometry, z0: float, z1: float) -> Mesh:
    """Extrude every polygon of an area between two heights, metres."""
    return merge([slab(p, z0, z1) for p in polygons_of(area)])
