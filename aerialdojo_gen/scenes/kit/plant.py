"""Process plant out of doors: pipe bridges, walls about tanks, steel structures with platforms and vessels."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes.ground import edge_strip, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.steelwork import bars, guard_rails, plates, posts, rim
from aerialdojo_gen.scenes.kit.structures import Parts, Point, block, stairs
from aerialdojo_gen.scenes.mesh import merge, translated
from aerialdojo_gen.scenes.plans.values import Box, Line, Material, Number, Point3
from aerialdojo_gen.scenes.shapes import lathe
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

# Of the pipes: to the left of the middle, above the bearing, radius
_PIPES = (
    (-0.8, 0.36, 0.26), (-0.15, 0.28, 0.18), (0.7, 0.44, 0.34),
    (-0.6, 1.84, 0.24), (0.1, 1.76, 0.16), (0.75, 1.82, 0.22),
)  # fmt: skip


@site_builder
def pipe_bridge(
    site: Site, *, line: Line, z_m: Number, pipes: Annotated[list[Material], Field(min_length=1)],
    steel: Material = "steel", bay_m: Annotated[Number, Field(ge=0.5)] = 8.0,
) -> None:  # fmt: skip
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
