"""Estates: blocks of flats about gardens, courts and playgrounds, streets with parked cars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.blocks import lane_streets
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, Pose, ahead, beside, point, pose_on, towards
from aerialdojo_gen.scenes.worlds.wilds import strewn, trees

_STOREY_M, _PITCH_M = 3.2, 6.4  # Of flats and of their balconies
_NAMES = "ABCDEFGHIJKL"


class _Estate(NamedTuple):
    """What a topology gives to the stages after it."""

    flats: list[tuple[Pose, float]]  # Middle, where the front looks, and length
    lanes: list[Box]
    bays: list[tuple[Point, float, int]]  # Parking rows: middle, direction out of the bays, and number
    middle: Point  # Of the garden, which paths lead to


def write(draft: Draft) -> None:
    """Lay streets and bays, put up flats, then lead paths from their fronts through the garden, and fill slots."""
    estate = _TOPOLOGIES[draft.topology](draft, *draft.half)
    draft.section("Streets and parking bays")
    lane_streets(draft, estate.lanes)
    for lane in estate.lanes:
        draft.take(lane.shape())
    for at, yaw, count in estate.bays:
        _bays(draft, at, yaw, count)
    draft.section("The flats")
    fronts = [_flats(draft, pose, long, k) for k, (pose, long) in enumerate(estate.flats)]
    if sum(front is not None for front in fronts) < 2:
        raise NoRoomError("room for few flats")
    middle = estate.middle
    draft.section("Landmarks")
    draft.landmark([(*middle, draft.pick(SIDES, "landmark"))])
    draft.section("The garden")
    _paths(draft, [front for front in fronts if front is not None], middle)
    draft.section("Landmarks")
    near = sorted(
        draft.site.grown(-6).grid(5.0), key=lambda p: math.dist(p, middle) + draft.number(0, 10, "near", *p)
    )
    spots = [(*p, draft.pick(SIDES, "landmark", *p)) for p in near]
    for what in draft.shuffled(draft.kind.landmarks, "landmarks"):  # Else the narrowest would have all gaps
        draft.landmark(spots, of=[what])
    _courts(draft, middle)
    strewn(draft, "garden", 44, (3.8, 3.8), 3.0)
    draft.fill_slots()
    draft.section("Trees")
    trees(draft, draft.site.grown(-2).rounded(), 7, round(draft.knob("trees")), "trees", fit="skip")


def _bays(draft: Draft, at: Point, yaw: float, count: int) -> None:
    """Pave a row of parking bays, with cars in some; nothing where the ground is taken."""
    half = count * 1.3
    row = ((0.0, -half), (0.0, half), (-5.2, half), (-5.2, -half))
    area = shapely.Polygon([ahead(at, yaw, u, v) for u, v in row])
    if not draft.is_free(area.buffer(-0.1)):
        return
    draft.paint([round(v, 2) for v in area.bounds], draft.material("street"))
    rows = [[round(at[0], 2), round(at[1], 2), yaw, count]]
    draft.make("parking_rows", rows=rows, occupancy=draft.knob("occupancy"))
    draft.take(area)


def _flats(draft: Draft, pose: Pose, long_m: float, k: int) -> Point | None:
    """Put up a block of flats, with things on its roof, balconies, before and behind it; gives its door's place."""
    deep = draft.number(9.5, 11.5, "deep", k)
    body = shapely.Polygon(
        [beside(pose, u * deep / 2, v * long_m / 2) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    if not draft.is_free(body.buffer(1.0)):
        return None
    storeys, name = max(3, round(draft.knob("storeys")) - draft.whole(0, 2, "storeys", k)), f"block {_NAMES[k % 12]}"
    draft.make(
        "flats", at=pose[:2], yaw_deg=pose[2], size_m=[long_m, deep], storeys=storeys, name=name,
        wall=draft.material("wall", k), band=draft.material("band", k), paving=draft.material("plaza"),
        **{"as": f"roof_{k}"},
    )  # fmt: skip
    draft.take(body.buffer(0.5))
    for j in range(3):
        draft.slot("roof", *beside(pose, 0.0, (j - 1) * long_m * 0.3), pose[2], (4.6, 4.6), on=f"roof_{k}")
    bays = int((long_m - 2.0) // _PITCH_M)
    for j in range(bays):
        for floor in range(1, storeys):
            if draft.chance(0.16, "balcony", k, j, floor):
                at = beside(pose, deep / 2 + 0.8, (j - (bays - 1) / 2) * _PITCH_M)
                draft.slot("balcony", *at, pose[2], (1.5, 2.8), on=round(floor * _STOREY_M, 1))
    for j in range(int(long_m // 5.0)):
        v = (j + 0.5) * 5.0 - long_m / 2
        if abs(v) > 4.5:
            draft.slot("front", *beside(pose, deep / 2 + 2.6, v), pose[2], (2.2, 3.4))
            draft.slot("back", *beside(pose, -deep / 2 - 1.9, v), pose[2] + 180.0, (2.4, 4.4))
    apron = ((0.0, -1), (4.0, -1), (4.0, 1), (0.0, 1))
    draft.take(shapely.Polygon([beside(pose, deep / 2 + u, v * long_m / 2) for u, v in apron]))
    return beside(pose, deep / 2 + 4.2, 0.0)


def _paths(draft: Draft, fronts: Sequence[Point], middle: Point) -> None:
    """Lead paths from the doors to the middle of the garden, benches beside them."""
    path, radius = draft.material("path"), draft.number(5.5, 8.0, "plaza")
    lines = [shapely.LineString([front, middle]) for front in fronts]
    draft.paint([{"ribbon": [front, middle], "width_m": 2.2, "round_ends": True} for front in fronts], path)
    draft.paint({"disc": [*middle, radius]}, draft.material("plaza"))
    for n, line in enumerate(lines):
        for k in range(int((line.length - radius) // 6.0)):
            x, y, yaw = pose_on(line, 3.0 + 6.0 * k, 1 if (k + n) % 2 else -1, 2.3)
            if draft.has_room(x, y, 1.0):
                draft.slot("path", x, y, yaw, (2.0, 2.6))
    for line in lines:
        draft.take(line.buffer(1.5))
    for k in range(8):
        draft.slot("plaza", *ahead(middle, 45.0 * k, radius - 1.0), 45.0 * k + 180.0, (2.2, 2.8))


def _courts(draft: Draft, middle: Point) -> None:
    """Lay out a ball court, a playground and a bed of vegetables where there is room, near the middle."""
    for kind, wide, deep in (("court", 18.0, 12.0), ("play", 15.0, 12.0), ("beds", 12.0, 9.0)):
        if draft.chance(0.5, kind):
            wide, deep = deep, wide
        spots = draft.shuffled([(8.0 * i, 7.0 * j) for i in range(-6, 7) for j in range(-6, 7)], kind)
        for x, y in sorted(spots, key=lambda p: math.hypot(*p) + draft.number(0, 22, kind, *p)):
            box = Box.about(*point(middle[0] + x, middle[1] + y), wide, deep)
            if draft.is_free(box.shape()):
                _court(draft, kind, box)
                draft.take(box.grown(0.4).shape())
                break


def _court(draft: Draft, kind: str, box: Box) -> None:
    if kind == "beds":
        draft.paint(box.rounded(), draft.material("path"))
        at = [[round(x, 2), round(y, 2)] for x, y in box.grown(-1.2).grid(3.9)]
        draft.make("vegetable_beds", at=at[::2], greens=["foliage:#4f7f38", "foliage:#a8b860", "foliage:#8a4a5a"])
        for x, y in at[1::2]:
            draft.slot("allotment", x, y, draft.pick(SIDES, "bed", x, y), (3.4, 3.4))
        return
    draft.paint(box.rounded(), draft.material(kind))
    if kind == "play":
        for x, y in box.grid(5.6):
            draft.slot("play", x, y, draft.number(0, 360, "play", x, y), (5.6, 4.6))
        return
    x, y = box.middle
    ring = {"disc": [round(x, 2), round(y, 2), 1.8]}
    draft.make("outline_marks", areas=[box.grown(-0.6).rounded(), ring], width_m=0.1)
    out = max(box.width, box.depth) / 2 - 1.4
    for side, yaw in ((-1, 0.0), (1, 180.0)):
        if box.upright:
            draft.slot("hoop", x, y + side * out, yaw + 90.0, (4.2, 7.6))
        else:
            draft.slot("hoop", x + side * out, y, yaw, (4.2, 7.6))


def _court_estate(draft: Draft, w: float, d: float) -> _Estate:
    """Blocks about a garden, a street around it all at three sides."""
    lanes = [Box(-w, -d + 1, w, -d + 9.8), Box(-w, -d + 9.8, -w + 8.8, d)]
    x0, y0 = -w + 16.5, -d + 17.5
    long = draft.number(28, 34, "long")
    flats = [((x0 + 8 + long / 2, y0, 90.0), long), ((w - 8.0, 0.06 * d, 180.0), min(1.1 * d, 40.0)),
             ((0.25 * w, d - 8.0, 270.0), long), ((x0, 0.25 * d, 0.0), min(0.9 * d, 34.0))]  # fmt: skip
    bays = [((-0.2 * w + 21 * k, -d + 15.0), 270.0, 5) for k in range(-1, 3)]
    return _Estate(flats, lanes, bays, point(0.12 * w, 0.1 * d))


def _rows(draft: Draft, w: float, d: float) -> _Estate:
    """Blocks in parallel with greens between them, bays along the street that joins them."""
    lanes = [Box(-w, -d + 1, -w + 8.8, d)]
    flats, bays, y, k = [], [], -d + 8.0, 0
    while y < d - 6.0:
        long = draft.number(30, 38, "long", k)
        x = -w + 17 + long / 2 + draft.number(0, 6, "in", k)
        flats.append(((x, y, 90.0), long))
        if x + long / 2 + 26 < w:
            flats.append(((x + long / 2 + 6 + 13, y + draft.number(-1, 1, "off", k), 90.0), 24.0))
        bays.append(((-w + 14.0, y + 12.0), 180.0, 4))
        y, k = y + draft.number(22, 27, "pitch", k), k + 1
    return _Estate(flats, lanes, bays, point(0.35 * w, -d + 8 + 12.5))


def _comb(draft: Draft, w: float, d: float) -> _Estate:
    """A street from end to end, blocks at right angles to it on both sides."""
    y = draft.number(-0.15, 0.15, "street") * d
    lanes = [Box(-w, y - 4.4, w, y + 4.4)]
    flats, bays = [], []
    for side in (-1, 1):
        room = d - 6.0 - side * y
        x, k = -w + 10.0 + draft.number(0, 6, "first", side), 0
        while x < w - 8.0 and room > 26.0:
            long = min(draft.number(22, 32, "long", side, k), room - 6.0)
            flats.append(((x, y + side * (8.5 + long / 2), 0.0 if k % 2 == 0 else 180.0), long))
            if k % 2:
                bays.append(((x - 13.0, y + side * 9.8), 270.0 if side > 0 else 90.0, 5))
            x, k = x + draft.number(25, 30, "pitch", side, k), k + 1
    garden = point(draft.number(-0.3, 0.3, "mid") * w, y + 0.6 * d * draft.pick([-1, 1], "garden"))
    return _Estate(flats, lanes, bays, garden)


def _crescent(draft: Draft, w: float, d: float) -> _Estate:
    """Blocks along a bow that opens to a street."""
    lanes = [Box(-w, -d + 1, w, -d + 9.8)]
    cx, cy, radius = draft.number(-0.1, 0.1, "x") * w, -0.42 * d, min(0.72 * w, 1.22 * d)
    flats = []
    n = draft.whole(4, 5, "blocks")
    for k in range(n):
        turn = math.radians(18 + 144 / (n - 1) * k)
        at = point(cx + radius * math.cos(turn), cy + radius * math.sin(turn))
        flats.append(((*at, math.degrees(turn) + 180.0), draft.number(20, 25, "long", k)))
    bays = [((cx + 21.0 * k, -d + 15.0), 270.0, 6) for k in (-1, 0, 1)]
    return _Estate(flats, lanes, bays, point(cx, cy + 0.45 * radius))


def _towers(draft: Draft, w: float, d: float) -> _Estate:
    """Short high blocks that stand about a park, turned as they please, streets at two sides."""
    lanes = [Box(-w, -d + 1, w, -d + 9.8), Box(w - 9.8, -d + 9.8, w - 1, d)]
    spots = [(-0.65, -0.35), (0.05, -0.4), (-0.7, 0.45), (-0.1, 0.72), (0.5, 0.5), (0.5, -0.25)]
    flats = []
    for k, (u, v) in enumerate(spots):
        at = point(u * w + draft.number(-3, 3, "x", k), v * d + draft.number(-2, 2, "y", k))
        yaw = towards(at, (0.0, 0.0)) + draft.number(-20, 20, "yaw", k)
        flats.append(((*at, yaw), draft.number(16, 20, "long", k)))
    bays = [((-0.5 * w + 22.0 * k, -d + 15.0), 270.0, 5) for k in range(3)]
    return _Estate(flats, lanes, bays, point(-0.1 * w, 0.08 * d))


_TOPOLOGIES = {
    "court": _court_estate, "rows": _rows, "comb": _comb, "crescent": _crescent, "towers": _towers,
}  # fmt: skip
