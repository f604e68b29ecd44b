"""Neighbourhoods: houses in their gardens along streets, and what the people who live there share."""

from __future__ import annotations

import math
from collections import Counter
from itertools import product
from typing import Any

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, Pose, ahead, towards
from aerialdojo_gen.scenes.worlds.streets import (
    HALF_M,
    Plot,
    Way,
    block_building,
    edge_slots,
    kerb_slots,
    plot,
    streets,
)
from aerialdojo_gen.scenes.worlds.wilds import strewn, winding

_MIN_HOUSES = 4
_FENCES = ["picket", "hedge", "wall", "railing"]
Layout = tuple[list[Way], list[Pose]]


def write(draft: Draft) -> None:
    """Lay the streets, set landmarks at them, then plots along them, and fill what is left with green."""
    w, d = draft.half
    draft.section("The streets")
    ways, spots = _TOPOLOGIES[draft.topology](draft, w, d)
    draft.section("Landmarks")
    corners = [(x * (w - 5.5), y * (d - 5.5), draft.number(0, 360, x, y)) for x in (-1, 1) for y in (-1, 1)]
    draft.landmark([*spots, *draft.shuffled(corners, "corners")])
    draft.section("The houses and their gardens")
    drives = _houses(draft, ways)
    kerb_slots(draft, ways, drives)
    draft.section("Allotments, and trees about the site")
    _allotments(draft, w, d)
    edge_slots(draft, "tree", draft.site.grown(-2.2), 5.5, (3.5, 3.5))
    strewn(draft, "verge", 26, (4.2, 4.2), 3.0)
    draft.fill_slots()


def _houses(draft: Draft, ways: list[Way]) -> list[shapely.Polygon]:
    """Line streets with houses, each called by its colour; gives the drives and paths that lead to them."""
    colours = _colours(draft, "colours")
    used: Counter[tuple[str, str]] = Counter()
    lots: list[dict[str, Any]] = []
    drives: list[shapely.Polygon] = []
    for n, way in enumerate(ways):
        for side in (1, -1):
            at = draft.number(0.5, 3.0, "first", n, side)
            while at < way.line.length and len(lots) < len(colours):
                key = (n, side, round(at, 1))
                style = _style(draft, colours[len(lots)], key)
                front, back = draft.number(4.2, 6.4, "front", *key), draft.number(6.5, 9.0, "back", *key)
                wide = style["width_m"] + (7.6 if style["garage"] else draft.number(4.4, 7.0, "wide", *key))
                for behind in (back, 5.0):
                    depth = front + style["depth_m"] + behind + 0.4
                    if (ground := plot(draft, way, at + wide / 2, side, (wide, depth))) is not None:
                        break
                else:
                    at += 1.0
                    continue
                lots.append(_lot(draft, ground, colours[len(lots)], style, (front, behind), used))
                drives.append(ground.strip(0.0, 0.9, 3.0))
                if style["garage"]:
                    drives.append(ground.strip(style["garage"] * (style["width_m"] / 2 + 1.8), 2.3, 3.0))
                at += wide + draft.number(0.3, 1.5, "gap", *key)
    if len(lots) < (2 if draft.topology == "terraces" else _MIN_HOUSES):
        raise NoRoomError("room for few houses")
    draft.make("house_lots", lots=lots, path=draft.material("path"), drive=draft.material("drive"))
    return drives


def _allotments(draft: Draft, w: float, d: float) -> None:
    """Dig vegetable beds where the corners of the site are free."""
    for x, y in product((-1, 1), repeat=2):
        box = Box.about(x * (w - 12.5), y * (d - 11.5), 15.0, 13.0)
        if not draft.is_free(box.shape()):
            continue
        draft.paint(box.rounded(), draft.material("path"))
        beds = [[round(bx, 2), round(by, 2)] for bx, by in box.grown(-1.5).grid(3.9)]
        chosen = draft.shuffled(beds, "beds", x, y)
        greens = draft.shuffled(["#4f7f38", "#7f9a44", "#a8b860", "#3f6f44", "#8a4a5a"], "greens", x, y)[:3]
        draft.make("vegetable_beds", at=sorted(chosen[:5]), greens=[f"foliage:{one}" for one in greens])
        for bx, by in chosen[5:]:
            draft.slot("allotment", bx, by, draft.pick(SIDES, "allotment", bx, by), (3.6, 3.6))
        draft.take(box.shape())


def _colours(draft: Draft, key: str) -> list[str]:
    """Roles of the palette that houses are called by, in a drawn order."""
    return draft.shuffled([role for role in draft.palette.materials if role.startswith("house_")], key)


def _style(draft: Draft, role: str, key: tuple[object, ...]) -> dict[str, Any]:
    garage = draft.pick([-1, 1], "side", *key) if draft.chance(draft.knob("garages"), "garage", *key) else 0
    style: dict[str, Any] = {
        "width_m": draft.number(7.8, 10.6, "width", *key), "depth_m": draft.number(7.2, 8.8, "depth", *key),
        "storeys": max(1, round(draft.knob("storeys")) - draft.whole(0, 1, "lower", *key)),
        "wall": draft.material(role), "roof": draft.material("roof", *key), "door": draft.material("door", *key),
        "roof_m": draft.number(2.2, 3.4, "ridge", *key), "garage": garage,
        "roof_kind": draft.pick(["gable", "gable", "hip"], "roof_kind", *key),
        "chimney": draft.chance(0.7, "chimney", *key),
    }  # fmt: skip
    if draft.chance(0.45, "porch", *key):
        style["porch_m"] = draft.number(1.9, 2.4, "porch_m", *key)
    return style


def _lot(
    draft: Draft, ground: Plot, role: str, style: dict[str, Any], deep: tuple[float, float],
    used: Counter[tuple[str, str]],
) -> dict[str, Any]:  # fmt: skip
    front, back = deep
    key = (ground.x, ground.y)
    lot: dict[str, Any] = {
        "colour": role.removeprefix("house_").replace("_", " "),
        "at": list(ground.at(front + style["depth_m"] / 2)), "yaw_deg": ground.yaw_deg, "style": style,
        "front_m": front, "back_m": back, "side_m": round(ground.width_m / 2, 2),
        "front_fence": draft.pick(_FENCES, "front_fence", *key),
        "back_fence": draft.pick(["board", "board", "hedge"], "back_fence", *key),
        "back": _draw_categories(draft, "back garden", round(draft.knob("things")), key, used),
        "front": _draw_categories(draft, "front garden", draft.whole(2, 3, "front", *key), key, used),
        "trees": draft.material("trees", *key).split("+")[: draft.whole(0, 2, "trees", *key)],
    }  # fmt: skip
    if "porch_m" in style:
        lot["porch"] = _draw_categories(draft, "porch", 2, key, used)
    if style["garage"]:
        lot["vehicle"] = (_draw_categories(draft, "drive", 1, key, used) or [""])[0]
        lot["garage_roof"] = (_draw_categories(draft, "garage roof", 1, key, used) or [""])[0]
    return {name: value for name, value in lot.items() if value not in ("", [])}


def _draw_categories(
    draft: Draft, kind: str, n: int, key: tuple[object, ...], used: Counter[tuple[str, str]]
) -> list[str]:
    """Draw different categories of a kind of slots, which a builder of the kit finds the places of."""
    left = draft.available(kind, used)
    drawn = sorted(left, key=lambda what: -math.log(draft.rng("deal", kind, *key, what).random()) / left[what])[:n]
    used.update((kind, what) for what in drawn)
    return drawn


def _mirrored(draft: Draft, *points: Point) -> list[Point]:
    """Turn an arrangement over, along x, y or both, as drawn: else all of a topology would lie alike."""
    sx, sy = draft.pick([(1, 1), (-1, 1), (1, -1), (-1, -1)], "mirrored")
    return [(round(sx * x, 2), round(sy * y, 2)) for x, y in points]


def _straight(draft: Draft, paths: dict[str, list[Point]]) -> list[Way]:
    return streets(draft, [*paths.values()], [shapely.LineString(path) for path in paths.values()])


def _green(draft: Draft, box: Box) -> list[Pose]:
    """Lay out a common green with crossing paths; gives where landmarks may stand on it."""
    x, y = box.middle
    draft.take(box.grown(-1.0).shape().difference(box.grown(-2.0).shape()))
    draft.paint(box.rounded(), draft.material("green"))
    lines = [[[box.x0, box.y0], [x, y], [box.x1, box.y1]], [[box.x0, box.y1], [x, y], [box.x1, box.y0]]]
    path = draft.material("path")
    draft.paint([{"ribbon": [[round(u, 2), round(v, 2)] for u, v in line], "width_m": 1.6} for line in lines], path)
    draft.paint({"disc": [round(x, 2), round(y, 2), 5.6]}, path)
    ways = [shapely.LineString(line).buffer(1.1) for line in lines]
    for u, v in box.grown(-2.5).grid(4.2):
        spot = shapely.Point(u, v)
        if spot.distance(shapely.Point(x, y)) > 7.4 and not any(way.intersects(spot.buffer(1.5)) for way in ways):
            draft.slot("green", u, v, round(towards((u, v), (x, y)) / 90) * 90.0, (3.9, 3.9))
    return [(round(x, 2), round(y, 2), draft.pick(SIDES, "green"))]


def _culdesac(draft: Draft, w: float, d: float) -> Layout:
    radius, road = draft.number(9.4, 11.0, "radius"), -d + draft.number(7.5, 12.0, "road")
    x, y = draft.number(-w / 6, w / 6, "lane"), d - radius - draft.number(21.0, 24.0, "head")
    points = _mirrored(draft, (-w, road), (w, road), (x, road), (x, y), (x, y + 1.0))
    (cx, cy), up = points[3], points[4][1] - points[3][1]
    draft.paint({"disc": [cx, cy, radius + 1.8]}, draft.material("pavement"), rise_m=0.12)
    ways = _straight(draft, {"road": points[:2], "lane": [points[2], (cx, cy - up * (radius - 1.0))]})
    street = draft.material("street")
    draft.paint([{"disc": [cx, cy, radius]}, {"ribbon": [points[2], (cx, cy)], "width_m": 6.0}], street)
    draft.paint({"disc": [cx, cy, 4.9]}, draft.material("green"), rise_m=0.12)
    ring = shapely.Point(cx, cy).buffer(radius + 0.4).difference(shapely.Point(cx, cy).buffer(5.1))
    draft.take(ring)
    start = math.degrees(math.atan2(-up, 0.0)) + 14.0
    turns = [math.radians(start + k * 332.0 / 40) for k in range(41)]
    circle = shapely.LineString([(cx + radius * math.cos(t), cy + radius * math.sin(t)) for t in turns])
    for k, turn in enumerate(turns[3:-3:5]):
        at = ahead((cx, cy), math.degrees(turn), radius - 1.4)
        draft.slot("circle", *at, math.degrees(turn) + (90.0 if k % 2 else -90.0), (5.2, 2.3))
    return [Way(circle, 2.1, False), ways[1], ways[0]], [(cx, cy, 0.0)]


def _village(draft: Draft, w: float, d: float) -> Layout:
    half_x, half_y = draft.number(16.0, 19.0, "green_x"), draft.number(13.0, 15.0, "green_y")
    x = draft.number(-w / 3, w / 3, "link")
    x = min(max(x, -half_x), half_x)
    link = _mirrored(draft, (x, half_y), (x, d))
    green = Box(-half_x, -half_y, half_x, half_y)
    ring = [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y), (-half_x, -half_y)]
    ways = _straight(draft, {"ring": ring, "link": link})
    sides = [Way(shapely.LineString(ring[k : k + 2])) for k in range(4)]
    return [*sides, ways[1]], _green(draft, green.grown(-HALF_M - 0.3))


def _crossroads(draft: Draft, w: float, d: float) -> Layout:
    x, y = draft.number(-w / 5, w / 5, "x"), draft.number(-d / 5, d / 5, "y")
    ways = _straight(draft, {"street": [(-w, y), (w, y)], "road": [(x, -d), (x, d)]})
    draft.make("crossings", at=[[x - 8.0, y, 90.0, 6.0], [x + 8.0, y, 90.0, 6.0]], width_m=2.4)
    sx, sy = draft.pick([(1, 1), (-1, 1), (1, -1), (-1, -1)], "shop")
    x0, y0 = x + sx * (HALF_M + 3.0), y + sy * (HALF_M + 3.4)
    long, deep = draft.number(11, 15, "shop_long"), draft.number(9, 11, "shop_deep")
    shop = Box(*shapely.box(x0, y0, x0 + sx * long, y0 + sy * deep).bounds)
    draft.paint(shop.grown(2.9).rounded(), draft.material("pavement"), rise_m=0.12)
    storeys = draft.whole(1, 2, "shop_storeys")
    block_building(draft, shop, "shop", storeys=storeys, street_deg=270.0 if sy > 0 else 90.0, category="corner_shop")
    draft.take(shop.grown(2.9).shape())
    green = Box.about(x - sx * (HALF_M + 9.5), y - sy * (HALF_M + 9.0), 18.0, 17.0)
    spots = _green(draft, green)
    draft.take(green.shape().difference(shapely.Point(green.middle).buffer(6.0)))
    return ways, spots


def _crescent(draft: Draft, w: float, d: float) -> Layout:
    ends = _mirrored(draft, (-w, -d + draft.number(16, 24, "west")), (w, d - draft.number(16, 24, "east")))
    line = winding(draft, "crescent", (ends[0], ends[1]), 9.0, 2)
    middle = line.interpolate(line.length * draft.number(0.4, 0.6, "link"))
    side = draft.pick([-1, 1], "side")
    link = [(round(middle.x, 1), round(middle.y, 1)), (round(middle.x + draft.number(-6, 6, "lean"), 1), side * d)]
    return streets(draft, ["crescent", link], [line, shapely.LineString(link)]), []


def _terraces(draft: Draft, w: float, d: float) -> Layout:
    y = -d + HALF_M + 20.5
    other = d - HALF_M - draft.number(17.0, 20.5, "other")
    x = draft.number(-6.0, 6.0, "cross")
    points = _mirrored(draft, (-w, y), (w, y), (-w, other), (w, other), (x, y), (x, other))
    ways = _straight(draft, {"terraces": points[:2], "houses": points[2:4], "cross": points[4:]})
    y, up = points[0][1], 1.0 if points[2][1] > points[0][1] else -1.0
    used: Counter[tuple[str, str]] = Counter()
    for side in (up, -up):
        at, gap = (points[4][0], HALF_M + 1.5) if side == up else (0.0, 2.0)
        for end in (-1, 1):
            n = min(int((w - 2.5 - end * at - gap) // 6.4), 5)
            middle = (round(at + end * (gap + n * 3.2), 2), round(y + side * (HALF_M + 7.9), 2))
            whose = f"{'north' if side > 0 else 'south'}-{'west' if end < 0 else 'east'} terrace"
            _terrace(draft, middle, -90.0 * side, n, whose, used)
    return [ways[1], ways[2], ways[0]], []


def _terrace(
    draft: Draft, at: Point, yaw: float, n: int, name: str, used: Counter[tuple[str, str]]
) -> None:  # fmt: skip
    roles = _colours(draft, name)[:n]
    roof, storeys = draft.material("roof", name), max(2, round(draft.knob("storeys")))
    houses = [
        {
            "colour": role.removeprefix("house_").replace("_", " "), "wall": draft.material(role), "roof": roof,
            "door": draft.material("door", name, role), "storeys": storeys, "chimney": draft.chance(0.6, name, role),
            "front": (_draw_categories(draft, "front garden", 1, (name, k), used) or [""])[0],
            "back": (_draw_categories(draft, "back garden", 1, (name, k), used) or [""])[0],
        }
        for k, role in enumerate(roles)
    ]  # fmt: skip
    houses = [{key: value for key, value in house.items() if value != ""} for house in houses]
    draft.make("terrace", at=at, yaw_deg=yaw, houses=houses, name=name, pitch_m=6.4)
    half, behind, before = n * 3.2 + 0.5, 10.4, 7.6
    y0, y1 = (at[1] - before, at[1] + behind) if yaw < 0 else (at[1] - behind, at[1] + before)
    draft.take(shapely.box(at[0] - half, y0, at[0] + half, y1))


def _courts(draft: Draft, w: float, d: float) -> Layout:
    road = -d + draft.number(6.5, 8.0, "road")
    ways = _straight(draft, {"road": [(-w, road), (w, road)]})
    walks = []
    for k, x in enumerate((-w / 2, w / 2)):
        path = [(round(x, 1), road + HALF_M), (round(x + draft.number(-3, 3, k), 1), d - 6.0)]
        draft.paint({"ribbon": path, "width_m": 2.4}, draft.material("path"))
        draft.paint({"disc": [*path[1], 5.2]}, draft.material("path"))
        line = shapely.LineString(path)
        draft.take(line.buffer(1.5, cap_style="flat"))
        for n in range(int(line.length // 5)):
            p, side = line.interpolate(4.0 + 5.0 * n), 1 if n % 2 else -1
            draft.slot("walk", p.x + side * 2.2, p.y, 90.0 + side * 90.0, (1.3, 3.0))
        walks.append(Way(line, 3.2, False))
    spots = [(w / 2 * s, d - 6.0, 270.0) for s in (-1, 1)]
    return [*walks, *ways], spots


_TOPOLOGIES = {
    "culdesac": _culdesac, "village": _village, "crossroads": _crossroads, "crescent": _crescent,
    "terraces": _terraces, "courts": _courts,
}  # fmt: skip
