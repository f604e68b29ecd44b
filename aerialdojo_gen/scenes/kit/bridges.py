"""Bridges whose road runs along x at z = 0: decks, parapets, arches, and the roads that lead to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of, rectangle
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.steelwork import plates
from aerialdojo_gen.scenes.kit.structures import Parts, block, railing
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Material, Number
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

FOOTWAY_M = 0.12


@part_builder
def bridge_deck(
    *, x0: Number, x1: Number, road_m: Number, half_m: Number, depth_m: Number = 1.0, girder: Material = "concrete",
    girders: Sequence[Number] = (), girder_m: Number = 1.4, holes: Sequence[Area] = (),
    pavement: Material = "paving:#b3a899",
) -> Parts:  # fmt: skip
    """Make a deck: roadway with marks, footways, edge beams and girders.

    `road_m` and `half_m` are half widths of the roadway and of the whole; edge beams are `depth_m` high; `girders`
    run at those y and reach `girder_m` below the road; `holes` stay open, e.g. for the legs of pylons.
    """
    h, r = half_m, road_m
    sheet: BaseGeometry = rectangle(x0, -h, x1, h)
    for hole in holes:
        sheet = sheet.difference(hole)
    road = rectangle(x0, -r, x1, r)
    ways = sheet.difference(road)
    beams = rectangle(x0, -h, x1, h).difference(rectangle(x0, -h + 0.5, x1, h - 0.5))
    for hole in holes:
        beams = beams.difference(hole)
    below = [slab(p, -depth_m, -0.35) for p in polygons_of(beams)]
    below += [block(x0, y - 0.3, x1, y + 0.3, -girder_m, -0.35) for y in girders]
    cross = [
        block(x - 0.15, -h + 0.4, x + 0.15, h - 0.4, -depth_m + 0.1, -0.35)
        for x in np.arange(x0 + 2.0, x1 - 1.0, 4.0)
    ]
    under = sheet.difference(rectangle(x0 - 1, -r - 0.02, x1 + 1, r + 0.02)).buffer(-0.01, join_style="mitre")
    marks = [block(x, -0.08, x + 2.0, 0.08, -0.03, 0.008) for x in np.arange(x0 + 1.5, x1 - 2.0, 5.0)]
    marks += [block(x0, s * (r - 0.25) - 0.07, x1, s * (r - 0.25) + 0.07, -0.03, 0.008) for s in (-1, 1)]
    return [
        (girder, merge([*below, *cross])),
        ("asphalt", slab(road, -0.35, 0.0)),
        ("concrete", plates(under, -0.35, -0.05)),
        (pavement, plates(ways, -0.05, FOOTWAY_M)),
        ("marking", merge(marks)),
    ]


@part_builder
def bridge_parapets(
    *, x0: Number, x1: Number, half_m: Number, frame: Material, gaps: Sequence[tuple[Number, Number, int]] = (),
    inset_m: Number = 0.25, pane: Material = "chain_link",
) -> Parts:  # fmt: skip
    """Make railings along both edges of a deck, open at gaps: from x, to x, side -1 or 1."""
    parts: Parts = []
    for side in (-1, 1):
        y, x = side * (half_m - inset_m), x0
        for a, b, _ in sorted(g for g in (*gaps, (x1, x1, side)) if g[2] == side):
            if a > x:
                parts += railing([(x, y), (a, y)], FOOTWAY_M, height_m=1.15, pane=pane, frame=frame)
            x = b
    return parts


@part_builder
def truss_arch(
    *, half_span_m: Number, spring_z: Number, crown_z: Number, ribs: tuple[Number, Number], material: Material,
    panels: int = 14,
) -> Parts:  # fmt: skip
    """Make an arch of two ribs (y, metres) as trusses, columns on them up to a deck, and bracing between them."""

    def rib(x: float) -> float:
        return crown_z - (crown_z - spring_z) * (x / half_span_m) ** 2

    xs = np.linspace(-half_span_m, half_span_m, panels + 1)
    bodies: list[Mesh] = []
    depth = [0.9 + 1.5 * (abs(float(x)) / half_span_m) ** 2 for x in xs]
    for y in ribs:
        upper = [(float(x), y, rib(float(x))) for x in xs]
        lower = [(float(x), y, rib(float(x)) - d) for x, d in zip(xs, depth, strict=True)]
        bodies += [sweep(path=upper, section=(0.45, 0.35)), sweep(path=lower, section=(0.45, 0.35))]
        for k in range(len(xs)):
            bodies.append(_bar(upper[k], lower[k], 0.16))
            if k + 1 < len(xs):
                a, b = (upper[k], lower[k + 1]) if xs[k] < -0.1 else (lower[k], upper[k + 1])
                bodies.append(_bar(a, b, 0.14))
        for x, _, z in upper:
            if z < -2.2:
                bodies.append(block(x - 0.17, y - 0.17, x + 0.17, y + 0.17, z, -1.05))
    low, high = ribs
    for k, x in enumerate(float(v) for v in xs):
        bodies.append(_bar((x, low, rib(x)), (x, high, rib(x)), 0.2))
        if k + 1 < len(xs):
            nxt = float(xs[k + 1])
            here, there = (low, high) if k % 2 else (high, low)
            bodies.append(_bar((x, here, rib(x)), (nxt, there, rib(nxt)), 0.14))
        if rib(x) < -4.5:
            bodies.append(_bar((x, low, rib(x)), (x, high, -1.2), 0.12))
            bodies.append(_bar((x, high, rib(x)), (x, low, -1.2), 0.12))
    return [(material, merge(bodies))]


@site_builder
def bridge_approach(
    site: Site, *, x0: Number, x1: Number, road_m: Number, half_m: Number, pavement: Material = "paving:#b3a899"
) -> None:
    """Paint the road before a bridge on level ground at z = 0, as wide as the deck."""
    site.paint(rectangle(x0, -half_m, x1, half_m), pavement, FOOTWAY_M)
    site.paint(rectangle(x0, -road_m, x1, road_m), "asphalt")
    for side in (-1, 1):
        y = side * (road_m - 0.25)
        site.paint(rectangle(x0, y - 0.07, x1, y + 0.07), "marking")
    for x in np.arange(x0 + 1.5, x1 - 2.0, 5.0):
        site.paint(rectangle(x, -0.08, x + 2.0, 0.08), "marking")


@site_builder
def toll_islands(
    site: Site, *, x0: Number, x1: Number, rows: list[Number], marks: list[Number], half_m: Number = 0.9
) -> None:
    """Paint kerbed islands between toll lanes along x, in rows (y, metres), each in line with marks about some x."""
    for y in rows:
        site.paint(rectangle(x0, y - half_m, x1, y + half_m), "concrete", FOOTWAY_M)
        for x in marks:
            site.paint(rectangle(x - 1.4, y - 0.08, x + 1.4, y + 0.08), "marking")


def _bar(a: tuple[float, float, float], b: tuple[float, float, float], thick_m: float) -> Mesh:
    return sweep(path=[a, b], section=(thick_m, thick_m))


@site_builder
def footbridge(
    site: Site, *, at: At, yaw_deg: Number, span_m: Annotated[Number, Field(gt=0, le=60)], place: str,
    sunk_m: Number = 0.28, margin_m: Number = 1.6,
) -> None:  # fmt: skip
    """Lay a footbridge of the catalogue over a gap, a little lower than the higher bank."""
    frame = Frame(*at, yaw_deg)
    z = max(site.ground_z(*frame.at(side * span_m / 2, 0.0)) for side in (-1.0, 1.0)) - sunk_m
    bridge = Placement("footbridge", *at, yaw_deg, DRAWN, z, place, params={"span": span_m})
    site.place(bridge, margin_m=margin_m)
