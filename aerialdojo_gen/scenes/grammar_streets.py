"""Grammar of layouts: streets with marks and kerbs, crossings, car parks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring, unary_union

from aerialdojo_gen.scenes.grammar_scatter import Polyline, Pose
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.site import Site

MARK_M = 0.15
KERB_M = 0.12
_DASH_M, _GAP_M = 2.0, 3.0


def streets(
    site: Site,
    paths: Sequence[Polyline],
    *,
    lanes: int = 2,
    lane_m: float = 3.25,
    pavement_m: float = 2.0,
    surface: str = "asphalt",
    pavement: str = "paving",
    marks: bool = True,
) -> BaseGeometry:
    """Paint streets that may cross, from middle lines in metres; returns the area of all carriageways."""
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
    return carriageways


def drive(site: Site, path: Polyline, width_m: float, lanes: int, oneway: bool = False) -> None:
    """Tell the site of a street's lanes; one drives on the right."""
    lane_m, line = width_m / lanes, LineString(path)
    for k in range(lanes):
        offset = (k + 0.5) * lane_m - width_m / 2
        shifted = line.offset_curve(offset, join_style="mitre") if abs(offset) > 1e-6 else line
        if isinstance(shifted, LineString) and not shifted.is_empty:
            site.lanes.append((shifted.reverse() if offset > 1e-6 and not oneway else shifted, lane_m))


def crossing(
    site: Site, x: float, y: float, yaw_deg: float, length_m: float, width_m: float = 3.0, surface: str = "asphalt"
) -> None:
    """Paint a zebra crossing about (x, y): walked along `yaw_deg` for `length_m`, stripes half a metre wide."""
    site.paint(
        _posed(rectangle(-length_m / 2, -width_m / 2 - 0.5, length_m / 2, width_m / 2 + 0.5), x, y, yaw_deg), surface
    )
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


def arrow(site: Site, x: float, y: float, yaw_deg: float, length_m: float = 3.0, material: str = "marking") -> None:
    """Paint a straight arrow on the ground that points along `yaw_deg`."""
    shaft = rectangle(-length_m / 2, -0.09, length_m * 0.15, 0.09)
    head = LineString([(length_m * 0.15, 0.0), (length_m / 2, 0.0)]).buffer(0.01).convex_hull.union(
        rectangle(length_m * 0.15, -0.4, length_m * 0.16, 0.4)
    ).convex_hull  # fmt: skip
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
