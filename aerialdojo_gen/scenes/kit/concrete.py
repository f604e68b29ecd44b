"""Concrete under way: frames of slabs and columns, starter bars, props, infill walls, stair cores, scaffolds.

Things may stand on the slabs, whose floor stays free between the columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, leg, plates
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.buildings import wall_with_openings
from aerialdojo_gen.scenes.kit.steelwork import bars, guard_rails, posts, rim
from aerialdojo_gen.scenes.kit.structures import Point, block, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, translated
from aerialdojo_gen.scenes.plans.values import Area, At, Box, Line, Material, Number
from aerialdojo_gen.scenes.shapes import box as cuboid
from aerialdojo_gen.scenes.site import Site

SLAB_M = 0.28
_Step = Annotated[Number, Field(ge=0.2)]


@dataclass(frozen=True)
class Slab:
    """A floor of a frame."""

    area: Area
    z: Number  # Height of its top
    opening: Area | None = None  # For stairs and shafts

    @property
    def floor(self) -> BaseGeometry:
        """Outline without the opening."""
        return self.area if self.opening is None else self.area.difference(self.opening)


@site_builder
def concrete_frame(
    site: Site, *, xs: list[Number], ys: list[Number], slabs: list[Slab], base_m: Number = 0.0,
    column_m: Number = 0.5, bars_m: Number = 1.1, concrete: Material = "concrete",
) -> None:  # fmt: skip
    """Put up a frame: columns, slabs, guard rails, and starter bars on the columns that will go on.

    Columns stand where grid lines `xs` and `ys` cross, the lowest on `base_m`; only they take ground. Slabs are given
    from the lowest up; `bars_m` is the length of the starter bars.
    """
    parts: Parts = []
    low, d = base_m, column_m * 0.36
    for slab, above in zip(slabs, [*slabs[1:], None], strict=True):
        top, under = slab.z, slab.area.buffer(0.4)
        feet = [(x, y) for x in xs for y in ys if shapely.contains_xy(under, x, y)]
        parts.append((concrete, posts(feet, low, top - SLAB_M, column_m)))
        parts.append((concrete, plates(slab.floor, top - SLAB_M, top)))
        parts.append((concrete, _beams(slab, ys)))
        parts += guard_rails(rim(slab.floor), top, toe="planks")
        ahead = shapely.Polygon() if above is None else above.area
        ends = [p for p in feet if not shapely.contains_xy(ahead.buffer(0.4), *p)]
        rods = [(x + i * d, y + j * d) for x, y in ends for i in (-1, 1) for j in (-1, 1)]
        parts.append(("rust", posts(rods, top, top + bars_m, 0.04)))
        for x, y in feet:
            site.occupy(disc(x, y, column_m * 0.75, 8), low, top - 0.05)
        low = top
    site.add(None, "concrete_frame", parts)


def _beams(slab: Slab, ys: Sequence[float]) -> Mesh:
    """Make beams under a slab along the long grid lines, so that its underside is not bare."""
    x0, _, x1, _ = slab.area.bounds
    z, out = slab.z - SLAB_M, []
    for y in ys:
        line = LineString([(x0, y), (x1, y)]).intersection(slab.area.buffer(0.01))
        if not line.is_empty and line.length > 1.0:
            a, _, b, _ = line.bounds
            out.append(block(a + 0.02, y - 0.2, b - 0.02, y + 0.2, z - 0.3, z))
    return merge(out)


@site_builder
def slab_props(
    site: Site, *, boxes: list[Box], z: tuple[Number, Number], spacing_m: _Step = 1.8,
    panel: Material = "planks:#c8a468",
) -> None:  # fmt: skip
    """Prop fresh slabs between two heights: rows of thin props under beams and panels; they take their ground."""
    z0, z1 = z
    for box in boxes:
        x0, y0, x1, y1 = box
        xs = np.linspace(x0 + 0.5, x1 - 0.5, max(round((x1 - x0) / spacing_m), 2)).tolist()
        ys = np.linspace(y0 + 0.5, y1 - 0.5, max(round((y1 - y0) / spacing_m), 2)).tolist()
        beams = [block(x0 + 0.1, y - 0.06, x1 - 0.1, y + 0.06, z1 - 0.2, z1 - 0.06) for y in ys]
        parts: Parts = [
            ("marking_yellow:#d9a32a", posts([(x, y) for x in xs for y in ys], z0, z1 - 0.2, 0.09)),
            ("wood:#c9a05a", merge(beams)),
            (panel, block(*box, z1 - 0.06, z1 - 0.005)),
        ]
        site.add(None, "shoring", parts)
        site.occupy(rectangle(*box), z0, z1 - 0.1)


@site_builder
def stair_core(
    site: Site, *, box: Box, z: tuple[Number, Number], floors: list[Number], concrete: Material = "concrete:#b5b2aa"
) -> None:
    """Put up a stair and lift core between two heights: a door to the south on every floor, bars on top."""
    (x0, y0, x1, y1), (z0, top), middle = box, z, (box[2] - box[0]) / 2
    doors = [(middle - 0.6, middle + 0.6, f - z0, f - z0 + 2.1) for f in (z0, *floors) if f + 2.3 < top]
    rods = [(x0 + 0.13 + (x1 - x0 - 0.26) * k / 8, y) for k in range(9) for y in (y0 + 0.13, y1 - 0.13)]
    sides = [block(x, y0 + 0.26, x + 0.26, y1 - 0.26, z0, top) for x in (x0, x1 - 0.26)]
    parts: Parts = [
        (concrete, wall_with_openings((x0, y0 + 0.13), (x1, y0 + 0.13), z0, top, doors, 0.26)),
        (concrete, merge([block(x0, y1 - 0.26, x1, y1, z0, top), *sides])),
        ("rust", posts(rods, top, top + 0.9, 0.05)),
    ]
    parts += [("concrete", block(x0 + 0.26, y0 + 0.26, x1 - 0.26, y1 - 0.26, f - 0.2, f)) for f in floors]
    site.add(None, "stair_core", parts, footprint=rectangle(*box))


@site_builder
def stair_flight(
    site: Site, *, at: At, yaw_deg: Number, z: tuple[Number, Number], run_m: Number = 4.6,
    stringer: Material = "concrete:#c0bcb2",
) -> None:  # fmt: skip
    """Put up a flight of stairs between two floors that climbs from `at` along `yaw_deg`, and keep its way free."""
    z0, z1 = z
    parts = stairs(at, yaw_deg, 1.2, z1 - z0, run_m, z_m=z0, tread="concrete", stringer=stringer)
    site.add(None, "flight_of_stairs", parts)
    way = LineString(Frame(*at, yaw_deg).path([(-0.9, 0.0), (run_m + 0.9, 0.0)]))
    site.occupy(way.buffer(0.85, cap_style="flat"), z0, z1 + 1.0)


@site_builder
def infill_walls(
    site: Site, *, walls: list[tuple[At, At, Number, Number, Material, Annotated[int, Field(ge=0, le=100)]]],
    sill_m: Number = 0.9,
) -> None:  # fmt: skip
    """Fill bays of a frame with masonry: ends, foot, top, material and count of the open windows of each wall."""
    for a, b, z0, z1, material, windows in walls:
        (length, _), line = leg(a, b), LineString([a, b])
        wide, head = length / max(windows, 1), z1 - z0 - 0.6
        holes = [(k * wide + wide * 0.22, k * wide + wide * 0.78, sill_m, head) for k in range(windows)]
        z = z0 + head + 0.1
        parts: Parts = [(material, wall_with_openings(a, b, z0, z1, holes, 0.24))]
        for u0, u1, _, _ in holes:
            p, q = ((a[0] + (b[0] - a[0]) * u / length, a[1] + (b[1] - a[1]) * u / length, z)
                    for u in (u0 - 0.2, u1 + 0.2))  # fmt: skip
            parts.append(("concrete", bars([(p, q)], 0.27)))
        site.add(None, "brick_wall" if material.startswith("brick") else "block_wall", parts)
        site.occupy(line.buffer(0.15, cap_style="flat"), z0, z1)


@site_builder
def scaffold(
    site: Site, *, line: tuple[At, At], z: tuple[Number, Number], net: Material | None = None, lift_m: _Step = 2.0,
    depth_m: Number = 1.1,
) -> None:  # fmt: skip
    """Put up a façade scaffold to the left of a line: standards, decks, rails, and nets in places.

    The line is its inner side, `z` the heights of its feet and of its uppermost deck; a lift is about `lift_m` high.
    """
    (length, yaw_deg), high = leg(*line), z[1] - z[0]
    bays, lifts = max(round(length / 2.5), 1), max(round(high / lift_m), 1)
    us, edges = [length * k / bays for k in range(bays + 1)], (0.0, depth_m)
    steel = [block(u - 0.035, v - 0.035, u + 0.035, v + 0.035, 0.0, high + 1.1) for u in us for v in edges]
    ledger = cuboid(size=[length, 0.05, 0.05])
    decks, nets = [], []
    for j in range(1, lifts + 1):
        w = high * j / lifts
        decks.append(block(0.0, 0.06, length, depth_m - 0.06, w - 0.08, w))
        steel += [translated(ledger, (length / 2, v, w - 0.14)) for v in edges]
        steel += [translated(ledger, (length / 2, depth_m, w + up)) for up in (0.5, 1.0)]
        # Nets are hung from one end, and lower lifts get theirs first.
        hung = [k for k in range(bays) if k < bays * (1.0 - 0.55 * (j - 1) / lifts)]
        nets += [block(us[k] + 0.05, depth_m + 0.05, us[k + 1] - 0.05, depth_m + 0.08, w, w + high / lifts - 0.2)
                 for k in hung]  # fmt: skip
    braces = []
    for k in range(0, bays, 3):
        for j in range(lifts):
            p, q = (us[k], us[k + 1]) if j % 2 else (us[k + 1], us[k])
            braces.append(((p, depth_m, high * j / lifts), (q, depth_m, high * (j + 1) / lifts)))
    raw: Parts = [("metal", merge([*steel, bars(braces, 0.05)])), ("planks:#b08d58", merge(decks))]
    raw += [] if net is None else [(net, merge(nets))]
    parts = Frame(*line[0], yaw_deg).parts(raw, z[0])
    area = LineString(line).buffer(depth_m, cap_style="flat", single_sided=True)
    site.add(None, "scaffold", parts, footprint=area)


@site_builder
def sheet_piles(
    site: Site, *, line: Line, z: tuple[Number, Number], step_m: _Step = 0.9, steel: Material = "rust:#7a5a48"
) -> None:
    """Line a dig with a folded steel wall between two heights, with a beam near its head."""
    folds: list[Point] = []
    for a, b in pairwise(line):
        length, _ = leg(a, b)
        count = max(round(length / step_m), 1)
        normal = (-(b[1] - a[1]) / length, (b[0] - a[0]) / length)
        for k in range(count):
            side = 0.14 if k % 2 else -0.14
            for t in (k / count, (k + 0.999) / count):
                x, y = a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t
                folds.append((x + normal[0] * side, y + normal[1] * side))
    wall = LineString(folds).buffer(0.06, cap_style="flat", join_style="mitre", mitre_limit=2.0)
    beam = LineString(line).buffer(0.3, cap_style="flat", join_style="mitre")
    parts: Parts = [(steel, plates(wall, *z)), ("steel", plates(beam, z[1] - 1.3, z[1] - 0.9))]
    site.add(None, "sheet_piles", parts, footprint=beam)
