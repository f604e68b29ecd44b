"""Stages of land by the sea: a village with landings, lookouts, paths, beaches, boats and what grows."""

from __future__ import annotations

from typing import NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shores import (
    afloat,
    ahead,
    beach_slots,
    huts_over_water,
    jetty,
    landing,
    towards,
    walls,
)
from aerialdojo_gen.scenes.worlds.wilds import about, anywhere, clearing, paths, step, strewn, winding

Point = tuple[float, float]


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
    w, d = draft.width_m / 2, draft.depth_m / 2
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
    draft.take(shapely.Point(isle.village).buffer(9.0))
    afloat(draft, isle.land, 9)
    beach_slots(draft, isle.land, off=isle.cliffs)
    sea = shapely.box(-w, -d, w, d).difference(isle.land.buffer(-3.5))
    draft.take(sea)
    step(draft, "level_under_things")
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
    lines = {}
    shore = landing(isle.land, isle.village, isle.bay_deg)
    lines["to_shore"] = winding(draft, "to_shore", (ahead(isle.village, isle.bay_deg, 6.5), shore), 0.4, 1)
    for k, head in enumerate(isle.heads):
        yaw = towards(isle.village, head)
        ends = (ahead(isle.village, yaw, 6.5), ahead(head, yaw, -6.6))
        line = winding(draft, f"way_{k}", ends, 5.0, 3)
        if isle.land.buffer(-2.0).contains(line) and not isle.shut.intersects(line):
            lines[f"way_{k}"] = line
        else:
            del draft.lines[f"way_{k}"]
    paths(draft, lines)


def _houses(draft: Draft, isle: Isle) -> None:
    """Houses about the square, fronts to it, each on a level pad with a yard."""
    inner = isle.land.buffer(-6.5)
    found: list[tuple[float, float, float]] = []
    wanted = round(draft.knob("houses"))
    rng = draft.rng("houses")
    for _ in range(160):
        angle, away = float(rng.uniform(0, 360)), float(rng.uniform(13.5, 27.0))
        x, y = ahead(isle.village, angle, away)
        spot = shapely.Point(x, y)
        if len(found) < wanted and inner.contains(spot) and draft.is_free(spot.buffer(5.2)):
            turn = round(angle + 180.0 + float(rng.uniform(-25, 25)), 1) % 360.0
            found.append((x, y, turn))
            draft.take(spot.buffer(5.6))
    if len(found) < 2:
        raise NoRoomError("no room for the village")
    for x, y, yaw in found:
        step(draft, "level_area", area=[{"disc": [x, y, 4.2]}], blend_m=3.5)
        draft.paint({"blob": [x, y, 6.0, draft.whole(0, 999, "yard", x), 0.2]}, draft.material("glade", x))
        for side in (-1, 1):
            draft.slot("yard", *ahead((x, y), yaw, draft.number(1, 4, "yard", x, side), side * 6.2), yaw, (3.0, 3.0))
    poses = [list(p) for p in found]
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
        {"of": tree, "spacing_m": 3.8, "limit": most, "scale": draft.number(low_, high, "scale", tree, low_)}
        for tree in trees
        for low_, high in ((0.9, 1.1), (1.2, 1.5))
    ]
    kinds += [{"of": one, "spacing_m": 2.6, "limit": 15, "scale": draft.number(1, 1.5, "low", one)} for one in low]
    draft.make("undergrowth", area="inner", kinds=kinds)


def inside(land: BaseGeometry, at: Point, yaw_deg: float, from_shore_m: float) -> Point:
    """Point that lies so far behind the shore, from a point on land in a direction."""
    return ahead(landing(land, at, yaw_deg), yaw_deg, -from_shore_m)
