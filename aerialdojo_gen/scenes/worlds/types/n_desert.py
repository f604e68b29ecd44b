"""Deserts: dunes, canyons, oases and pans, with camps, villages, digs and what stands beside tracks."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.wilds import (
    Rock,
    about,
    beside,
    houses_about,
    landmarks,
    lay_out,
    point,
    rocks,
    rocks_about,
    rolling,
    spot_for,
    step,
    strewn,
    track,
    winding,
)

Point = tuple[float, float]


def write(draft: Draft) -> None:
    """Shape the sand, then rocks, water, tracks and houses as the topology has them, its places, and growth."""
    w, d = draft.width_m / 2, draft.depth_m / 2
    draft.section("What covers the ground")
    patches = [draft.material("patch", k) for k in range(2)]
    draft.make("paint_patches", materials=patches, count=30, radius_m=[2.5, 7], seed=draft.whole(0, 9999, "patches"))
    spots = _TOPOLOGIES[draft.topology](draft, w, d)
    draft.head["placing"] = {"settle_m": 0.5, "margin_m": 0.4}
    draft.level_things = True
    step(draft, "level_under_things")
    landmarks(draft, spots)
    strewn(draft, "desert", 34, (4.6, 4.6))
    draft.fill_slots()
    _growth(draft, w, d)


def _growth(draft: Draft, w: float, d: float) -> None:
    draft.section("Growth and stones")
    ground = [-w + 1.5, -d + 1.5, w - 1.5, d - 1.5]
    if "water" in draft.areas:
        shore = {"area": {"area": "water", "grow_m": 5.0}, "minus": {"area": "water", "grow_m": 0.6}}
        reeds = {"area": {"area": "water", "grow_m": 0.6}, "minus": {"area": "water", "grow_m": -0.5}}
        draft.make("strew", of="palm_tree", area=shore, spacing_m=2.8, limit=26)
        draft.make("strew", of="reed_clump", area=reeds, spacing_m=1.6, limit=22, solid=False)
        draft.make("keep_free", areas=["water"])
    plants = round(draft.knob("plants"))
    draft.make("strew", of="acacia_tree", area=ground, spacing_m=10, limit=max(plants // 5, 1))
    draft.make("strew", of="boulder:sandstone", area=ground, spacing_m=5, limit=34,
               roles={"rock": draft.material("boulder"), "top": draft.material("scree")})  # fmt: skip
    draft.make("strew", of="bush", area=ground, spacing_m=5, limit=plants, scale=0.6, params={"berries": 0},
               roles={"leaves": draft.material("shrub")}, attributes={"pattern": "dry leaves"})  # fmt: skip
    draft.make("strew", of="grass_tuft", area=ground, spacing_m=4, limit=plants)


def _dunes(draft: Draft) -> None:
    height, wave = draft.knob("relief_m"), draft.number(20, 28, "waves")
    step(draft, "dunes", cell_m=1.5, height_m=height, wavelength_m=wave, wind_deg=draft.whole(0, 359, "wind"))


def _tracked(draft: Draft, w: float, d: float, swing_m: float = 14.0) -> shapely.LineString:
    """Lead a track across the site."""
    ends = point(-w - 1, draft.number(-0.5, 0.5, "in") * d), point(w + 1, draft.number(-0.5, 0.5, "out") * d)
    if draft.chance(0.5, "turned"):
        ends = point(draft.number(-0.5, 0.5, "in") * w, -d - 1), point(draft.number(-0.5, 0.5, "out") * w, d + 1)
    line = winding(draft, "track", ends, swing_m)
    track(draft, "track", line, 3.2)
    return line


def _erg(draft: Draft, w: float, d: float) -> list[Point]:
    """A sand sea with mesas, a camp of nomads and oil works by a track."""
    _dunes(draft)
    _tracked(draft, w, d)
    spots = lay_out(draft)
    rocks(draft, rocks_about(draft, draft.whole(3, 5, "rocks"), (5, 9), (4, 10)))
    return spots


def _oasis(draft: Draft, w: float, d: float) -> list[Point]:
    """A pool among palms, a village of mud bricks beside it, and its field."""
    if draft.chance(0.5, "dunes"):
        _dunes(draft)
    else:
        rolling(draft, draft.knob("relief_m") * 0.5)
    at = point(draft.number(-0.3, 0.3, "x") * w, draft.number(-0.3, 0.3, "y") * d)
    radius = draft.number(5.5, 8.5, "pool")
    draft.areas["water"] = {"blob": [*at, radius, draft.whole(0, 999, "pool"), 0.2]}
    step(draft, "level_area", area={"disc": [*at, radius + 4.5]}, blend_m=9)
    step(draft, "sink_area", area={"disc": [*at, radius + 1.0]}, depth_m=0.7, blend_m=2.5)
    step(draft, "level_area", area={"area": "water", "grow_m": 0.4}, blend_m=1.5)
    draft.section("The oasis")
    for grow, role in ((6.0, "fringe"), (3.6, "oasis")):
        draft.paint({"area": "water", "grow_m": grow, "ragged": [1.2, round(grow), 3]}, draft.material(role))
    draft.paint({"area": "water", "grow_m": 0.6}, draft.material("bank"))
    draft.paint("water", draft.material("water"))
    about(draft, "shore", at, (radius + 3.2, radius + 4.6), 9, (4.6, 4.2))
    draft.take(shapely.Point(at).buffer(radius + 6.5))
    _tracked(draft, w, d, 6.0) if _off(draft, w, d, at, radius + 9.0) else None
    _field(draft, at)
    spots = lay_out(draft)
    _village(draft, draft.whole(5, 8, "houses"), at, 40.0)
    rocks(draft, rocks_about(draft, 2, (4.5, 7.5), (4, 9)))
    return spots


def _off(draft: Draft, w: float, d: float, at: Point, by_m: float) -> bool:
    """Whether the site is wide enough for a track that passes a pool."""
    return max(abs(at[0]) + w, abs(at[1]) + d) > 2.0 * by_m and abs(at[0]) > by_m


def _field(draft: Draft, near: Point) -> None:
    """Plough a field in rows, with what belongs to it at its edge."""
    at = spot_for(draft, 9.0, "field", spots=[beside((*near, 45.0 * k), 24.0, 0.0) for k in range(8)])
    if at is None:
        return
    x, y = at
    box = [round(v, 1) for v in (x - 6, y - 4.5, x + 6, y + 4.5)]
    step(draft, "level_area", area=box, blend_m=3)
    draft.paint(box, draft.material("soil"))
    rows = [
        [box[0] + 0.5, round(box[1] + 0.5 + 1.4 * k, 1), box[2] - 0.5, round(box[1] + 1.2 + 1.4 * k, 1)]
        for k in range(6)
    ]
    draft.paint(rows, draft.material("crop"))
    for k in range(6):
        draft.slot(
            "field", x + (-5 + 5 * (k % 3)), y + (6.2 if k < 3 else -6.2), 90.0 if k < 3 else 270.0, (3.0, 4.0)
        )
    draft.take(shapely.box(x - 8, y - 8, x + 8, y + 8))


def _village(draft: Draft, number: int, facing: Point | shapely.LineString, reach_m: float) -> None:
    """Houses of mud bricks about a point or along a way, with things on their roofs and about them."""
    poses = houses_about(draft, number, 5.9, "village", facing=facing, reach_m=reach_m)
    if len(poses) < 3:
        raise NoRoomError("no room for the village")
    draft.section("The village")
    houses = [
        {"name": f"house_{k}", "at": list(pose[:2]), "yaw_deg": pose[2], "wall": draft.material("wall", k),
         "size_m": [draft.number(5.4, 6.4, "deep", k), draft.number(6.0, 8.0, "wide", k),
                    draft.number(3.1, 3.9, "high", k) + (2.8 if draft.chance(0.25, "tower", k) else 0.0)]}
        for k, pose in enumerate(poses)
    ]  # fmt: skip
    draft.make("mudbrick_houses", houses=houses, **{"as": [f"roof_{k}" for k in range(len(poses))]})
    for k, pose in enumerate(poses):
        for side in (-1, 1):
            draft.slot("roof", *beside(pose, -0.4, side * 1.5), pose[2], (3.0, 3.2), on=f"roof_{k}")
            draft.slot("village", *beside(pose, 4.8, side * 2.6), pose[2], (3.0, 3.2))


def _canyon(draft: Draft, w: float, d: float) -> list[Point]:
    """A dry river bed between steps of rock and layered walls."""
    turned = draft.chance(0.5, "canyon")
    far, wide = (d, w) if turned else (w, d)
    bed = []
    for k in range(8):
        along, off = (k / 3.5 - 1.0) * (far + 2), draft.number(-0.22, 0.22, "bed", k) * wide
        bed.append(list(point(off, along) if turned else point(along, off)))
    line = shapely.LineString(bed)
    draft.lines["bed"] = bed
    draft.lines["bed_way"] = {"points": "bed", "smooth": 3}
    first, second = draft.number(7.5, 10, "first"), draft.number(15, 19, "second")
    steps = [[3.5, 6.0, 1.4], [first, first + 3.5, draft.number(1.8, 3.0, "rise")],
             [second, second + 4.0, draft.number(2.2, 4.0, "rise", 2)]]  # fmt: skip
    step(draft, "stepped_valley", cell_m=1.5, bed="bed", steps=steps, roughness_m=draft.number(0.6, 1.4, "rough"))
    draft.section("The river bed")
    draft.paint({"ribbon": "bed_way", "width_m": 7.5}, draft.material("bed"))
    draft.paint({"ribbon": "bed_way", "width_m": 3.4}, draft.material("patch", "bed"))
    for k in range(int(line.length // 14)):
        p = line.interpolate(7 + 14 * k)
        draft.slot("wash", p.x, p.y, draft.number(0, 360, "wash", k), (5.4, 4.4))
    draft.take(line.buffer(4.2))
    standing = []
    for k in range(draft.whole(7, 10, "walls")):
        along, side = draft.number(0.03, 0.97, "along", k) * line.length, draft.pick([-1, 1], "wall", k)
        p, q = line.interpolate(along), line.interpolate(along + 0.5)
        yaw = math.degrees(math.atan2(q.y - p.y, q.x - p.x))
        away = draft.number(second + 1, second + 12, "away", k)
        rock = Rock(
            point(*beside((p.x, p.y, yaw), 0.0, side * away)), draft.number(4.0, 8.0, "wall", k, "radius"),
            draft.number(5, 11, "wall", k, "high"), draft.number(1.4, 2.8, "wall", k, "long"), round(yaw % 180.0, 1),
        )  # fmt: skip
        if draft.is_free(rock.shape(1.0)):
            draft.take(rock.shape(2.0))
            standing.append(rock)
    standing += [Rock(r.at, r.radius_m, r.height_m) for r in rocks_about(draft, 3, (1.5, 2.2), (4, 8))]
    spots = lay_out(draft)
    rocks(draft, standing)
    return spots


def _dig(draft: Draft, w: float, d: float) -> list[Point]:
    """A dig at an old town: crumbling walls about courts, statues, and the diggers' camp."""
    rolling(draft, draft.knob("relief_m") * 0.45)
    _tracked(draft, w, d, 6.0)
    at = spot_for(draft, 15.0, "dig")
    if at is None:
        raise NoRoomError("no room for the dig")
    step(draft, "level_area", area={"disc": [*at, 16.0]}, blend_m=6)
    yaw = draft.number(0, 90, "dig")
    draft.section("The dig")
    draft.paint({"blob": [*at, 16.0, draft.whole(0, 999, "dig"), 0.2]}, draft.material("glade", "dig"))
    if draft.landmark([(*at, yaw)], of=["pyramid_ruin"] if draft.chance(0.5, "pyramid") else ["obelisk"]):
        draft.take(shapely.Point(at).buffer(9.0))
    outer = draft.number(14.5, 17.5, "outer")
    walls = []
    for k in range(4):
        for part, (a, b) in enumerate(((-0.95, -0.15), (0.2, 0.9))):
            if draft.chance(0.75, "wall", k, part):
                ends = [beside((*at, yaw + 90 * k), outer, f * outer) for f in (a, b)]
                walls.append(
                    {"line": [list(e) for e in ends], "height_m": draft.number(1.8, 4.2, "wall", k, part, "m")}
                )
                draft.take(shapely.LineString(ends).buffer(1.0))
        draft.slot("dig", *beside((*at, yaw + 90 * k), outer, 0.5), yaw + 90 * k, (4.8, 3.4))
        for f in (-0.6, 0.6):
            draft.slot("dig", *beside((*at, yaw + 90 * k), outer - 3.4, f * outer), yaw + 90 * k, (3.4, 4.0))
            draft.slot("dig", *beside((*at, yaw + 90 * k), outer + 3.4, f * outer), yaw + 90 * k, (3.4, 4.0))
    draft.make("crumbling_walls", walls=walls, material=draft.material("ruin"))
    draft.take(shapely.Point(at).buffer(outer + 5.0))
    spots = lay_out(draft)
    rocks(draft, rocks_about(draft, 2, (4.5, 7.5), (3, 8)))
    return spots


def _pan(draft: Draft, w: float, d: float) -> list[Point]:
    """A flat pan of salt with the camp of a rally on it, pillars of rock and low dunes about it."""
    rolling(draft, draft.knob("relief_m") * 0.6)
    at = point(draft.number(-0.15, 0.15, "x") * w, draft.number(-0.15, 0.15, "y") * d)
    radius = draft.number(24, 30, "pan")
    draft.areas["pan"] = {"blob": [*at, radius, draft.whole(0, 999, "pan"), 0.2]}
    step(draft, "level_area", area={"disc": [*at, radius]}, blend_m=8)
    draft.section("The pan")
    draft.paint({"area": "pan", "grow_m": 1.5}, draft.material("glade"))
    draft.paint("pan", draft.material("salt"))
    for k in range(12):
        away, turn = radius * (0.2 + 0.6 * draft.number(0, 1, "pan", k)), math.radians(30 * k)
        x, y = at[0] + away * math.cos(turn), at[1] + away * math.sin(turn)
        draft.slot("pan", x, y, draft.number(0, 360, "pan", k, "yaw"), (5.6, 5.0))
    spots = lay_out(draft, [point(at[0] + 12, at[1])])
    standing = [Rock(r.at, r.radius_m, r.height_m) for r in rocks_about(draft, 9, (1.5, 3.0), (4, 9), long=1.0)]
    rocks(draft, standing + rocks_about(draft, 1, (6, 8), (5, 9)))
    return spots


def _serai(draft: Draft, w: float, d: float) -> list[Point]:
    """A walled yard of caravans: houses along its sides, gates, and a well in the middle."""
    _dunes(draft)
    at = point(draft.number(-0.2, 0.2, "x") * w, draft.number(-0.2, 0.2, "y") * d)
    yaw, half = draft.number(0, 90, "yaw"), 15.5
    step(draft, "level_area", area={"disc": [*at, half * 1.45]}, blend_m=6)
    draft.section("The caravanserai")
    draft.paint({"box": [-half, -half, half, half], "frame": [*at, yaw]}, draft.material("glade"))
    walls: list[dict[str, Any]] = []
    houses: list[dict[str, Any]] = []
    for k in range(4):
        turn = yaw + 90 * k
        for a, b in ((-1.0, -0.18), (0.18, 1.0)):
            ends = [list(beside((*at, turn), half, f * half)) for f in (a, b)]
            walls.append({"line": ends, "height_m": draft.number(3.0, 4.0, "wall", k, a), "decay": 0.3})
        for f in (-0.55, 0.55) if k % 2 == 0 else ():
            x, y = beside((*at, turn), half - 4.2, f * half)
            houses.append({"name": f"house_{len(houses)}", "at": [x, y], "yaw_deg": round((turn + 180) % 360, 1),
                           "size_m": [5.6, draft.number(7.0, 9.0, "wide", k, f), 3.4],
                           "wall": draft.material("wall", k, f)})  # fmt: skip
            draft.slot("roof", x, y, turn, (3.0, 3.0), on=f"roof_{len(houses) - 1}")
        draft.slot("village", *beside((*at, turn), half + 2.6, 0.0), turn, (4.0, 4.0))
    draft.make("crumbling_walls", walls=walls, material=draft.material("ruin"))
    draft.make("mudbrick_houses", houses=houses, **{"as": [f"roof_{k}" for k in range(len(houses))]})
    about(draft, "village", at, (1.0, 1.6), 2, (3.0, 3.0))
    about(draft, "village", at, (4.2, 5.6), 8, (4.0, 3.2))
    draft.take(shapely.Point(at).buffer(half * 1.45))
    spots = lay_out(draft)
    rocks(draft, rocks_about(draft, 3, (5, 8), (4, 9)))
    return spots


_TOPOLOGIES: dict[str, Callable[[Draft, float, float], list[Point]]] = {
    "erg": _erg, "oasis": _oasis, "canyon": _canyon, "dig": _dig, "pan": _pan, "serai": _serai,
}  # fmt: skip
