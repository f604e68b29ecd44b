"""What stands and drives in a town: things of the map, and what such streets have by rule."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import oriented_rectangle
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_props import next_variant
from aerialdojo_gen.scenes.grammar_scatter import Pose, place_along, poisson_disc, wall
from aerialdojo_gen.scenes.grammar_streets import parking_row
from aerialdojo_gen.scenes.kit.natural_ground import settled_z
from aerialdojo_gen.scenes.layouts.places.town.buildings import building_base
from aerialdojo_gen.scenes.layouts.places.town.model import Area, Barrier, Building, Parameters, Road, Thing
from aerialdojo_gen.scenes.layouts.places.town.roofs import PARAPET_M
from aerialdojo_gen.scenes.layouts.places.town.streets import Streets, kerbside
from aerialdojo_gen.scenes.mesh import translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.site import Site

_PARKED = {
    "sedan": 0.33, "hatchback": 0.31, "suv": 0.2, "delivery_van": 0.07, "motorcycle": 0.05, "pickup_truck": 0.04,
}  # fmt: skip
_DRIVEN = {
    "sedan": 0.34, "hatchback": 0.24, "suv": 0.14, "delivery_van": 0.1, "city_bus": 0.08, "box_truck": 0.05,
    "motorcycle": 0.05,
}  # fmt: skip
# Along pavements, in turn.
_FURNITURE = (
    "bench", "litter_bin", "bicycle_rack", "planter", "a_board", "newspaper_box", "mailbox", "parking_meter",
    "recycling_bin", "bicycle", "advertising_column", "fire_hydrant",
)  # fmt: skip
_SHOPS = ("a_board", "cafe_table", "planter", "clothes_rack", "menu_board", "bicycle")
_ON_ROOFS = ("air_conditioner", "vent_stack", "satellite_dish", "skylight", "solar_panels")
_FROM_EDGE_M, _LEAST_ROOF_M2 = 1.8, 40.0
_LAMPS_M, _FURNITURE_M, _BAY_M, _TRAFFIC_M = 26.0, 9.0, 6.2, 34.0
_LEAST_LAMPS = 4
_LEAST_TREES = 3
_ROOM_M = 0.25


def set_out(site: Site, p: Parameters, streets: Streets) -> None:
    """Place the things of the map, each on its ground and in nobody's way; what has no room is left out."""
    for thing in p.things:
        _put(site, streets, thing)
    for x, y in p.signals:
        _signal(site, streets, x, y, p.drive_on)
    for barrier in p.barriers:
        _barrier(site, barrier)


def by_rule(site: Site, p: Parameters, streets: Streets) -> None:
    """Add what such streets have: lamps, parked and driving vehicles, furniture, trees in parks."""
    rule = p.rule
    for k, area in enumerate(p.areas):
        if area.parking:
            _car_park(site, area, rule.parked, k)
    for k, (road, line) in enumerate(zip(streets.roads, streets.lines, strict=True)):
        if road.parking:
            _park(site, streets, road, line, rule.parked, k)
        if road.kind == "main":
            _traffic(site, streets, road, line, rule.driving, k, p.drive_on)
    if rule.lamps and sum(t.category == "street_lamp" for t in p.things) < _LEAST_LAMPS:
        for road, line in zip(streets.roads, streets.lines, strict=True):
            if road.pavement_m > 0.0:
                for pose in kerbside(road, line, _LAMPS_M, 0.5)[:: 2 if road.width_m < 8 else 1]:
                    _on_street(site, streets, "street_lamp", pose)
    _furnish(site, streets, rule.furniture)
    for k, building in enumerate(p.buildings):
        _on_roofs(site, building, rule.furniture, k)
    for building in p.buildings:
        if building.shops:
            _shop_things(site, streets, building, rule.furniture)
    for k, area in enumerate(p.areas):
        if area.grows:
            _grow(site, p, area, k, streets)


def _put(site: Site, streets: Streets, thing: Thing) -> Instance | None:
    x, y = thing.at
    yaw = thing.yaw
    if yaw is None:
        near = streets.nearest(x, y)
        yaw = near[2] if near else -90.0
        # Whoever waits at a stop looks at the street; whoever puts up a sign wants it seen along it.
        yaw += 90.0 if thing.category in ("billboard", "crossing_sign", "stop_sign") else 0.0
    spots = [(x, y)] + [(x + r * math.cos(a), y + r * math.sin(a)) for r in (0.6, 1.2, 1.8) for a in _AROUND]
    for u, v in spots:
        if (u, v) != (x, y) and thing.category in _ROOTED and math.dist((u, v), (x, y)) > 1.0:
            return None
        if shapely.contains_xy(streets.carriageways, u, v) and thing.category not in _IN_STREETS:
            continue
        found = _try(site, streets, thing.category, Pose(u, v, yaw), scale=thing.scale)
        if found is not None:
            return found
    return None


_AROUND = tuple(math.radians(45.0 * k) for k in range(8))
_ROOTED = frozenset({"urban_tree", "oak_tree", "spruce_tree", "pine_tree", "birch_tree"})
# One street has one kind of them.
_ALIKE = frozenset({"bollard", "street_lamp", "traffic_light"})
_IN_STREETS = frozenset({"bollard", "traffic_cone"})


def _try(site: Site, streets: Streets, category: str, pose: Pose, place: str = "", **options: Any) -> Instance | None:
    street = "" if place else streets.street(pose.x, pose.y)
    words = {"place": place or f"on {street}"} if place or street else None
    # Plants come as often as their weights say: nobody plants every fifth tree pink.
    kind = site.catalogue[category].kind
    if category in _ALIKE:
        variant = next(iter(v.name for v in site.catalogue[category].variants), None)
    else:
        variant = None if kind == "vegetation" else next_variant(site, category)
    if np.ptp(site.terrain.heights_m) > 0.0:
        options = {"z": settled_z(site, pose.x, pose.y), **options}
    return site.try_place(category, *pose, variant=variant, attributes=words, **options)


def _on_street(site: Site, streets: Streets, category: str, pose: Pose) -> Instance | None:
    """Place a thing beside a street, not in one."""
    if shapely.contains_xy(streets.carriageways, pose.x, pose.y):
        return None
    return _try(site, streets, category, pose)


def _signal(site: Site, streets: Streets, x: float, y: float, drive_on: str) -> None:
    """Traffic lights stand at the kerb on the driver's side and face those who come."""
    near = streets.nearest(x, y)
    if near is None or near[1] > 6.0:
        return
    road, line = streets.roads[near[0]], streets.lines[near[0]]
    s = line.project(Point(x, y))
    a, b = line.interpolate(max(s - 0.5, 0.0)), line.interpolate(min(s + 0.5, line.length))
    yaw = math.atan2(b.y - a.y, b.x - a.x)
    at = line.interpolate(s)
    side = -1.0 if drive_on == "right" else 1.0
    for way in (1.0,) if road.oneway else (1.0, -1.0):
        d = side * way * (road.width_m / 2 + 0.6)
        u, v = at.x - d * math.sin(yaw), at.y + d * math.cos(yaw)
        _on_street(site, streets, "traffic_light", Pose(u, v, math.degrees(yaw) + (180.0 if way > 0 else 0.0)))


def _park(site: Site, streets: Streets, road: Road, line: shapely.LineString, share: float, k: int) -> None:
    for n, pose in enumerate(kerbside(road, line, _BAY_M, -1.15)):
        rng = site.rng_for("parked", k, n)
        free = not shapely.intersects(streets.busy, Point(pose.x, pose.y).buffer(2.5))
        if not free or rng.random() >= share:
            continue
        category = _drawn(_PARKED, rng.random())
        turn = -90.0 if rng.random() < 0.75 or road.oneway else 90.0
        _try(site, streets, category, Pose(pose.x, pose.y, pose.yaw_deg + turn + rng.uniform(-2.0, 2.0)))


def _traffic(site: Site, streets: Streets, road: Road, line: shapely.LineString, share: float, k: int,
             drive_on: str) -> None:  # fmt: skip
    lane = road.width_m / max(road.lanes, 1)
    ways = range(road.lanes)
    for way in ways:
        middle = way * lane + lane / 2 - road.width_m / 2
        # Positive offsets lie to the left of the line.
        back = not road.oneway and (middle > 0.0) == (drive_on == "right")
        count = math.ceil(line.length / _TRAFFIC_M)
        for n in range(count):
            rng = site.rng_for("driving", k, way, n)
            if rng.random() >= share * line.length / (count * _TRAFFIC_M):
                continue
            s = (n + rng.uniform(0.2, 0.8)) * line.length / count
            a, b = line.interpolate(max(s - 0.5, 0.0)), line.interpolate(min(s + 0.5, line.length))
            yaw = math.atan2(b.y - a.y, b.x - a.x)
            x, y = (a.x + b.x) / 2 - middle * math.sin(yaw), (a.y + b.y) / 2 + middle * math.cos(yaw)
            if not shapely.intersects(streets.busy, Point(x, y).buffer(1.0)):
                facing = math.degrees(yaw) + (180.0 if back else 0.0)
                _try(site, streets, _drawn(_DRIVEN, rng.random()), Pose(x, y, facing))


def _car_park(site: Site, area: Area, share: float, k: int) -> None:
    """Fill a car park with rows of bays along its longer side, an aisle between each two."""
    plan = area.plan.intersection(site.extent).buffer(-0.3)
    if not isinstance(plan, Polygon) or plan.area < 30.0:
        return
    (x, y), long, wide, yaw = oriented_rectangle(plan)
    frame = Frame(x, y, yaw)
    depth, aisle = 5.2, 6.0
    count = int(long // 2.6)
    v = -wide / 2
    rows: list[tuple[float, float]] = []
    while v + depth <= wide / 2 + 0.01:
        rows.append((v, -90.0))
        if v + 2 * depth + aisle <= wide / 2 + 0.01:
            rows.append((v + 2 * depth + aisle, 90.0))
        v += 2 * depth + aisle
    place = f"in the car park {area.name}" if area.name else "in the car park"
    for closed, turn in rows:
        at = frame.at(0.0, closed)
        bays = parking_row(site, *at, yaw + turn, count)
        for n, bay in enumerate(bays):
            rng = site.rng_for("bay", k, closed, n)
            whole = plan.contains(Point(bay.x, bay.y).buffer(2.0))
            if whole and rng.random() < share:
                back = 180.0 if rng.random() < 0.25 else 0.0
                pose = Pose(bay.x, bay.y, bay.yaw_deg + back + rng.uniform(-2.0, 2.0))
                category = _drawn(_PARKED, rng.random())
                site.try_place(category, *pose, variant=next_variant(site, category), attributes={"place": place})


def _furnish(site: Site, streets: Streets, share: float) -> None:
    turn = 0
    for k, (road, line) in enumerate(zip(streets.roads, streets.lines, strict=True)):
        if road.pavement_m < 1.5:
            continue
        for n, pose in enumerate(kerbside(road, line, _FURNITURE_M, 0.75)):
            rng = site.rng_for("furniture", k, n)
            if rng.random() >= share * 0.5 or shapely.contains_xy(streets.busy, pose.x, pose.y):
                continue
            if _on_street(site, streets, _FURNITURE[turn % len(_FURNITURE)], pose) is not None:
                turn += 1


def _on_roofs(site: Site, building: Building, share: float, k: int) -> None:
    """Set out what stands on flat roofs, away from their edges."""
    base = building_base(site, building)
    turn = k
    for body in building.bodies:
        room = body.plan.buffer(-_FROM_EDGE_M)
        if building.canopy or body.roof != "flat" or room.area < _LEAST_ROOF_M2:
            continue
        rng = site.rng_for("roof", k, round(room.area))
        for pose in poisson_disc(room, 7.0, rng, limit=4):
            if rng.random() < share:
                category, z = _ON_ROOFS[turn % len(_ON_ROOFS)], base + body.top_m - PARAPET_M
                yaw = 90.0 * round(pose.yaw_deg / 90.0)
                words = {"place": "on the roof"}
                site.try_place(
                    category, pose.x, pose.y, yaw, z=z, variant=next_variant(site, category), attributes=words
                )
                turn += 1


def _shop_things(site: Site, streets: Streets, building: Building, share: float) -> None:
    plan = building.bodies[0].plan
    turn = 0
    for pose in _before(plan, 6.5, 1.1):
        rng = site.rng_for("shop", round(pose.x, 1), round(pose.y, 1))
        near = streets.nearest(pose.x, pose.y)
        if near is None or near[1] > 16.0 or rng.random() >= share * 0.5:
            continue
        category = _SHOPS[(turn + int(rng.integers(len(_SHOPS)))) % len(_SHOPS)]
        if _on_street(site, streets, category, pose) is not None:
            turn += 1


def _before(plan: Polygon, spacing_m: float, offset_m: float) -> list[Pose]:
    from aerialdojo_gen.scenes.grammar_buildings import before_walls

    return before_walls(plan.simplify(0.5), spacing_m, offset_m, 1.5)


def _grow(site: Site, p: Parameters, area: Area, k: int, streets: Streets) -> None:
    plan: BaseGeometry = area.plan.intersection(site.extent.buffer(-1.5)).difference(streets.carriageways.buffer(1.5))
    paths = [shapely.LineString(r.line).buffer(r.width_m / 2 + 1.0) for r in p.roads if r.kind == "path"]
    plan = plan.difference(shapely.union_all(paths)) if paths else plan
    mapped = sum(t.category in _ROOTED and area.plan.contains(Point(t.at)) for t in p.things)
    if plan.is_empty or (area.grows == "park" and mapped >= _LEAST_TREES):
        return
    spacing, kinds = {
        "wood": (4.5, ("oak_tree", "birch_tree", "urban_tree", "spruce_tree")),
        "park": (11.0, ("urban_tree", "oak_tree", "birch_tree")),
        "scrub": (2.6, ("bush", "bush", "fern")),
    }[area.grows]
    rng = site.rng_for("grow", k)
    for n, pose in enumerate(poisson_disc(plan, spacing, rng, limit=250)):
        if site.is_free(pose.x, pose.y, 0.5):
            place = f"in {area.name}" if area.name else ""
            _try(site, streets, kinds[int(rng.integers(len(kinds)))], pose, place)
        if n >= 200:
            break


def _barrier(site: Site, barrier: Barrier) -> None:
    line = shapely.intersection(shapely.LineString(barrier.line), site.extent.buffer(-0.4))
    legs = [leg for leg in getattr(line, "geoms", [line]) if isinstance(leg, shapely.LineString) and leg.length > 0.6]
    for leg in legs:
        path = [(float(x), float(y)) for x, y in leg.simplify(0.1).coords]
        if barrier.kind == "hedge":
            place_along(site, "hedge_block", path, _HEDGE_M, turn_deg=90.0)
        elif barrier.kind == "wall":
            site.add(
                None, "garden_wall", [("stone", wall(site, path, barrier.height_m, 0.3))], footprint=leg.buffer(0.2)
            )
        else:
            _fence(site, path, barrier.height_m, leg)


_HEDGE_M = 4.0


def _fence(site: Site, path: Sequence[tuple[float, float]], height_m: float, leg: shapely.LineString) -> None:
    rails = [wall(site, path, 0.06, 0.04, z=height_m * share) for share in (0.2, 0.55, 0.92)]
    count = max(round(leg.length / 2.0), 1)
    posts = []
    for k in range(count + 1):
        at = leg.interpolate(leg.length * k / count)
        posts.append(translated(box(size=(0.06, 0.06, height_m)), (at.x, at.y, site.ground_z(at.x, at.y))))
    parts = [("iron", body) for body in (*rails, *posts)]
    site.add(None, "railing", parts, footprint=leg.buffer(0.1))


def _drawn(weights: dict[str, float], u: float) -> str:
    total, at = sum(weights.values()), 0.0
    for name, weight in weights.items():
        at += weight / total
        if u < at:
            return name
    return next(reversed(weights))
