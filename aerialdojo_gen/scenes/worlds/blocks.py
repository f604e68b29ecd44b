"""Stages of built-up ground: blocks with lanes between them, houses on them, what stands and hangs at their walls."""

from __future__ import annotations

import math
from collections.abc import Sequence

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.streets import Box, grid

Point = tuple[float, float]
SIDES = (0.0, 90.0, 180.0, 270.0)


def split(draft: Draft, box: Box, lane_m: Point, size_m: Point, *key: object) -> tuple[list[Box], list[Box]]:
    """Split ground into blocks, and the lanes between them; blocks are of `size_m`, the least and the most."""
    wide = box.width >= box.depth
    length, (least, most) = (box.width if wide else box.depth), size_m
    lane = draft.number(*lane_m, "lane", *key)
    if length <= most or length < 2.0 * least + lane:
        return [box], []
    low = max(least, 0.34 * length)
    at = draft.number(low, max(low, length - lane - low), "cut", *key)
    if wide:
        parts = [Box(box.x0, box.y0, box.x0 + at, box.y1), Box(box.x0 + at + lane, box.y0, box.x1, box.y1)]
        between = Box(box.x0 + at, box.y0, box.x0 + at + lane, box.y1)
    else:
        parts = [Box(box.x0, box.y0, box.x1, box.y0 + at), Box(box.x0, box.y0 + at + lane, box.x1, box.y1)]
        between = Box(box.x0, box.y0 + at, box.x1, box.y0 + at + lane)
    blocks, lanes = [], [between]
    for k, part in enumerate(parts):
        more, ways = split(draft, part, lane_m, size_m, *key, k)
        blocks += more
        lanes += ways
    return blocks, lanes


def side_of(box: Box, yaw: float, out_m: float = 0.0) -> tuple[Point, Point, float]:
    """Middle of a rectangle's side that looks along a direction of the four, the unit vector along it, its length."""
    x, y = box.middle
    out = {0: (box.x1 + out_m, y), 90: (x, box.y1 + out_m), 180: (box.x0 - out_m, y), 270: (x, box.y0 - out_m)}
    upright = round(yaw) % 180 == 0
    return out[round(yaw) % 360], ((0.0, 1.0) if upright else (1.0, 0.0)), box.depth if upright else box.width


def inner_sides(draft: Draft, box: Box, margin_m: float = 2.5) -> list[float]:
    """Sides of a rectangle that do not lie at the site's edge."""
    w, d = draft.width_m / 2 - margin_m, draft.depth_m / 2 - margin_m
    clear = {0.0: box.x1 < w, 90.0: box.y1 < d, 180.0: box.x0 > -w, 270.0: box.y0 > -d}
    return [yaw for yaw in SIDES if clear[yaw]]


def town_house(draft: Draft, box: Box, name: str, storeys: int, category: str = "town_house") -> None:
    """Put up a house on a block, with things on its roof where that is flat."""
    flat = draft.chance(0.65, name, "flat")
    arguments = {
        "outline": box.rounded(), "wall": draft.material("wall", name), "storeys": storeys, "storey_m": 3.0,
        "roof": draft.material("flat_roof" if flat else "roof", name), "on": 0, "category": category,
        "as": f"{name}_top", "overhang_m": 0.25,
    }  # fmt: skip
    if not flat:
        kind = draft.pick(["gable", "hip"], name, "kind")
        arguments |= {"roof_kind": kind, "roof_m": draft.number(1.8, 2.8, name, "roof_m")}
    draft.make("building", **arguments)
    draft.take(box.shape())
    if flat:
        for x, y in grid(box.grown(-1.6), 4.2):
            draft.slot("roof", x, y, draft.pick(SIDES, name, x, y), (3.4, 3.4), on=f"{name}_top")


def dressed(draft: Draft, box: Box, name: str, storeys: int, sides: Sequence[float], shops: float = 0.4) -> None:
    """Offer slots at a house's walls (``shop``, ``sign``, ``lane``); hang awnings, balconies and fire escapes."""
    awnings, escapes, balconies = [], [], []
    for yaw in sides:
        (x, y), (u, v), length = side_of(box, yaw)
        c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
        n = int(length // 6.6)
        for k in range(n):
            off = (k - (n - 1) / 2) * (length / n)
            at = round(x + u * off, 2), round(y + v * off, 2)
            drawn = float(draft.rng("wall", name, yaw, k).random())
            if drawn < shops:
                draft.slot("shop", *at, yaw, (1.4, 6.2), on=0.0)
                continue
            for f in (-1.6, 1.6):
                draft.slot("lane", at[0] + u * f + c * 1.35, at[1] + v * f + s * 1.35, yaw, (2.1, 3.0))
            if drawn > 0.92 and storeys > 2:
                escapes.append([*at, yaw])
            elif drawn > 0.8:
                awnings.append([*at, yaw])
            elif storeys > 1 and draft.chance(0.4, "balcony", name, yaw, k):
                thing = draft.pick([*draft.kind.slots["balcony"].of], "balcony", name, yaw, k, "thing")
                high = 3.0 * draft.whole(1, storeys - 1, "balcony", name, yaw, k, "high")
                balconies.append({"at": list(at), "yaw_deg": yaw, "z_m": high, "thing": thing, "width_m": 3.4})
            else:
                draft.slot("sign", *at, yaw, (2.6, 2.0), on=3.6)
    if awnings:
        cloths = draft.shuffled(["stripes:#b8322c", "stripes:#2f6f5a", "fabric:#d9a441", "stripes:#3f6fa8"], name)[:2]
        draft.make("awnings", at=awnings, cloths=cloths, width_m=3.2)
    if escapes:
        draft.make("fire_escapes", at=escapes, storeys=storeys, storey_m=3.0)
    if balconies:
        draft.make("balconies", on_walls=balconies, depth_m=1.5)


def strung(draft: Draft, lanes: Sequence[Box], houses: Sequence[Box], z_m: float = 5.6) -> None:
    """Hang washing and lights across lanes, from house to house."""
    walls = shapely.union_all([house.shape() for house in houses])
    washing: list[list[float]] = []
    lights: list[list[float]] = []
    for lane in lanes:
        upright = lane.depth > lane.width
        for k in range(int(max(lane.width, lane.depth) // 9.0)):
            at = draft.number(3.0, 7.0, "across", lane.x0, lane.y0, k) + 9.0 * k
            if upright:
                ends = [lane.x0 - 0.02, lane.y0 + at, lane.x1 + 0.02, lane.y0 + at + 0.3]
            else:
                ends = [lane.x0 + at, lane.y0 - 0.02, lane.x0 + at + 0.3, lane.y1 + 0.02]
            if not all(walls.buffer(0.05).contains(shapely.Point(*end)) for end in (ends[:2], ends[2:])):
                continue
            rope = [*(round(e, 2) for e in ends), round(z_m - draft.number(0.0, 0.9, "across", "z", *ends), 2)]
            (washing if draft.chance(0.5, "washing", *ends) else lights).append(rope)
    if washing:
        draft.make("washing_lines", across=washing)
    if lights:
        draft.make("light_strings", across=lights)


def square(draft: Draft, box: Box, kind: str = "square", step_m: float = 3.5) -> Point:
    """Pave a square, and offer slots on it, its middle left free; gives the middle."""
    draft.paint(box.rounded(), draft.material("square", box.x0, box.y0), rise_m=0.12)
    x, y = box.middle
    for u, v in grid(box.grown(-1.4), step_m):
        if math.hypot(u - x, v - y) > 4.4:
            yaw = round(math.degrees(math.atan2(y - v, x - u)) / 90.0) * 90.0
            draft.slot(kind, u, v, yaw, (3.3, 3.3))
    return round(x, 2), round(y, 2)


def lane_streets(draft: Draft, lanes: Sequence[Box], lane_m: float = 2.8, pavement_m: float = 1.6) -> None:
    """Pave the lanes between blocks as streets; offer slots on them (``road``) and at their kerbs (``kerb``)."""
    paths, w, d = [], draft.width_m / 2, draft.depth_m / 2
    for lane in lanes:
        x, y = lane.middle
        more = lane_m + pavement_m
        if lane.depth > lane.width:
            low, high = (lane.y0 - more, lane.y1 + more)
            paths.append([[round(x, 2), round(max(low, -d), 2)], [round(x, 2), round(min(high, d), 2)]])
        else:
            low, high = (lane.x0 - more, lane.x1 + more)
            paths.append([[round(max(low, -w), 2), round(y, 2)], [round(min(high, w), 2), round(y, 2)]])
    draft.make(
        "streets", paths=paths, lane_m=lane_m, pavement_m=pavement_m, surface=draft.material("street"),
        pavement=draft.material("pavement"),
    )  # fmt: skip
    for lane in lanes:
        x, y = lane.middle
        upright = lane.depth > lane.width
        length, start = (lane.depth, lane.y0) if upright else (lane.width, lane.x0)
        for k in range(int(length // 6.0)):
            at = start + 3.0 + 6.0 * k
            for side in (-1, 1):
                road, kerb = side * lane_m / 2, side * (lane_m + pavement_m - 0.85)
                yaw = (90.0 if side > 0 else 270.0) if upright else (180.0 if side > 0 else 0.0)
                if k % 2 == (side > 0):
                    draft.slot("road", *((x + road, at) if upright else (at, y + road)), yaw, (9.5, 2.9))
                draft.slot("kerb", *((x + kerb, at) if upright else (at, y + kerb)), yaw + 90.0, (1.6, 4.6))
