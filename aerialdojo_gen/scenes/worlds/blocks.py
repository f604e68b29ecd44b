"""Stages of built-up ground: blocks with lanes between them, layouts of towns, houses, what hangs at their walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point


def split(draft: Draft, box: Box, lane_m: Point, size_m: Point, *key: object) -> tuple[list[Box], list[Box]]:
    """Split ground into blocks, and the lanes between them; blocks are of `size_m`, the least and the most."""
    length, (least, most) = max(box.width, box.depth), size_m
    lane = draft.number(*lane_m, "lane", *key)
    if length <= most or length < 2.0 * least + lane:
        return [box], []
    low = max(least, 0.34 * length)
    at = draft.number(low, max(low, length - lane - low), "cut", *key)
    if box.upright:
        first, last = box._replace(y1=box.y0 + at), box._replace(y0=box.y0 + at + lane)
        between = box._replace(y0=first.y1, y1=last.y0)
    else:
        first, last = box._replace(x1=box.x0 + at), box._replace(x0=box.x0 + at + lane)
        between = box._replace(x0=first.x1, x1=last.x0)
    blocks, lanes = split_all(draft, [first, last], lane_m, size_m, *key)
    return blocks, [between, *lanes]


def split_all(
    draft: Draft, areas: Sequence[Box], lane_m: Point, size_m: Point, *key: object
) -> tuple[list[Box], list[Box]]:  # fmt: skip
    """Split several areas, as `split` does one."""
    parts = [split(draft, area, lane_m, size_m, *key, k) for k, area in enumerate(areas)]
    return [block for blocks, _ in parts for block in blocks], [lane for _, lanes in parts for lane in lanes]


def fence_lines(box: Box, gate_x: float, half_m: float) -> list[list[list[float]]]:
    """Lines round a box, as plans write them, with a gate in its south side, the first two beside it."""
    x0, y0, x1, y1 = box
    ends = [(gate_x + half_m, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    runs = [((x0, y0), (gate_x - half_m, y0)), *pairwise(ends)]
    return [[[round(x, 2), round(y, 2)] for x, y in run] for run in runs]


def ring(outer: Box, inner: Box) -> list[Box]:
    """Ground between a box and one in it, in four boxes; those in the south and the north reach from side to side."""
    return [outer._replace(y1=inner.y0), outer._replace(y0=inner.y1),
            Box(outer.x0, inner.y0, inner.x0, inner.y1), Box(inner.x1, inner.y0, outer.x1, inner.y1)]  # fmt: skip


def inner_sides(draft: Draft, box: Box) -> list[float]:
    """Sides of a rectangle that do not lie at the site's edge."""
    inner = draft.site.grown(-2.5)
    clear = (box.x1 < inner.x1, box.y1 < inner.y1, box.x0 > inner.x0, box.y0 > inner.y0)
    return [yaw for yaw, is_clear in zip(SIDES, clear, strict=True) if is_clear]


def town_house(draft: Draft, box: Box, name: str, storeys: int) -> None:
    """Put up a house on a block, with things on its roof where that is flat."""
    flat = draft.chance(0.65, name, "flat")
    arguments = {
        "outline": box.rounded(), "wall": draft.material("wall", name), "storeys": storeys, "storey_m": 3.0,
        "roof": draft.material("flat_roof" if flat else "roof", name), "on": 0, "category": "town_house",
        "as": f"{name}_top", "overhang_m": 0.25,
    }  # fmt: skip
    if not flat:
        kind = draft.pick(["gable", "hip"], name, "kind")
        arguments |= {"roof_kind": kind, "roof_m": draft.number(1.8, 2.8, name, "roof_m")}
    draft.make("building", **arguments)
    draft.take(box.shape())
    if flat:
        draft.slots_over("roof", box.grown(-1.6), 4.2, (3.4, 3.4), name, on=f"{name}_top")


def dressed(draft: Draft, box: Box, name: str, storeys: int, sides: Sequence[float], shops: float = 0.4) -> None:
    """Offer slots at a house's walls (``shop``, ``sign``, ``lane``); hang awnings, balconies and fire escapes."""
    awnings, escapes, balconies = [], [], []
    for yaw in sides:
        (x, y), (u, v), length = box.side(yaw)
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
    ropes: dict[str, list[list[float]]] = {"washing_lines": [], "light_strings": []}
    for lane in lanes:
        for k in range(int(max(lane.width, lane.depth) // 9.0)):
            at = draft.number(3.0, 7.0, "across", lane.x0, lane.y0, k) + 9.0 * k
            if lane.upright:
                ends = [lane.x0 - 0.02, lane.y0 + at, lane.x1 + 0.02, lane.y0 + at + 0.3]
            else:
                ends = [lane.x0 + at, lane.y0 - 0.02, lane.x0 + at + 0.3, lane.y1 + 0.02]
            if not all(walls.buffer(0.05).contains(shapely.Point(*end)) for end in (ends[:2], ends[2:])):
                continue
            rope = [*(round(e, 2) for e in ends), round(z_m - draft.number(0.0, 0.9, "across", "z", *ends), 2)]
            ropes["washing_lines" if draft.chance(0.5, "washing", *ends) else "light_strings"].append(rope)
    for builder, across in ropes.items():
        if across:
            draft.make(builder, across=across)


def square(draft: Draft, box: Box) -> Point:
    """Pave a square, and offer slots on it, its middle left free; gives the middle."""
    draft.paint(box.rounded(), draft.material("square", box.x0, box.y0), rise_m=0.12)
    x, y = box.middle
    for u, v in box.grown(-1.4).grid(3.5):
        if math.hypot(u - x, v - y) > 4.4:
            yaw = round(math.degrees(math.atan2(y - v, x - u)) / 90.0) * 90.0
            draft.slot("square", u, v, yaw, (3.3, 3.3))
    return round(x, 2), round(y, 2)


def lane_streets(draft: Draft, lanes: Sequence[Box]) -> None:
    """Pave the lanes between blocks as streets; offer slots on them (``road``) and at their kerbs (``kerb``)."""
    paths, (w, d), lane_m, pavement_m = [], draft.half, 2.8, 1.6
    for lane in lanes:
        x, y = lane.middle
        x0, y0, x1, y1 = lane.grown(lane_m + pavement_m)
        ends = ((x, max(y0, -d)), (x, min(y1, d))) if lane.upright else ((max(x0, -w), y), (min(x1, w), y))
        paths.append([[round(u, 2), round(v, 2)] for u, v in ends])
    draft.make(
        "streets", paths=paths, lane_m=lane_m, pavement_m=pavement_m, surface=draft.material("street"),
        pavement=draft.material("pavement"),
    )  # fmt: skip
    for lane in lanes:
        (x, y), upright = lane.middle, lane.upright
        for k in range(int(max(lane.width, lane.depth) // 6.0)):
            at = (lane.y0 if upright else lane.x0) + 3.0 + 6.0 * k
            for side in (-1, 1):
                road, kerb = side * lane_m / 2, side * (lane_m + pavement_m - 0.85)
                yaw = (90.0 if side > 0 else 270.0) if upright else (180.0 if side > 0 else 0.0)
                if k % 2 == (side > 0):
                    draft.slot("road", *((x + road, at) if upright else (at, y + road)), yaw, (9.5, 2.9))
                draft.slot("kerb", *((x + kerb, at) if upright else (at, y + kerb)), yaw + 90.0, (1.6, 4.6))


Layout = tuple[list[Box], list[Box], list[Box]]  # Lots, streets and open ground


def left_open(draft: Draft, blocks: list[Box], number: int) -> tuple[list[Box], list[Box]]:
    """Leave so many blocks open, those nearest to the middle of the site."""
    near = sorted(blocks, key=lambda b: abs(b.middle[0]) + abs(b.middle[1]) + draft.number(0, 12, "open", *b))
    return near[number:], near[:number]


def town(draft: Draft, w: float, d: float) -> Layout:
    """Blocks of uneven sizes between streets, some open."""
    blocks, lanes = split(draft, Box(-w, -d, w, d), (8.8, 8.8), (16.0, 30.0))
    lots, open_ = left_open(draft, blocks, 2)
    return lots, lanes, open_


def about_square(draft: Draft, w: float, d: float) -> Layout:
    """A square in the middle, streets into it, blocks about it."""
    half_x, half_y, lane = draft.number(15, 19, "x"), draft.number(12, 15, "y"), 8.8
    x0, y0, x1, y1 = -half_x, -half_y, half_x, half_y
    lanes = [Box(-w, y1, x1 + lane, y1 + lane), Box(x1, -d, x1 + lane, y1), Box(x0 - lane, y0 - lane, x1, y0),
             Box(x0 - lane, y0, x0, d)]  # fmt: skip
    areas = [Box(-w, y1 + lane, x0 - lane, d), Box(x0, y1 + lane, w, d), Box(x1 + lane, -d, w, y1 + lane),
             Box(-w, -d, x1, y0 - lane), Box(-w, y0 - lane, x0 - lane, y1)]  # fmt: skip
    parts = [(k, area) for k, area in enumerate(areas) if min(area.width, area.depth) > 9.0]
    lots = [lot for k, area in parts for lot in split(draft, area, (3.0, 4.5), (13.0, 30.0), k)[0]]
    return lots, lanes, [Box(x0, y0, x1, y1)]


def avenue(draft: Draft, w: float, d: float) -> Layout:
    """A street from end to end, blocks in rows at both sides, a park at one end."""
    y, lane = draft.number(-0.25, 0.25, "y") * d, 8.8
    at = draft.number(0.4, 0.55, "park") * w
    street, park = Box(-w, y - lane / 2, w, y + lane / 2), Box(at, -d, w, y - lane / 2)
    rows = [Box(-w, -d, at, street.y0), Box(-w, street.y1, w, d)]
    lots, lanes = split_all(draft, rows, (8.8, 8.8), (18.0, 34.0))
    lots, more = left_open(draft, lots, 1)
    return lots, [street, *lanes], [park, *more]


def estate(draft: Draft, w: float, d: float) -> Layout:
    """Long blocks of flats in parallel, greens between them, off one street."""
    lane, street = 8.8, draft.number(-0.9, -0.75, "street") * d + 4.4
    lanes = [Box(-w, street - lane / 2, w, street + lane / 2)]
    y, lots, open_, k = street + lane / 2, [], [], 0
    while y + 13.0 < d:
        end = draft.number(-2, 6, "end", k)
        lots.append(Box(-w + draft.number(2, 8, "in", k), y + 0.5, end, y + 13.0))
        lots.append(Box(end + draft.number(5, 9, "gap", k), y + 0.5, w - draft.number(2, 8, "out", k), y + 13.0))
        gap = draft.number(10, 14, "green", k)
        if y + 13.0 + gap < d:
            open_.append(Box(-w + 2.0, y + 13.5, w - 2.0, y + 13.0 + gap))
        y, k = y + 13.0 + gap, k + 1
    return lots, lanes, open_
