"""Streets with marks and pavements, crossings, arrows, parking bays; other marks on paved ground and its rails.

`rise_m` of a mark is the rise of the paving that it lies in.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring, unary_union

from aerialdojo_gen.scenes.grammar import Polyline, Pose
from aerialdojo_gen.scenes.ground import polygons_of, rectangle, ribbon
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
from aerialdojo_gen.scenes.site import Site

MARK_M = 0.15
KERB_M = 0.12
_DASH_M, _GAP_M = 2.0, 3.0


@site_builder
def streets(
    site: Site, *, paths: list[Line], lanes: Annotated[int, Field(ge=1, le=12)] = 2, lane_m: Number = 3.25,
    pavement_m: Number = 2.0, surface: Material = "asphalt", pavement: Material = "paving", marks: bool = True,
) -> None:  # fmt: skip
    """Paint streets that may cross, along their middle lines."""
    width = lanes * lane_m
    roads = [ribbon(path, width) for path in paths]
    if pavement_m > 0.0:
        site.paint(unary_union([ribbon(path, width + 2 * pavement_m) for path in paths]), pavement, KERB_M)
    carriageways = unary_union(roads)
    site.paint(carriageways, surface)
    for path in paths:
        drive(site, path, width, lanes)
    if marks:
        for k, path in enumerate(paths):
            others = unary_union([r.buffer(1.0) for j, r in enumerate(roads) if j != k])
            for side in (-1, 1):
                _line(site, path, side * (width / 2 - 0.3), False, others)
            for lane in range(1, lanes):
                _line(site, path, lane * lane_m - width / 2, not (lanes >= 4 and lane * 2 == lanes), others)


def drive(site: Site, path: Polyline, width_m: float, lanes: int, oneway: bool = False) -> None:
    """Tell the site of a street's lanes; one drives on the right."""
    lane_m, line = width_m / lanes, LineString(path)
    for k in range(lanes):
        offset = (k + 0.5) * lane_m - width_m / 2
        shifted = line.offset_curve(offset, join_style="mitre") if abs(offset) > 1e-6 else line
        if isinstance(shifted, LineString) and not shifted.is_empty:
            site.lanes.append((shifted.reverse() if offset > 1e-6 and not oneway else shifted, lane_m))


@site_builder
def crossings(
    site: Site, *, at: list[tuple[Number, Number, Number, Number]], width_m: Number = 3.0,
    surface: Material = "asphalt",
) -> None:  # fmt: skip
    """Paint zebra crossings: middle, direction of walking and length of each (x, y, yaw_deg, length_m)."""
    for x, y, yaw_deg, length_m in at:
        around = rectangle(-length_m / 2, -width_m / 2 - 0.5, length_m / 2, width_m / 2 + 0.5)
        site.paint(_posed(around, x, y, yaw_deg), surface)
        site.crossings.append(Point(x, y))
        count = int(length_m // 1.0)
        for k in range(count):
            u = (k - (count - 1) / 2) * 1.0
            stripe = rectangle(u - 0.25, -width_m / 2, u + 0.25, width_m / 2)
            site.paint(_posed(stripe, x, y, yaw_deg), "marking")


def parking_row(
    site: Site,
    x: float,
    y: float,
    yaw_deg: float,
    count: int,
    *,
    bay_m: tuple[float, float] = (2.6, 5.2),
    z: float | None = None,
    material: str = "marking",
) -> list[Pose]:
    """Mark a row of parking bays and return the pose of each, facing the closed side; metres and degrees."""
    width, depth = bay_m
    half = count * width / 2
    if z is None:
        for k in range(count + 1):
            v = k * width - half
            site.paint(_posed(rectangle(-depth, v - MARK_M / 2, 0.0, v + MARK_M / 2), x, y, yaw_deg), material)
        site.paint(_posed(rectangle(-MARK_M, -half, 0.0, half), x, y, yaw_deg), material)
    c, s = float(np.cos(np.radians(yaw_deg))), float(np.sin(np.radians(yaw_deg)))
    poses = []
    for k in range(count):
        u, v = -depth / 2, (k + 0.5) * width - half
        poses.append(Pose(x + c * u - s * v, y + s * u + c * v, yaw_deg))
    return poses


@site_builder
def arrows(
    site: Site, *, at: list[tuple[Number, Number, Number]], length_m: Number = 3.0, material: Material = "marking"
) -> None:
    """Paint straight arrows on the ground: middle and direction of each (x, y, yaw_deg)."""
    shaft = rectangle(-length_m / 2, -0.09, length_m * 0.15, 0.09)
    head = LineString([(length_m * 0.15, 0.0), (length_m / 2, 0.0)]).buffer(0.01).convex_hull.union(
        rectangle(length_m * 0.15, -0.4, length_m * 0.16, 0.4)
    ).convex_hull  # fmt: skip
    for x, y, yaw_deg in at:
        site.paint(_posed(shaft.union(head), x, y, yaw_deg), material)


def _line(site: Site, path: Polyline, offset_m: float, dashed: bool, clear: BaseGeometry) -> None:
    line = LineString(path)
    if offset_m:
        line = line.offset_curve(offset_m, join_style="mitre")
    for leg in getattr(line, "geoms", [line]):
        if not dashed:
            mark = leg.buffer(MARK_M / 2, cap_style="flat", join_style="mitre").difference(clear)
            if not mark.is_empty:
                site.paint(mark, "marking")
            continue
        for s in np.arange(_GAP_M / 2, leg.length - _DASH_M, _DASH_M + _GAP_M):
            dash = substring(leg, s, s + _DASH_M).buffer(MARK_M / 2, cap_style="flat")
            if not dash.intersects(clear):
                site.paint(dash, "marking")


def _posed(area: BaseGeometry, x: float, y: float, yaw_deg: float) -> BaseGeometry:
    return translate(rotate(area, yaw_deg, origin=(0, 0)), x, y)


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
