"""Streets of a town: carriageways between raised pavements, lane marks, crossings, rails, paths."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.grammar_streets import KERB_M, MARK_M
from aerialdojo_gen.scenes.ground import Surface, rectangle, ribbon
from aerialdojo_gen.scenes.layouts.places.town.bridges import Deck, deck, put_up_bridge
from aerialdojo_gen.scenes.layouts.places.town.model import Parameters, Road
from aerialdojo_gen.scenes.site import Site

_DASH_M, _GAP_M = 2.0, 4.0
_ZEBRA_M, _STRIPE_M = 3.0, 0.5
_RAIL_M, _GAUGE_M = 0.05, 1.5
_AT_CROSSING_M = 5.0
_NEAR_M = 1.5


@dataclass(frozen=True)
class Streets:
    """The streets of a town, and where things may stand along them.

    Attributes
    ----------
    roads : tuple of Road
        Those on the ground that are driven on.
    lines : tuple of LineString
        Their middle lines, metres.
    carriageways, pavements : shapely geometry
        World frame, metres.
    busy : shapely geometry
        Junctions and crossings, which nobody parks in and no mark runs through.
    """

    roads: tuple[Road, ...]
    lines: tuple[LineString, ...]
    carriageways: BaseGeometry
    pavements: BaseGeometry
    busy: BaseGeometry

    def nearest(self, x: float, y: float) -> tuple[int, float, float] | None:
        """Find the street nearest to a point: its index, the distance of its middle line, the way there, degrees."""
        if not self.lines:
            return None
        spot = Point(x, y)
        k = int(np.argmin(shapely.distance(np.array(self.lines), spot)))
        there = self.lines[k].interpolate(self.lines[k].project(spot))
        yaw = math.degrees(math.atan2(there.y - y, there.x - x))
        return k, float(spot.distance(self.lines[k])), yaw

    def street(self, x: float, y: float, within_m: float = 14.0) -> str:
        """Name of the street that a point is on; empty where none has a name within reach."""
        spot = Point(x, y)
        named = [(float(spot.distance(line)), road.name) for road, line in zip(self.roads, self.lines, strict=True)
                 if road.name]  # fmt: skip
        away, name = min(named, default=(math.inf, ""))
        return name if away <= within_m else ""


def lay(site: Site, p: Parameters) -> Streets:
    """Paint all streets and what is marked on them; put up their bridges."""
    decks = [_deck(site, p, k) for k in range(len(p.bridges))]
    driven = [road for road in p.roads if road.kind != "path"]
    lines = [LineString(road.line) for road in driven]
    zebras = [z for z in (_zebra(x, y, driven, lines) for x, y in p.crossings) if z is not None]
    discs = [Point(x, y).buffer(_AT_CROSSING_M) for x, y in p.crossings]
    busy = shapely.union_all([*_junctions(driven), *discs])

    def on_ground(road: Road, width_m: float) -> BaseGeometry:
        own = None if road.bridge is None else decks[road.bridge]
        area = ribbon(road.line, width_m, round_ends=True)
        return area if own is None else area.difference(own.plan)

    stripes = [stripe for zebra in zebras for stripe in zebra]
    surfaces, carriageways, pavements = _painted(site, p.roads, on_ground, stripes, busy)
    tracks = [LineString(line) for line in p.rails]
    for surface in surfaces:
        site.paint(surface.area, surface.material, surface.rise_m, surface.edge)
    for bridge, one in zip(p.bridges, decks, strict=True):
        off = shapely.Polygon() if one is None else one.plan
        for surface in _rails(site, [LineString(line) for line in bridge.rails]):
            site.paint(surface.area.difference(off), surface.material)
    for surface in _rails(site, tracks):
        site.paint(surface.area, surface.material)
    marks = _marks(site, p.roads, carriageways, stripes, busy, [None if d is None else d.plan for d in decks])
    if not marks.is_empty:
        site.paint(marks, "marking")
    paths = [on_ground(road, road.width_m) for road in p.roads if road.kind == "path"]
    beds = [line.buffer(_GAUGE_M, cap_style="flat") for line in tracks]
    below = shapely.union_all([carriageways, pavements, *paths, *beds])
    for k, one in enumerate(decks):
        if one is not None:
            put_up_bridge(site, one, _on_deck(site, p, k, busy), below)
    level = [k for k, road in enumerate(driven) if road.bridge is None or decks[road.bridge] is None]
    return Streets(
        tuple(driven[k] for k in level), tuple(lines[k] for k in level), carriageways,
        shapely.difference(pavements, carriageways), busy,
    )  # fmt: skip


def _deck(site: Site, p: Parameters, k: int) -> Deck | None:
    """Find where a bridge stands, by what it bears."""
    roads = [ribbon(r.line, r.width_m + 2 * r.pavement_m, round_ends=True) for r in p.roads if r.bridge == k]
    rails = [LineString(line).buffer(_GAUGE_M / 2 + 1.0) for line in p.bridges[k].rails]
    return deck(site, p.bridges[k], [*roads, *rails]) if roads or rails else None


def _painted(
    site: Site, roads: Sequence[Road], area_of: Callable[[Road, float], BaseGeometry],
    stripes: Sequence[BaseGeometry], busy: BaseGeometry,
) -> tuple[list[Surface], BaseGeometry, BaseGeometry]:  # fmt: skip
    """Lay out streets: what is painted, in order, but rails and marks; all carriageways; all pavements."""
    driven = [road for road in roads if road.kind != "path"]
    paths = [road for road in roads if road.kind == "path"]
    ribbons = [area_of(r, r.width_m) for r in driven]
    carriageways = shapely.union_all(ribbons)
    kerbed = [area_of(r, r.width_m + 2 * r.pavement_m) for r in driven if r.pavement_m > 0.0]
    raised = [area_of(r, r.width_m) for r in paths if r.raised]
    pavements = shapely.union_all([*kerbed, *raised])
    out = []
    for surface, members in _by_surface(r for r in paths if not r.raised):
        out.append(Surface(shapely.union_all([area_of(r, r.width_m) for r in members]), surface))
    if not pavements.is_empty:
        kerb = site.material("kerb", "#8d8a84")
        out.append(Surface(pavements, site.material("pavement", "paving:#aaa59c"), KERB_M, kerb))
    for surface, _ in _by_surface(driven):
        own = [area for r, area in zip(driven, ribbons, strict=True) if r.surface == surface]
        out.append(Surface(shapely.union_all(own), surface))
    return out, carriageways, pavements


def _marks(
    site: Site, roads: Sequence[Road], carriageways: BaseGeometry, stripes: Sequence[BaseGeometry],
    busy: BaseGeometry, decks: Sequence[BaseGeometry | None],
) -> BaseGeometry:  # fmt: skip
    """Lay out lane marks and zebra stripes, within carriageways and off other streets' decks."""
    out = list(stripes)
    for road in roads:
        if road.kind != "path" and road.marks:
            whole = shapely.union_all(_lane_marks(road, LineString(road.line)))
            own = None if road.bridge is None or not decks else decks[road.bridge]
            out.append(shapely.difference(whole, busy if own is None else busy.union(own)))
    return shapely.intersection(shapely.union_all(out), carriageways)


def _on_deck(site: Site, p: Parameters, k: int, busy: BaseGeometry) -> list[Surface]:
    """Lay out what is painted on a bridge."""
    roads = [road for road in p.roads if road.bridge == k]
    surfaces, carriageways, _ = _painted(site, roads, lambda r, w: ribbon(r.line, w, round_ends=True), (), busy)
    surfaces += _rails(site, [LineString(line) for line in p.bridges[k].rails])
    marks = _marks(site, roads, carriageways, (), busy, ())
    return surfaces if marks.is_empty else [*surfaces, Surface(marks, "marking")]


def _by_surface(roads: Iterable[Road]) -> list[tuple[str, list[Road]]]:
    """Streets by what they are paved with; smoother surfaces go over rougher ones."""
    groups: dict[str, list[Road]] = {}
    for road in roads:
        groups.setdefault(road.surface, []).append(road)
    return sorted(groups.items(), key=lambda item: (item[0].startswith("asphalt"), item[0]))


def _junctions(roads: Sequence[Road]) -> list[Polygon]:
    """Discs about the points that three stretches of street or more begin at, end at or pass through."""
    ends: Counter[tuple[float, float]] = Counter()
    width: dict[tuple[float, float], float] = {}
    for road in roads:
        if road.kind == "service":
            continue
        for k, at in enumerate(road.line):
            ends[at] += 1 if k in (0, len(road.line) - 1) else 2
            width[at] = max(width.get(at, 0.0), road.width_m)
    return [Point(at).buffer(width[at] / 2 + 2.5) for at, n in ends.items() if n >= 3]


def _lane_marks(road: Road, line: LineString) -> list[BaseGeometry]:
    lane = road.width_m / road.lanes
    out = []
    for k in range(1, road.lanes):
        offset = k * lane - road.width_m / 2
        middle = not road.oneway and road.lanes % 2 == 0 and 2 * k == road.lanes
        shifted = line.offset_curve(offset, join_style="mitre") if abs(offset) > 1e-6 else line
        for leg in getattr(shifted, "geoms", [shifted]):
            if middle and road.lanes >= 4:
                out.append(leg.buffer(MARK_M / 2, cap_style="flat", join_style="mitre"))
                continue
            for s in np.arange(_GAP_M / 2, leg.length - _DASH_M, _DASH_M + _GAP_M):
                out.append(substring(leg, s, s + _DASH_M).buffer(MARK_M / 2, cap_style="flat"))
    return out


def _zebra(x: float, y: float, roads: Sequence[Road], lines: Sequence[LineString]) -> list[Polygon] | None:
    """Stripes of a crossing, along the street that it crosses; None where there is none."""
    away = [
        line.distance(Point(x, y)) if r.kind != "service" else math.inf for r, line in zip(roads, lines, strict=True)
    ]
    if not away or min(away) > _NEAR_M:
        return None
    k = int(np.argmin(away))
    s = lines[k].project(Point(x, y))
    a, b = lines[k].interpolate(max(s - 0.5, 0.0)), lines[k].interpolate(min(s + 0.5, lines[k].length))
    yaw = math.degrees(math.atan2(b.y - a.y, b.x - a.x))
    count = int(roads[k].width_m // (2 * _STRIPE_M))
    out = []
    for n in range(count):
        v = (n - (count - 1) / 2) * 2 * _STRIPE_M
        stripe = rectangle(-_ZEBRA_M / 2, v - _STRIPE_M / 2, _ZEBRA_M / 2, v + _STRIPE_M / 2)
        out.append(translate(rotate(stripe, yaw, origin=(0, 0)), x, y))
    return out


def _rails(site: Site, lines: Sequence[LineString]) -> list[Surface]:
    """Lay out tracks: their beds, then their rails."""
    if not lines:
        return []
    bed = shapely.union_all([line.buffer(_GAUGE_M / 2 + 0.6, cap_style="flat") for line in lines])
    sides = [line.offset_curve(d) for line in lines for d in (-_GAUGE_M / 2, _GAUGE_M / 2)]
    iron = shapely.union_all([s.buffer(_RAIL_M, cap_style="flat") for s in sides])
    return [Surface(bed, site.material("track", "cobbles:#7d7a75")), Surface(iron, "iron")]


def kerbside(road: Road, line: LineString, spacing_m: float, offset_m: float) -> list[Pose]:
    """List poses on both sides of a street, `offset_m` beyond its kerbs, that face it."""
    out = []
    # Maps cut streets at every corner: rounding down would leave the short stretches bare.
    count = round(line.length / spacing_m)
    for k in range(count):
        s = (k + 0.5) * line.length / count
        a, b = line.interpolate(max(s - 0.3, 0.0)), line.interpolate(min(s + 0.3, line.length))
        yaw = math.atan2(b.y - a.y, b.x - a.x)
        at = line.interpolate(s)
        for side in (1, -1):
            d = side * (road.width_m / 2 + offset_m)
            x, y = at.x - d * math.sin(yaw), at.y + d * math.cos(yaw)
            out.append(Pose(x, y, math.degrees(yaw) - 90.0 * side))
    return out
