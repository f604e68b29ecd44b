"""Marks on paved ground: lines, dashes, outlines, rails; `rise_m` is the rise of the paving that they lie in."""

from __future__ import annotations

from typing import Literal

import numpy as np
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.scenes.ground import polygons_of, ribbon
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
from aerialdojo_gen.scenes.site import Site


@site_builder
def line_marks(
    site: Site, *, lines: list[Line], width_m: Number = 0.18, material: Material = "marking", rise_m: Number = 0.0
) -> None:
    """Paint lines."""
    for line in lines:
        site.paint(ribbon(line, width_m), material, rise_m, material)


@site_builder
def dashed_marks(
    site: Site, *, lines: list[Line], dash_m: Number = 2.0, gap_m: Number = 3.0, width_m: Number = 0.16,
    material: Material = "marking", rise_m: Number = 0.0,
) -> None:  # fmt: skip
    """Paint dashed lines, each from 1 m after its start."""
    for line in lines:
        whole = LineString(line)
        for s in np.arange(1.0, whole.length - dash_m, max(dash_m + gap_m, 0.1)):
            a, b = whole.interpolate(s), whole.interpolate(s + dash_m)
            site.paint(ribbon([(a.x, a.y), (b.x, b.y)], width_m), material, rise_m, material)


@site_builder
def outline_marks(
    site: Site, *, areas: list[Area], width_m: Number = 0.16, material: Material = "marking", rise_m: Number = 0.0,
    join: Literal["mitre", "round"] = "mitre", within: Area | None = None,
) -> None:  # fmt: skip
    """Paint lines around areas, such as bays, places of stacks or courts; only `within` an area."""
    for area in areas:
        for piece in polygons_of(area):
            ring = Polygon(piece.exterior).exterior.buffer(width_m / 2, join_style=join)
            ring = ring if within is None else ring.intersection(within)
            site.paint(ring, material, rise_m, material)


@site_builder
def crane_rails(
    site: Site, *, lines: list[Line], material: Material = "steel", marks: Material = "marking_yellow",
    rise_m: Number = 0.0,
) -> None:  # fmt: skip
    """Lay rails of cranes flush with the paving, with a warning line on both sides."""
    for line in lines:
        site.paint(ribbon(line, 0.16), material, rise_m, material)
        for side in (-0.6, 0.6):
            beside = LineString(line).offset_curve(side, join_style="mitre")
            site.paint(ribbon(beside.coords, 0.12), marks, rise_m, marks)
