"""Buildings of works: halls to fly into, with saw-tooth, flat or gable roofs, sheds on posts, overhead cranes.

All stand along the axes; heights are above z = 0 unless a foot is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof, wall_with_openings
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, letters
from aerialdojo_gen.scenes.layouts.urban.construction_site.industry import Point3, bars, plates, posts
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.shapes_extruded import extrude
from aerialdojo_gen.scenes.site import Site

Opening = tuple[float, float, float, float]


@dataclass(frozen=True)
class Hall:
    """A hall along the axes.

    Attributes
    ----------
    x0, y0, x1, y1 : float
        Outline, metres.
    eaves_m : float
        Height of its walls.
    wall, roof : str
        Materials.
    gates : dict
        Openings by side (``"s"``, ``"e"``, ``"n"``, ``"w"``): (from, to, sill, head) along the wall from its west or
        south end, metres.
    base : str
        Material of the lowest metre of the walls.
    """

    x0: float
    y0: float
    x1: float
    y1: float
    eaves_m: float
    wall: str
    roof: str
    gates: dict[str, tuple[Opening, ...]] = field(default_factory=dict)
    base: str = "brick:#8a4f40"

    def sides(self) -> list[tuple[str, tuple[float, float], tuple[float, float]]]:
        """Ends of the walls' middle lines, from west to east and from south to north."""
        t = 0.15
        return [
            ("s", (self.x0, self.y0 + t), (self.x1, self.y0 + t)),
            ("n", (self.x0, self.y1 - t), (self.x1, self.y1 - t)),
            ("w", (self.x0 + t, self.y0 + 2 * t), (self.x0 + t, self.y1 - 2 * t)),
            ("e", (self.x1 - t, self.y0 + 2 * t), (self.x1 - t, self.y1 - 2 * t)),
        ]


def put_up_hall(
    site: Site, hall: Hall, category: str, roof: Parts, *, name: str = "", sign_side: str = "s", letter_m: float = 1.2
) -> None:
    """Put up a hall's walls with its gates and bands of windows, under a given roof.

    Parameters
    ----------
    site : Site
        Where; walls take their ground, the floor inside stays free.
    hall : Hall
        What.
    category : str
        What it is called.
    roof : list of (material, Mesh)
        From `saw_roof`, `flat_roof` or `gable_roof`.
    name : str
        Written high on the wall of `sign_side`.
    """
    parts: Parts = list(roof)
    for side, a, b in hall.sides():
        gates = hall.gates.get(side, ())
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        low = [(u0, u1, s, min(h, 1.2)) for u0, u1, s, h in gates if s < 1.2]
        high = [(u0, u1, max(s - 1.2, 0.0), h - 1.2) for u0, u1, s, h in gates if h > 1.2]
        parts.append((hall.base, wall_with_openings(a, b, 0.0, 1.2, low, 0.34)))
        parts.append((hall.wall, wall_with_openings(a, b, 1.2, hall.eaves_m, high, 0.3)))
        parts += _openings(side, a, length, gates)
        parts += _windows(side, a, length, hall.eaves_m, gates)
        at = 0.0
        for u0, u1, sill, _ in sorted(gates):
            if sill < 0.5:
                _take(site, a, side, at, u0)
                at = u1
        _take(site, a, side, at, length)
    if name:
        x, y, yaw = {
            "s": ((hall.x0 + hall.x1) / 2, hall.y0 - 0.03, -90.0),
            "e": (hall.x1 + 0.03, (hall.y0 + hall.y1) / 2, 0.0),
            "n": ((hall.x0 + hall.x1) / 2, hall.y1 + 0.03, 90.0),
            "w": (hall.x0 - 0.03, (hall.y0 + hall.y1) / 2, 180.0),
        }[sign_side]
        parts.append(("marking", letters(name, letter_m, (x, y, hall.eaves_m - letter_m - 0.35), yaw, 0.12)))
    site.add(None, category, parts)


def _take(site: Site, a: tuple[float, float], side: str, u0: float, u1: float) -> None:
    if u1 - u0 > 0.05:
        across = side in "sn"
        box = (
            rectangle(a[0] + u0, a[1] - 0.2, a[0] + u1, a[1] + 0.2)
            if across
            else rectangle(a[0] - 0.2, a[1] + u0, a[0] + 0.2, a[1] + u1)
        )
        site.occupy(box, -1.0, 6.0)


def _openings(side: str, a: tuple[float, float], length: float, gates: Sequence[Opening]) -> Parts:
    """Frame every gate, and hang a rolled-up shutter in its head."""
    del length
    frames, drums = [], []
    for u0, u1, sill, head in gates:
        for v0, v1, z0, z1 in (
            (u0 - 0.2, u0, sill, head),
            (u1, u1 + 0.2, sill, head),
            (u0 - 0.2, u1 + 0.2, head, head + 0.25),
        ):
            frames.append(_along(side, a, v0, v1, 0.24, z0, z1))
        drums.append(_along(side, a, u0, u1, 0.3, head - 0.35, head))
    return [("marking_yellow", merge(frames)), ("sheet_metal", merge(drums))] if frames else []


def _along(side: str, a: tuple[float, float], u0: float, u1: float, half_m: float, z0: float, z1: float) -> Mesh:
    if side in "sn":
        return block(a[0] + u0, a[1] - half_m, a[0] + u1, a[1] + half_m, z0, z1)
    return block(a[0] - half_m, a[1] + u0, a[0] + half_m, a[1] + u1, z0, z1)


def _windows(side: str, a: tuple[float, float], length: float, eaves: float, gates: Sequence[Opening]) -> Parts:
    """Set tall windows between the gates and pilasters between the windows."""
    panes, piers = [], []
    count = max(int(length // 4.0), 1)
    wide = length / count
    for k in range(count):
        u0, u1 = k * wide + wide * 0.2, (k + 1) * wide - wide * 0.2
        if all(u1 < g0 - 0.4 or u0 > g1 + 0.4 for g0, g1, _, _ in gates):
            panes.append(_along(side, a, u0, u1, 0.19, 1.7, eaves - 1.9))
        if k and all(not g0 - 0.4 < k * wide < g1 + 0.4 for g0, g1, _, _ in gates):
            piers.append(_along(side, a, k * wide - 0.2, k * wide + 0.2, 0.3, 0.0, eaves - 0.1))
    out: Parts = []
    if panes:
        out.append(("glass:#6f8796", merge(panes)))
    if piers:
        out.append(("concrete:#9d978c", merge(piers)))
    return out


def saw_roof(hall: Hall, teeth: int, rise_m: float = 2.6) -> Parts:
    """Make a saw-tooth roof whose glazed faces look north, with its gable ends, beams and gutters."""
    wide = (hall.y1 - hall.y0) / teeth
    z, out = hall.eaves_m, 0.35
    sheets, panes, gables, beams = [], [], [], []
    for k in range(teeth):
        a, b = hall.y0 + k * wide, hall.y0 + (k + 1) * wide
        slope = [(a, z), (b - 0.15, z + rise_m), (b - 0.15, z + rise_m + 0.18), (a, z + 0.18)]
        sheets.append(across_x(slope, hall.x0 - out, hall.x1 + out))
        panes.append(block(hall.x0, b - 0.2, hall.x1, b - 0.08, z + 0.25, z + rise_m))
        gables += [
            across_x([(a, z), (b - 0.2, z), (b - 0.2, z + rise_m)], x - 0.1, x + 0.1)
            for x in (hall.x0 + 0.15, hall.x1 - 0.15)
        ]
        beams.append(block(hall.x0 + 0.3, b - 0.25, hall.x1 - 0.3, b - 0.03, z - 0.35, z + 0.25))
    return [
        (hall.roof, merge(sheets)),
        ("curtain_wall:#87a3b2", merge(panes)),
        (hall.wall, merge(gables)),
        ("steel", merge(beams)),
    ]


def flat_roof(hall: Hall, parapet_m: float = 0.7, lights: int = 0) -> Parts:
    """Make a flat roof with a parapet and a row of roof lights."""
    plan = rectangle(hall.x0, hall.y0, hall.x1, hall.y1)
    ring = plan.difference(plan.buffer(-0.3, join_style="mitre"))
    z = hall.eaves_m
    parts: Parts = [
        (hall.roof, block(hall.x0 + 0.02, hall.y0 + 0.02, hall.x1 - 0.02, hall.y1 - 0.02, z - 0.3, z)),
        ("concrete", plates(ring, z, z + parapet_m)),
    ]
    for k in range(lights):
        x = hall.x0 + (hall.x1 - hall.x0) * (k + 0.5) / lights
        y = (hall.y0 + hall.y1) / 2
        parts.append(("glass:#a9c0cc", block(x - 1.0, y - 2.6, x + 1.0, y + 2.6, z, z + 0.5)))
    return parts


def gable_roof(hall: Hall, rise_m: float, overhang_m: float = 0.5) -> Parts:
    """Make a gable roof, its ridge along the longer side, hollow below."""
    plan = rectangle(hall.x0, hall.y0, hall.x1, hall.y1)
    chevron = pitched_roof(plan, hall.eaves_m, rise_m, hall.wall, hall.roof, overhang_m=overhang_m)[:1]
    ends: Parts = []
    if hall.x1 - hall.x0 >= hall.y1 - hall.y0:
        middle = (hall.y0 + hall.y1) / 2
        tri = [(hall.y0, hall.eaves_m), (hall.y1, hall.eaves_m), (middle, hall.eaves_m + rise_m)]
        ends = [(hall.wall, merge([across_x(tri, x - 0.12, x + 0.12) for x in (hall.x0 + 0.15, hall.x1 - 0.15)]))]
    else:
        middle = (hall.x0 + hall.x1) / 2
        tri = [(hall.x0, hall.eaves_m), (hall.x1, hall.eaves_m), (middle, hall.eaves_m + rise_m)]
        ends = [(hall.wall, merge([across_y(tri, y - 0.12, y + 0.12) for y in (hall.y0 + 0.15, hall.y1 - 0.15)]))]
    return [*chevron, *ends]


def overhead_crane(site: Site, hall: Hall, at_m: float, z_m: float, colour: str = "#e0a92a") -> None:
    """Hang a travelling crane in a hall: runways on columns along x, a bridge at x = `at_m`, a hoist and its hook."""
    ys = (hall.y0 + 1.0, hall.y1 - 1.0)
    count = max(int((hall.x1 - hall.x0) // 8.0), 1)
    xs = [hall.x0 + 1.0 + (hall.x1 - hall.x0 - 2.0) * k / count for k in range(count + 1)]
    stand = [(x, y) for x in xs for y in ys]
    middle = (ys[0] + ys[1]) / 2 + 2.0
    parts: Parts = [
        ("steel", posts(stand, 0.0, z_m - 0.5, 0.34)),
        ("steel", merge([block(hall.x0 + 0.8, y - 0.2, hall.x1 - 0.8, y + 0.2, z_m - 0.5, z_m) for y in ys])),
        (
            colour,
            merge([block(at_m + d, ys[0] - 0.3, at_m + d + 0.4, ys[1] + 0.3, z_m, z_m + 0.7) for d in (-1.0, 0.6)]),
        ),
        ("iron", block(at_m - 0.9, middle - 0.7, at_m + 0.9, middle + 0.7, z_m + 0.7, z_m + 1.3)),
        ("iron", block(at_m - 0.04, middle - 0.04, at_m + 0.04, middle + 0.04, z_m - 2.0, z_m + 0.7)),
        (colour, block(at_m - 0.3, middle - 0.2, at_m + 0.3, middle + 0.2, z_m - 2.5, z_m - 2.0)),
    ]
    site.add(None, "overhead_crane", parts)
    for x, y in stand:
        site.occupy(rectangle(x - 0.3, y - 0.3, x + 0.3, y + 0.3), 0.0, z_m)


def open_shed(
    site: Site,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    eaves_m: float,
    rise_m: float,
    roof: str,
    *,
    post_m: float = 5.0,
    z: float = 0.0,
    post: str = "wood",
) -> None:
    """Put up a roof on posts without walls, its ridge along the longer side."""
    hall = Hall(x0, y0, x1, y1, z + eaves_m, "planks", roof)
    n, m = (max(round(d / post_m), 1) for d in (x1 - x0 - 0.8, y1 - y0 - 0.8))
    xs = [x0 + 0.4 + (x1 - x0 - 0.8) * k / n for k in range(n + 1)]
    ys = [y0 + 0.4 + (y1 - y0 - 0.8) * k / m for k in range(m + 1)]
    edge = [(x, y) for i, x in enumerate(xs) for j, y in enumerate(ys) if i in (0, n) or j in (0, m)]
    ties: list[tuple[Point3, Point3]] = []
    top = z + eaves_m - 0.15
    if x1 - x0 >= y1 - y0:
        ties += [((x, ys[0], top), (x, ys[-1], top)) for x in xs] + [
            ((xs[0], y, top), (xs[-1], y, top)) for y in (ys[0], ys[-1])
        ]
    else:
        ties += [((xs[0], y, top), (xs[-1], y, top)) for y in ys] + [
            ((x, ys[0], top), (x, ys[-1], top)) for x in (xs[0], xs[-1])
        ]
    site.add(
        None,
        "shed",
        [*gable_roof(hall, rise_m)[:1], (post, posts(edge, z, z + eaves_m, 0.24)), (post, bars(ties, 0.22))],
    )
    for x, y in edge:
        site.occupy(rectangle(x - 0.2, y - 0.2, x + 0.2, y + 0.2), z, z + eaves_m)


def across_x(points: Sequence[tuple[float, float]], x0: float, x1: float) -> Mesh:
    """Extrude an outline of (y, z) from `x0` to `x1`, metres."""
    body = extrude(Polygon(points), x1 - x0)
    return Mesh(body.vertices[:, [2, 0, 1]] + np.array([x0, 0.0, 0.0]), body.faces)


def across_y(points: Sequence[tuple[float, float]], y0: float, y1: float) -> Mesh:
    """Extrude an outline of (x, z) from `y0` to `y1`, metres."""
    body = extrude(Polygon(points), y1 - y0)
    a, b, c = body.vertices.T
    return Mesh(np.column_stack([a, y1 - c, b]), body.faces)
