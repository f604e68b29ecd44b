"""Roofs, as parts of structures, and roofs over plans of any outline."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Parts
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import edge_strip, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import part_builder
from aerialdojo_gen.scenes.mesh import Mesh, merge, mesh
from aerialdojo_gen.scenes.plans.values import Box, Material, Number
from aerialdojo_gen.scenes.shapes_extruded import triangulate

# Of a rectangle around it that a plan must fill, for a ridge from gable to gable.
_RECTANGLE = 0.93
_GABLE_THICK_M = 0.18
_STEPS = 8
_ON_M = 1e-6
PARAPET_M, _PARAPET_THICK_M = 0.45, 0.3


@part_builder
def gable_roof(
    box: Box, z: Number, rise_m: Number, wall: Material, roof: Material,
    hip: bool = False, overhang_m: Number = 0.4,
) -> Parts:  # fmt: skip
    """Make a gable or hip roof over a rectangle, the ridge along its longer side."""
    return pitched_roof(rectangle(*box), z, rise_m, wall, roof, hip=hip, overhang_m=overhang_m)


def any_roof(plan: Polygon, top_m: float, rise_m: float, form: str, wall: str, roofing: str) -> Parts:
    """Make a roof over a plan of any outline.

    `top_m` is its highest point, over a flat roof that of the parapet; the eaves lie `rise_m` below. A gable over
    anything but a rectangle is hipped.
    """
    if form == "flat" or rise_m < 0.3:
        return _flat(plan, top_m, roofing)
    around = plan.minimum_rotated_rectangle
    if form == "gabled" and not plan.interiors and plan.area > _RECTANGLE * around.area:
        height = max(rise_m - _GABLE_THICK_M, 0.1)
        return pitched_roof(plan, top_m - rise_m, height, wall, roofing, overhang_m=0.3)
    return [(roofing, _inset(plan, top_m - rise_m, rise_m, round_=form == "dome"))]


def _flat(plan: Polygon, top_m: float, roofing: str) -> Parts:
    # The lid's sides must not lie in the walls' plane, where both would flicker.
    lid = plan.buffer(-0.02, join_style="mitre")
    level = top_m - PARAPET_M
    rim = edge_strip(plan, _PARAPET_THICK_M).buffer(-0.004, join_style="mitre")
    parts = [(roofing, slab(p, level - 0.25, level)) for p in polygons_of(lid)]
    return parts + [("concrete", slab(p, level - 0.05, top_m)) for p in polygons_of(rim)]


def _inset(plan: Polygon, eaves_m: float, rise_m: float, *, round_: bool) -> Mesh:
    """Raise every point by its distance from the outline: hips, ridges and valleys come of themselves."""
    reach = float(shapely.maximum_inscribed_circle(plan, tolerance=0.05).length)
    levels = [reach * k / _STEPS for k in range(_STEPS)] + [reach * 0.985]
    pieces: list[Mesh] = []
    inner: BaseGeometry = plan
    for low, high in zip(levels, [*levels[1:], math.inf], strict=True):
        outer = inner
        inner = plan.buffer(-high, join_style="mitre", mitre_limit=3.0) if math.isfinite(high) else Polygon()
        for ring in polygons_of(outer.difference(inner)):
            flat, faces = triangulate(ring)
            # By the ring that a corner is of: where it points inwards it lies farther from the walls.
            on_outer = shapely.distance(outer.boundary, shapely.points(flat)) < _ON_M
            share = np.where(on_outer, low, min(high, reach)) / reach
            up = np.sqrt(np.maximum(1.0 - (1.0 - share) ** 2, 0.0)) if round_ else share
            pieces.append(mesh(np.column_stack([flat, eaves_m + rise_m * up]), faces))
    whole = merge(pieces)
    top = float(whole.vertices[:, 2].max())
    z = whole.vertices[:, 2]
    # The ridge is as high as was asked for, though the last inset ends a little before it.
    stretched = eaves_m + (z - eaves_m) * (rise_m / max(top - eaves_m, 1e-6))
    return Mesh(np.column_stack([whole.vertices[:, :2], stretched]), whole.faces)
