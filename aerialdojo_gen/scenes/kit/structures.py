"""Structure that urban layouts share: decks on columns, railings, stairs, canopies, lettering on walls, slabs.

Every function returns meshes in world coordinates with their materials, to be given to `Site.add`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, leg, plates, slab
from aerialdojo_gen.scenes.ground import edge_strip, rectangle, without
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, Areas, At, Box, Line, Material, Number, Spacing
from aerialdojo_gen.scenes.shapes import box, cylinder, profile
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.vocabulary import text

Point = tuple[float, float]


def rail_legs(path: Sequence[Point], spacing_m: float) -> Iterator[tuple[float, np.ndarray, Point, list[Point]]]:
    """Yield length, turn, middle and places of posts of every leg, the posts about `spacing_m` apart."""
    for a, b in pairwise(path):
        length, yaw = leg(a, b)
        shares = [k / n for n in (max(round(length / spacing_m), 1),) for k in range(n + 1)]
        spots = [(a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t) for t in shares]
        yield length, rotation(0.0, 0.0, yaw), ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), spots


def block(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float) -> Mesh:
    """Make an axis-parallel block between two corners, metres; x in either order."""
    return slab(rectangle(min(x0, x1), y0, max(x0, x1), y1), z0, z1)


def columns(points: Sequence[Point], z0: float, z1: float, radius_m: float = 0.25, segments: int = 8) -> Mesh:
    """Make round columns at points, from `z0` to `z1`, metres."""
    return merge([translated(cylinder(radius=radius_m, height=z1 - z0, segments=segments), (*p, z0)) for p in points])


@part_builder
def round_columns(
    *, at: list[At], z: tuple[Number, Number], material: Material, radius_m: Number = 0.25,
    segments: Annotated[int, Field(ge=3, le=64)] = 8,
) -> Parts:  # fmt: skip
    """Make round columns at points, between two heights."""
    return [(material, columns(at, *z, radius_m, segments))]


@part_builder
def railing(
    path: Line, z_m: Number, *, height_m: Number = 1.05, pane: Material | None = "glass", frame: Material = "iron"
) -> Parts:
    """Make a railing along a polyline on a floor at `z_m`: posts every 2 m, a handrail, and panes.

    Without a `pane` it has two slim bars below the handrail: what stands behind it is seen.
    """
    posts, panes, rails = [], [], []
    for length, turn, middle, spots in rail_legs(path, 2.0):
        if pane is None:
            rails += [
                posed(box(size=[length, 0.03, 0.03]), turn, (*middle, z_m + s * height_m)) for s in (0.33, 0.67)
            ]
        else:
            panes.append(posed(box(size=[length, 0.04, height_m - 0.25]), turn, (*middle, z_m + 0.12)))
        rails.append(posed(box(size=[length + 0.08, 0.1, 0.08]), turn, (*middle, z_m + height_m)))
        posts += [posed(box(size=[0.08, 0.08, height_m]), turn, (*spot, z_m)) for spot in spots]
    body = (frame, merge(posts + rails))
    return [body] if pane is None else [(pane, merge(panes)), body]


@part_builder
def deck(
    plan: Area, z_m: Number, *, floor: Material, under: Material = "plaster", thickness_m: Number = 0.3,
    posts: Sequence[At] = (), post_rows: Sequence[Line] = (), post_every_m: Spacing = 6.0, foot_m: Number = 0.0,
    post: Material = "plaster", post_radius_m: Number = 0.28,
) -> Parts:  # fmt: skip
    """Make a floor at `z_m` (its top) on round columns that stand on `foot_m`, in rows or one by one."""
    parts: Parts = [
        (floor, slab(plan, z_m - 0.05, z_m)),
        (under, slab(plan.buffer(-0.02, join_style="mitre"), z_m - thickness_m, z_m - 0.05)),
    ]
    stand = [*_in_rows(post_rows, post_every_m), *posts]
    if stand:
        parts.append((post, columns(stand, foot_m, z_m - thickness_m, post_radius_m)))
    return parts


@part_builder
def stairs(
    foot: At, yaw_deg: Number, width_m: Number, rise_m: Number, run_m: Number, *, z_m: Number = 0.0,
    tread: Material = "concrete", stringer: Material = "iron",
) -> Parts:  # fmt: skip
    """Make open stairs that climb from `foot` along `yaw_deg`: treads between two stringers.

    `foot` is the middle of the lowest edge, at the height `z_m`; width, rise and run are those of the whole flight.
    """
    count = max(round(rise_m / 0.22), 2)
    step, going = rise_m / count, run_m / count
    treads = [
        translated(box(size=[going + 0.06, width_m, 0.08]), (going * (k + 0.5), 0.0, step * (k + 1) - 0.08))
        for k in range(count)
    ]
    edge = [(0.0, 0.0), (run_m, rise_m - 0.28), (run_m, rise_m), (-0.0, 0.28)]
    side = [translated(profile(points=edge, width=0.1), (0.0, s * (width_m / 2 + 0.05), 0.0)) for s in (-1, 1)]
    rail = [(0.0, 1.0), (run_m, rise_m + 1.0), (run_m, rise_m + 1.08), (0.0, 1.08)]
    side += [translated(profile(points=rail, width=0.06), (0.0, s * (width_m / 2 + 0.05), 0.0)) for s in (-1, 1)]
    for k in range(0, count, 4):
        at = (going * (k + 0.5), step * (k + 1))
        side += [translated(box(size=[0.06, 0.06, 1.0]), (at[0], s * (width_m / 2 + 0.05), at[1])) for s in (-1, 1)]
    return Frame(*foot, yaw_deg).parts([(tread, merge(treads)), (stringer, merge(side))], z_m)


@site_builder
def flights(
    site: Site, *, feet: list[At], yaw_deg: Number, width_m: Number, run_m: Number, to_m: Number,
    on: Number | None = None, tread: Material = "concrete", stringer: Material = "iron",
) -> None:  # fmt: skip
    """Put up flights of open steps that climb from each foot along `yaw_deg`, from `on` or the ground."""
    plan = rectangle(0.0, -width_m / 2 - 0.1, run_m, width_m / 2 + 0.1)
    for foot in feet:
        z = site.ground_z(*foot) - 0.1 if on is None else on
        parts = stairs(foot, yaw_deg, width_m, to_m - z, run_m, z_m=z, tread=tread, stringer=stringer)
        site.add(None, "steps", parts, footprint=Frame(*foot, yaw_deg).area(plan))


@part_builder
def canopy(
    box: Box, z_m: Number, *, roof: Material, post: Material = "chrome",
    posts: Sequence[At] = (), post_rows: Sequence[Line] = (), post_every_m: Spacing = 6.0, foot_m: Number = 0.0,
) -> Parts:  # fmt: skip
    """Make a flat roof with its underside at `z_m`, a fascia around it, and slender posts, in rows or one by one."""
    ring = rectangle(*box).exterior.buffer(0.09, join_style="mitre", cap_style="flat")
    parts: Parts = [(roof, block(*box, z_m + 0.08, z_m + 0.22)), (post, slab(ring, z_m, z_m + 0.34))]
    stand = [*_in_rows(post_rows, post_every_m), *posts]
    if stand:
        parts.append((post, columns(stand, foot_m, z_m + 0.08, 0.12)))
    return parts


def ramp(a: Point, b: Point, z0_m: float, z1_m: float, width_m: float, *, floor: str, wall: str) -> Parts:
    """Make a straight ramp of a car park from `a` up to `b` with low walls on both sides."""
    (length, yaw_deg), rise = leg(a, b), z1_m - z0_m
    way = profile(points=[(0.0, -0.02), (length, rise - 0.3), (length, rise), (0.0, 0.01)], width=width_m)
    edge = [(0.0, 0.0), (length, rise - 0.3), (length, rise + 0.9), (0.0, 0.9)]
    sides = [translated(profile(points=edge, width=0.2), (0.0, s * (width_m / 2 + 0.1), 0.0)) for s in (-1, 1)]
    return Frame(*a, yaw_deg).parts([(floor, way), (wall, merge(sides))], z0_m)


def parapet(plan: BaseGeometry, z_m: float, height_m: float = 1.0, gaps: Sequence[BaseGeometry] = ()) -> Mesh:
    """Make a low wall along a plan's edge on a floor at `z_m`, open where it meets `gaps`."""
    return plates(without(edge_strip(plan, 0.2), gaps), z_m, z_m + height_m)


@part_builder
def sash_windows(
    *, at_x: list[Number], walls: list[tuple[Number, Number]], sills: list[Number], frame: Material,
    pane: Material = "window",
) -> Parts:  # fmt: skip
    """Make windows with sill and mullion on walls along x: (y, -1 or 1 for the side that it faces)."""
    parts: Parts = []
    for x in at_x:
        for y, s in walls:
            a, b = sorted((y - s * 0.05, y + s * 0.08))
            for z in sills:
                parts.append((pane, block(x - 0.55, a, x + 0.55, b, z, z + 1.6)))
                parts.append((frame, merge([block(x - 0.7, a, x + 0.7, b + 0.04, z - 0.15, z),
                                            block(x - 0.04, a, x + 0.04, b + 0.03, z, z + 1.6)])))  # fmt: skip
    return parts


def letters(
    line: str, height_m: float, at: tuple[float, float, float], yaw_deg: float, depth_m: float = 0.12
) -> Mesh:
    """Write on a wall: bottom middle `at` a point of its face, metres, read by whoever looks against `yaw_deg`."""
    return posed(text(text=line, height=height_m, depth=depth_m), rotation(0.0, 0.0, yaw_deg), at)


def spaced(a: Point, b: Point, spacing_m: float) -> list[Point]:
    """List points from `a` to `b`, both of them and others about `spacing_m` apart."""
    line = LineString([a, b])
    count = max(round(line.length / spacing_m), 1)
    return [(float(p.x), float(p.y)) for p in (line.interpolate(line.length * k / count) for k in range(count + 1))]


def _in_rows(rows: Sequence[Sequence[Point]], spacing_m: float) -> list[Point]:
    """List points along every leg of lines, about `spacing_m` apart."""
    return [point for row in rows for a, b in pairwise(row) for point in spaced(a, b, spacing_m)]


@part_builder
def area_slab(area: Areas, z: tuple[Number, Number], role: Material) -> Parts:
    """Extrude an area, or several, between two heights: a deck, a hull, walls around a yard, panes of a front."""
    return [(role, plates(one, *z)) for one in area]
