"""Stages of coasts: islands, landings, piers, huts over the water, villages with paths and beaches, boats."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import Point, Pose, ahead, point, smoothed, towards
from aerialdojo_gen.scenes.worlds.wilds import about, anywhere, clearing, strewn, tread, winding


def coast(
    draft: Draft, name: str, at: Point, radii_m: Point, bays: Sequence[tuple[float, float, float]] = ()
) -> shapely.Polygon:
    """Name an island's coastline: a wavy ellipse with bays (direction, share of the radius, half width)."""
    rng, (w, d), points = draft.rng("coast", name), draft.half, []
    waves = [(k, float(rng.uniform(0.02, 0.16 / k)), float(rng.uniform(0, 360))) for k in (2, 3, 5)]
    for k in range(36):
        deg = 10.0 * k
        share = 1.0 + sum(a * math.cos(math.radians(n * deg + phase)) for n, a, phase in waves)
        for bay, depth, half in bays:
            off = abs((deg - bay + 180.0) % 360.0 - 180.0)
            share *= 1.0 - depth * max(0.0, 1.0 - (off / half) * (off / half))
        angle = math.radians(deg)
        x, y = at[0] + radii_m[0] * share * math.cos(angle), at[1] + radii_m[1] * share * math.sin(angle)
        points.append(point(min(max(x, 4 - w), w - 4), min(max(y, 4 - d), d - 4)))
    draft.lines[name] = {"points": points, "smooth": 1}
    return shapely.Polygon(smoothed(points, 1).coords).buffer(0)


def islands(
    draft: Draft, parts: Sequence[Any], land: BaseGeometry, relief_m: float, *,
    heights: Mapping[str, str], total: str, inland: Mapping[str, Any] | None = None,
) -> None:  # fmt: skip
    """Raise land out of the sea: its shore by how far inland a place is, and formulas of hills; paint both."""
    ragged = [1.4, draft.whole(0, 999, "ragged"), 2.4]  # Of several polygons it would keep one
    uneven = [part if "blob" in part else {**part, "ragged": ragged} for part in parts]
    draft.areas["land"] = uneven[0] if len(parts) == 1 else {"union": uneven}
    draft.floors["sea"] = 0.0
    shore = f"0.5*eased(inland, 0, 3.5) + 0.09*clip(inland, 0, 14) + {relief_m}*eased(inland, 6, 20)*(1 + 0.8*noise)"
    draft.step("ground_by_formula", cell_m=2.0, noise_m=draft.number(16, 30, "noise"),
        inland={"inland": "land", **(inland or {})}, let={"shore": shore, **heights},
        height=f"choose(inland, max(shore + {total}, 0.25*eased(inland, 0, 1)), 0)",
    )  # fmt: skip
    draft.settle()
    draft.section("The land and the sea")
    box = [round(v, 1) for v in land.bounds]
    draft.make("paint_heath", layers=[
        {"material": draft.material("patch", k), "count": 14, "radius_m": [3.0, 8.0], "box": box, "ragged": 0.45,
         "within": {"area": "land", "grow_m": -5}, "seed": draft.whole(0, 999, "heath", k)} for k in range(2)
    ])  # fmt: skip
    draft.make(
        "paint_beach", land="land", width_m=draft.number(4, 9, "beach"), material=draft.material("beach"),
        seed=draft.whole(0, 999, "beach_seed"),
    )  # fmt: skip
    draft.make("paint_cliffs", material=draft.material("cliff"), steeper_deg=41, within="land")
    sea = {role: draft.material(role) for role in ("deep", "shallow", "lagoon", "wet")}
    draft.make("paint_sea", land="land", shallow_m=draft.number(6, 13, "shallow"), **sea)


def landing(land: BaseGeometry, at: Point, yaw_deg: float) -> Point:
    """Where the way from a point on land in a direction comes to the sea."""
    way = shapely.LineString([at, ahead(at, yaw_deg, 200.0)]).intersection(land)
    first = way if way.geom_type == "LineString" else way.geoms[0]
    if first.is_empty:
        raise NoRoomError("no way to the shore")
    return tuple(first.coords[-1])


def is_open(draft: Draft, land: BaseGeometry, area: BaseGeometry, margin_m: float = 2.0) -> bool:
    """Whether an area is free water."""
    return draft.is_free(area) and land.distance(area) > margin_m


def _strip(at: Point, yaw_deg: float, first_m: float, last_m: float, half_m: float) -> BaseGeometry:
    ends = [ahead(at, yaw_deg, first_m), ahead(at, yaw_deg, last_m)]
    return shapely.LineString(ends).buffer(half_m, cap_style="flat")


def jetty(draft: Draft, land: BaseGeometry, at: Point, yaw_deg: float, length_m: float) -> bool:
    """Build a jetty out from a point of the shore, where the water is free; offer slots on it, and berths."""
    draft.floors.setdefault("jetty", 1.4)
    width, foot = 2.6, ahead(at, yaw_deg, -2.2)
    if not is_open(draft, land, _strip(at, yaw_deg, 2.5, length_m + 7, 5.5), 0.3):
        return False
    draft.make(
        "pier", at=foot, yaw_deg=round(yaw_deg, 1), length_m=length_m + 2.2, width_m=width, z="jetty",
        bay_m=3.8, floor=draft.material("boards"), category="jetty",
    )  # fmt: skip
    # The berths have ground of their own, which nothing that drifts may take.
    for side in (1.0, -1.0):
        for k in range(max(1, int((length_m - 4.0) // 11.5))):
            berth = ahead(at, yaw_deg, 9.0 + 11.5 * k, side * (width / 2 + 2.5))
            draft.slot("berth", *berth, yaw_deg + (180.0 if side > 0 else 0.0), (10.6, 4.2), on="sea")
    draft.slot("berth", *ahead(at, yaw_deg, length_m + 4.2), yaw_deg + 90.0, (14.2, 5.4), on="sea")
    for k in range(int(length_m // 4.6)):
        side = -1 if k % 2 else 1
        spot = ahead(at, yaw_deg, 3.4 + 4.6 * k, side * 0.75)
        draft.slot("jetty", *spot, yaw_deg - side * 90.0, (2.0, 2.9), on="jetty")
    draft.take(_strip(at, yaw_deg, -2.2, length_m + 7, 6.5))
    return True


def huts_over_water(draft: Draft, land: BaseGeometry, at: Point, yaw_deg: float, rows: int) -> bool:
    """Lead a boardwalk out from the shore, with huts on stilts at both sides of it."""
    length = 6.0 + 9.0 * rows
    if not is_open(draft, land, _strip(at, yaw_deg, 4.0, length + 2, 9.5), 0.2):
        return False
    draft.floors["boardwalk"] = 1.72
    middles = [7.5 + 9.0 * k for k in range(rows)]
    draft.make(
        "pier", at=ahead(at, yaw_deg, -2.2), yaw_deg=round(yaw_deg, 1), length_m=length + 2.2, width_m=3.2,
        z=1.7, bay_m=3.8, rail="wood:#9a8058", gates=[[m + 0.8, m + 3.6] for m in middles], category="jetty",
        floor=draft.material("boards"),
    )  # fmt: skip
    huts = [(*ahead(at, yaw_deg, m, side * 6.3), round((yaw_deg - side * 90.0) % 360, 1)) for m in middles
            for side in (1.0, -1.0)]  # fmt: skip
    draft.make(
        "stilt_huts", at=huts, walls=walls(draft, 4, "huts"), on="boardwalk", width_m=5.4,
        porch_m=2.1, steps=False,
    )  # fmt: skip
    for k in range(rows):
        side = -1 if k % 2 else 1
        spot = ahead(at, yaw_deg, 3.4 + 9.0 * k, side * 0.9)
        draft.slot("jetty", *spot, yaw_deg - side * 90.0, (2.0, 2.0), on="boardwalk")
    draft.slot("jetty", *ahead(at, yaw_deg, length - 1.2), yaw_deg, (2.0, 2.4), on="boardwalk")
    draft.take(shapely.LineString([at, ahead(at, yaw_deg, length + 3)]).buffer(10.5, cap_style="flat"))
    return True


def walls(draft: Draft, number: int, *key: object) -> list[str]:
    """Draw materials of several houses' walls."""
    return [draft.material("wall", *key, k) for k in range(number)]


def afloat(draft: Draft, land: BaseGeometry, number: int) -> None:
    """Offer slots (``sea``) on open water, far from one another."""
    rng, w, d = draft.rng("afloat"), draft.width_m / 2 - 9.0, draft.depth_m / 2 - 9.0
    chosen: list[shapely.Point] = []
    for _ in range(number * 14):
        spot = shapely.Point(float(rng.uniform(-w, w)), float(rng.uniform(-d, d)))
        yaw = float(rng.uniform(0, 360))
        if len(chosen) == number or land.distance(spot) > 200.0 or any(spot.distance(c) < 15.0 for c in chosen):
            continue
        if is_open(draft, land, spot.buffer(7.2), 1.6):
            chosen.append(spot)
            draft.slot("sea", spot.x, spot.y, yaw, (14.2, 6.0), on="sea")


def beach_slots(draft: Draft, land: BaseGeometry, off: BaseGeometry) -> None:
    """Offer slots (``beach``) along the shore, fronts to the sea, where the ground is free, off an area."""
    inner, step_m = land.buffer(-4.8), 6.5
    for part in getattr(inner, "geoms", [inner]):
        ring = part.exterior
        for k in range(int(ring.length // step_m)):
            p = ring.interpolate((k + draft.number(0.2, 0.8, "beach", k, round(part.area))) * step_m)
            q = ring.interpolate(ring.project(p) + 0.5)
            yaw = towards((p.x, p.y), (q.x, q.y)) + (-90.0 if ring.is_ccw else 90.0)
            if draft.is_free(p.buffer(2.2)) and not off.intersects(p):
                draft.slot("beach", p.x, p.y, yaw, (5.4, 4.0))


class Isle(NamedTuple):
    """What a topology gives to the stages after it."""

    land: BaseGeometry
    village: Point
    bay_deg: float  # Where the village looks to the sea
    heads: list[Point]  # Level places for landmarks, and what belongs to lookouts
    shut: BaseGeometry = shapely.Point()  # Too steep for houses and woods
    cliffs: BaseGeometry = shapely.Point()  # Where the shore is no beach


def build_village(draft: Draft, isle: Isle) -> None:
    """Found a village with landings, lookouts, paths between them, beaches, boats and woods."""
    draft.take(isle.shut)
    clearing(draft, "square", isle.village, 8.0)
    for k, head in enumerate(isle.heads):
        clearing(draft, f"head_{k}", head, 6.5)
    draft.section("Landings")
    _landings(draft, isle)
    _ways(draft, isle)
    draft.section("The village")
    _houses(draft, isle)
    about(draft, "village", isle.village, (3.2, 6.6), 9, (4.9, 3.8))
    draft.take_disc(isle.village, 9.0)
    afloat(draft, isle.land, 9)
    beach_slots(draft, isle.land, off=isle.cliffs)
    draft.take(draft.site.shape().difference(isle.land.buffer(-3.5)))
    draft.step("level_under_things")
    draft.section("Landmarks")
    spots = [(*head, float(round(towards(head, isle.village)))) for head in isle.heads]
    inner = isle.land.buffer(-7.0)
    spots += [p for p in anywhere(draft, 200) if inner.contains(shapely.Point(p[0], p[1]))]
    if draft.chance(0.6, "lighthouse"):
        draft.landmark(spots[: len(isle.heads)], of=["lighthouse"])
    draft.landmark(spots)
    for head in isle.heads:
        about(draft, "lookout", head, (5.2, 7.4), 5, (3.4, 3.4))
    draft.level_things = False  # The land is gentle enough for small things
    strewn(draft, "inland", 30, (3.6, 3.6))
    draft.fill_slots()
    _growth(draft)


def _landings(draft: Draft, isle: Isle) -> None:
    built, huts = 0, draft.material("homes") == "huts"
    for off in (0.0, 22.0, -22.0, 40.0, -40.0, 60.0, -60.0, 85.0, -85.0):
        yaw = isle.bay_deg + off
        shore = landing(isle.land, isle.village, yaw)
        if built == 1 and huts and huts_over_water(draft, isle.land, shore, yaw, draft.whole(2, 3, "rows")):
            built += 1
        elif built < 2:
            built += jetty(draft, isle.land, shore, yaw, draft.number(12, 18, "jetty", off))
    if not built:
        raise NoRoomError("no room for a jetty")


def _ways(draft: Draft, isle: Isle) -> None:
    """Paths from the village to the lookouts and to the shore, so far as they lie on land."""
    shore = landing(isle.land, isle.village, isle.bay_deg)
    lines = {"to_shore": winding(draft, "to_shore", (ahead(isle.village, isle.bay_deg, 6.5), shore), 0.4, 1)}
    for k, head in enumerate(isle.heads):
        yaw = towards(isle.village, head)
        ends = (ahead(isle.village, yaw, 6.5), ahead(head, yaw, -6.6))
        line = winding(draft, f"way_{k}", ends, 5.0, 3)
        if isle.land.buffer(-2.0).contains(line) and not isle.shut.intersects(line):
            lines[f"way_{k}"] = line
        else:
            del draft.lines[f"way_{k}"]
    tread(draft, lines)


def _houses(draft: Draft, isle: Isle) -> None:
    """Houses about the square, fronts to it, each on a level pad with a yard."""
    inner = isle.land.buffer(-6.5)
    poses: list[Pose] = []
    wanted, rng = round(draft.knob("houses")), draft.rng("houses")
    for _ in range(160):
        angle, away = float(rng.uniform(0, 360)), float(rng.uniform(13.5, 27.0))
        spot = ahead(isle.village, angle, away)
        if len(poses) < wanted and inner.contains(shapely.Point(spot)) and draft.has_room(*spot, 5.2):
            poses.append((*spot, round(angle + 180.0 + float(rng.uniform(-25, 25)), 1) % 360.0))
            draft.take_disc(spot, 5.6)
    if len(poses) < 2:
        raise NoRoomError("no room for the village")
    for x, y, yaw in poses:
        draft.step("level_area", area=[{"disc": [x, y, 4.2]}], blend_m=3.5)
        draft.paint({"blob": [x, y, 6.0, draft.whole(0, 999, "yard", x), 0.2]}, draft.material("glade", x))
        for side in (-1, 1):
            draft.slot("yard", *ahead((x, y), yaw, draft.number(1, 4, "yard", x, side), side * 6.2), yaw, (3.0, 3.0))
    if draft.material("homes") == "huts":
        draft.make("stilt_huts", at=poses, walls=walls(draft, len(poses), "home"))
        return
    draft.make(
        "house_row", at=[p[:2] for p in poses], yaws_deg=[p[2] for p in poses], walls=walls(draft, 6, "home"),
        style={"width_m": draft.number(6.0, 6.9, "house_w"), "depth_m": 5.6, "storeys": 1, "storey_m": 2.7,
               "roof_m": draft.number(2.0, 2.8, "house_roof")},
        roofs=[draft.material("roof", k) for k in range(2)], doors=["#2f5f6e", "#6e2f2a", "#e9dcb0"],
        storeys=[draft.whole(1, 2, "storeys", k) for k in range(3)], chimneys=[True, False],
    )  # fmt: skip


def _growth(draft: Draft) -> None:
    """Boulders at the shore, and what grows inland."""
    draft.section("Rocks, and what grows")
    draft.make(
        "strew_rocks", area={"outline": "land", "width_m": 4.0}, spacing_m=draft.number(3.2, 6.0, "rocks"),
        radius_m=[0.5, 1.4], material=draft.material("boulder"), limit=60,
    )  # fmt: skip
    draft.areas["inner"] = {"area": "land", "grow_m": -5.0}
    trees, low = draft.material("trees").split("+"), draft.material("low").split("+")
    most = round(draft.knob("trees") / len(trees) / 2)
    kinds = [
        {"of": tree, "spacing_m": 3.8, "limit": most, "scale": draft.number(least, high, "scale", tree, least)}
        for tree in trees
        for least, high in ((0.9, 1.1), (1.2, 1.5))
    ]
    kinds += [{"of": one, "spacing_m": 2.6, "limit": 15, "scale": draft.number(1, 1.5, "low", one)} for one in low]
    draft.make("undergrowth", area="inner", kinds=kinds)


def inside(land: BaseGeometry, at: Point, yaw_deg: float, from_shore_m: float) -> Point:
    """Point that lies so far behind the shore, from a point on land in a direction."""
    return ahead(landing(land, at, yaw_deg), yaw_deg, -from_shore_m)
