"""Concrete under way: frames of slabs and columns, starter bars, shores, infill walls, stair cores, scaffolds.

Everything is given to the site at once; things may stand on the slabs, whose ground stays free between the columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import wall_with_openings
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, stairs
from aerialdojo_gen.scenes.layouts.urban.construction_site.industry import bars, guard_rails, plates, posts, rim
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.site import Site

SLAB_M = 0.28
_RAIL = "marking_yellow"
Xy = tuple[float, float]


@dataclass(frozen=True)
class Frame:
    """A concrete frame.

    Attributes
    ----------
    xs, ys : tuple of float
        Grid lines on which columns stand, metres.
    floors : tuple of (plan, z)
        Slabs from the lowest up: their outline and the height of their top, metres.
    base_m : float
        What the lowest columns stand on.
    voids : dict
        Openings by the number of the slab (0 is the lowest): stairs and shafts.
    column_m : float
        Width of a column.
    concrete : str
        Material.
    """

    xs: tuple[float, ...]
    ys: tuple[float, ...]
    floors: tuple[tuple[BaseGeometry, float], ...]
    base_m: float = 0.0
    voids: dict[int, BaseGeometry] = field(default_factory=dict)
    column_m: float = 0.5
    concrete: str = "concrete"

    def points(self, plan: BaseGeometry) -> list[Xy]:
        """Columns under a slab."""
        grown = plan.buffer(0.4)
        return [(x, y) for x in self.xs for y in self.ys if shapely.contains_xy(grown, x, y)]

    def slab(self, k: int) -> BaseGeometry:
        """Outline of a slab without its openings."""
        plan = self.floors[k][0]
        return plan.difference(self.voids[k]) if k in self.voids else plan


def put_up_frame(site: Site, frame: Frame, *, rails: Sequence[int] | None = None, bars_m: float = 1.1) -> None:
    """Put a frame up: columns, slabs, guard rails, and starter bars on the columns that will go on.

    Parameters
    ----------
    site : Site
        Where; only the columns take ground.
    frame : Frame
        What.
    rails : sequence of int, optional
        Slabs with guard rails; all by default.
    bars_m : float
        Length of the starter bars.
    """
    parts: Parts = []
    low = frame.base_m
    starters: list[Xy] = []
    for k, (plan, top) in enumerate(frame.floors):
        points = frame.points(plan)
        parts.append((frame.concrete, posts(points, low, top - SLAB_M, frame.column_m)))
        parts.append((frame.concrete, plates(frame.slab(k), top - SLAB_M, top)))
        parts.append((frame.concrete, _beams(frame, plan, top)))
        above = frame.floors[k + 1][0] if k + 1 < len(frame.floors) else shapely.Polygon()
        if rails is None or k in rails:
            parts += guard_rails(rim(frame.slab(k)), top, material=_RAIL)
        starters = [p for p in points if not shapely.contains_xy(above.buffer(0.4), *p)]
        if starters:
            parts.append(("rust", _starter_bars(starters, top, frame.column_m, bars_m)))
        for x, y in points:
            site.occupy(disc(x, y, frame.column_m * 0.75, 8), low, top - 0.05)
        low = top
    site.add(None, "concrete_frame", parts)


def _beams(frame: Frame, plan: BaseGeometry, top: float) -> Mesh:
    """Downstand beams along the long grid lines, so that the slabs' undersides are not bare."""
    x0, _, x1, _ = plan.bounds
    out = []
    for y in frame.ys:
        line = LineString([(x0, y), (x1, y)]).intersection(plan.buffer(0.01))
        if not line.is_empty and line.length > 1.0:
            a, _, b, _ = line.bounds
            out.append(block(a + 0.02, y - 0.2, b - 0.02, y + 0.2, top - SLAB_M - 0.3, top - SLAB_M))
    return merge(out)


def _starter_bars(points: Sequence[Xy], z: float, width: float, length: float) -> Mesh:
    d = width * 0.36
    out = [
        block(x + i * d - 0.02, y + j * d - 0.02, x + i * d + 0.02, y + j * d + 0.02, z, z + length)
        for x, y in points
        for i in (-1, 1)
        for j in (-1, 1)
    ]
    return merge(out)


def shores(site: Site, area: BaseGeometry, z0: float, z1: float, spacing_m: float = 1.8) -> None:
    """Prop a fresh slab: rows of thin yellow props under timber beams; they take the ground they stand on."""
    x0, y0, x1, y1 = area.bounds
    xs = np.linspace(x0 + 0.5, x1 - 0.5, max(round((x1 - x0) / spacing_m), 2))
    ys = np.linspace(y0 + 0.5, y1 - 0.5, max(round((y1 - y0) / spacing_m), 2))
    points = [(float(x), float(y)) for x in xs for y in ys]
    beams = merge([block(x0 + 0.1, float(y) - 0.06, x1 - 0.1, float(y) + 0.06, z1 - 0.2, z1 - 0.06) for y in ys])
    panel = block(x0, y0, x1, y1, z1 - 0.06, z1 - 0.005)
    parts: Parts = [
        ("marking_yellow:#d9a32a", posts(points, z0, z1 - 0.2, 0.09)),
        ("wood:#c9a05a", beams),
        ("planks:#c8a468", panel),
    ]
    site.add(None, "shoring", parts)
    site.occupy(area, z0, z1 - 0.1)


def core(
    site: Site, outline: tuple[float, float, float, float], z0: float, tops: Sequence[float], top: float
) -> None:
    """Put up a stair and lift core: concrete walls with a door to the south on every floor, bars on top.

    Parameters
    ----------
    site : Site
        Where; the core takes its ground.
    outline : (x0, y0, x1, y1)
        Metres.
    z0, top : float
        Foot and head.
    tops : sequence of float
        Heights of the floors, where doors stand.
    """
    x0, y0, x1, y1 = outline
    middle = (x1 - x0) / 2
    doors = [(middle - 0.6, middle + 0.6, z - z0, z - z0 + 2.1) for z in (z0, *tops) if z + 2.3 < top]
    parts: Parts = [("concrete:#b5b2aa", wall_with_openings((x0, y0 + 0.13), (x1, y0 + 0.13), z0, top, doors, 0.26))]
    parts.append(("concrete:#b5b2aa", block(x0, y1 - 0.26, x1, y1, z0, top)))
    for x in (x0, x1 - 0.26):
        parts.append(("concrete:#b5b2aa", block(x, y0 + 0.26, x + 0.26, y1 - 0.26, z0, top)))
    dots = [(x0 + 0.13 + (x1 - x0 - 0.26) * k / 8, y) for k in range(9) for y in (y0 + 0.13, y1 - 0.13)]
    parts.append(("rust", posts(dots, top, top + 0.9, 0.05)))
    for z in tops:
        parts.append(("concrete", block(x0 + 0.26, y0 + 0.26, x1 - 0.26, y1 - 0.26, z - 0.2, z)))
    site.add(None, "stair_core", parts, footprint=rectangle(x0, y0, x1, y1))


def flight(site: Site, x: float, y: float, yaw_deg: float, z0: float, z1: float, run_m: float = 4.6) -> None:
    """Put up a flight of stairs that climbs from (x, y) along `yaw_deg`, with rails on both sides."""
    parts = stairs((x, y), yaw_deg, 1.2, z1 - z0, run_m, z_m=z0, tread="concrete", stringer="concrete:#c0bcb2")
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    site.add(None, "flight_of_stairs", parts)
    line = LineString([(x - 0.9 * c, y - 0.9 * s), (x + (run_m + 0.9) * c, y + (run_m + 0.9) * s)])
    site.occupy(line.buffer(0.85, cap_style="flat"), z0, z1 + 1.0)


def infill(
    site: Site, a: Xy, b: Xy, z0: float, z1: float, material: str, windows: int, *, sill_m: float = 0.9
) -> None:
    """Fill a bay's edge with masonry that has open windows; no windows where `windows` is 0."""
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    wide = length / max(windows, 1)
    holes = [(k * wide + wide * 0.22, k * wide + wide * 0.78, sill_m, z1 - z0 - 0.6) for k in range(windows)]
    body = wall_with_openings(a, b, z0, z1, holes, 0.24)
    lintels = []
    for u0, u1, _, head in holes:
        p, q = ((a[0] + (b[0] - a[0]) * u / length, a[1] + (b[1] - a[1]) * u / length) for u in (u0 - 0.2, u1 + 0.2))
        lintels.append(((*p, z0 + head + 0.1), (*q, z0 + head + 0.1)))
    parts: Parts = [(material, body)]
    if lintels:
        parts.append(("concrete", bars(lintels, 0.27)))
    site.add(None, "brick_wall" if material.startswith("brick") else "block_wall", parts)
    site.occupy(LineString([a, b]).buffer(0.15, cap_style="flat"), z0, z1)


def scaffold(
    site: Site,
    a: Xy,
    b: Xy,
    z_top: float,
    *,
    z0: float = 0.0,
    net: str = "",
    lift_m: float = 2.0,
    depth_m: float = 1.1,
) -> None:
    """Put up a façade scaffold to the left of the line from `a` to `b`: standards, decks, rails, nets in places.

    Parameters
    ----------
    site : Site
        Where; the scaffold takes its ground.
    a, b : (x, y)
        Ends of its inner side, metres.
    z_top, z0 : float
        Height of its uppermost deck, and of its feet.
    net : str
        Material of the nets; empty for none.
    """
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    bays = max(round(length / 2.5), 1)
    lifts = max(round((z_top - z0) / lift_m), 1)
    high = z_top - z0
    us = [length * k / bays for k in range(bays + 1)]
    steel = [block(u - 0.035, v - 0.035, u + 0.035, v + 0.035, 0.0, high + 1.1) for u in us for v in (0.0, depth_m)]
    decks, nets = [], []
    for j in range(1, lifts + 1):
        z = high * j / lifts
        decks.append(block(0.0, 0.06, length, depth_m - 0.06, z - 0.08, z))
        for v in (0.0, depth_m):
            steel.append(translated(box(size=[length, 0.05, 0.05]), (length / 2, v, z - 0.14)))
        for up in (0.5, 1.0):
            steel.append(translated(box(size=[length, 0.05, 0.05]), (length / 2, depth_m, z + up)))
        for k in range(bays):
            # Nets are hung from one end, and lower lifts get theirs first.
            if net and k < bays * (1.0 - 0.55 * (j - 1) / lifts):
                nets.append(
                    block(us[k] + 0.05, depth_m + 0.05, us[k + 1] - 0.05, depth_m + 0.08, z, z + high / lifts - 0.2)
                )
    braces = []
    for k in range(0, bays, 3):
        for j in range(lifts):
            z, up = high * j / lifts, high * (j + 1) / lifts
            p, q = (us[k], us[k + 1]) if j % 2 else (us[k + 1], us[k])
            braces.append(((p, depth_m, z), (q, depth_m, up)))
    turn = rotation(0.0, 0.0, float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0]))))
    raw: Parts = [("metal", merge([*steel, bars(braces, 0.05)])), ("planks:#b08d58", merge(decks))]
    if nets:
        raw.append((net, merge(nets)))
    parts = [(m, translated(rotated(body, turn), (*a, z0))) for m, body in raw]
    line = LineString([a, b])
    area = line.buffer(depth_m, cap_style="flat", single_sided=True)
    site.add(None, "scaffold", parts, footprint=area)


def bulkheads(site: Site, path: Sequence[Xy], z0: float, z1: float, step_m: float = 0.9) -> None:
    """Line a dig with sheet piles: a folded steel wall along a path, with a waling beam near its head."""
    zigzag: list[Xy] = []
    for a, b in pairwise(path):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        count = max(round(length / step_m), 1)
        normal = (-(b[1] - a[1]) / length, (b[0] - a[0]) / length)
        for k in range(count):
            side = 0.14 if k % 2 else -0.14
            for t in (k / count, (k + 0.999) / count):
                zigzag.append(
                    (a[0] + (b[0] - a[0]) * t + normal[0] * side, a[1] + (b[1] - a[1]) * t + normal[1] * side)
                )
    wall = LineString(zigzag).buffer(0.06, cap_style="flat", join_style="mitre", mitre_limit=2.0)
    beam = LineString(path).buffer(0.3, cap_style="flat", join_style="mitre")
    parts: Parts = [("rust:#7a5a48", plates(wall, z0, z1)), ("steel", plates(beam, z1 - 1.3, z1 - 0.9))]
    site.add(None, "sheet_piles", parts, footprint=beam)
