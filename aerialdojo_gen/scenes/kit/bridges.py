"""Bridges and viaducts whose way runs along x, at z = 0 or on piers, the roads that lead to them, and walkways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, between_gates, plates, slab
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle, without
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.halls import across_x
from aerialdojo_gen.scenes.kit.steelwork import guard_rails, posts, rim, trestle
from aerialdojo_gen.scenes.kit.structures import block, columns, deck, railing, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Bodies, Box, Line, Material, Number, Positive
from aerialdojo_gen.scenes.shapes import sweep, upright
from aerialdojo_gen.scenes.site import Site

FOOTWAY_M = 0.12
_BEAM_M = 0.05  # The beams of a footbridge reach so far below its origin


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
    sheet = without(rectangle(x0, -h, x1, h), holes)
    road = rectangle(x0, -r, x1, r)
    ways = sheet.difference(road)
    beams = without(rectangle(x0, -h, x1, h), [rectangle(x0, -h + 0.5, x1, h - 0.5), *holes])
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
        y = side * (half_m - inset_m)
        for a, b in between_gates(x0, x1, [gap[:2] for gap in gaps if gap[2] == side], 0.0):
            parts += railing([(a, y), (b, y)], FOOTWAY_M, height_m=1.15, pane=pane, frame=frame)
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
    """Lay a footbridge of the catalogue over a gap, a little below the higher bank; stone bears its other end."""
    frame = Frame(*at, yaw_deg)
    banks = {u: site.ground_z(*frame.at(u, 0.0)) for u in (-span_m / 2, span_m / 2)}
    z = max(banks.values()) - sunk_m
    bridge = Placement("footbridge", *at, yaw_deg, DRAWN, z, place, params={"span": span_m}, margin_m=margin_m)
    node = site.place(bridge).node
    stones = [
        block(u - 0.5, -0.95, u + 0.5, 0.95, ground - 0.4, z - _BEAM_M + 0.02)
        for u, ground in banks.items() if z - _BEAM_M > ground
    ]  # fmt: skip
    if stones:
        site.add(f"plinth_{node}", "plinth", frame.parts([(site.material("plinth", "concrete"), merge(stones))]))


_SIDES = (-2.4, 2.4)


@part_builder
def stone_viaduct(
    *, x0: Number, x1: Number, foot_m: Number, arches: list[tuple[Number, Positive, Number]], piers: list[Number],
    ballast_m: Number, stone: Material, trim: Material, ballast: Material = "gravel:#867e74",
) -> Parts:  # fmt: skip
    """Make a viaduct for one track at z = 0: arches with rings, a string course, parapets, pilasters, ballast.

    Arches are (middle, radius, springing); pilasters stand at the x of `piers`, the ballast reaches up to
    `ballast_m`.
    """
    parts: Parts = [(stone, arcade(x0, x1, foot_m, 0.0, arches, 5.0))]
    rings = []
    for middle, radius, spring in arches:
        upper = rectangle(middle - 9, spring, middle + 9, spring + 9)
        ring = disc(middle, spring, radius + 0.6, 32).difference(disc(middle, spring, radius, 32))
        rings.append(upright(polygons_of(ring.intersection(upper)), 5.3))
        ends = (middle - radius - 0.35, middle + radius + 0.35)
        rings += [block(x - 0.5, -2.7, x + 0.5, 2.7, spring - 0.45, spring) for x in ends]
    walls = [block(x0 - 1.5, s - 0.2, x1 + 1.5, s + 0.2, 0.0, 1.25) for s in _SIDES]
    caps = [block(x0 - 1.6, s - 0.3, x1 + 1.6, s + 0.3, 1.25, 1.4) for s in _SIDES]
    course = [block(x0 - 1.5, s - 0.35, x1 + 1.5, s + 0.35, -0.35, 0.0) for s in _SIDES]
    pilasters = [block(x - 0.7, s - 0.6, x + 0.7, s + 0.6, foot_m + 0.6, 0.0) for x in piers for s in (-2.5, 2.5)]
    parts += [(trim, merge([*rings, *caps, *course])), (stone, merge([*walls, *pilasters]))]
    parts.append((ballast, block(x0 - 0.2, -2.2, x1 + 0.2, 2.2, -0.05, ballast_m)))
    return parts


@part_builder
def box_girder(
    *, x: tuple[Number, Number], y: Number, top_m: Number, half_m: Number = 5.4, deep_m: Number = 2.2,
    concrete: Material = "concrete:#bdb9ae",
) -> Parts:  # fmt: skip
    """Make a girder of concrete along x about `y`, half as wide as its deck at its foot."""
    side = [(half_m, top_m - 0.25), (3.0, top_m - 0.55), (2.4, top_m - deep_m)]
    deck = [(y - half_m, top_m - 0.25), (y - half_m, top_m), (y + half_m, top_m)]
    outline = [*deck, *((y + v, z) for v, z in side), *((y - v, z) for v, z in side[:0:-1])]
    return [(concrete, across_x(outline, *x))]


@site_builder
def bridge_piers(
    site: Site, *, at: list[At], top_m: Number | None = None, built_m: Number = 4.6,
    concrete: Material = "concrete:#b6b2a8", footing: Material = "concrete",
) -> None:  # fmt: skip
    """Put up piers with a hammerhead at `top_m`; without it they are under way, `built_m` high, with bars on top."""
    for x, y in at:
        foot = site.ground_z(x, y) - 0.4
        top = foot + built_m if top_m is None else top_m
        parts: Parts = [(footing, block(x - 2.6, y - 3.8, x + 2.6, y + 3.8, foot, foot + 0.9))]
        shaft = [(y - 1.7, foot + 0.9), (y + 1.7, foot + 0.9)]
        if top_m is None:
            shaft += [(y + 1.7, top), (y - 1.7, top)]
            rods = [(x + i * 0.6, y + j * 0.4) for i in (-1, 0, 1) for j in range(-3, 4)]
            parts.append(("rust", posts(rods, top, top + 2.2, 0.06)))
        else:
            head = [(1.7, top - 1.6), (2.9, top - 0.3), (2.9, top)]
            shaft += [*((y + v, z) for v, z in head), *((y - v, z) for v, z in head[::-1])]
        parts.append((concrete, across_x(shaft, x - 0.9, x + 0.9)))
        site.add(None, "bridge_pier", parts)
        site.occupy(rectangle(x - 2.7, y - 3.9, x + 2.7, y + 3.9), foot - 2.0, foot + 1.2)
        site.occupy(rectangle(x - 1.1, y - 2.2, x + 1.1, y + 2.2), foot, top)


@site_builder
def falsework(
    site: Site, *, box: Box, top_m: Number,
    towers: tuple[list[Number], list[Number]], beams: list[Number], extra: Bodies = [],  # noqa: B006
) -> None:  # fmt: skip
    """Carry a platform on trestles that stand on the ground, every x with every y, and on beams (y) along x."""
    x0, y0, x1, y1 = box
    parts: Parts = []
    for x in towers[0]:
        for y in towers[1]:
            foot = site.ground_z(x, y) - 0.1
            parts.append(("marking_yellow:#d9a32a", trestle(x, y, foot, top_m - 0.7, 0.8, 0.12)))
            site.occupy(rectangle(x - 1, y - 1, x + 1, y + 1), foot - 0.5, top_m - 0.8)
    parts += [("steel", block(x0, y - 0.2, x1, y + 0.2, top_m - 0.7, top_m - 0.3)) for y in beams]
    parts += [("planks:#c8a468", block(*box, top_m - 0.3, top_m)), *extra]
    site.add(None, "falsework", [*parts, *guard_rails(rim(rectangle(x0, y0, x1, y1)), top_m, toe="planks")])


def arcade(
    x0: float, x1: float, z0: float, z1: float, arches: Sequence[tuple[float, float, float]], width_m: float
) -> Mesh:
    """Make a wall of round arches that runs along x.

    Each opening (middle, radius, springing) reaches from the foot up to its springing and half a circle beyond.
    """
    face: BaseGeometry = rectangle(x0, z0, x1, z1)
    for middle, radius, spring in arches:
        face = face.difference(rectangle(middle - radius, z0 - 1.0, middle + radius, spring))
        face = face.difference(shapely.Point(middle, spring).buffer(radius, quad_segs=8))
    return upright(polygons_of(face), width_m)


@site_builder
def raised_walkway(
    site: Site, *, line: Line, z_m: Number, stair_yaws: tuple[Number, Number], width_m: Number = 3.2,
    stilts: Material = "wood", floor: Material = "boards:#a98a62", under: Material = "planks:#7d6446",
    spacing_m: Annotated[Number, Field(ge=1.0)] = 5.0, run_m: Number = 5.4, node: str | None = None,
) -> None:  # fmt: skip
    """Lead a walkway on stilts along a line, with railings, and stairs that climb to its ends in two directions."""
    middle = LineString(line)
    parts: Parts = []
    for p in (middle.interpolate(s) for s in np.arange(1.0, middle.length, spacing_m)):
        x, y = float(p.x), float(p.y)
        parts.append((stilts, columns([(x, y)], site.ground_z(x, y) - 0.2, z_m - 0.3, 0.2)))
    plan = middle.buffer(width_m / 2, cap_style="flat", join_style="mitre")
    parts += deck(plan, z_m, floor=floor, under=under)
    for side in (-1, 1):
        rim = middle.offset_curve(side * (width_m / 2 - 0.1), join_style="mitre")
        for leg in getattr(rim, "geoms", [rim]):
            parts += railing([(float(x), float(y)) for x, y in leg.coords], z_m, pane="iron", height_m=0.95)
    for (x, y), yaw in zip((line[0], line[-1]), stair_yaws, strict=True):
        back = (x - run_m * float(np.cos(np.radians(yaw))), y - run_m * float(np.sin(np.radians(yaw))))
        foot = site.ground_z(*back)
        parts += stairs(back, yaw, width_m - 0.6, z_m - foot, run_m, z_m=foot, tread=under)
    site.add(node, "raised_walkway", parts, {"material": "wooden"})


@part_builder
def piles(
    *, line: Line, z: tuple[Number, Number], spacing_m: Annotated[Number, Field(ge=0.2)] = 3.0,
    radius_m: Number = 0.16, material: Material = "wood",
) -> Parts:  # fmt: skip
    """Drive piles along a line, at its corners and at most `spacing_m` apart."""
    at = [(float(x), float(y)) for x, y in LineString(line).segmentize(spacing_m).coords]
    return [(material, columns(at, *z, radius_m))]
