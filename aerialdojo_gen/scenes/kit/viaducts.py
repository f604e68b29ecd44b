"""Viaducts along x: walls of round arches in stone; box girders on piers, and what they are built on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.ground import polygons_of, rectangle
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.halls import across_x
from aerialdojo_gen.scenes.kit.steelwork import guard_rails, posts, rim, trestle
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.plans.values import At, Bodies, Box, Material, Number
from aerialdojo_gen.scenes.shapes_extruded import upright
from aerialdojo_gen.scenes.site import Site

_SIDES = (-2.4, 2.4)


@part_builder
def stone_viaduct(
    *, x0: Number, x1: Number, foot_m: Number, arches: list[tuple[Number, Annotated[Number, Field(gt=0)], Number]],
    piers: list[Number], ballast_m: Number, stone: Material, trim: Material,
    ballast: Material = "gravel:#867e74",
) -> Parts:  # fmt: skip
    """Make a viaduct for one track at z = 0: arches with rings, a string course, parapets, pilasters, ballast.

    Arches are (middle, radius, springing); pilasters stand at the x of `piers`, the ballast reaches up to
    `ballast_m`.
    """
    parts: Parts = [(stone, arcade(x0, x1, foot_m, 0.0, arches, 5.0))]
    rings = []
    for middle, radius, spring in arches:
        upper = rectangle(middle - 9, spring, middle + 9, spring + 9)
        ring = _circle(middle, spring, radius + 0.6).difference(_circle(middle, spring, radius))
        rings.append(upright(polygons_of(ring.intersection(upper)), 5.3))
        for x in (middle - radius - 0.35, middle + radius + 0.35):
            rings.append(block(x - 0.5, -2.7, x + 0.5, 2.7, spring - 0.45, spring))
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


def _circle(x: float, z: float, radius: float) -> BaseGeometry:
    return Polygon(
        [(x + radius * float(np.cos(a)), z + radius * float(np.sin(a))) for a in np.linspace(0, 2 * np.pi, 33)[:-1]]
    )


def arcade(
    x0: float, x1: float, z0: float, z1: float, arches: Sequence[tuple[float, float, float]], width_m: float,
    y: float = 0.0,
) -> Mesh:  # fmt: skip
    """Make a wall of round arches that runs along x.

    Each opening (middle, radius, springing) reaches from the foot up to its springing and half a circle beyond.
    """
    face: BaseGeometry = rectangle(x0, z0, x1, z1)
    for middle, radius, spring in arches:
        face = face.difference(rectangle(middle - radius, z0 - 1.0, middle + radius, spring))
        face = face.difference(shapely.Point(middle, spring).buffer(radius, quad_segs=8))
    return upright(polygons_of(face), width_m, y)
