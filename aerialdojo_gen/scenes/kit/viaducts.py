"""Stone viaducts along x: walls of round arches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import part_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.plans.values import Material, Number
from aerialdojo_gen.scenes.shapes_extruded import extrude

_SIDES = (-2.4, 2.4)


@part_builder
def stone_viaduct(
    *, x0: Number, x1: Number, foot_m: Number, arches: list[tuple[Number, Annotated[Number, Field(gt=0)], Number]],
    piers: list[Number], ballast_m: Number, stone: Material, trim: Material,
    ballast: Material = "gravel:#867e74",
) -> Parts:  # fmt: skip
    """Make a viaduct for one track at z = 0: arches with rings, a string course, parapets, pilasters, ballast.

    Parameters
    ----------
    x0, x1 : float
        Its ends.
    foot_m : float
        Height of its foot.
    arches : list of (middle, radius, springing)
        Its openings.
    piers : list of float
        Where pilasters stand between the arches, x in metres.
    ballast_m : float
        Height of the ballast's top.
    stone, trim, ballast : str
        Materials.
    """
    parts: Parts = [(stone, arcade(x0, x1, foot_m, 0.0, arches, 5.0))]
    rings = []
    for middle, radius, spring in arches:
        upper = rectangle(middle - 9, spring, middle + 9, spring + 9)
        ring = _circle(middle, spring, radius + 0.6).difference(_circle(middle, spring, radius))
        rings.append(upright(ring.intersection(upper), 5.3))
        for x in (middle - radius - 0.35, middle + radius + 0.35):
            rings.append(block(x - 0.5, -2.7, x + 0.5, 2.7, spring - 0.45, spring))
    walls = [block(x0 - 1.5, s - 0.2, x1 + 1.5, s + 0.2, 0.0, 1.25) for s in _SIDES]
    caps = [block(x0 - 1.6, s - 0.3, x1 + 1.6, s + 0.3, 1.25, 1.4) for s in _SIDES]
    course = [block(x0 - 1.5, s - 0.35, x1 + 1.5, s + 0.35, -0.35, 0.0) for s in _SIDES]
    pilasters = [block(x - 0.7, s - 0.6, x + 0.7, s + 0.6, foot_m + 0.6, 0.0) for x in piers for s in (-2.5, 2.5)]
    parts += [(trim, merge([*rings, *caps, *course])), (stone, merge([*walls, *pilasters]))]
    parts.append((ballast, block(x0 - 0.2, -2.2, x1 + 0.2, 2.2, -0.05, ballast_m)))
    return parts


def _circle(x: float, z: float, radius: float) -> BaseGeometry:
    return Polygon(
        [(x + radius * float(np.cos(a)), z + radius * float(np.sin(a))) for a in np.linspace(0, 2 * np.pi, 33)[:-1]]
    )


def arcade(
    x0: float,
    x1: float,
    z0: float,
    z1: float,
    arches: Sequence[tuple[float, float, float]],
    width_m: float,
    y: float = 0.0,
) -> Mesh:
    """Make a wall of round arches that runs along x.

    Parameters
    ----------
    x0, x1, z0, z1 : float
        Ends, foot and top, metres.
    arches : sequence of (middle, radius, springing)
        Each opening reaches from the foot up to its springing and half a circle beyond, metres.
    width_m : float
        Across, about `y`.
    """
    face: BaseGeometry = rectangle(x0, z0, x1, z1)
    for middle, radius, spring in arches:
        face = face.difference(rectangle(middle - radius, z0 - 1.0, middle + radius, spring))
        face = face.difference(shapely.Point(middle, spring).buffer(radius, quad_segs=8))
    return upright(face, width_m, y)


def upright(face: BaseGeometry, width_m: float, y: float = 0.0) -> Mesh:
    """Extrude a side view, polygons of (x, z) in metres, along y, centred on `y`."""
    bodies = []
    for piece in getattr(face, "geoms", [face]):
        flat = extrude(piece, width_m)
        u, v, w = flat.vertices.T
        bodies.append(Mesh(np.column_stack([u, y + width_m / 2 - w, v]), flat.faces))
    return merge(bodies)
