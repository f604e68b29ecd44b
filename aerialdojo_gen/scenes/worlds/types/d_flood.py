"""Floods: drowned streets, farms and towns, dykes and mounds that are dry, boats, and what drifts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.blocks import split
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, Pose, ahead, beside, point, pose_on, smoothed
from aerialdojo_gen.scenes.worlds.wilds import about, trees

_TRIMS = ["#f2efe6", "#5a3f2c", "#2f5a46"]
# Of the feet of what is afloat, of cars, and of what stands in gardens, over the water.
_HEIGHTS_M = {"moored": -0.12, "afloat": -0.12, "drowned": -0.55, "garden": -0.45}


class _Land(NamedTuple):
    """What a topology gives to the stages after it."""

    dykes: list[list[Point]]  # Lines of their crests
    mounds: list[tuple[Point, float]]  # Level dry places
    houses: list[Pose]  # With gables, up to their sills in water
    flats: list[tuple[Box, float]]  # With flat roofs, and where their fronts look
    currents: list[list[Point]]  # Where the water runs


def write(draft: Draft) -> None:
    """Raise dykes and mounds out of the water, drown houses, and set boats, tents and what drifts about them."""
    w, d = draft.half
    land = _TOPOLOGIES[draft.topology](draft, w, d)
    mounds = land.mounds
    draft.head["palette"] = {role: draft.material(role) for role in ("mud", "bank", "foam", "stain")}
    draft.step("water_level")
    _banks(draft, land)
    draft.section("Landmarks")
    draft.landmark([(*at, draft.number(0, 360, "landmark", *at)) for at, _ in draft.shuffled(mounds, "landmarks")])
    for at, radius in mounds:
        if radius > 8.0:
            about(draft, "mound", at, (radius - 3.0, radius - 1.6), 7, (7.0, 6.6))
        about(draft, "small", at, (radius - 2.6, radius - 1.0), 7, (2.6, 2.6))
        draft.take_disc(at, radius + 5.0)
    draft.section("Drowned houses")
    _houses(draft, land.houses)
    _flats(draft, land.flats)
    _water(draft, w, d)
    draft.fill_slots()
    _trees(draft)


def _banks(draft: Draft, land: _Land) -> None:
    mounds, high = land.mounds, draft.number(2.4, 3.6, "dyke")
    crests = [f"crest_{k}" for k in range(len(land.dykes))]
    for k, line in enumerate(land.dykes):
        draft.lines[f"dyke_{k}"] = {"points": line, "smooth": 3}
        draft.areas[f"crest_{k}"] = {"ribbon": f"dyke_{k}", "width_m": 4}
        draft.step("raise_bank", area=f"crest_{k}", to_m=high)
    for k, (at, radius) in enumerate(mounds):
        draft.areas[f"mound_{k}"] = {"disc": [*at, radius]}
        draft.step("raise_bank", area=f"mound_{k}", to_m=draft.number(0.8, 1.8, "mound", k), slope_m=4)
    draft.section("Water, banks and mounds")
    for line in land.currents:
        draft.make("streaks", paths=[line], width_m=draft.number(5, 9, "current"))
    for k in range(len(mounds)):
        draft.make("paint_island", area=f"mound_{k}", slope_m=4, way=draft.material("mound", k))
    if crests:
        draft.make("paint_bank", crests=crests, way=draft.material("track"))
    ways = [smoothed(line, 3) for line in land.dykes]
    for way in ways:
        for k in range(int((way.length - 6.0) // 7.0)):
            x, y, yaw = pose_on(way, 5.0 + 7.0 * k, 1, 0.0)
            draft.slot("dyke", x, y, yaw + 90.0, (9.0, 3.4))
        draft.take(way.buffer(8.8))
    for way in ways:
        for k in range(int((way.length - 6.0) // 9.0)):
            x, y, _ = pose_on(way, 7.0 + 9.0 * k, 1 if draft.chance(0.5, "dyke", k) else -1, 12.4)
            _wet(draft, "moored", (x, y), draft.number(0, 360, "moored", k))


def _wet(draft: Draft, kind: str, at: Point, yaw_deg: float) -> None:
    """Offer a slot in the water, at the height of its kind, where there is no bank and no house."""
    if draft.is_free(shapely.Point(at).buffer(2.7)):
        draft.slot(kind, *at, yaw_deg, (5.6, 4.6), on=_HEIGHTS_M[kind])


def _houses(draft: Draft, poses: Sequence[Pose]) -> None:
    built = 0
    for k, pose in enumerate(poses):
        wide, deep = draft.number(7.5, 10.5, "wide", k), draft.number(7.0, 8.6, "deep", k)
        body = shapely.Point(pose[:2]).buffer(0.5 * math.hypot(wide, deep))
        if not draft.is_free(body):
            continue
        built += 1
        style = {
            "width_m": wide, "depth_m": deep, "trim": "#f2efe6", "wall": draft.material("wall", k),
            "roof": draft.material("roof", k), "roof_m": draft.number(2.6, 3.8, "roof", k),
            "storeys": draft.whole(1, 2, "storeys", k), "door": draft.material("door", k),
        }  # fmt: skip
        draft.make("flooded_house", at=pose[:2], yaw_deg=pose[2], style=style)
        draft.take(body)
        for side in (-1, 1):
            _wet(draft, "drowned", beside(pose, draft.number(-2, 4, "drowned", k, side), side * 9.2), pose[2])
        _wet(draft, "moored", beside(pose, deep / 2 + 5.0, draft.number(-2, 2, "moored", k)), pose[2] + 90.0)
        _wet(draft, "garden", beside(pose, -deep / 2 - 5.0, draft.number(-3, 3, "garden", k)), pose[2] + 180.0)
    if not built and poses:
        raise NoRoomError("no room for the houses")


def _flats(draft: Draft, flats: Sequence[tuple[Box, float]]) -> None:
    for k, (box, facing) in enumerate(flats):
        if not draft.is_free(box.shape()):
            continue
        name = f"flat_{k}"
        draft.make(
            "flat_house", box=box.rounded(), storeys=draft.whole(1, round(draft.knob("storeys")), "flat", k),
            wall=draft.material("wall", "flat", k), facing_deg=facing, trim=draft.pick(_TRIMS, name),
            roof=draft.material("flat_roof", k), parapet_m=0.25, **{"as": f"{name}_roof"},
        )  # fmt: skip
        draft.take(box.shape())
        for x, y in box.grown(-1.3).grid(4.0):
            draft.slot("roof", x, y, draft.number(0, 360, name, x, y), (3.6, 3.6), on=f"{name}_roof")
        for off in (-0.3, 0.3):
            at = ahead(box.middle, facing, 0.0, off * max(box.width, box.depth))
            out = (box.width if facing % 180.0 == 0 else box.depth) / 2 + 3.4
            _wet(draft, "moored", ahead(at, facing, out), facing + 90.0)


def _water(draft: Draft, w: float, d: float) -> None:
    """Offer slots on what is open water."""
    rng, spots = draft.rng("water"), list[shapely.Point]()
    for _ in range(400):
        spot = shapely.Point(float(rng.uniform(-w + 4, w - 4)), float(rng.uniform(-d + 4, d - 4)))
        yaw, kind = float(rng.uniform(0, 360)), ("afloat", "drowned", "garden")[int(rng.integers(3))]
        if len(spots) < 46 and all(spot.distance(o) > 7.0 for o in spots) and draft.is_free(spot.buffer(2.7)):
            spots.append(spot)
            _wet(draft, kind, (spot.x, spot.y), yaw)


def _trees(draft: Draft) -> None:
    """Let treetops stand out of the water, and wreckage drift."""
    draft.section("Trees in the water, and what drifts")
    banks = [{"area": name, "grow_m": 9.5 if name.startswith("crest") else 6.5} for name in draft.areas]
    open_ = {"box": list(draft.site.grown(-2.5)), **({"minus": banks} if banks else {})}
    trees(draft, open_, 9, round(draft.knob("trees")), "trees", on=-0.5, fit="skip")
    afloat = {"categories": ["floating_debris"], "spacing_m": 10, "limit": 8, "place": "adrift on the flood"}
    draft.make("drift", area=open_, **afloat)


def _row(draft: Draft, u0: float, u1: float, v: float, yaw: float, key: str) -> list[Pose]:
    """Poses of houses in a row along x."""
    poses, at, k = [], u0 + 6.0, 0
    while at < u1 - 5.0:
        poses.append((*point(at, v + draft.number(-1, 1, key, k)), yaw + draft.number(-6, 6, key, k, "yaw")))
        at, k = at + draft.number(14, 18, key, k, "step"), k + 1
    return poses


def _street(draft: Draft, w: float, d: float) -> _Land:
    """A drowned street with a row of houses at either side, a dyke behind one of them."""
    y = draft.number(-0.2, 0.05, "street") * d
    rows = [*_row(draft, -w, w, y + 11.0, 270.0, "north"), *_row(draft, -w, w, y - 11.0, 90.0, "south")]
    top, bends = d - draft.number(8, 11, "dyke"), [draft.number(-4, 3, "bend", k) for k in range(2)]
    dyke = [(-w - 2, top), (-w / 3, top + bends[0]), (w / 3, top + bends[1]), (w + 2, top)]
    mound = point(draft.number(-0.5, 0.5, "mound") * w, -d + 12.0)
    return _Land([dyke], [(mound, 9.5)], rows, [], [[(-w, y), (w, y)]])


def _polder(draft: Draft, w: float, d: float) -> _Land:
    """A dyke with a gap, a farm on a mound, a mill on another."""
    top, gap = d - draft.number(11, 15, "dyke"), draft.number(-0.3, 0.3, "gap") * w
    west = [(-w - 2, top - 5), (-0.5 * w + gap / 2, top), (gap - 7, top)]
    dykes = [west, [(gap + 7, top), (0.5 * w + gap / 2, top), (w + 2, top - 6)]]
    x, y = farm = point(draft.number(0.1, 0.3, "farm") * w, draft.number(-0.3, -0.1, "farm_y") * d)
    mill = point(-0.6 * w, draft.number(-0.5, -0.2, "mill") * d)
    spots = ((x - 21.5, y - 12.0, 0.0), (x - 22.0, y + 8.0, 0.0), (x + 21.5, y - 11.0, 180.0))
    houses = [(*point(u, v), yaw) for u, v, yaw in spots]
    flats = [(Box(x + 15.0, y - 2.0, x + 23.0, y + 11.0), 180.0), (Box(x - 7.0, -d + 3.0, x + 4.0, -d + 11.0), 90.0)]
    current = [(gap, d), (gap, top), (gap + 3, top - 14), (gap - 3, 0)]
    return _Land(dykes, [(farm, 9.5), (mill, 8.0)], houses, flats, [current])


def _town(draft: Draft, w: float, d: float) -> _Land:
    """Flat-roofed houses on a grid of drowned lanes, squares that are dry."""
    blocks, _ = split(draft, Box(-w + 3, -d + 3, w - 3, d - 3), (8.0, 10.0), (12.0, 24.0))
    near = sorted(blocks, key=lambda b: math.hypot(*b.middle) + draft.number(0, 10, "square", *b))
    mounds = [(point(*box.middle), 8.6) for box in near[:2]]
    flats = []
    for box in near[2:]:
        inner = box.grown(-1.2)
        wide = min(inner.width, draft.number(11, 16, "wide", *box))
        deep = min(inner.depth, draft.number(9, 13, "deep", *box))
        flats.append((Box.about(*box.middle, wide, deep), draft.pick(SIDES, "front", *box)))
    return _Land([], mounds, [], flats, [[(-w, 0.0), (w, 0.0)]])


def _river(draft: Draft, w: float, d: float) -> _Land:
    """A river between two dykes, one of them broken, houses behind both."""
    bend, half = draft.number(-7, 7, "bend"), draft.number(9, 12, "half")
    gap = draft.number(-0.4, 0.4, "gap") * w
    north = [(-w - 2, half), (-w / 3, half + bend), (w / 3, half - bend), (w + 2, half)]
    west = [(-w - 2, -half), (gap - 14, -half + bend / 2), (gap - 7, -half)]
    south = [west, [(gap + 7, -half), (gap + 14, -half - bend / 2), (w + 2, -half)]]
    rows = [*_row(draft, -w, w, half + 19.0, 270.0, "north"), *_row(draft, -w, w, -half - 20.0, 90.0, "south")]
    keep = [p for k, p in enumerate(rows) if k % 4 != 2]
    mounds = [(p[:2], 8.4) for k, p in enumerate(rows) if k % 4 == 2][:2]
    return _Land([north, *south], mounds, keep, [], [[(-w, 0.0), (w, 0.0)], [(gap, 0.0), (gap, -half - 12)]])


def _mounds(draft: Draft, w: float, d: float) -> _Land:
    """Hamlets on mounds that the flood made islands of, a dyke that joins two of them."""
    mounds, houses, flats = [], [], []
    spots = [(-0.55, -0.5), (0.5, -0.45), (-0.45, 0.5), (0.55, 0.5), (0.0, 0.0)]
    for k, (u, v) in enumerate(draft.shuffled(spots, "spots")[:4]):
        at = point(u * w + draft.number(-4, 4, "x", k), v * d + draft.number(-4, 4, "y", k))
        mounds.append((at, draft.number(7.5, 9.5, "radius", k)))
        for j in range(3):
            yaw = draft.number(0, 90, "house", k) + 120.0 * j
            x, y = ahead(at, yaw, 22.0)
            if k % 2:
                houses.append((x, y, yaw + 180.0))
            else:
                flats.append((Box.about(x, y, 10.0, 9.0), draft.pick(SIDES, "flat", k, j)))
    (a, _), (b, _) = mounds[0], mounds[1]
    middle = ((a[0] + b[0]) / 2 + draft.number(-6, 6, "bow"), (a[1] + b[1]) / 2)
    return _Land([[a, middle, b]], mounds, houses, flats, [])


_TOPOLOGIES = {
    "street": _street, "polder": _polder, "town": _town, "river": _river, "mounds": _mounds,
}  # fmt: skip
