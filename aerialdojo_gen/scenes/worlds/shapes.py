"""Plane geometry of worlds: points, poses, boxes and lines, x east, y north, metres and degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

Point = tuple[float, float]
Pose = tuple[float, float, float]  # x, y, direction
SIDES = (0.0, 90.0, 180.0, 270.0)


class Box(NamedTuple):
    """A rectangle of ground, metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    @classmethod
    def about(cls, x: float, y: float, width: float, depth: float) -> Box:
        """Make a box about its middle."""
        return cls(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)

    @property
    def width(self) -> float:
        """Extent along x."""
        return self.x1 - self.x0

    @property
    def depth(self) -> float:
        """Extent along y."""
        return self.y1 - self.y0

    @property
    def upright(self) -> bool:
        """Whether it is longer along y."""
        return self.depth > self.width

    @property
    def middle(self) -> Point:
        """Its middle."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2

    def grown(self, by_m: float) -> Box:
        """Return it grown to all sides, or with a negative number shrunk."""
        return Box(self.x0 - by_m, self.y0 - by_m, self.x1 + by_m, self.y1 + by_m)

    def shape(self) -> shapely.Polygon:
        """Return it as a polygon."""
        return shapely.box(*self)

    def rounded(self) -> list[float]:
        """Return it as plans write it."""
        return [round(v, 2) for v in self]

    def side(self, yaw: float, out_m: float = 0.0) -> tuple[Point, Point, float]:
        """Middle of the side that looks along a direction of the four, the unit vector along it, its length."""
        x, y = self.middle
        out = {
            0: (self.x1 + out_m, y), 90: (x, self.y1 + out_m), 180: (self.x0 - out_m, y), 270: (x, self.y0 - out_m),
        }  # fmt: skip
        upright = round(yaw) % 180 == 0
        return out[round(yaw) % 360], ((0.0, 1.0) if upright else (1.0, 0.0)), self.depth if upright else self.width

    def grid(self, step_m: float) -> list[Point]:
        """Points over it, evenly, at least that far apart."""
        nx, ny = max(int(self.width // step_m), 0), max(int(self.depth // step_m), 0)
        return [
            (self.x0 + (i + 0.5) * self.width / nx, self.y0 + (j + 0.5) * self.depth / ny)
            for i in range(nx)
            for j in range(ny)
        ]


def point(x: float, y: float) -> Point:
    """Round a point to decimetres, as plans write it."""
    return round(x, 1), round(y, 1)


def beside(pose: Pose, ahead_m: float, left_m: float = 0.0) -> Point:
    """Point ahead of a pose and to its left."""
    c, s = math.cos(math.radians(pose[2])), math.sin(math.radians(pose[2]))
    return round(pose[0] + c * ahead_m - s * left_m, 2), round(pose[1] + s * ahead_m + c * left_m, 2)


def ahead(at: Point, yaw_deg: float, by_m: float, left_m: float = 0.0) -> Point:
    """Point that lies so far from another in a direction, and to the left of it."""
    return beside((*at, yaw_deg), by_m, left_m)


def towards(at: Point, to: Point) -> float:
    """Direction from a point to another, degrees."""
    return math.degrees(math.atan2(to[1] - at[1], to[0] - at[0]))


def heading(line: shapely.LineString, at_m: float) -> Pose:
    """Point of a line, and the direction of the line from there on."""
    here, there = line.interpolate(at_m), line.interpolate(at_m + 0.5)
    return here.x, here.y, towards((here.x, here.y), (there.x, there.y))


def pose_on(line: shapely.LineString, at_m: float, side: int, away_m: float) -> Pose:
    """Give a point beside a line, left of it for side 1, and the direction from there to the line."""
    here, there = line.interpolate(at_m), line.interpolate(min(at_m + 0.5, line.length))
    back = line.interpolate(max(at_m - 0.5, 0.0))
    yaw = math.atan2(there.y - back.y, there.x - back.x)
    x, y = here.x - math.sin(yaw) * side * away_m, here.y + math.cos(yaw) * side * away_m
    return round(x, 2), round(y, 2), round(math.degrees(yaw) - side * 90.0, 1)


def smoothed(points: Sequence[Point], times: int) -> shapely.LineString:
    """Cut corners so often, as plans do."""
    line = np.array(points)
    for _ in range(times):
        first, last = line[:-1] * 0.75 + line[1:] * 0.25, line[:-1] * 0.25 + line[1:] * 0.75
        line = np.concatenate([line[:1], np.stack([first, last], 1).reshape(-1, 2), line[-1:]])
    return shapely.LineString(line)
