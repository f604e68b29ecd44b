"""Plant out of doors: pipe bridges, bunds, steel structures with platforms and vessels, conveyor galleries."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from shapely.geometry import LineString

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, stairs
from aerialdojo_gen.scenes.layouts.urban.parts.industry import (
    Point3,
    bars,
    guard_rails,
    pipes,
    plates,
    posts,
    rim,
    trestle,
)
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box, lathe
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

Xy = tuple[float, float]


def pipe_bridge(
    site: Site, path: Sequence[Xy], z_m: float, colours: Sequence[str], *, steel: str = "steel", bay_m: float = 8.0
) -> None:
    """Lay a pipe bridge along a polyline of axis-parallel legs: trestles, two decks of pipes, braced girders.

    Parameters
    ----------
    site : Site
        Where; the trestles' feet take their ground.
    path : sequence of (x, y)
        Middle line, metres.
    z_m : float
        Height of the lower pipes' bearing.
    colours : sequence of str
        Materials of the pipes.
    """
    feet: list[Xy] = []
    lines: list[tuple[Point3, Point3]] = []
    for a, b in pairwise(path):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        dx, dy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
        count = max(round(length / bay_m), 1)
        for k in range(count + 1):
            x, y = a[0] + dx * length * k / count, a[1] + dy * length * k / count
            ends = [(x - dy * s * 1.3, y + dx * s * 1.3) for s in (-1, 1)]
            if all(np.hypot(x - u, y - v) > 0.5 for u, v in feet[::2]):
                feet += ends
                for up in (0.0, 1.5):
                    lines.append(((*ends[0], z_m + up), (*ends[1], z_m + up)))
        for s in (-1, 1):
            p, q = (a[0] - dy * s * 1.3, a[1] + dx * s * 1.3), (b[0] - dy * s * 1.3, b[1] + dx * s * 1.3)
            lines += [((*p, z_m + up), (*q, z_m + up)) for up in (-0.05, 1.45)]
    parts: Parts = [(steel, posts(feet, 0.0, z_m + 1.6, 0.26)), (steel, bars(lines, 0.2))]
    lay = [
        (side, up, radius, colours[k % len(colours)])
        for k, (side, up, radius) in enumerate(
            (
                (-0.8, 0.36, 0.26),
                (-0.15, 0.28, 0.18),
                (0.7, 0.44, 0.34),
                (-0.6, 1.84, 0.24),
                (0.1, 1.76, 0.16),
                (0.75, 1.82, 0.22),
            )
        )
    ]
    parts += pipes([(x, y, z_m) for x, y in path], lay)
    site.add(None, "pipe_bridge", parts)
    for x, y in feet:
        site.occupy(rectangle(x - 0.35, y - 0.35, x + 0.35, y + 0.35), 0.0, z_m)


def bund(site: Site, x0: float, y0: float, x1: float, y1: float, height_m: float = 0.9) -> None:
    """Wall a tank farm in, and pave it with concrete; a step leads over the wall on the south side."""
    plan = rectangle(x0, y0, x1, y1)
    site.paint(plan, "concrete:#a7a297")
    ring = plan.difference(plan.buffer(-0.3, join_style="mitre"))
    middle = (x0 + x1) / 2
    steps = [
        block(middle - 0.7, y0 - 0.4 * k, middle + 0.7, y0 + 0.3 + 0.4 * k, 0.0, height_m - 0.3 * k) for k in (1, 2)
    ]
    parts: Parts = [("concrete:#8e8a80", plates(ring, 0.0, height_m)), ("marking_yellow", merge(steps))]
    site.add(None, "bund_wall", parts, footprint=ring)


def platform_tower(
    site: Site,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    levels: Sequence[float],
    vessels: Sequence[tuple[float, float, float, float, str]],
    *,
    steel: str = "#5f7f8f",
    floor: str = "sheet_metal:#7d8488",
) -> None:
    """Put up a steel structure with platforms, round vessels that rise through them, and a stair at its west side.

    Parameters
    ----------
    site : Site
        Where; columns, vessels and stairs take their ground.
    x0, y0, x1, y1 : float
        Outline, metres.
    levels : sequence of float
        Heights of the platforms.
    vessels : sequence of (x, y, radius, top, material)
        Upright vessels; they stand on the ground.
    """
    nx, ny = (max(round(d / 5.5), 1) for d in (x1 - x0, y1 - y0))
    xs = [x0 + (x1 - x0) * k / nx for k in range(nx + 1)]
    ys = [y0 + (y1 - y0) * k / ny for k in range(ny + 1)]
    points = [(x, y) for x in xs for y in ys if all(np.hypot(x - v[0], y - v[1]) > v[2] + 0.4 for v in vessels)]
    parts: Parts = [(steel, posts(points, 0.0, levels[-1] + 0.1, 0.3))]
    plan = rectangle(x0 - 0.3, y0 - 0.3, x1 + 0.3, y1 + 0.3)
    beams: list[tuple[Point3, Point3]] = []
    low = 0.0
    for k, z in enumerate(levels):
        holes = [v for v in vessels if v[3] > z]
        deck = plan
        for x, y, r, _, _ in holes:
            deck = deck.difference(rectangle(x - r - 0.25, y - r - 0.25, x + r + 0.25, y + r + 0.25))
        parts.append((floor, plates(deck, z - 0.12, z)))
        ends = [rectangle(x0 - 1.0, y, x0 + 0.2, y + 1.4) for y in (y0 - 0.2, y1 - 1.2)]
        parts += guard_rails(rim(plan, ends), z, toe=None)
        beams += [((x, ys[0], z - 0.3), (x, ys[-1], z - 0.3)) for x in xs]
        beams += [((xs[0], y, z - 0.3), (xs[-1], y, z - 0.3)) for y in ys]
        beams += [((xs[0], ys[0], low), (xs[0], ys[1], z - 0.4)), ((xs[-1], ys[-1], low), (xs[-1], ys[-2], z - 0.4))]
        # Flights climb to and fro along the west side.
        foot, yaw = ((x0 - 0.95, y0 + 0.2), 90.0) if k % 2 == 0 else ((x0 - 0.95, y1 - 0.2), -90.0)
        parts += stairs(foot, yaw, 1.0, z - low, y1 - y0 - 0.4, z_m=low, tread="sheet_metal")
        low = z
    parts.append((steel, bars(beams, 0.18)))
    for x, y, r, top, material in vessels:
        parts += _vessel(x, y, r, top, material)
        site.occupy(rectangle(x - r - 0.1, y - r - 0.1, x + r + 0.1, y + r + 0.1), 0.0, top)
    site.add(None, "process_structure", parts)
    for x, y in points:
        site.occupy(rectangle(x - 0.25, y - 0.25, x + 0.25, y + 0.25), 0.0, levels[-1])
    site.occupy(rectangle(x0 - 1.6, y0 - 0.8, x0 - 0.3, y1 + 0.8), 0.0, levels[-1] + 1.0)


def _vessel(x: float, y: float, r: float, top: float, material: str) -> Parts:
    skirt, dome = 1.2, r * 0.5
    shell = [
        (r * 0.75, 0.0),
        (r * 0.75, skirt - 0.3),
        (r, skirt),
        (r, top - dome),
        (r * 0.7, top - dome * 0.3),
        (0.0, top),
    ]
    body = translated(lathe(points=shell, segments=16), (x, y, 0.0))
    bands = [
        translated(lathe(points=[(r + 0.05, 0.0), (r + 0.05, 0.18)], segments=16), (x, y, z))
        for z in np.linspace(skirt + 0.6, top - dome - 0.6, 3)
    ]
    stub = sweep(
        path=[(x, y, top - 0.2), (x, y, top + 0.7), (x + r + 0.6, y, top + 0.7), (x + r + 0.6, y, top - 1.8)],
        radius=0.14,
    )
    return [(material, body), ("metal", merge(bands)), ("metal", stub)]


def gallery(
    site: Site,
    a: Point3,
    b: Point3,
    wall: str,
    *,
    wide_m: float = 2.4,
    high_m: float = 2.4,
    legs: Sequence[float] = (),
) -> None:
    """Carry a closed conveyor gallery from `a` up to `b` (middle of its floor), on trestles at shares of it."""
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    rise = b[2] - a[2]
    line = [(0.0, 0.0, high_m / 2), (length, 0.0, rise + high_m / 2)]
    raw: Parts = [(wall, sweep(path=line, section=(wide_m, high_m)))]
    n = max(int(length // 3.0), 1)
    panes = []
    for k in range(n):
        u = length * (k + 0.5) / n
        panes.append(translated(box(size=[1.3, wide_m + 0.1, 0.7]), (u, 0.0, rise * u / length + high_m * 0.5)))
    raw.append(("glass:#7f95a0", merge(panes)))
    raw.append(
        (
            "iron",
            sweep(path=[(0.0, 0.0, high_m + 0.1), (length, 0.0, rise + high_m + 0.1)], section=(wide_m + 0.3, 0.16)),
        )
    )
    turn = rotation(0.0, 0.0, float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0]))))
    parts: Parts = [(m, translated(rotated(body, turn), a)) for m, body in raw]
    stands: list[Mesh] = []
    for t in legs:
        x, y = a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t
        foot = site.ground_z(x, y)
        stands.append(trestle(x, y, foot, a[2] + rise * t + 0.1, 1.0))
        site.occupy(rectangle(x - 1.2, y - 1.2, x + 1.2, y + 1.2), foot, a[2] + rise * t)
    if stands:
        parts.append(("steel", merge(stands)))
    site.add(None, "conveyor_gallery", parts)
    low = LineString([a[:2], b[:2]]).buffer(wide_m / 2, cap_style="flat")
    site.occupy(low, min(a[2], b[2]), max(a[2], b[2]) + high_m)
