"""What stands at the water's edge: quays over water at z = 0, fenders, mooring lines, breakwaters, jetties.

The water is the ground itself, level at z = 0; quays are painted with a rise, so that their walls stand upright.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import ribbon
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
from aerialdojo_gen.scenes.shapes import box, crown, cylinder
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

_Point3 = tuple[Number, Number, Number]


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
            yaw = float(np.degrees(np.arctan2(b.y - a.y, b.x - a.x))) - 90.0
            turn = rotation(0.0, 0.0, yaw)
            if k % 4 == 2:
                parts = [translated(box(size=(0.08, 0.08, 2.2)), (0.06, v, 0.0)) for v in (-0.25, 0.25)]
                parts += [translated(box(size=(0.06, 0.5, 0.06)), (0.06, 0.0, 0.2 + 0.35 * j)) for j in range(6)]
                rungs.append(translated(rotated(merge(parts), turn), (a.x, a.y, 0.0)))
            else:
                tyre = rotated(cylinder(radius=0.55, height=0.3, segments=10), rotation(0.0, 90.0, 0.0))
                tyres.append(translated(rotated(translated(tyre, (0.02, 0.0, 1.0)), turn), (a.x, a.y, 0.0)))
    parts_of: Parts = [("rubber", merge(tyres))]
    if rungs:
        parts_of.append(("marking_yellow", merge(rungs)))
    site.add(None, "fenders", parts_of)


@site_builder
def mooring_lines(
    site: Site, *, ropes: list[tuple[_Point3, _Point3]], sag_m: Number = 0.3, material: Material = "#c9a96a"
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
        length = float(np.hypot(x1 - x0, y1 - y0))
        count = max(round(length / 4.0), 1)
        piles = [(length * k / count, s * (width_m / 2 - 0.1)) for k in range(count + 1) for s in (-1, 1)]
        joists = [block(0.0, s - 0.08, length, s + 0.08, z - 0.36, z - 0.12) for s in (-0.8, 0.8)]
        local: Parts = [
            (floor, block(0.0, -width_m / 2, length, width_m / 2, z - 0.12, z)),
            ("wood", merge(joists)),
            (pile, columns(piles, -0.3, z + 0.55, 0.15, 6)),
        ]
        frame = Frame(x0, y0, float(np.degrees(np.arctan2(y1 - y0, x1 - x0))))
        site.add(None, "jetty", frame.parts(local))
