"""Streets with marks and pavements, crossings, arrows, parking bays, marks on paved ground; decks of bridges.

`rise_m` of a mark is the rise of the paving that it lies in.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring, unary_union

from aerialdojo_gen.scenes.grammar import Frame, Polyline, Pose, slab
from aerialdojo_gen.scenes.ground import Surface, ground_meshes, outer_walls, polygons_of, rectangle, ribbon
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.mesh import Floats, Mesh, Parts, flipped, merge, translated
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

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
        middle = shifted(line, offset)
        if isinstance(middle, LineString) and not middle.is_empty:
            site.lanes.append((middle.reverse() if offset > 1e-6 and not oneway else middle, lane_m))


@site_builder
def crossings(
    site: Site, *, at: list[tuple[Number, Number, Number, Number]], width_m: Number = 3.0,
    surface: Material = "asphalt",
) -> None:  # fmt: skip
    """Paint zebra crossings: middle, direction of walking and length of each (x, y, yaw_deg, length_m)."""
    for x, y, yaw_deg, length_m in at:
        frame = Frame(x, y, yaw_deg)
        around = rectangle(-length_m / 2, -width_m / 2 - 0.5, length_m / 2, width_m / 2 + 0.5)
        site.paint(frame.area(around), surface)
        site.crossings.append(Point(x, y))
        count = int(length_m // 1.0)
        for k in range(count):
            u = (k - (count - 1) / 2) * 1.0
            stripe = rectangle(u - 0.25, -width_m / 2, u + 0.25, width_m / 2)
            site.paint(frame.area(stripe), "marking")


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
    (width, depth), frame = bay_m, Frame(x, y, yaw_deg)
    half = count * width / 2
    if z is None:
        for k in range(count + 1):
            v = k * width - half
            site.paint(frame.area(rectangle(-depth, v - MARK_M / 2, 0.0, v + MARK_M / 2)), material)
        site.paint(frame.area(rectangle(-MARK_M, -half, 0.0, half)), material)
    return [frame.pose(-depth / 2, (k + 0.5) * width - half) for k in range(count)]


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
        site.paint(Frame(x, y, yaw_deg).area(shaft.union(head)), material)


def _line(site: Site, path: Polyline, offset_m: float, dashed: bool, clear: BaseGeometry) -> None:
    for mark in marks_along(LineString(path), offset_m, _GAP_M if dashed else None):
        # A dash is whole, or left out.
        left = mark if dashed else mark.difference(clear)
        if not left.is_empty and not (dashed and mark.intersects(clear)):
            site.paint(left, "marking")


def shifted(line: LineString, offset_m: float) -> BaseGeometry:
    """Give the line that runs beside another, to its left where the offset is positive."""
    return line.offset_curve(offset_m, join_style="mitre") if abs(offset_m) > 1e-6 else line


def marks_along(line: LineString, offset_m: float, gap_m: float | None) -> Iterator[BaseGeometry]:
    """Yield the marks beside a line: dashes with a gap between them, or a whole line."""
    beside = shifted(line, offset_m)
    for leg in getattr(beside, "geoms", [beside]):
        if gap_m is None:
            yield leg.buffer(MARK_M / 2, cap_style="flat", join_style="mitre")
            continue
        for s in np.arange(gap_m / 2, leg.length - _DASH_M, _DASH_M + gap_m):
            yield substring(leg, s, s + _DASH_M).buffer(MARK_M / 2, cap_style="flat")


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


_CELL_M = 2.0
_RIM_M = 0.35
_PARAPET_M, _THICK_M = 1.0, 0.25
# Lower than this the deck stands on solid ground: nobody flies there.
_LOWEST_FREE_M = 1.0
_HIGHEST_OPEN_M = 0.4
_PIERS_M, _PIER_M, _SHIFT_M, _END_M = 16.0, 0.8, 6.0, 1.0
_FROM_ROADS_M = 0.6
_SUNK_M = 0.3
_SLICE_M = 4.0


@dataclass(frozen=True)
class Bridge:
    """A deck that streets, paths or rails lie on, with its ramps."""

    line: Line  # From the foot of one ramp to that of the other, points at equal distances
    # Of the road at those points, over the straight line between the ground at both ends.
    heights_m: Annotated[list[Annotated[Number, Field(ge=0, le=60)]], Field(min_length=2, max_length=1000)]
    span_m: tuple[Number, Number]  # What of the line is bridge; before and behind it are ramps
    depth_m: Annotated[Number, Field(ge=0.1, le=5)] = 0.8  # Thickness of the deck
    rails: Annotated[list[Line], Field(max_length=100)] = field(default_factory=list)  # Tracks on it
    name: str = ""  # What a person calls it
    concrete: Material = "concrete:#a19d95"
    paving: Material = "paving:#aaa59c"
    abutment: Material = "stone"

    def __post_init__(self) -> None:
        """Check that the numbers make a bridge."""
        if len(self.line) != len(self.heights_m):
            raise ValueError("line and heights_m of a bridge must have as many points")
        if not 0.0 <= self.span_m[0] < self.span_m[1]:
            raise ValueError("span_m of a bridge runs from a place on its line to one farther along")


@dataclass(frozen=True)
class Deck:
    """A bridge where it stands."""

    bridge: Bridge
    plan: BaseGeometry  # Deck and ramps from above, where they are over the ground
    span: BaseGeometry  # What of the plan is free below, and what is not
    solid: BaseGeometry
    heights: Terrain  # Of the road


def deck(site: Site, bridge: Bridge, ways: Sequence[BaseGeometry]) -> Deck | None:
    """Find where a bridge stands, of the plans of the ways that it bears; None where it rises nowhere on the site."""
    plan = shapely.union_all(ways).buffer(_RIM_M + 1.0, join_style="mitre").buffer(-1.0, join_style="mitre")
    plan = plan.intersection(site.extent)
    if plan.is_empty:
        return None
    axis = LineString(bridge.line)
    s = np.linspace(0.0, axis.length, len(bridge.heights_m))
    across = 1.0 + float(shapely.hausdorff_distance(plan, axis))
    terrain = _heights(site, bridge, axis, plan)
    # Where it lies on the ground, it is the ground's.
    up = [k for k, z in enumerate(bridge.heights_m) if z > 0.02]
    ends = np.diff([site.terrain.z(*p) for p in (bridge.line[0], bridge.line[-1])])
    level = abs(float(ends[0])) < 1e-6 and np.ptp(site.terrain.heights_m) == 0.0
    if level:
        if not up:
            return None
        first, last = max(up[0] - 1, 0), min(up[-1] + 1, len(s) - 1)
        plan = _slice(plan, axis, s[first], s[last], across)
    low, high = bridge.span_m
    t = np.arange(low, high + 1e-9, 0.5)
    at = shapely.get_coordinates(axis.interpolate(t))
    free = terrain.z(*at.T) - bridge.depth_m - site.terrain.z(*at.T) >= _LOWEST_FREE_M
    opening = _band(axis, t[free][0], t[free][-1], across) if free.sum() > 4 else shapely.Polygon()
    # By the band itself: what is cut twice along one edge leaves slivers, which would be walls.
    return Deck(bridge, plan, plan.intersection(opening), plan.difference(opening), terrain)


def put_up_bridge(site: Site, deck: Deck, surfaces: Sequence[Surface], below: BaseGeometry) -> None:
    """Build a bridge with surfaces painted on it; piers keep off the streets and rails `below`."""
    depth, axis = deck.bridge.depth_m, LineString(deck.bridge.line)
    concrete = deck.bridge.concrete
    rim = _parapets(site, deck, axis)
    painted = [*surfaces, *(Surface(p, concrete, _PARAPET_M, concrete) for p in polygons_of(rim))]
    parts: Parts = []
    for plan in polygons_of(deck.plan):
        parts += ground_meshes(deck.heights, plan, deck.bridge.paving, painted)
    for plan in polygons_of(deck.span):
        under = [m for _, m in ground_meshes(deck.heights, plan, concrete, ())]
        parts += [(concrete, flipped(translated(m, (0.0, 0.0, -depth)))) for m in under]
        parts.append((concrete, _walls(plan, deck.heights, deck.heights, -depth)))
    for plan in polygons_of(deck.solid):
        parts.append((deck.bridge.abutment, _walls(plan, deck.heights, site.terrain, -_SUNK_M)))
    parts += [(concrete, pier) for pier in _piers(site, deck, axis, below)]
    attributes = {"place": f"called {deck.bridge.name}"} if deck.bridge.name else {}
    site.add(None, "bridge", [(material, m) for material, m in parts if len(m.faces)], attributes)
    _occupy(site, deck, axis)


def _heights(site: Site, bridge: Bridge, axis: LineString, plan: BaseGeometry) -> Terrain:
    """Heights of the road over a grid about the plan: what the axis has beside it."""
    x0, y0, x1, y1 = plan.buffer(_CELL_M).bounds
    x, y = (np.arange(a, b + _CELL_M, _CELL_M) for a, b in ((x0, x1), (y0, y1)))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    s = axis.project(shapely.points(grid))
    first, last = (float(site.terrain.z(*bridge.line[k])) for k in (0, -1))
    own = np.interp(s, np.linspace(0.0, axis.length, len(bridge.heights_m)), bridge.heights_m)
    z = first + (last - first) * s / axis.length + own
    return Terrain(float(x[0]), float(y[0]), _CELL_M, z.reshape(len(y), len(x)))


def _slice(plan: BaseGeometry, axis: LineString, low: float, high: float, across_m: float) -> BaseGeometry:
    """Cut a plan across an axis, at two places along it."""
    return plan.intersection(_band(axis, low, high, across_m))


def _band(axis: LineString, low: float, high: float, across_m: float) -> BaseGeometry:
    if high - low < 0.05:
        return shapely.Polygon()
    return substring(axis, low, high).buffer(across_m, cap_style="flat", join_style="mitre")


def _parapets(site: Site, deck: Deck, axis: LineString) -> BaseGeometry:
    """Find where parapets stand: along the rim, where the deck is over the ground, open at its ends."""
    inner = deck.plan.buffer(-_THICK_M, join_style="mitre")
    s = np.arange(0.0, axis.length + 1e-9, 0.5)
    at = shapely.get_coordinates(axis.interpolate(s))
    high = np.flatnonzero(deck.heights.z(*at.T) - site.terrain.z(*at.T) > _HIGHEST_OPEN_M)
    if not len(high):
        return shapely.Polygon()
    across = 1.0 + float(shapely.hausdorff_distance(deck.plan, axis))
    # What the site's border cuts has no end there, and no parapet across the road.
    inside = site.extent.buffer(-_THICK_M - 0.01, join_style="mitre")
    low, top = (min(max(s[k], 0.6), axis.length - 0.6) for k in (high[0], high[-1]))
    rim = deck.plan.difference(inner)
    return _slice(rim, axis, low, top, across).intersection(inside)


def _walls(plan: BaseGeometry, top: Terrain, bottom: Terrain, sink_m: float) -> Mesh:
    """Make the walls of a body around a plan, from the road down to a surface sunk by `sink_m`."""

    def heights(xy: Floats) -> tuple[Floats, Floats]:
        high = top.z(*xy.T)
        return np.minimum(bottom.z(*xy.T) + sink_m, high - 0.01), high

    return merge(outer_walls(plan, _CELL_M / 2, heights))


def _piers(site: Site, deck: Deck, axis: LineString, below: BaseGeometry) -> list[Mesh]:
    """Stand piers under the free span, none in a street."""
    if deck.span.is_empty:
        return []
    free = [axis.project(Point(p)) for p in shapely.get_coordinates(deck.span)]
    low, high = min(free), max(free)
    count = max(round((high - low) / _PIERS_M), 1)
    spots = [low + (high - low) * k / count for k in range(1, count)]
    # Where the site's border cuts the span no ramp carries it.
    cut = [axis.interpolate(s).distance(site.extent.exterior) < 1.0 for s in (low, high)]
    spots = [low + _END_M] * cut[0] + spots + [high - _END_M] * cut[1]
    streets = below.buffer(_FROM_ROADS_M)
    out, last = [], -1e9
    for spot in spots:
        for shift in (0.0, *(sign * d for d in np.arange(1.0, _SHIFT_M + 0.1) for sign in (1.0, -1.0))):
            s = spot + shift
            if not (max(low, last) + _END_M <= s <= high - _END_M):
                continue
            plan = _slice(deck.span, axis, s - _PIER_M / 2, s + _PIER_M / 2, 100.0)
            plan = plan.buffer(-0.15, join_style="mitre")
            if plan.is_empty or plan.intersects(streets):
                continue
            x, y = shapely.get_coordinates(plan).T
            foot = float(site.terrain.z(x, y).min()) - _SUNK_M
            top = float(deck.heights.z(x, y).min()) - deck.bridge.depth_m / 2
            out += [slab(piece, foot, top) for piece in polygons_of(plan)]
            site.occupy(plan.buffer(0.1))
            last = s
            break
    return out


def _occupy(site: Site, deck: Deck, axis: LineString) -> None:
    """Take the air that the deck is in: what stands below stays below, and nothing stands in its ramps."""
    site.occupy(deck.solid)
    across = 1.0 + float(shapely.hausdorff_distance(deck.plan, axis))
    for s in np.arange(0.0, axis.length, _SLICE_M):
        part = _slice(deck.span, axis, s, min(s + _SLICE_M, axis.length), across)
        if not part.is_empty:
            z = deck.heights.z(*shapely.get_coordinates(part).T)
            site.occupy(part.buffer(0.1), float(z.min()) - deck.bridge.depth_m - 0.1, 1000.0)
