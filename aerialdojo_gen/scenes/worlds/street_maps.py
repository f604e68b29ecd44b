"""Streets that meet, the slots at their kerbs, and rows of plots beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft

Point = tuple[float, float]
LANE_M, PAVEMENT_M = 3.0, 1.8
HALF_M = LANE_M + PAVEMENT_M


class Way(NamedTuple):
    """A street or a footway: where it goes, and half its width with pavements, metres."""

    line: shapely.LineString
    half_m: float = HALF_M
    paved: bool = True  # Whether it has kerbs and traffic


def pose_on(line: shapely.LineString, at_m: float, side: int, away_m: float) -> tuple[float, float, float]:
    """Give a point beside a line, left of it for side 1, and the direction from there to the line, degrees."""
    here, there = line.interpolate(at_m), line.interpolate(min(at_m + 0.5, line.length))
    back = line.interpolate(max(at_m - 0.5, 0.0))
    yaw = math.atan2(there.y - back.y, there.x - back.x)
    x, y = here.x - math.sin(yaw) * side * away_m, here.y + math.cos(yaw) * side * away_m
    return round(x, 2), round(y, 2), round(math.degrees(yaw) - side * 90.0, 1)


def streets(draft: Draft, paths: dict[str, Any], lines: Sequence[shapely.LineString], **more: Any) -> list[Way]:
    """Pave streets that meet, two lanes each, and take their ground; `paths` as plans write them."""
    draft.make(
        "streets", paths=list(paths.values()), lane_m=LANE_M, pavement_m=PAVEMENT_M,
        surface=draft.material("street"), pavement=draft.material("pavement"), **more,
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
