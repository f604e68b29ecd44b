"""What stands and drives in a town: things of the map, and what such streets have by rule."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.imports.map_tags import TABLES
from aerialdojo_gen.imports.placing import Placer
from aerialdojo_gen.scenes.grammar import Frame, Pose, poisson_disc
from aerialdojo_gen.scenes.kit.buildings import before_walls, oriented_rectangle
from aerialdojo_gen.scenes.kit.street_network import StreetLayout
from aerialdojo_gen.scenes.kit.streets import parking_row
from aerialdojo_gen.scenes.kit.town_buildings import PARAPET_M
from aerialdojo_gen.scenes.placement import DRAWN

# What stands along pavements, before shops and on roofs, in turn.
_IN_TURN = {place: things.split() for place, things in TABLES["furniture"].items()}
# What stands though the map does not say so: shares of what there could be.
_SHARE_PARKED, _SHARE_DRIVING, _SHARE_FURNITURE = 0.55, 0.35, 0.6
_FROM_EDGE_M, _MIN_ROOF_M2 = 1.8, 40.0
_LAMPS_M, _FURNITURE_M, _BAY_M, _TRAFFIC_M = 26.0, 9.0, 6.2, 34.0
_MIN_LAMPS = 4
_MIN_TREES = 3
_AROUND = tuple(math.radians(45.0 * k) for k in range(8))
_ROOTED = frozenset({"urban_tree", "oak_tree", "spruce_tree", "pine_tree", "birch_tree"})
# One street has one kind of them.
_ALIKE = frozenset({"bollard", "street_lamp", "traffic_light"})
_IN_STREETS = frozenset({"bollard", "traffic_cone"})

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Streets:
    """The streets of a town on the ground that are driven on, and where things may stand along them."""

    roads: tuple[Table, ...]
    lines: tuple[LineString, ...]  # Middle lines
    layout: StreetLayout

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
        spot, streets = Point(x, y), zip(self.roads, self.lines, strict=True)
        named = ((float(spot.distance(line)), road["name"]) for road, line in streets if road.get("name"))
        away, name = min(named, default=(math.inf, ""))
        return name if away <= within_m else ""

    def driven_on(self, x: float, y: float) -> bool:
        """Whether a point is in a carriageway."""
        return bool(shapely.contains_xy(self.layout.carriageways, x, y))


class Furniture:
    """Places what a town has besides its buildings."""

    def __init__(self, placer: Placer, town: Table, streets: Streets, drive_on: str) -> None:
        self._placer, self._site, self._town, self._streets = placer, placer.site, town, streets
        shapely.prepare([streets.layout.carriageways, streets.layout.busy])
        self._drive_on = drive_on

    def place_mapped(self) -> None:
        """Place the things of the map, each on its ground and in nobody's way; what has no room is left out."""
        self._placer.begin("Things of the map")
        for thing in self._town["things"]:
            self._put(thing)
        for x, y in self._town["signals"]:
            self._signal(x, y)

    def place_by_rule(self) -> None:
        """Add what such streets have: parked and driving vehicles, lamps, furniture, trees in parks."""
        streets, areas, buildings = self._streets, self._town["areas"], self._town["buildings"]
        self._placer.begin("Added by rule: parked and driving vehicles")
        for k, area in enumerate(areas):
            if area.get("parking"):
                self._car_park(area, k)
        for k, (road, line) in enumerate(zip(streets.roads, streets.lines, strict=True)):
            if road.get("parking"):
                self._park(road, line, k)
            if road["kind"] == "main":
                self._traffic(road, line, k)
        self._placer.begin("Added by rule: lamps and furniture along the streets")
        self._lamps()
        self._along_pavements()
        self._placer.begin("Added by rule: on roofs and before shops")
        for k, one in enumerate(buildings):
            self._on_roofs(one, k)
        for one in buildings:
            if one.get("shops"):
                self._before_shop(one)
        self._placer.begin("Added by rule: trees and bushes")
        for k, area in enumerate(areas):
            if area.get("grows"):
                self._grow(area, k)

    def _try(self, category: str, pose: Pose, phrase: str = "", scale: float = 1.0) -> bool:
        street = "" if phrase else self._streets.street(pose.x, pose.y)
        prop = self._site.catalogue[category]
        # Plants come as often as their weights say: nobody plants every fifth tree pink.
        drawn = DRAWN if prop.kind == "vegetation" else None
        variant = prop.variants[0].name if category in _ALIKE else drawn
        phrase = phrase or (f"on {street}" if street else "")
        return self._placer.place(category, pose, phrase=phrase, scale=scale, variant=variant)

    def _on_street(self, category: str, pose: Pose) -> bool:
        """Place a thing beside a street, not in one."""
        return not self._streets.driven_on(pose.x, pose.y) and self._try(category, pose)

    def _put(self, thing: Table) -> None:
        (x, y), category, yaw = thing["at"], thing["category"], thing.get("yaw")
        if yaw is None:
            near = self._streets.nearest(x, y)
            yaw = near[2] if near else -90.0
            # Whoever waits at a stop looks at the street; whoever puts up a sign wants it seen along it.
            yaw += 90.0 if category in ("billboard", "crossing_sign", "stop_sign") else 0.0
        spots = [(x, y)] + [(x + r * math.cos(a), y + r * math.sin(a)) for r in (0.6, 1.2, 1.8) for a in _AROUND]
        for u, v in spots:
            if category in _ROOTED and math.dist((u, v), (x, y)) > 1.0:
                return
            if self._streets.driven_on(u, v) and category not in _IN_STREETS:
                continue
            if self._try(category, Pose(u, v, yaw), scale=thing.get("scale", 1.0)):
                return

    def _signal(self, x: float, y: float) -> None:
        """Traffic lights stand at the kerb on the driver's side and face those who come."""
        near = self._streets.nearest(x, y)
        if near is None or near[1] > 6.0:
            return
        road, line = self._streets.roads[near[0]], self._streets.lines[near[0]]
        s = line.project(Point(x, y))
        side = -1.0 if self._drive_on == "right" else 1.0
        for way in (1.0,) if road.get("oneway") else (1.0, -1.0):
            kerb = _aside(line, s, side * way * (road["width_m"] / 2 + 0.6), 180.0 if way > 0 else 0.0)
            self._on_street("traffic_light", kerb)

    def _park(self, road: Table, line: LineString, k: int) -> None:
        for n, pose in enumerate(_kerbside(road, line, _BAY_M, -1.15)):
            rng = self._site.rng_for("parked", k, n)
            free = not shapely.intersects(self._streets.layout.busy, Point(pose.x, pose.y).buffer(2.5))
            if not free or rng.random() >= _SHARE_PARKED:
                continue
            category = _drawn(TABLES["parked"], rng.random())
            turn = -90.0 if rng.random() < 0.75 or road.get("oneway") else 90.0
            self._try(category, Pose(pose.x, pose.y, pose.yaw_deg + turn + rng.uniform(-2.0, 2.0)))

    def _traffic(self, road: Table, line: LineString, k: int) -> None:
        lane = road["width_m"] / max(road["lanes"], 1)
        for way in range(road["lanes"]):
            middle = way * lane + lane / 2 - road["width_m"] / 2
            # Positive offsets lie to the left of the line.
            back = not road.get("oneway") and (middle > 0.0) == (self._drive_on == "right")
            count = math.ceil(line.length / _TRAFFIC_M)
            for n in range(count):
                rng = self._site.rng_for("driving", k, way, n)
                if rng.random() >= _SHARE_DRIVING * line.length / (count * _TRAFFIC_M):
                    continue
                s = (n + rng.uniform(0.2, 0.8)) * line.length / count
                pose = _aside(line, s, middle, 180.0 if back else 0.0)
                if not shapely.intersects(self._streets.layout.busy, Point(pose.x, pose.y).buffer(1.0)):
                    self._try(_drawn(TABLES["driven"], rng.random()), pose)

    def _car_park(self, area: Table, k: int) -> None:
        plan = area["plan"].intersection(self._site.extent)
        name = area.get("name", "")
        for x, y, yaw, count in car_park_rows(area, self._site.extent):
            # On a floor no marks are painted: those are in the plan already.
            for n, bay in enumerate(parking_row(self._site, x, y, yaw, count, z=0.0)):
                rng = self._site.rng_for("bay", k, x, y, n)
                if plan.contains(Point(bay.x, bay.y).buffer(2.0)) and rng.random() < _SHARE_PARKED:
                    back = 180.0 if rng.random() < 0.25 else 0.0
                    pose = Pose(bay.x, bay.y, bay.yaw_deg + back + rng.uniform(-2.0, 2.0))
                    phrase = f"in the car park {name}" if name else "in the car park"
                    self._try(_drawn(TABLES["parked"], rng.random()), pose, phrase)

    def _lamps(self) -> None:
        if sum(thing["category"] == "street_lamp" for thing in self._town["things"]) >= _MIN_LAMPS:
            return
        for road, line in zip(self._streets.roads, self._streets.lines, strict=True):
            if road.get("pavement_m"):
                for pose in list(_kerbside(road, line, _LAMPS_M, 0.5))[:: 2 if road["width_m"] < 8 else 1]:
                    self._on_street("street_lamp", pose)

    def _along_pavements(self) -> None:
        turn = 0
        for k, (road, line) in enumerate(zip(self._streets.roads, self._streets.lines, strict=True)):
            if road.get("pavement_m", 0.0) < 1.5:
                continue
            for n, pose in enumerate(_kerbside(road, line, _FURNITURE_M, 0.75)):
                rng = self._site.rng_for("furniture", k, n)
                busy = shapely.contains_xy(self._streets.layout.busy, pose.x, pose.y)
                if rng.random() < _SHARE_FURNITURE * 0.5 and not busy:
                    turn += self._on_street(_next("pavements", turn), pose)

    def _on_roofs(self, building: Table, k: int) -> None:
        """Set out what stands on flat roofs, away from their edges."""
        bodies, turn = building["bodies"], k
        base = min(self._site.ground_z(x, y) for body in bodies for x, y in body["plan"].exterior.coords)
        for body in bodies:
            room = body["plan"].buffer(-_FROM_EDGE_M)
            if building.get("canopy") or body["roof"] != "flat" or room.area < _MIN_ROOF_M2:
                continue
            rng = self._site.rng_for("roof", k, round(room.area))
            for pose in poisson_disc(room, 7.0, rng, limit=4):
                if rng.random() < _SHARE_FURNITURE:
                    self._placer.place(
                        _next("roofs", turn), pose._replace(yaw_deg=90.0 * round(pose.yaw_deg / 90.0)),
                        phrase="on the roof", on=round(base + body["top_m"] - PARAPET_M, 3),
                    )  # fmt: skip
                    turn += 1

    def _before_shop(self, building: Table) -> None:
        turn = 0
        for pose in before_walls(building["bodies"][0]["plan"].simplify(0.5), 6.5, 1.1, 1.5):
            rng = self._site.rng_for("shop", round(pose.x, 1), round(pose.y, 1))
            near = self._streets.nearest(pose.x, pose.y)
            if near is None or near[1] > 16.0 or rng.random() >= _SHARE_FURNITURE * 0.5:
                continue
            turn += self._on_street(_next("shops", turn + int(rng.integers(len(_IN_TURN["shops"])))), pose)

    def _grow(self, area: Table, k: int) -> None:
        whole = area["plan"]
        plan: BaseGeometry = whole.intersection(self._site.extent.buffer(-1.5))
        plan = plan.difference(self._streets.layout.carriageways.buffer(1.5))
        paths = [road for road in self._town["roads"] if road["kind"] == "path"]
        beside = [LineString(path["line"]).buffer(path["width_m"] / 2 + 1.0) for path in paths]
        plan = plan.difference(shapely.union_all(beside)) if beside else plan
        mapped = sum(t["category"] in _ROOTED and whole.contains(Point(t["at"])) for t in self._town["things"])
        if plan.is_empty or (area["grows"] == "park" and mapped >= _MIN_TREES):
            return
        kinds = TABLES["grows"][area["grows"]]["plants"].split()
        rng = self._site.rng_for("grow", k)
        for pose in poisson_disc(plan, TABLES["grows"][area["grows"]]["spacing_m"], rng, limit=200):
            if self._site.is_free(pose.x, pose.y, 0.5):
                phrase = f"in {area['name']}" if area.get("name") else ""
                self._try(kinds[int(rng.integers(len(kinds)))], pose, phrase)


def car_park_rows(area: Table, extent: BaseGeometry) -> list[list[Any]]:
    """Lay rows of bays along the longer side of a car park, an aisle between each two: x, y, yaw, count."""
    plan = area["plan"].intersection(extent).buffer(-0.3)
    if not isinstance(plan, Polygon) or plan.area < 30.0:
        return []
    (x, y), long, wide, yaw = oriented_rectangle(plan)
    depth, aisle = 5.2, 6.0
    count = int(long // 2.6)
    v = -wide / 2
    poses = []
    while count and v + depth <= wide / 2 + 0.01:
        poses.append(Frame(x, y, yaw).pose(0.0, v, -90.0))
        v += 2 * depth + aisle
        if v <= wide / 2 + 0.01:
            poses.append(Frame(x, y, yaw).pose(0.0, v, 90.0))
    return [[round(p.x, 2), round(p.y, 2), round(p.yaw_deg, 2), min(count, 200)] for p in poses]


def _kerbside(road: Table, line: LineString, spacing_m: float, offset_m: float) -> Iterator[Pose]:
    """Yield poses on both sides of a street, `offset_m` beyond its kerbs, that face it."""
    # Maps cut streets at every corner: rounding down would leave the short stretches bare.
    count = round(line.length / spacing_m)
    for k in range(count):
        s = (k + 0.5) * line.length / count
        for side in (1, -1):
            yield _aside(line, s, side * (road["width_m"] / 2 + offset_m), -90.0 * side, 0.3)


def _aside(line: LineString, s: float, left_m: float, turn_deg: float, reach_m: float = 0.5) -> Pose:
    """Pose to the left of a line, `s` metres along it, turned from its direction; that is measured over `reach_m`."""
    a, b = line.interpolate(max(s - reach_m, 0.0)), line.interpolate(min(s + reach_m, line.length))
    yaw, at = math.atan2(b.y - a.y, b.x - a.x), line.interpolate(s)
    return Pose(at.x - left_m * math.sin(yaw), at.y + left_m * math.cos(yaw), math.degrees(yaw) + turn_deg)


def _next(place: str, turn: int) -> str:
    return _IN_TURN[place][turn % len(_IN_TURN[place])]


def _drawn(weights: Mapping[str, float], u: float) -> str:
    total = sum(weights.values())
    k = bisect.bisect(list(accumulate(weight / total for weight in weights.values())), u)
    return [*weights][min(k, len(weights) - 1)]
