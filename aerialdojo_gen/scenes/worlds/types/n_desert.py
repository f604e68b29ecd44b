"""Deserts: dunes, canyons, oases and pans, with camps, villages, digs and what stands beside tracks."""

from __future__ import annotations

from typing import Any

import shapely

from aerialdojo_gen.scenes.worlds import wilds
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import Point, ahead, beside, heading, point


def write(draft: Draft) -> None:
    """Shape the sand, then rocks, water, tracks and houses as the topology has them, its places, and growth."""
    draft.section("What covers the ground")
    wilds.patches(draft, "patch", 2, 30, [2.5, 7])
    spots = _TOPOLOGIES[draft.topology](draft, *draft.half)
    draft.settle()
    wilds.open_country(draft, spots, "desert", 34, (4.6, 4.6))
    _growth(draft)


def _growth(draft: Draft) -> None:
    draft.section("Growth and stones")
    ground = list(draft.site.grown(-1.5))
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
    draft.step("dunes", cell_m=1.5, height_m=height, wavelength_m=wave, wind_deg=draft.whole(0, 359, "wind"))


def _tracked(draft: Draft, w: float, d: float, swing_m: float = 14.0) -> None:
    """Lead a track across the site."""
    ends = point(-w - 1, draft.number(-0.5, 0.5, "in") * d), point(w + 1, draft.number(-0.5, 0.5, "out") * d)
    if draft.chance(0.5, "turned"):
        ends = point(draft.number(-0.5, 0.5, "in") * w, -d - 1), point(draft.number(-0.5, 0.5, "out") * w, d + 1)
    wilds.track(draft, wilds.winding(draft, "track", ends, swing_m), 3.2)


def _erg(draft: Draft, w: float, d: float) -> list[Point]:
    """A sand sea with mesas, a camp of nomads and oil works by a track."""
    _dunes(draft)
    _tracked(draft, w, d)
    spots = wilds.lay_out(draft)
    wilds.rocks(draft, wilds.rocks_about(draft, draft.whole(3, 5, "rocks"), (5, 9), (4, 10)))
    return spots


def _oasis(draft: Draft, w: float, d: float) -> list[Point]:
    """A pool among palms, a village of mud bricks beside it, and its field."""
    if draft.chance(0.5, "dunes"):
        _dunes(draft)
    else:
        wilds.rolling(draft, draft.knob("relief_m") * 0.5)
    at = point(draft.number(-0.3, 0.3, "x") * w, draft.number(-0.3, 0.3, "y") * d)
    radius = draft.number(5.5, 8.5, "pool")
    draft.areas["water"] = {"blob": [*at, radius, draft.whole(0, 999, "pool"), 0.2]}
    draft.step("level_area", area={"disc": [*at, radius + 4.5]}, blend_m=9)
    draft.step("sink_area", area={"disc": [*at, radius + 1.0]}, depth_m=0.7, blend_m=2.5)
    draft.step("level_area", area={"area": "water", "grow_m": 0.4}, blend_m=1.5)
    draft.section("The oasis")
    for grow, role in ((6.0, "fringe"), (3.6, "oasis")):
        draft.paint({"area": "water", "grow_m": grow, "ragged": [1.2, round(grow), 3]}, draft.material(role))
    draft.paint({"area": "water", "grow_m": 0.6}, draft.material("bank"))
    draft.paint("water", draft.material("water"))
    wilds.about(draft, "shore", at, (radius + 3.2, radius + 4.6), 9, (4.6, 4.2))
    draft.take_disc(at, radius + 6.5)
    by_m = radius + 9.0
    if max(abs(at[0]) + w, abs(at[1]) + d) > 2.0 * by_m and abs(at[0]) > by_m:  # Wide enough to pass the pool
        _tracked(draft, w, d, 6.0)
    _field(draft, at)
    spots = wilds.lay_out(draft)
    _village(draft, draft.whole(5, 8, "houses"), at, 40.0)
    wilds.rocks(draft, wilds.rocks_about(draft, 2, (4.5, 7.5), (4, 9)))
    return spots


def _field(draft: Draft, near: Point) -> None:
    """Plough a field in rows, with what belongs to it at its edge."""
    at = wilds.spot_for(draft, 9.0, "field", spots=[ahead(near, 45.0 * k, 24.0) for k in range(8)])
    if at is None:
        return
    x, y = at
    box = [round(v, 1) for v in (x - 6, y - 4.5, x + 6, y + 4.5)]
    draft.step("level_area", area=box, blend_m=3)
    draft.paint(box, draft.material("soil"))
    x0, low, x1, _ = box
    rows = [[x0 + 0.5, round(low + 0.5 + 1.4 * k, 1), x1 - 0.5, round(low + 1.2 + 1.4 * k, 1)] for k in range(6)]
    draft.paint(rows, draft.material("crop"))
    for side, yaw in ((6.2, 90.0), (-6.2, 270.0)):
        for k in (-5, 0, 5):
            draft.slot("field", x + k, y + side, yaw, (3.0, 4.0))
    draft.take(shapely.box(x - 8, y - 8, x + 8, y + 8))


def _village(draft: Draft, number: int, facing: Point, reach_m: float) -> None:
    """Houses of mud bricks about a point, with things on their roofs and about them."""
    poses = wilds.houses_about(draft, number, 5.9, "village", facing, reach_m, 3, "the village")
    draft.section("The village")
    houses = [
        {"name": f"house_{k}", "at": pose[:2], "yaw_deg": pose[2], "wall": draft.material("wall", k),
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
        bed.append(point(off, along) if turned else point(along, off))
    line = shapely.LineString(bed)
    draft.lines["bed"] = bed
    draft.lines["bed_way"] = {"points": "bed", "smooth": 3}
    first, second = draft.number(7.5, 10, "first"), draft.number(15, 19, "second")
    steps = [[3.5, 6.0, 1.4], [first, first + 3.5, draft.number(1.8, 3.0, "rise")],
             [second, second + 4.0, draft.number(2.2, 4.0, "rise", 2)]]  # fmt: skip
    draft.step("stepped_valley", cell_m=1.5, bed="bed", steps=steps, roughness_m=draft.number(0.6, 1.4, "rough"))
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
        pose, away = heading(line, along), draft.number(second + 1, second + 12, "away", k)
        radius, high = draft.number(4.0, 8.0, "wall", k, "radius"), draft.number(5, 11, "wall", k, "high")
        at, long = point(*beside(pose, 0.0, side * away)), draft.number(1.4, 2.8, "wall", k, "long")
        rock = wilds.Rock(at, radius, high, long, round(pose[2] % 180.0, 1))
        if draft.is_free(rock.shape(1.0)):
            draft.take(rock.shape(2.0))
            standing.append(rock)
    standing += [wilds.Rock(r.at, r.radius_m, r.height_m) for r in wilds.rocks_about(draft, 3, (1.5, 2.2), (4, 8))]
    spots = wilds.lay_out(draft)
    wilds.rocks(draft, standing)
    return spots


def _dig(draft: Draft, w: float, d: float) -> list[Point]:
    """A dig at an old town: crumbling walls about courts, statues, and the diggers' camp."""
    wilds.rolling(draft, draft.knob("relief_m") * 0.45)
    _tracked(draft, w, d, 6.0)
    at = wilds.spot_for(draft, 15.0, "dig")
    if at is None:
        raise NoRoomError("no room for the dig")
    draft.step("level_area", area={"disc": [*at, 16.0]}, blend_m=6)
    yaw = draft.number(0, 90, "dig")
    draft.section("The dig")
    draft.paint({"blob": [*at, 16.0, draft.whole(0, 999, "dig"), 0.2]}, draft.material("glade", "dig"))
    if draft.landmark([(*at, yaw)], of=["pyramid_ruin"] if draft.chance(0.5, "pyramid") else ["obelisk"]):
        draft.take_disc(at, 9.0)
    outer = draft.number(14.5, 17.5, "outer")
    walls = []
    for k in range(4):
        turn = yaw + 90 * k
        for part, (a, b) in enumerate(((-0.95, -0.15), (0.2, 0.9))):
            if draft.chance(0.75, "wall", k, part):
                ends = [ahead(at, turn, outer, f * outer) for f in (a, b)]
                high = draft.number(1.8, 4.2, "wall", k, part, "m")
                walls.append({"line": ends, "height_m": high})
                draft.take(shapely.LineString(ends).buffer(1.0))
        draft.slot("dig", *ahead(at, turn, outer, 0.5), turn, (4.8, 3.4))
        for f in (-0.6, 0.6):
            for off in (-3.4, 3.4):
                draft.slot("dig", *ahead(at, turn, outer + off, f * outer), turn, (3.4, 4.0))
    draft.make("crumbling_walls", walls=walls, material=draft.material("ruin"))
    draft.take_disc(at, outer + 5.0)
    spots = wilds.lay_out(draft)
    wilds.rocks(draft, wilds.rocks_about(draft, 2, (4.5, 7.5), (3, 8)))
    return spots


def _pan(draft: Draft, w: float, d: float) -> list[Point]:
    """A flat pan of salt with the camp of a rally on it, pillars of rock and low dunes about it."""
    wilds.rolling(draft, draft.knob("relief_m") * 0.6)
    at = point(draft.number(-0.15, 0.15, "x") * w, draft.number(-0.15, 0.15, "y") * d)
    radius = draft.number(24, 30, "pan")
    draft.areas["pan"] = {"blob": [*at, radius, draft.whole(0, 999, "pan"), 0.2]}
    draft.step("level_area", area={"disc": [*at, radius]}, blend_m=8)
    draft.section("The pan")
    draft.paint({"area": "pan", "grow_m": 1.5}, draft.material("glade"))
    draft.paint("pan", draft.material("salt"))
    for k in range(12):
        spot = ahead(at, 30.0 * k, radius * (0.2 + 0.6 * draft.number(0, 1, "pan", k)))
        draft.slot("pan", *spot, draft.number(0, 360, "pan", k, "yaw"), (5.6, 5.0))
    spots = wilds.lay_out(draft, [point(at[0] + 12, at[1])])
    standing = [
        wilds.Rock(r.at, r.radius_m, r.height_m) for r in wilds.rocks_about(draft, 9, (1.5, 3.0), (4, 9), long=1.0)
    ]
    wilds.rocks(draft, standing + wilds.rocks_about(draft, 1, (6, 8), (5, 9)))
    return spots


def _serai(draft: Draft, w: float, d: float) -> list[Point]:
    """A walled yard of caravans: houses along its sides, gates, and a well in the middle."""
    _dunes(draft)
    at = point(draft.number(-0.2, 0.2, "x") * w, draft.number(-0.2, 0.2, "y") * d)
    yaw, half = draft.number(0, 90, "yaw"), 15.5
    draft.step("level_area", area={"disc": [*at, half * 1.45]}, blend_m=6)
    draft.section("The caravanserai")
    draft.paint({"box": [-half, -half, half, half], "frame": [*at, yaw]}, draft.material("glade"))
    walls: list[dict[str, Any]] = []
    houses: list[dict[str, Any]] = []
    for k in range(4):
        turn = yaw + 90 * k
        for a, b in ((-1.0, -0.18), (0.18, 1.0)):
            ends = [ahead(at, turn, half, f * half) for f in (a, b)]
            walls.append({"line": ends, "height_m": draft.number(3.0, 4.0, "wall", k, a), "decay": 0.3})
        for f in (-0.55, 0.55) if k % 2 == 0 else ():
            x, y = ahead(at, turn, half - 4.2, f * half)
            houses.append({"name": f"house_{len(houses)}", "at": [x, y], "yaw_deg": round((turn + 180) % 360, 1),
                           "size_m": [5.6, draft.number(7.0, 9.0, "wide", k, f), 3.4],
                           "wall": draft.material("wall", k, f)})  # fmt: skip
            draft.slot("roof", x, y, turn, (3.0, 3.0), on=f"roof_{len(houses) - 1}")
        draft.slot("village", *ahead(at, turn, half + 2.6), turn, (4.0, 4.0))
    draft.make("crumbling_walls", walls=walls, material=draft.material("ruin"))
    draft.make("mudbrick_houses", houses=houses, **{"as": [f"roof_{k}" for k in range(len(houses))]})
    wilds.about(draft, "village", at, (1.0, 1.6), 2, (3.0, 3.0))
    wilds.about(draft, "village", at, (4.2, 5.6), 8, (4.0, 3.2))
    draft.take_disc(at, half * 1.45)
    spots = wilds.lay_out(draft)
    wilds.rocks(draft, wilds.rocks_about(draft, 3, (5, 8), (4, 9)))
    return spots


_TOPOLOGIES = {
    "erg": _erg, "oasis": _oasis, "canyon": _canyon, "dig": _dig, "pan": _pan, "serai": _serai,
}  # fmt: skip
