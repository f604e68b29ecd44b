"""Stages of open country made of data: a type's places, rocks with tops to stand on, tracks, huts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.sizes import extents_m
from aerialdojo_gen.scenes.worlds.street_maps import pose_on
from aerialdojo_gen.scenes.worlds.wilds import about, anywhere, clearing, step

Point = tuple[float, float]
Pose = tuple[float, float, float]


def point(x: float, y: float) -> Point:
    """Round a point to decimetres, as plans write it."""
    return round(x, 1), round(y, 1)


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
        round_ = shapely.affinity.scale(shapely.Point(0, 0).buffer(1.0), u, v, origin=(0, 0))
        return shapely.affinity.translate(shapely.affinity.rotate(round_, self.yaw_deg, origin=(0, 0)), *self.at)


def spot_for(draft: Draft, radius_m: float, *key: object, spots: Iterable[Point] = ()) -> Point | None:
    """Find a free round spot: the first of some, else anywhere."""
    rng, w, d = draft.rng("spot", *key), draft.width_m / 2 - radius_m - 1.5, draft.depth_m / 2 - radius_m - 1.5
    drawn = ((round(float(rng.uniform(-w, w)), 1), round(float(rng.uniform(-d, d)), 1)) for _ in range(240))
    for spot in (*spots, *drawn):
        if draft.is_free(shapely.Point(spot).buffer(radius_m)):
            return spot
    return None


def lay_out(draft: Draft, spots: Sequence[Point] = ()) -> list[Point]:
    """Lay out the topology's places at the first free of some spots, else where there is room."""
    found = []
    for k, name in enumerate(draft.kind.topologies[draft.topology].places):
        place = draft.kind.places[name]
        at = spot_for(draft, place.radius_m + 0.8, "place", k, spots=spots)
        if at is None:
            continue
        clearing(draft, f"{name}_{k}", at, place.radius_m)
        for ring in place.rings:
            about(draft, ring.slots, at, ring.away_m, ring.number, ring.room_m)
        draft.take(shapely.Point(at).buffer(place.radius_m + 0.5))
        found.append(at)
    return found


def rocks(draft: Draft, standing: Sequence[Rock], kind: str = "top") -> None:
    """Put up layered rocks with scree about them, and offer slots on their tops."""
    if not standing:
        return
    names = [f"rock_{k}" for k in range(len(standing))]
    for name, rock in zip(names, standing, strict=True):
        area = {"blob": [*rock.at, rock.radius_m, draft.whole(0, 1999, name), 0.22, 36]}
        draft.areas[name] = area | ({"long": [rock.long, rock.yaw_deg]} if rock.long > 1.0 else {})
    step(draft, "bank_scree", areas=names, rise_m=0.9, reach_m=4)
    draft.make("paint_scree", areas=names, material=draft.material("scree"), seed=draft.whole(0, 999, "scree"))
    cap = {"cap": draft.material("cap")} if "cap" in draft.palette.materials else {}
    draft.make(
        "layered_rocks", bands=draft.material("bands").split("+"), **cap, **{"as": [f"{name}_top" for name in names]},
        rocks=[{"area": n, "name": n, "height_m": r.height_m} for n, r in zip(names, standing, strict=True)],
    )  # fmt: skip
    for name, rock in zip(names, standing, strict=True):
        draft.take(rock.shape(1.0))
        top = rock.shape(-0.26 * rock.radius_m - 0.14 * rock.height_m - 1.7)
        if top.is_empty or rock.radius_m / math.sqrt(rock.long) < 3.2:
            continue
        along = math.radians(rock.yaw_deg)
        reach = rock.radius_m * math.sqrt(rock.long) * 0.42
        for f in (-1, 0, 1) if rock.radius_m > 5.0 else (0,):
            x, y = rock.at[0] + f * reach * math.cos(along), rock.at[1] + f * reach * math.sin(along)
            draft.slot(kind, x, y, draft.number(0, 360, name, f), (3.0, 3.0), on=f"{name}_top")


def rocks_about(
    draft: Draft, number: int, radius_m: Point, height_m: Point, spots: Sequence[Point] = (), long: float = 2.0
) -> list[Rock]:
    """Draw rocks on free ground, and take it."""
    standing = []
    for k in range(number):
        radius = draft.number(*radius_m, "rock", k)
        ratio = draft.number(1.0, long, "rock", k, "long")
        at = spot_for(draft, radius * math.sqrt(ratio) + 1.0, "rock", k, spots=spots[k : k + 1])
        if at is not None:
            high, yaw = draft.number(*height_m, "rock", k, "high"), draft.number(0, 180, "rock", k, "yaw")
            rock = Rock(at, radius, high, ratio, yaw)
            draft.take(rock.shape(1.5))
            standing.append(rock)
    return standing


def track(draft: Draft, name: str, line: shapely.LineString, width_m: float = 3.4, bank_m: float = 0.0) -> None:
    """Lay a track along a named line, with ruts; offer slots on it (``track``) and beside it (``wayside``)."""
    step(draft, "level_along", lines=[name], width_m=round(width_m * 0.8, 2), blend_m=3, smooth_m=12)
    if bank_m:
        step(draft, "banks_beside", line=name, width_m=width_m, height_m=bank_m)
    draft.section("The track")
    draft.paint({"ribbon": name, "width_m": round(width_m + 0.8, 2), "round_ends": True}, draft.material("verge"))
    draft.paint({"ribbon": name, "width_m": width_m, "round_ends": True}, draft.material("track"))
    draft.make("strips_beside", line=name, offsets_m=[-0.85, 0.85], width_m=0.5, material=draft.material("rut"))
    draft.make("keep_free", areas=[{"ribbon": name, "width_m": width_m}])
    for k in range(int(line.length // 9.0)):
        at, side = 4.5 + 9.0 * k, 1 if draft.chance(0.5, "side", name, k) else -1
        x, y, yaw = pose_on(line, at, side, width_m / 2 + 3.0)
        if k % 2:
            ahead = pose_on(line, at, 1, 0.0)
            draft.slot("track", ahead[0], ahead[1], yaw - side * 90.0, (9.0, width_m))
        if draft.is_free(shapely.Point(x, y).buffer(1.4)):
            draft.slot("wayside", x, y, yaw, (4.4, 4.4))
    draft.take(line.buffer(width_m / 2 + 0.6))


def houses_about(
    draft: Draft, number: int, radius_m: float, *key: object, facing: shapely.LineString | Point | None = None,
    reach_m: float = 1e3, least_m: float = 0.0,
) -> list[Pose]:  # fmt: skip
    """Find poses for houses on free ground, fronts to a way or a point that is near enough; level and take it."""
    rng, w, d = draft.rng("houses", *key), draft.width_m / 2 - radius_m - 2.0, draft.depth_m / 2 - radius_m - 2.0
    found: list[Pose] = []
    for _ in range(number * 90):
        x, y = round(float(rng.uniform(-w, w)), 1), round(float(rng.uniform(-d, d)), 1)
        spot, yaw = shapely.Point(x, y), float(rng.uniform(0, 360))
        if isinstance(facing, shapely.LineString):
            to = facing.interpolate(facing.project(spot))
        else:
            to = shapely.Point(facing) if facing is not None else None
        if to is not None:
            yaw = math.degrees(math.atan2(to.y - y, to.x - x)) + float(rng.uniform(-8, 8))
            if not least_m <= to.distance(spot) <= reach_m:
                continue
        if len(found) < number and draft.is_free(spot.buffer(radius_m)):
            found.append((x, y, round(yaw % 360.0, 1)))
            draft.take(spot.buffer(radius_m + 0.3))
            step(draft, "level_area", area={"disc": [x, y, round(radius_m * 0.85, 1)]}, blend_m=3.5)
    return found


def beside(pose: Pose, ahead_m: float, left_m: float) -> Point:
    """Point ahead of a pose and to its left."""
    c, s = math.cos(math.radians(pose[2])), math.sin(math.radians(pose[2]))
    return round(pose[0] + c * ahead_m - s * left_m, 2), round(pose[1] + s * ahead_m + c * left_m, 2)


def landmarks(draft: Draft, near: Sequence[Point] = (), margin_m: float = 7.0) -> None:
    """Place landmarks where there is much room, beside some points first, else where there is little."""
    about_ = [beside((*at, 45.0 * k), 16.0, 0.0) for at in near for k in draft.shuffled(range(8), "landmark", *at)]
    poses = [(*spot, float(draft.whole(0, 359, "landmark_yaw", *spot))) for spot in about_]
    poses += anywhere(draft, 160, margin_m)
    wide = [pose for pose in poses if draft.is_free(shapely.Point(pose[:2]).buffer(6.0))]
    draft.section("Landmarks")
    for what, x, y in draft.landmark([*wide, *poses]):
        reach = max(extents_m(draft.catalogue, what)) / 2 + 0.8
        step(draft, "level_area", area={"disc": [x, y, round(reach, 1)]}, blend_m=4)
