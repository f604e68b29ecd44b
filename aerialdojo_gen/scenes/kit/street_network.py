"""A network of streets: carriageways between raised pavements, lane marks, crossings, rails, paths, bridges."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar import Frame
from aerialdojo_gen.scenes.ground import Surface, rectangle, ribbon
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.streets import KERB_M, Bridge, Deck, deck, drive, marks_along, put_up_bridge
from aerialdojo_gen.scenes.plans.values import At, Line, Material, Number
from aerialdojo_gen.scenes.site import Site

_GAP_M = 4.0
_ZEBRA_M, _STRIPE_M = 3.0, 0.5
_RAIL_M, _GAUGE_M = 0.05, 1.5
_AT_CROSSING_M = 5.0
_NEAR_M = 1.5


@dataclass(frozen=True)
class Street:
    """A stretch of street or path."""

    line: Line
    width_m: Annotated[Number, Field(ge=0.3, le=60)]  # Of the carriageway
    kind: Literal["street", "service", "path"] = "street"  # Only streets meet in junctions
    pavement_m: Annotated[Number, Field(ge=0, le=20)] = 0.0  # Of the raised pavement on either side
    lanes: Annotated[int, Field(ge=1, le=12)] = 1
    oneway: bool = False
    marks: bool = False  # Whether lane marks are painted
    surface: Material = "asphalt"
    raised: bool = False  # Of a path: as high as pavements
    bridge: Annotated[int, Field(ge=0)] | None = None  # Which of the bridges, from 0, it lies on or climbs to
    name: str = ""  # What a person calls it


@dataclass(frozen=True)
class StreetLayout:
    """Where streets are on the ground, once their bridges and junctions are known."""

    decks: list[Deck | None]  # Of every bridge that rises on the site
    surfaces: list[Surface]  # What is painted, in order
    marks: BaseGeometry
    carriageways: BaseGeometry
    pavements: BaseGeometry
    busy: BaseGeometry  # Junctions and crossings, which nobody parks in and no mark runs through

    def on_ground(self, street: Street) -> bool:
        """Whether a street lies on the ground, and neither on a bridge nor on its ramps."""
        return street.bridge is None or self.decks[street.bridge] is None


@site_builder
def street_network(
    site: Site, *, streets: list[Street], bridges: list[Bridge] = [], rails: list[Line] = [],  # noqa: B006
    crossings: list[At] = [], pavement: Material = "paving:#aaa59c", kerb: Material = "#8d8a84",  # noqa: B006
    track: Material = "cobbles:#7d7a75",
) -> None:  # fmt: skip
    """Paint streets that meet in junctions, paths, tracks and zebra crossings; put up the bridges they lie on."""
    layout = lay_out(site, streets, bridges, crossings, pavement, kerb)
    for street in streets:
        if street.kind == "street" and layout.on_ground(street):
            drive(site, street.line, street.width_m, street.lanes, street.oneway)
    site.crossings += [Point(at) for at in crossings]
    tracks = [LineString(line) for line in rails]
    for surface in layout.surfaces:
        site.paint(surface.area, surface.material, surface.rise_m, surface.edge)
    for bridge, one in zip(bridges, layout.decks, strict=True):
        off = shapely.Polygon() if one is None else one.plan
        for surface in _rails([LineString(line) for line in bridge.rails], track):
            site.paint(surface.area.difference(off), surface.material)
    for surface in _rails(tracks, track):
        site.paint(surface.area, surface.material)
    if not layout.marks.is_empty:
        site.paint(layout.marks, "marking")
    paths = [_on_ground(layout.decks, street, street.width_m) for street in streets if street.kind == "path"]
    beds = [line.buffer(_GAUGE_M, cap_style="flat") for line in tracks]
    below = shapely.union_all([layout.carriageways, layout.pavements, *paths, *beds])
    for k, one in enumerate(layout.decks):
        if one is not None:
            own = [street for street in streets if street.bridge == k]
            put_up_bridge(site, one, _on_deck(own, bridges[k], layout.busy, pavement, kerb, track), below)


def lay_out(
    site: Site, streets: Sequence[Street], bridges: Sequence[Bridge], crossings: Sequence[At],
    pavement: str = "paving", kerb: str = "concrete",
) -> StreetLayout:  # fmt: skip
    """Find where streets lie, without painting them."""
    for k, street in enumerate(streets):
        if street.bridge is not None and street.bridge >= len(bridges):
            raise AssetError(f"streets.{k}: bridge {street.bridge} is none of {len(bridges)}, counted from 0")
    decks = [_deck(site, streets, bridge, k) for k, bridge in enumerate(bridges)]
    driven = [street for street in streets if street.kind != "path"]
    lines = [LineString(street.line) for street in driven]
    zebras = [z for z in (_zebra(x, y, driven, lines) for x, y in crossings) if z is not None]
    discs = [Point(at).buffer(_AT_CROSSING_M) for at in crossings]
    busy = shapely.union_all([*_junctions(driven), *discs])
    surfaces, carriageways, pavements = _painted(
        streets, lambda street, width_m: _on_ground(decks, street, width_m), pavement, kerb
    )
    stripes = [stripe for zebra in zebras for stripe in zebra]
    marks = _marks(streets, carriageways, stripes, busy, [None if d is None else d.plan for d in decks])
    return StreetLayout(decks, surfaces, marks, carriageways, shapely.difference(pavements, carriageways), busy)


def _on_ground(decks: Sequence[Deck | None], street: Street, width_m: float) -> BaseGeometry:
    own = None if street.bridge is None else decks[street.bridge]
    area = ribbon(street.line, width_m, round_ends=True)
    return area if own is None else area.difference(own.plan)


def _deck(site: Site, streets: Sequence[Street], bridge: Bridge, k: int) -> Deck | None:
    """Find where a bridge stands, by what it bears."""
    ways = [ribbon(r.line, r.width_m + 2 * r.pavement_m, round_ends=True) for r in streets if r.bridge == k]
    ways += [LineString(line).buffer(_GAUGE_M / 2 + 1.0) for line in bridge.rails]
    return deck(site, bridge, ways) if ways else None


def _painted(
    roads: Sequence[Street], area_of: Callable[[Street, float], BaseGeometry], pavement: str, kerb: str
) -> tuple[list[Surface], BaseGeometry, BaseGeometry]:  # fmt: skip
    """Lay out streets: what is painted, in order, but rails and marks; all carriageways; all pavements."""
    driven = [road for road in roads if road.kind != "path"]
    paths = [road for road in roads if road.kind == "path"]
    carriageways = shapely.union_all([area_of(r, r.width_m) for r in driven])
    kerbed = [area_of(r, r.width_m + 2 * r.pavement_m) for r in driven if r.pavement_m > 0.0]
    raised = [area_of(r, r.width_m) for r in paths if r.raised]
    pavements = shapely.union_all([*kerbed, *raised])
    between = [] if pavements.is_empty else [Surface(pavements, pavement, KERB_M, kerb)]
    low = _by_surface([r for r in paths if not r.raised], area_of)
    return [*low, *between, *_by_surface(driven, area_of)], carriageways, pavements


def _marks(
    roads: Sequence[Street], carriageways: BaseGeometry, stripes: Sequence[BaseGeometry], busy: BaseGeometry,
    decks: Sequence[BaseGeometry | None],
) -> BaseGeometry:  # fmt: skip
    """Lay out lane marks and zebra stripes, within carriageways and off other streets' decks."""
    out = list(stripes)
    for road in roads:
        if road.kind != "path" and road.marks:
            whole = shapely.union_all(_lane_marks(road, LineString(road.line)))
            own = None if road.bridge is None or not decks else decks[road.bridge]
            out.append(shapely.difference(whole, busy if own is None else busy.union(own)))
    return shapely.intersection(shapely.union_all(out), carriageways)


def _on_deck(
    streets: Sequence[Street], bridge: Bridge, busy: BaseGeometry, pavement: str, kerb: str, track: str
) -> list[Surface]:
    """Lay out what is painted on a bridge."""
    surfaces, carriageways, _ = _painted(
        streets, lambda street, width_m: ribbon(street.line, width_m, round_ends=True), pavement, kerb
    )
    surfaces += _rails([LineString(line) for line in bridge.rails], track)
    marks = _marks(streets, carriageways, (), busy, ())
    return surfaces if marks.is_empty else [*surfaces, Surface(marks, "marking")]


def _by_surface(roads: Sequence[Street], area_of: Callable[[Street, float], BaseGeometry]) -> list[Surface]:
    """Areas of streets by what they are paved with; smoother surfaces go over rougher ones."""
    groups: dict[str, list[BaseGeometry]] = {}
    for road in roads:
        groups.setdefault(road.surface, []).append(area_of(road, road.width_m))
    ordered = sorted(groups.items(), key=lambda item: (item[0].startswith("asphalt"), item[0]))
    return [Surface(shapely.union_all(areas), surface) for surface, areas in ordered]


def _junctions(roads: Sequence[Street]) -> list[Polygon]:
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


def _lane_marks(road: Street, line: LineString) -> list[BaseGeometry]:
    lane = road.width_m / road.lanes
    out: list[BaseGeometry] = []
    for k in range(1, road.lanes):
        whole = road.lanes >= 4 and not road.oneway and 2 * k == road.lanes
        out += marks_along(line, k * lane - road.width_m / 2, None if whole else _GAP_M)
    return out


def _zebra(x: float, y: float, roads: Sequence[Street], lines: Sequence[LineString]) -> list[Polygon] | None:
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
        out.append(Frame(x, y, yaw).area(stripe))
    return out


def _rails(lines: Sequence[LineString], track: str) -> list[Surface]:
    """Lay out tracks: their beds, then their rails."""
    if not lines:
        return []
    bed = shapely.union_all([line.buffer(_GAUGE_M / 2 + 0.6, cap_style="flat") for line in lines])
    sides = [line.offset_curve(d) for line in lines for d in (-_GAUGE_M / 2, _GAUGE_M / 2)]
    iron = shapely.union_all([s.buffer(_RAIL_M, cap_style="flat") for s in sides])
    return [Surface(bed, track), Surface(iron, "iron")]
