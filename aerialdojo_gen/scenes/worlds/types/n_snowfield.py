"""Snowfields: stations, villages and runs between drifts, rocks and ice."""

from __future__ import annotations

import math

import shapely

from aerialdojo_gen.scenes.worlds import wilds
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Point, ahead, beside, point, pose_on, towards


def write(draft: Draft) -> None:
    """Shape the snow, then ways, ice, rocks and huts as the topology has them, its places, and trees."""
    wilds.rolling(draft, draft.knob("relief_m"), (16, 30), 1.5)
    draft.section("Drifts")
    wilds.patches(draft, "drift", 2, 30, [3, 8], key="drifts")
    wilds.open_country(draft, _TOPOLOGIES[draft.topology](draft, *draft.half), "snow", 30, (4.4, 4.4))
    _growth(draft)


def _growth(draft: Draft) -> None:
    draft.section("Trees and boulders")
    runs = [{"ribbon": name, "width_m": 9.4} for name in draft.lines if name.startswith("piste")]
    if free := [*runs, *(["lake"] if "lake" in draft.areas else [])]:
        draft.make("keep_free", areas=free)
    open_snow, limit = list(draft.site.grown(-1.5)), round(draft.knob("trees"))
    if limit:
        draft.make("strew", of="snowy_spruce", area=open_snow, spacing_m=3.4, limit=limit)
        draft.make("strew", of="young_spruce", area=open_snow, spacing_m=5, limit=limit // 3,
                   roles={"needles": "needles:#5a7466"})  # fmt: skip
    draft.make("strew", of="boulder:grey", area=open_snow, spacing_m=6, limit=24,
               roles={"rock": draft.material("boulder"), "top": "snow"})  # fmt: skip


def _lake(draft: Draft, at: Point, radius_m: float) -> None:
    """Freeze a lake over, with cracks in its ice and things on it."""
    draft.areas["lake"] = {"blob": [*at, radius_m, draft.whole(0, 999, "lake"), 0.22]}
    draft.step("level_area", area={"area": "lake", "grow_m": 2.0}, blend_m=4)
    draft.section("The frozen lake")
    draft.paint({"area": "lake", "grow_m": 0.9}, draft.material("verge"))
    draft.paint("lake", draft.material("ice"))
    rng, cracks = draft.rng("cracks"), []
    for k in range(5):
        turns = [math.radians(72.0 * k + 130.0 * j + float(rng.uniform(0, 60))) for j in range(4)]
        points = [point(at[0] + radius_m * math.cos(t), at[1] + radius_m * math.sin(t)) for t in turns]
        cracks.append({"ribbon": points, "width_m": round(0.1 + 0.04 * k, 2), "within": "lake"})
    draft.paint(cracks, draft.material("crack"))
    n = max(4, round(radius_m * 0.6))
    for k in range(n):
        spot = ahead(at, 360 / n * k, radius_m * (0.25 + 0.45 * draft.number(0, 1, "ice", k)))
        draft.slot("ice", *spot, draft.number(0, 360, "ice", k, "yaw"), (3.6, 3.6))
    draft.take_disc(at, radius_m * 1.15 + 1.5)


def _raised(draft: Draft, number: int, facing: shapely.LineString | Point, reach_m: float) -> None:
    """Huts on stilts, with things on their roofs and in the yards about them."""
    poses = wilds.houses_about(draft, number, 7.6, "raised", facing, reach_m, 2, "huts")
    draft.section("Huts on stilts")
    walls = draft.shuffled(draft.palette.materials["hut"], "hut")
    cabins = [
        {"at": pose[:2], "yaw_deg": pose[2], "wall": walls[k % len(walls)],
         "size_m": [draft.number(3.8, 4.6, "deep", k), draft.number(6.5, 10, "wide", k), 2.8]}
        for k, pose in enumerate(poses)
    ]  # fmt: skip
    draft.make("raised_cabins", cabins=cabins, **{"as": [f"hut_{k}_roof" for k in range(len(poses))]})
    for k, pose in enumerate(poses):
        for side in (-1, 1):
            draft.slot("hut roof", *beside(pose, 0.0, side * 2.2), pose[2], (3.0, 3.0), on=f"hut_{k}_roof")
            draft.slot("yard", *beside(pose, draft.number(2.5, 5, "yard", k, side), side * 5.6), pose[2], (3.2, 3.2))
        draft.slot("yard", *beside(pose, -4.8, 0.0), pose[2] + 180, (3.0, 4.6))


def _gabled(draft: Draft, number: int, way: shapely.LineString | Point, reach_m: float) -> None:
    """Cabins and chalets with fronts to a way or a point, and what stands about them."""
    poses = wilds.houses_about(draft, number, 7.4, "gabled", way, reach_m, 2, "houses")
    draft.section("Houses")
    sizes_m = {"deep": (5.5, 7), "wide": (7, 9.6), "high": (3, 4.4)}
    cabins = [
        {"at": pose[:2], "yaw_deg": pose[2], "wall": draft.material("wall", k),
         "size_m": [draft.number(*span, key, k) for key, span in sizes_m.items()]}
        for k, pose in enumerate(poses) if k % 2 == 0
    ]  # fmt: skip
    draft.make("gable_cabins", cabins=cabins)
    for k, pose in enumerate(poses):
        if k % 2:
            draft.slot("chalet", *pose, (10.0, 7.4))
        for side in (-1, 1):
            draft.slot("village", *beside(pose, 5.6, side * 3.4), pose[2], (3.0, 3.2))
            draft.slot("village", *beside(pose, -1.0, side * 6.4), pose[2] + side * 90, (2.8, 4.6))


def _station(draft: Draft, w: float, d: float) -> list[Point]:
    ends = ((-w - 1, draft.number(-d / 3, d / 3, "in")), (w + 1, draft.number(-d / 3, d / 3, "out")))
    line = wilds.winding(draft, "track", ends, d / 4)
    wilds.track(draft, line, bank_m=0.8)
    at = wilds.spot_for(draft, 10.5, "lake")
    if at is not None:
        _lake(draft, at, draft.number(7.5, 9.0, "lake"))
    wilds.rocks(draft, wilds.rocks_about(draft, draft.whole(2, 3, "rocks"), (4.5, 7), (4, 8)))
    spots = wilds.lay_out(draft)
    _raised(draft, draft.whole(3, 5, "huts"), line, 24.0)
    _ridges(draft, 4)
    return spots


def _ridges(draft: Draft, number: int, along: float | None = None, length_m: float = 10.0) -> None:
    """Push ice up into ridges on free ground; in rows along a direction, where one is given."""
    lines = []
    for k in range(number):
        at = wilds.spot_for(draft, length_m / 2 if along is None else 4.0, "ridge", k)
        if at is None:
            continue
        yaw = along if along is not None else draft.number(0, 180, "ridge", k)
        bend = draft.number(-2.5, 2.5, "bend", k)
        points = [ahead(at, yaw, f * length_m / 2, bend * (1 - abs(f))) for f in (-1, 0, 1)]
        line = shapely.LineString(points)
        if draft.is_free(line.buffer(1.2)):
            lines.append(points)
            draft.take(line.buffer(1.6))
    if lines:
        draft.section("Ridges of broken ice")
        draft.make("ice_ridges", lines=lines, material=draft.material("ice"), height_m=draft.number(1.8, 3, "high"))


def _slope(draft: Draft, w: float, d: float) -> list[Point]:
    up, top = draft.pick([1, -1], "up"), draft.number(11, 16, "top")
    profile = ((-1.0, 0.0), (-0.7, 0.02), (-0.4, 0.18), (0.3, 0.82), (0.55, 0.95), (1.0, 1.0))
    points = sorted((round(up * y * d, 1), round(z * top, 2)) for y, z in profile)
    draft.step("profile_slope", profile=points, lean=draft.number(-4, 4, "lean") / 100)
    ends = point(-w - 1, -up * 0.62 * d), point(w + 1, -up * draft.number(0.54, 0.66, "road") * d)
    road = wilds.winding(draft, "track", ends, 3.0, 3)
    flip = draft.pick([1, -1], "flip")
    masts = [point(flip * f * w, up * y * d) for f, y in ((0.1, -0.3), (0.06, 0.12), (0.02, 0.62))]
    lift = shapely.LineString(masts)
    for k, (f, swing) in enumerate(((-0.5, 6.0), (0.6, 7.0))):
        ends = point(flip * f * w * 0.8, up * 0.62 * d), point(flip * f * w, -up * 0.36 * d)
        line = wilds.winding(draft, f"piste_{k}", ends, swing, 3)
        _piste(draft, f"piste_{k}", line, bumpy=k == 1 and draft.chance(0.6, "moguls"))
    wilds.track(draft, road, 4.0, bank_m=0.8)
    draft.section("The lift")
    draft.step("level_area", area=[{"disc": [*mast, 1.4]} for mast in masts], blend_m=2)
    pylon = ["ski_lift_pylon", *masts[1], round(towards(masts[1], masts[2]), 1)]
    draft.add({"place": [pylon], "fit": "must"})
    draft.landmarks.append("ski_lift_pylon")
    draft.lines["lift"] = masts
    draft.make("cableway", masts="lift", cabins=draft.whole(5, 9, "gondolas"))
    draft.make("keep_free", areas=[{"ribbon": "lift", "width_m": 9.0, "round_ends": 16}])
    draft.take(lift.buffer(5.5))
    for mast, kind in ((masts[0], "valley"), (masts[2], "summit")):
        for k in range(6):
            spot = ahead(mast, 60 * k + 20, draft.number(7.0, 9.0, kind, k))
            draft.slot(kind, *spot, 60.0 * k + 200, (3.6, 3.6))
    spots = wilds.lay_out(draft)
    _gabled(draft, draft.whole(4, 6, "houses"), road, 20.0)
    wilds.rocks(draft, wilds.rocks_about(draft, draft.whole(1, 3, "rocks"), (3.5, 5), (3, 6)))
    return spots


def _piste(draft: Draft, name: str, line: shapely.LineString, bumpy: bool) -> None:
    draft.step("level_along", lines=[name], width_m=6.6, blend_m=3, smooth_m=14)
    if bumpy:
        draft.step("moguls", area={"ribbon": name, "width_m": 8}, height_m=0.8)
    draft.step("banks_beside", line=name, width_m=8.6, height_m=0.6)
    draft.section("A run")
    draft.paint({"ribbon": name, "width_m": 8.6, "round_ends": True}, draft.material("piste"))
    draft.make("strips_beside", line=name, offsets_m=[-2.8, 0, 2.8], width_m=1.4, material=draft.material("groomed"))
    draft.take(line.buffer(5.2))
    for k in range(int(line.length // 8.5)):
        side = 1 if k % 2 else -1
        x, y, yaw = pose_on(line, 4.0 + 8.5 * k, side, 2.2)
        draft.slot("gate" if k % 4 else "piste", x, y, yaw + side * 90, (7.6, 4.4))
        draft.slot("piste side", *pose_on(line, 6.0 + 8.5 * k, -side, 6.6), (5.0, 3.0))


def _glacier(draft: Draft, w: float, d: float) -> list[Point]:
    """A tongue of ice down a valley between walls of rock, with crevasses."""
    fall = draft.number(0.05, 0.11, "fall") * draft.pick([1, -1], "down")
    half = draft.number(0.36, 0.44, "half") * d
    valley = f"5*eased(abs(y + 4*sin(x/19)), {half:.1f}, {half + 14:.1f})"
    draft.step("ground_by_formula", height=f"z + {fall:.3f}*x + {valley}")
    walls = []
    for k, (side, f) in enumerate((s, f) for s in (-1, 1) for f in (-0.62, 0.05, 0.7)):
        at = point((f + draft.number(-0.08, 0.08, "wall", k)) * w, side * (half + 8.5))
        radius, high = draft.number(5.5, 7.5, "wall", k, "radius"), draft.number(5, 11, "wall", k, "high")
        long, yaw = draft.number(1.8, 2.8, "wall", k, "long"), draft.number(0, 18, "wall", k, "yaw")
        if abs(at[1]) < d - 4:
            walls.append(wilds.Rock(at, radius, high, long, round((yaw - 9.0) % 180.0, 1)))
    draft.section("Crevasses")
    for k in range(draft.whole(4, 6, "crevasses")):
        x = round((-0.8 + 0.3 * k + draft.number(-0.06, 0.06, "crevasse", k)) * w, 1)
        y0, y1 = sorted((draft.number(-0.9, 0.9, "y0", k) * half, draft.number(-0.9, 0.9, "y1", k) * half))
        if y1 - y0 < 8:
            continue
        bend = draft.number(-3, 3, "bend", k)
        points = [point(u, v) for u, v in ((x, y0), (x + bend, (y0 + y1) / 2), (x, y1))]
        deep = draft.number(1.6, 3, "deep", k)
        draft.step("sink_area", area={"ribbon": points, "width_m": 3.4}, depth_m=deep, blend_m=1.2)
        draft.paint({"ribbon": points, "width_m": 2.8}, draft.material("crack"))
        draft.paint({"ribbon": points, "width_m": 1.5}, draft.material("ice"))
        draft.make("keep_free", areas=[{"ribbon": points, "width_m": 3.0}])
        draft.take(shapely.LineString(points).buffer(2.4))
    wilds.rocks(draft, walls)
    line = wilds.winding(draft, "track", ((-w - 1, 0.0), (w + 1, draft.number(-half / 2, half / 2, "out"))), half / 3)
    if all(draft.is_free(line.interpolate(f, normalized=True).buffer(2)) for f in (0.2, 0.4, 0.6, 0.8)):
        wilds.track(draft, line, 2.8)
    else:
        del draft.lines["track"]
    spots = wilds.lay_out(draft)
    _raised(draft, 3, (0.0, 0.0), 40.0)
    _ridges(draft, 5)
    return spots


def _ice(draft: Draft, w: float, d: float) -> list[Point]:
    """A wide frozen lake, houses and a track about it."""
    radius = draft.number(17, 21, "lake")
    at = point(draft.number(-0.25, 0.25, "x") * w, draft.number(-0.2, 0.2, "y") * d)
    _lake(draft, at, radius)
    side = draft.pick([1, -1], "side")
    y = at[1] + side * (radius * 1.2 + 6.0)
    ends = point(-w - 1, y), point(w + 1, y + draft.number(-2, 2, "road"))
    road = wilds.winding(draft, "track", ends, 2.0, 3)
    wilds.track(draft, road, 3.6, bank_m=0.8)
    spots = wilds.lay_out(draft)
    _gabled(draft, draft.whole(5, 7, "houses"), at, radius * 2.3)
    _ridges(draft, 3)
    return spots


def _hamlet(draft: Draft, w: float, d: float) -> list[Point]:
    """A ploughed street with houses at both sides, and a rink."""
    tilt = draft.number(-0.5, 0.5, "tilt")
    ends = (-w - 1, round(-tilt * d, 1)), (w + 1, round(tilt * d, 1))
    if draft.chance(0.5, "turned"):
        ends = (round(-tilt * w, 1), -d - 1), (round(tilt * w, 1), d + 1)
    road = wilds.winding(draft, "track", ends, 7.0, 3)
    wilds.track(draft, road, 4.4, bank_m=0.9)
    at = wilds.spot_for(draft, 10.5, "rink")
    if at is not None:
        yaw = draft.number(0, 180, "rink")
        draft.areas["rink"] = {"area": {"box": [-6.5, -2.5, 6.5, 2.5], "grow_m": [3, 4]}, "frame": [*at, yaw]}
        draft.step("level_area", area={"area": "rink", "grow_m": 1}, blend_m=4)
        draft.section("The rink")
        draft.paint("rink", draft.material("ice"))
        draft.make("rink_boards", rink="rink")
        draft.take_disc(at, 10.2)
        for k in range(8):
            turn = math.radians(45 * k + yaw)
            x, y = at[0] + 11.8 * math.cos(turn), at[1] + 9.6 * math.sin(turn)
            draft.slot("valley", x, y, 45.0 * k + yaw + 180, (3.0, 3.0))
    spots = wilds.lay_out(draft)
    _gabled(draft, draft.whole(7, 10, "houses"), road, 15.0)
    return spots


def _icefield(draft: Draft, w: float, d: float) -> list[Point]:
    """Rows of pressure ridges with a camp of an expedition between them."""
    along = draft.number(0, 180, "along")
    spots = wilds.lay_out(draft)
    _raised(draft, 3, (0.0, 0.0), 40.0)
    _ridges(draft, 14, along, draft.number(12, 18, "length"))
    wilds.rocks(draft, wilds.rocks_about(draft, 2, (4, 6), (4, 9)))
    return spots


_TOPOLOGIES = {
    "station": _station, "slope": _slope, "glacier": _glacier, "lake": _ice, "hamlet": _hamlet, "icefield": _icefield,
}  # fmt: skip
