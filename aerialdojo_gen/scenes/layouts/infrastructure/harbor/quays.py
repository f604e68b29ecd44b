"""What harbours are made of: quays over water at z = 0, fenders, breakwaters, jetties, stacked containers, halls.

The water is the ground itself, level at z = 0; quays are painted with a rise, so that their walls stand upright.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import Polyline, slab
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, letters
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box, crown, cylinder
from aerialdojo_gen.scenes.site import Site

QUAY_M = 2.0
LONG_M, WIDE_M, HIGH_M = 12.19, 2.44, 2.59
COLOURS = ("#a83c32", "#2f5f9e", "#4c8a5a", "#d0702c", "#8d8f92", "#d9b03a", "#6a4a3a", "#dfe2e2")


def quay(site: Site, area: BaseGeometry, material: str = "concrete", edge: str = "blocks:#8f8a80") -> None:
    """Lay a quay with upright walls out of the water and a coping of dressed stone along its edge."""
    site.paint(area, site.material("coping", "concrete:#bdb8ac"), QUAY_M, edge)
    site.paint(area.buffer(-0.6, join_style="mitre"), site.material("quay", material), QUAY_M, edge)


def lay(site: Site, area: BaseGeometry, material: str) -> None:
    """Paint an area of a quay: asphalt, lane marks, rails."""
    site.paint(area, material, QUAY_M, material)


def line(site: Site, path: Polyline, width_m: float = 0.18, material: str = "marking") -> None:
    """Paint a line on a quay."""
    lay(site, ribbon(path, width_m), material)


def dashes(site: Site, path: Polyline, material: str = "marking") -> None:
    """Paint a dashed line on a quay."""
    whole = LineString(path)
    for s in np.arange(1.0, whole.length - 2.0, 5.0):
        a, b = whole.interpolate(s), whole.interpolate(s + 2.0)
        line(site, [(a.x, a.y), (b.x, b.y)], 0.16, material)


def fenders(site: Site, edges: Sequence[Polyline], spacing_m: float = 7.0) -> None:
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


def breakwater(site: Site, path: Polyline, top_m: float = 2.6, seed: int = 0) -> None:
    """Heap up a breakwater of rocks with a paved way at `top_m` along a path."""
    wide, way = ribbon(path, 8.0), ribbon(path, 4.0)
    parts: Parts = [
        (site.material("rock_core", "rubble:#7f7a72"), slab(wide, -0.3, top_m - 1.3)),
        (site.material("mole", "concrete"), slab(way, top_m - 1.6, top_m)),
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


def jetty(site: Site, a: tuple[float, float], b: tuple[float, float], width_m: float = 2.4, z_m: float = 1.2) -> None:
    """Build a wooden jetty on piles from `a` to `b`."""
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    yaw = float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0])))
    count = max(round(length / 4.0), 1)
    piles = [(length * k / count, s * (width_m / 2 - 0.1)) for k in range(count + 1) for s in (-1, 1)]
    local: Parts = [
        ("planks:#9a8460", block(0.0, -width_m / 2, length, width_m / 2, z_m - 0.12, z_m)),
        ("wood", merge([block(0.0, s - 0.08, length, s + 0.08, z_m - 0.36, z_m - 0.12) for s in (-0.8, 0.8)])),
        ("bark:#5a4a3a", columns(piles, -0.3, z_m + 0.55, 0.15, 6)),
    ]
    turn = rotation(0.0, 0.0, yaw)
    site.add(None, "jetty", [(m, translated(rotated(body, turn), (*a, 0.0))) for m, body in local])


def container_block(
    site: Site, x: float, y: float, heights: Sequence[Sequence[int]], yaw_deg: float = 0.0, z: float = QUAY_M
) -> Polygon:
    """Stack long containers in bays end to end and rows side by side.

    Parameters
    ----------
    site : Site
        Where; the block takes its ground.
    x, y : float
        Its south-west corner before it is turned about it, metres.
    heights : sequence of sequence of int
        Tiers of every row (running along y) of every bay (along x).
    yaw_deg : float
        Direction of the containers' length.
    z : float
        Height of the floor, metres.

    Returns
    -------
    Polygon
        Its plan.
    """
    rng = site.rng_for("stack", x, y)
    bodies: dict[str, list[Mesh]] = {}
    dark: list[Mesh] = []
    for i, bay in enumerate(heights):
        for j, tiers in enumerate(bay):
            for k in range(tiers):
                colour = COLOURS[int(rng.integers(len(COLOURS)))]
                u, v, w = i * (LONG_M + 0.5), j * (WIDE_M + 0.12), k * HIGH_M
                body = block(u, v, u + LONG_M, v + WIDE_M, w, w + HIGH_M - 0.04)
                bodies.setdefault(colour, []).append(body)
                for end, out in ((u, -1), (u + LONG_M, 1)):
                    a, b = sorted((end, end + out * 0.03))
                    dark += [block(a, v + s, b, v + s + 0.07, w + 0.1, w + 2.4) for s in (0.35, 0.95, 1.42, 2.0)]
    turn = rotation(0.0, 0.0, yaw_deg)
    parts: Parts = [
        (f"corrugated:{c}", translated(rotated(merge(m), turn), (x, y, z))) for c, m in sorted(bodies.items())
    ]
    parts.append(("#c9ccce", translated(rotated(merge(dark), turn), (x, y, z))))
    length = len(heights) * (LONG_M + 0.5) - 0.5
    width = max(len(b) for b in heights) * (WIDE_M + 0.12) - 0.12
    plan = translate(rotate(rectangle(0, 0, length, width), yaw_deg, origin=(0, 0)), x, y)
    site.add(None, "container_stack", parts, footprint=plan)
    return plan


def hall(
    site: Site, x0: float, y0: float, x1: float, y1: float, height_m: float, *, wall: str, roof: str, doors: str,
    name: str = "", facing_deg: float = -90.0, ridge_m: float = 0.0, category: str = "warehouse", z: float = QUAY_M,
) -> float:  # fmt: skip
    """Put up a warehouse with big doors along its front, and a flat or pitched roof; gives the height of its eaves.

    Parameters
    ----------
    site : Site
        Where; the hall takes its ground.
    x0, y0, x1, y1 : float
        Its plan, metres.
    height_m : float
        Of its walls.
    wall, roof, doors : str
        Materials.
    name : str
        Stands on the front.
    facing_deg : float
        Of the front: a multiple of 90.
    ridge_m : float
        Height of the ridge over the eaves; 0 for a flat roof with a low rim.
    category, z : str, float
        Its own category, and the height of its floor.
    """
    plan, top = rectangle(x0, y0, x1, y1), z + height_m
    parts: Parts = [(wall, block(x0, y0, x1, y1, z, top - 0.02)),
                    ("concrete", _rim(plan, 0.06, 0.0, z, z + 0.9))]  # fmt: skip
    if ridge_m:
        parts += pitched_roof(plan, top - 0.02, ridge_m, wall, roof, overhang_m=0.5)
    else:
        parts += [(roof, block(x0 + 0.05, y0 + 0.05, x1 - 0.05, y1 - 0.05, top - 0.02, top)),
                  ("sheet_metal:#6e757c", _rim(plan, 0.12, 0.25, top - 0.4, top + 0.3))]  # fmt: skip
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    along_x = facing_deg % 180.0 == 90.0
    out, wide = ((y1 - y0) / 2, x1 - x0) if along_x else ((x1 - x0) / 2, y1 - y0)
    count = max(int(wide // 6.5), 1)
    local: Parts = []
    for k in range(count):
        v = (k - (count - 1) / 2) * wide / count
        panels = [block(out, v - 1.9, out + 0.12 - 0.05 * (j % 2), v + 1.9, 0.05 + 0.6 * j, 0.63 + 0.6 * j)
                  for j in range(6)]  # fmt: skip
        local.append((doors, merge(panels)))
        local.append(("#f1f0ea", merge([block(out, v + s - 0.12, out + 0.16, v + s + 0.12, 0.0, 3.8)
                                        for s in (-2.0, 2.0)])))  # fmt: skip
    panes = [block(out, v - 0.9, out + 0.06, v + 0.9, height_m - 1.5, height_m - 0.7)
             for v in np.arange(-wide / 2 + 2.0, wide / 2 - 1.5, 3.0)]  # fmt: skip
    turn = rotation(0.0, 0.0, facing_deg)
    if name:
        panes = panes[:1] + panes[-1:]
        sign = letters(name, 0.9, (out + 0.02, 0.0, height_m - 1.6), 0.0, 0.08)
        local.append((site.material("lettering", "#f1f0ea"), sign))
    local.append(("window", merge(panes)))
    parts += [(m, translated(rotated(b, turn), (*middle, z))) for m, b in local]
    site.add(None, category, parts, footprint=plan)
    return top


def open_shed(
    site: Site, x0: float, y0: float, x1: float, y1: float, height_m: float, roof: str, z: float = QUAY_M
) -> float:
    """Put up a roof on columns that one can fly under; gives the height of its top."""
    nx, ny = max(round((x1 - x0) / 8.0), 1), max(round((y1 - y0) / 8.0), 1)
    posts = [(x0 + 0.5 + (x1 - x0 - 1.0) * i / nx, y0 + 0.5 + (y1 - y0 - 1.0) * j / ny)
             for i in range(nx + 1) for j in range(ny + 1)]  # fmt: skip
    beams = [block(x - 0.12, y0 + 0.2, x + 0.12, y1 - 0.2, z + height_m - 0.45, z + height_m)
             for x in sorted({p[0] for p in posts})]  # fmt: skip
    parts: Parts = [
        ("steel", columns(posts, z, z + height_m - 0.45, 0.18, 6)),
        ("steel", merge(beams)),
        (roof, block(x0, y0, x1, y1, z + height_m, z + height_m + 0.25)),
    ]
    site.add(None, "open_shed", parts)
    for x, y in posts:
        site.occupy(rectangle(x - 0.3, y - 0.3, x + 0.3, y + 0.3))
    return z + height_m + 0.25


def set_out(
    site: Site, things: Sequence[tuple[str, float, float, float]], place: str, z: float | None = None
) -> None:
    """Set things (category, x, y, yaw) out."""
    for category, x, y, yaw in things:
        put(site, category, x, y, yaw, place, z=z)


def _rim(plan: Polygon, out_m: float, in_m: float, z0: float, z1: float) -> Mesh:
    ring = plan.buffer(out_m, join_style="mitre").difference(plan.buffer(-max(in_m, 0.02), join_style="mitre"))
    return slab(ring, z0, z1)
