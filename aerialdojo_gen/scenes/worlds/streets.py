"""Streets and what lines them: at a site's edge or meeting on it, plots, buildings, and their slots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Box, Point, pose_on

LANE_M, PAVEMENT_M = 3.0, 1.8
HALF_M = LANE_M + PAVEMENT_M
# Of streets along a site's edge, which are wider.
_EDGE_LANE_M, _EDGE_PAVEMENT_M = 3.25, 2.0


def street_along(draft: Draft, y: float) -> float:
    """Pave a street along x; slots on its lanes (``road``) and pavements (``kerb``); gives half its width, metres."""
    ends, half = [(-draft.half[0], y), (draft.half[0], y)], _EDGE_LANE_M + _EDGE_PAVEMENT_M
    draft.make("streets", paths=[ends], lanes=2, pavement_m=_EDGE_PAVEMENT_M)
    line = shapely.LineString(ends)
    draft.take(line.buffer(half, cap_style="flat"))
    for at in np.arange(4.0, line.length - 4.0, 7.5):
        here, there = line.interpolate(at), line.interpolate(at + 0.5)
        # 1 but for its last bits, by which the middles of lanes, which lie at half centimetres, are rounded.
        unit = (there.x - here.x) * 2
        for side, yaw in ((-1, 0.0), (1, 180.0)):
            draft.slot("road", here.x, y + side * unit * _EDGE_LANE_M / 2, yaw, (12.0, 2.9))
            draft.slot("kerb", here.x, y + side * unit * (half - 0.95), side * -90.0, (1.7, 5.0))
    return half


# Of bays for cars: width, depth, and from one double row to the next with the aisle.
BAY_M, BAY_DEPTH_M, DOUBLE_ROW_M = 2.6, 5.2, 2 * 5.2 + 6.4


def bay_islands(draft: Draft, x: float, y: float, count: int, back_m: float) -> list[Box]:
    """Pave islands at both ends of a double row of bays; slots on them (``tree``, ``island``)."""
    islands = [Box.about(x + side * (count * BAY_M / 2 + 1.6), y, 2.4, 2 * BAY_DEPTH_M) for side in (-1, 1)]
    for island in islands:
        draft.paint(island.rounded(), draft.material("island"), rise_m=0.12)
        draft.slot("tree", island.middle[0], y + 2.6, 0.0, (2.0, 2.0))
        draft.slot("island", island.middle[0], y - back_m, 90.0, (2.2, 4.0))
    return islands


class Way(NamedTuple):
    """A street or a footway: where it goes, and half its width with pavements, metres."""

    line: shapely.LineString
    half_m: float = HALF_M
    paved: bool = True  # Whether it has kerbs and traffic


def streets(draft: Draft, paths: Sequence[Any], lines: Sequence[shapely.LineString]) -> list[Way]:
    """Pave streets that meet, two lanes each, and take their ground; `paths` as plans write them."""
    draft.make(
        "streets", paths=list(paths), lane_m=LANE_M, pavement_m=PAVEMENT_M, surface=draft.material("street"),
        pavement=draft.material("pavement"),
    )  # fmt: skip
    ways = [Way(line) for line in lines]
    for way in ways:
        draft.take(way.line.buffer(way.half_m, cap_style="flat"))
    return ways


def kerb_slots(draft: Draft, ways: Sequence[Way], keep_free: Sequence[BaseGeometry] = ()) -> None:
    """Offer slots on the lanes (``road``) and pavements (``kerb``) of streets, off one another and off drives."""
    for way in (way for way in ways if way.paved):
        others = [o.line.buffer(o.half_m + 0.5) for o in ways if o.paved and o is not way]
        for k in range(int((way.line.length - 6.0) // 5.0)):
            at = 5.0 + 5.0 * k
            for side in (1, -1):
                x, y, yaw = pose_on(way.line, at, side, way.half_m - 0.9)
                spot = shapely.Point(x, y).buffer(1.3)
                if not any(one.intersects(spot) for one in (*others, *keep_free)):
                    draft.slot("kerb", x, y, yaw, (1.7, 4.6))
                x, y, yaw = pose_on(way.line, at, side, LANE_M / 2)
                if k % 2 and not any(one.contains(shapely.Point(x, y)) for one in others):
                    draft.slot("road", x, y, yaw - 90.0, (11.0, 3.1))


def plot(draft: Draft, way: Way, at_m: float, side: int, size_m: tuple[float, float]) -> Plot | None:
    """Take a plot (width, depth) beside a way, its front's middle at `at_m`; None where the ground is not free."""
    x, y, yaw = pose_on(way.line, at_m, side, way.half_m + 0.3)
    width, depth = size_m
    box = shapely.affinity.rotate(shapely.box(-depth, -width / 2, 0, width / 2), yaw, origin=(0, 0))
    area = shapely.affinity.translate(box, x, y)
    if not draft.is_free(area):
        return None
    draft.take(area)
    return Plot(x, y, yaw, width, depth)


class Plot(NamedTuple):
    """A rectangle of ground beside a way: the middle of its front, and the direction from there to the way."""

    x: float
    y: float
    yaw_deg: float
    width_m: float
    depth_m: float

    def at(self, away_m: float, left_m: float = 0.0) -> Point:
        """Give the point so far behind the front's middle, and left of it as seen looking to the way."""
        c, s = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return round(self.x - away_m * c - left_m * s, 2), round(self.y - away_m * s + left_m * c, 2)

    def strip(self, left_m: float, half_m: float, reach_m: float) -> shapely.Polygon:
        """Give the strip of a drive or a path, out of the plot by `reach_m`."""
        ends = [self.at(2.0, left_m), self.at(-reach_m, left_m)]
        return shapely.LineString(ends).buffer(half_m, cap_style="flat")


def block_building(draft: Draft, box: Box, name: str, *, storeys: int, street_deg: float, category: str) -> None:
    """Put up a building on a rectangle, with slots before its front and, where its roof is flat, on it."""
    flat = box.width * box.depth > 120 or draft.chance(0.5, name, "flat")
    arguments = {
        "outline": box.rounded(), "wall": draft.material("wall", name), "roof": draft.material("roof", name),
        "storeys": storeys, "storey_m": draft.number(2.9, 3.6, name, "storey"), "category": category,
        "as": f"{name}_top",
    }  # fmt: skip
    if not flat:
        kind = draft.pick(["gable", "hip"], name, "roof_kind")
        arguments |= {"roof_kind": kind, "roof_m": draft.number(1.8, 3.0, name, "roof_m")}
    draft.make("building", **arguments)
    draft.take(box.shape())
    front_slots(draft, box, street_deg)
    if flat:
        draft.slots_over("roof", box.grown(-2.2), 4.6, (3.2, 3.2), yaw_deg=street_deg, on=f"{name}_top")


def front_slots(draft: Draft, box: Box, street_deg: float, step_m: float = 3.4) -> None:
    """Offer slots (``front``) along the side of a box that looks along a direction of the four."""
    (cx, cy), (ux, uy), length = box.side(street_deg, 1.3)
    n = int((length - 1.0) // step_m)
    for k in range(n):
        v = (k - (n - 1) / 2) * step_m
        draft.slot("front", cx + ux * v, cy + uy * v, street_deg, (2.2, 3.0))


def edge_slots(draft: Draft, kind: str, box: Box, step_m: float, room_m: tuple[float, float]) -> None:
    """Offer slots around the inside of a box, fronts to its middle, where the ground is free."""
    x0, y0, x1, y1 = box
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    for line, yaw in zip(map(shapely.LineString, pairwise(corners)), (90.0, 180.0, 270.0, 0.0), strict=True):
        for k in range(int(line.length // step_m)):
            p = line.interpolate((k + 0.5) * step_m)
            if draft.is_free(p.buffer(max(room_m) / 2)):
                draft.slot(kind, p.x, p.y, yaw, room_m)
