"""Stages of open country: winding ways, relief, clearings, places of a type, rocks with tops, tracks, huts, trees."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.paints import extents_m
from aerialdojo_gen.scenes.worlds.shapes import Point, Pose, ahead, heading, point, pose_on, smoothed, towards


def rolling(draft: Draft, height_m: float, wavelength_m: tuple[float, float] = (28, 48), cell_m: float = 1.7) -> None:
    """Let the ground roll, and level it under what stands on it."""
    draft.step(
        "rolling_ground", cell_m=cell_m, height_m=height_m, octaves=3,
        wavelength_m=draft.number(*wavelength_m, "waves"), seed=draft.whole(0, 10_000, "relief"),
    )  # fmt: skip
    draft.settle()


def patches(
    draft: Draft, role: str, kinds: int, count: int, radius_m: list[float], most: int = 9999, key: str = "patches"
) -> None:  # fmt: skip
    """Paint patches of several materials of a role on the ground; their seed is drawn up to `most`."""
    names = [draft.material(role, k) for k in range(kinds)]
    draft.make("paint_patches", materials=names, count=count, radius_m=radius_m, seed=draft.whole(0, most, key))


def open_country(draft: Draft, spots: Sequence[Point], kind: str, number: int, room_m: Point) -> None:
    """Place landmarks, beside some points first, and things anywhere, on ground that is level under each."""
    draft.step("level_under_things")
    landmarks(draft, spots)
    strewn(draft, kind, number, room_m)
    draft.fill_slots()


def winding(draft: Draft, name: str, ends: tuple[Point, Point], swing_m: float, bends: int = 4) -> shapely.LineString:
    """Name a winding line of the plan between two points; gives about where it goes."""
    (x0, y0), (x1, y1) = ends
    length = math.dist(*ends)
    nx, ny = -(y1 - y0) / length, (x1 - x0) / length
    rng = draft.rng("line", name)
    offsets = [(k / (bends + 1), float(rng.uniform(-swing_m, swing_m))) for k in range(1, bends + 1)]
    bent = [(x0 + f * (x1 - x0) + nx * off, y0 + f * (y1 - y0) + ny * off) for f, off in offsets]
    points = [ends[0], *bent, ends[1]]
    draft.lines[name] = {"points": [point(x, y) for x, y in points], "smooth": 3}
    return smoothed(points, 3)


def paths(draft: Draft, ends: Mapping[str, tuple[Point, Point]], swing_m: float, bends: int) -> None:
    """Tread winding paths between points, by the names of their lines."""
    tread(draft, {name: winding(draft, name, both, swing_m, bends) for name, both in ends.items()})


def tread(draft: Draft, lines: Mapping[str, shapely.LineString]) -> None:
    """Tread paths along named lines: level, painted, kept free, with slots (``wayside``) beside them."""
    draft.step("level_along", lines=list(lines), width_m=1.2, blend_m=3, smooth_m=10)
    ribbons = [{"ribbon": name, "width_m": 1.5, "round_ends": True} for name in lines]
    draft.section("Paths")
    draft.paint(ribbons, draft.material("path"))
    draft.make("keep_free", areas=[{"ribbon": name, "width_m": 2.1} for name in lines])
    for line in lines.values():
        draft.take(line.buffer(1.05))
    for name, line in lines.items():
        for k in range(int(line.length // 8.0)):
            x, y, yaw = heading(line, 4.0 + 8.0 * k)
            side, turn = (1 if draft.chance(0.5, "side", name, k) else -1), math.radians(yaw)
            x, y = x - math.sin(turn) * side * 2.3, y + math.cos(turn) * side * 2.3
            if draft.has_room(x, y, 1.0):
                draft.slot("wayside", x, y, yaw - side * 90.0, (2.4, 2.6))


def clearing(draft: Draft, name: str, at: Point, radius_m: float) -> None:
    """Clear and level a round place, and take its ground."""
    draft.step("level_area", area={"disc": [*at, round(radius_m * 0.9, 1)]}, blend_m=5)
    draft.areas[name] = {"blob": [*at, radius_m, draft.whole(0, 1999, "blob", name), 0.25]}
    draft.paint({"area": name, "grow_m": 1.2}, draft.material("patch", name))
    draft.paint(name, draft.material("glade", name))


def brook(draft: Draft, name: str, ends: tuple[Point, Point], swing_m: float) -> shapely.LineString:
    """Cut the bed of a brook, and let water flow in it; gives its middle line."""
    bed = winding(draft, name, ends, swing_m)
    draft.step("level_along", lines=[name], width_m=5.6, blend_m=5, smooth_m=40)
    draft.step("sink_area", area={"ribbon": name, "width_m": 7.0}, depth_m=1.8, blend_m=2.4)
    draft.areas["water"] = {"ribbon": name, "width_m": 2.8}
    water(draft)
    return bed


def water(draft: Draft) -> None:
    """Paint the area `water` and its shore."""
    seed = draft.whole(0, 9999, "shore")
    draft.make("paint_shore", water="water", material=draft.material("bank"), lobe_m=1.4, seed=seed)
    draft.paint("water", draft.material("water"))


def bridged(draft: Draft, bed: shapely.LineString, share: float) -> list[Point]:
    """Lay a footbridge over a brook at a share of its length, and take its ground; gives the landings."""
    x, y, along = heading(bed, bed.length * share)
    across = math.radians(along + 90.0)
    draft.take(bed.buffer(3.8))
    draft.take_disc((x, y), 7.5)
    draft.make("footbridge", at=point(x, y), yaw_deg=round(along + 90.0, 1), span_m=8.5, place="")
    return [point(x + u * math.cos(across), y + u * math.sin(across)) for u in (-6.5, 6.5)]


def about(draft: Draft, kind: str, at: Point, ring: Point, number: int, room_m: Point) -> None:
    """Offer slots about a point, in a ring between two radii, fronts to the point."""
    rng = draft.rng("about", kind, *at)
    first = float(rng.uniform(0, 360))
    for k in range(number):
        turn = first + (k + float(rng.uniform(-0.25, 0.25))) * 360 / number
        spot = ahead(at, turn, float(rng.uniform(*ring)))
        draft.slot(kind, *spot, turn + 180.0 + float(rng.uniform(-20, 20)), room_m)


def strewn(draft: Draft, kind: str, number: int, room_m: tuple[float, float], margin_m: float = 4.0) -> None:
    """Offer slots anywhere on free ground, well apart."""
    rng, w, d = draft.rng("strewn", kind), draft.width_m / 2 - margin_m, draft.depth_m / 2 - margin_m
    chosen: list[shapely.Point] = []
    for _ in range(number * 6):
        spot = shapely.Point(float(rng.uniform(-w, w)), float(rng.uniform(-d, d)))
        if len(chosen) < number and all(spot.distance(c) > 6.0 for c in chosen) and draft.is_free(spot.buffer(1.6)):
            chosen.append(spot)
            draft.slot(kind, spot.x, spot.y, float(rng.uniform(0, 360)), room_m)


def anywhere(draft: Draft, number: int = 60, margin_m: float = 7.0) -> list[tuple[float, float, float]]:
    """Draw poses for landmarks over the site."""
    rng, w, d = draft.rng("anywhere"), draft.width_m / 2 - margin_m, draft.depth_m / 2 - margin_m
    return [(*point(rng.uniform(-w, w), rng.uniform(-d, d)), round(rng.uniform(0, 360))) for _ in range(number)]


def trees(draft: Draft, area: Any, spacing_m: float, limit: int, stream: str = "", **keys: Any) -> None:
    """Scatter the palette's trees over an area; `keys` are those of the entry."""
    pattern = {"of": draft.material("trees").split("+"), "scatter": area, "spacing_m": spacing_m, "limit": limit}
    draft.add({"pattern": pattern | ({"stream": stream} if stream else {}), **keys})


def wood(draft: Draft, area: Any, most: float, spacing_m: float = 4.6) -> None:
    """Plant the palette's trees on what is left of an area, and what grows under them."""
    trees(draft, area, spacing_m, int(most), "wood", fit="skip", room_m=0.0)
    low = draft.shuffled(["bush", "fern", "sapling", "grass_tuft", "wildflowers", "young_spruce"], "undergrowth")
    draft.make("undergrowth", area=area, kinds=[{"of": kind, "spacing_m": 3.5, "limit": 24} for kind in low[:3]])


class Rock(NamedTuple):
    """A rock of layers: `long` times as long as wide, along a direction."""

    at: Point
    radius_m: float
    height_m: float
    long: float = 1.0
    yaw_deg: float = 0.0

    def shape(self, grow_m: float = 0.0) -> shapely.Polygon:
        """Return about its outline."""
        u, v = self.radius_m * math.sqrt(self.long) + grow_m, self.radius_m / math.sqrt(self.long) + grow_m
        ellipse = shapely.affinity.scale(shapely.Point(0, 0).buffer(1.0), u, v, origin=(0, 0))
        return shapely.affinity.translate(shapely.affinity.rotate(ellipse, self.yaw_deg, origin=(0, 0)), *self.at)


def spot_for(draft: Draft, radius_m: float, *key: object, spots: Iterable[Point] = ()) -> Point | None:
    """Find a free round spot: the first of some, else anywhere."""
    rng, w, d = draft.rng("spot", *key), draft.width_m / 2 - radius_m - 1.5, draft.depth_m / 2 - radius_m - 1.5
    drawn = (point(rng.uniform(-w, w), rng.uniform(-d, d)) for _ in range(240))
    return next((spot for spot in (*spots, *drawn) if draft.has_room(*spot, radius_m)), None)


def lay_out(draft: Draft, spots: Sequence[Point] = ()) -> list[Point]:
    """Lay out the topology's places at the first free of some spots, else where there is room."""
    middles = []
    for k, name in enumerate(draft.kind.topologies[draft.topology].places):
        place = draft.kind.places[name]
        at = spot_for(draft, place.radius_m + 0.8, "place", k, spots=spots)
        if at is None:
            continue
        clearing(draft, f"{name}_{k}", at, place.radius_m)
        for ring in place.rings:
            about(draft, ring.slots, at, ring.away_m, ring.number, ring.room_m)
        draft.take_disc(at, place.radius_m + 0.5)
        middles.append(at)
    return middles


def rocks(draft: Draft, standing: Sequence[Rock]) -> None:
    """Put up layered rocks with scree about them, and offer slots on their tops."""
    if not standing:
        return
    named = {f"rock_{k}": rock for k, rock in enumerate(standing)}
    for name, rock in named.items():
        area = {"blob": [*rock.at, rock.radius_m, draft.whole(0, 1999, name), 0.22, 36]}
        draft.areas[name] = area | ({"long": [rock.long, rock.yaw_deg]} if rock.long > 1.0 else {})
    draft.step("bank_scree", areas=list(named), rise_m=0.9, reach_m=4)
    draft.make("paint_scree", areas=list(named), material=draft.material("scree"), seed=draft.whole(0, 999, "scree"))
    cap = {"cap": draft.material("cap")} if "cap" in draft.palette.materials else {}
    draft.make(
        "layered_rocks", bands=draft.material("bands").split("+"), **cap, **{"as": [f"{name}_top" for name in named]},
        rocks=[{"area": n, "name": n, "height_m": r.height_m} for n, r in named.items()],
    )  # fmt: skip
    for name, rock in named.items():
        draft.take(rock.shape(1.0))
        top = rock.shape(-0.26 * rock.radius_m - 0.14 * rock.height_m - 1.7)
        if top.is_empty or rock.radius_m / math.sqrt(rock.long) < 3.2:
            continue
        reach = rock.radius_m * math.sqrt(rock.long) * 0.42
        for f in (-1, 0, 1) if rock.radius_m > 5.0 else (0,):
            at = ahead(rock.at, rock.yaw_deg, f * reach)
            draft.slot("top", *at, draft.number(0, 360, name, f), (3.0, 3.0), on=f"{name}_top")


def rocks_about(draft: Draft, number: int, radius_m: Point, height_m: Point, long: float = 2.0) -> list[Rock]:
    """Draw rocks on free ground, and take it."""
    drawn = []
    for k in range(number):
        radius = draft.number(*radius_m, "rock", k)
        ratio = draft.number(1.0, long, "rock", k, "long")
        at = spot_for(draft, radius * math.sqrt(ratio) + 1.0, "rock", k)
        if at is not None:
            high, yaw = draft.number(*height_m, "rock", k, "high"), draft.number(0, 180, "rock", k, "yaw")
            drawn.append(Rock(at, radius, high, ratio, yaw))
            draft.take(drawn[-1].shape(1.5))
    return drawn


def track(draft: Draft, line: shapely.LineString, width_m: float = 3.4, bank_m: float = 0.0) -> None:
    """Lay a track along the line `track`, with ruts; offer slots on it (``track``) and beside it (``wayside``)."""
    draft.step("level_along", lines=["track"], width_m=round(width_m * 0.8, 2), blend_m=3, smooth_m=12)
    if bank_m:
        draft.step("banks_beside", line="track", width_m=width_m, height_m=bank_m)
    draft.section("The track")
    draft.paint({"ribbon": "track", "width_m": round(width_m + 0.8, 2), "round_ends": True}, draft.material("verge"))
    draft.paint({"ribbon": "track", "width_m": width_m, "round_ends": True}, draft.material("track"))
    draft.make("strips_beside", line="track", offsets_m=[-0.85, 0.85], width_m=0.5, material=draft.material("rut"))
    draft.make("keep_free", areas=[{"ribbon": "track", "width_m": width_m}])
    for k in range(int(line.length // 9.0)):
        at, side = 4.5 + 9.0 * k, 1 if draft.chance(0.5, "side", "track", k) else -1
        x, y, yaw = pose_on(line, at, side, width_m / 2 + 3.0)
        if k % 2:
            draft.slot("track", *pose_on(line, at, 1, 0.0)[:2], yaw - side * 90.0, (9.0, width_m))
        if draft.has_room(x, y, 1.4):
            draft.slot("wayside", x, y, yaw, (4.4, 4.4))
    draft.take(line.buffer(width_m / 2 + 0.6))


def houses_about(
    draft: Draft, number: int, radius_m: float, key: str, facing: shapely.LineString | Point, reach_m: float,
    least: int, what: str,
) -> list[Pose]:  # fmt: skip
    """Find poses for houses on free ground, fronts to a way or a point within reach; level and take it."""
    rng, w, d = draft.rng("houses", key), draft.width_m / 2 - radius_m - 2.0, draft.depth_m / 2 - radius_m - 2.0
    poses: list[Pose] = []
    for _ in range(number * 90):
        x, y = round(float(rng.uniform(-w, w)), 1), round(float(rng.uniform(-d, d)), 1)
        rng.uniform(0, 360)  # Not used; without this draw every world would change
        spot = shapely.Point(x, y)
        if isinstance(facing, shapely.LineString):
            to = facing.interpolate(facing.project(spot))
        else:
            to = shapely.Point(facing)
        yaw = towards((x, y), (to.x, to.y)) + float(rng.uniform(-8, 8))
        if to.distance(spot) <= reach_m and len(poses) < number and draft.has_room(x, y, radius_m):
            poses.append((x, y, round(yaw % 360.0, 1)))
            draft.take_disc((x, y), radius_m + 0.3)
            draft.step("level_area", area={"disc": [x, y, round(radius_m * 0.85, 1)]}, blend_m=3.5)
    if len(poses) < least:
        raise NoRoomError(f"no room for {what}")
    return poses


def landmarks(draft: Draft, near: Sequence[Point]) -> None:
    """Place landmarks where there is much room, beside some points first, else where there is little."""
    spots = [ahead(at, 45.0 * k, 16.0) for at in near for k in draft.shuffled(range(8), "landmark", *at)]
    poses = [(*spot, float(draft.whole(0, 359, "landmark_yaw", *spot))) for spot in spots] + anywhere(draft, 160)
    wide = [pose for pose in poses if draft.has_room(*pose[:2], 6.0)]
    draft.section("Landmarks")
    for what, x, y in draft.landmark([*wide, *poses]):
        reach = max(extents_m(draft.catalogue, what)) / 2 + 0.8
        draft.step("level_area", area={"disc": [x, y, round(reach, 1)]}, blend_m=4)
