"""Spatial relations between the instances of a scene, computed from their meshes.

The one rule of direction: a compass octant from the nearest landmark, from centroid to centroid in the plane. Each
relation takes a `slack`: with 1 it holds if a person could truly say so, with more if somebody might still think so,
as for the distractors of a description.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.frames import compass_direction, wrap_angle_rad
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

DISTRACTOR_SLACK = 1.35

# The one table of distances, for relations and for conditions of places.
TOUCHING_M, AGAINST_M = 0.3, 0.5
BESIDE_M, AT_M, NEAR_M = 3.0, 5.0, 8.0
SIDE_M = 12.0
BETWEEN_M = 6.0
LEVEL_M = 1.5  # less than a storey: things on different floors are not beside each other
COVER_M = 12.0
BETWEEN_DEG = 120.0
FRONT_DEG = 60.0
# Nearer to the border of an octant than this, texts name no direction.
BORDER_DEG = 5.0
_HALF_DEG = 22.5
_LARGE_M = 10.0  # larger things use the projected mesh as outline, smaller ones the convex hull
_MANY_FACES = 20_000
_GRID_M = 1e-3
# Outlines on the grid may exceed their boxes by this much, both of them.
_GRID_SLACK_M = 2.0 * _GRID_M
_TOUCH_M = 0.35
_HELD = 3  # of five probes below a thing


@dataclass(frozen=True)
class Bearing:
    """Index of the nearest landmark in the plane, and the compass direction from it."""

    landmark: int
    direction: str
    clear: bool = field(default=True, compare=False)  # At least `BORDER_DEG` from the octant's borders


def nearest_landmark(centre_m: NDArray[np.float64], landmarks_m: NDArray[np.float64]) -> Bearing | None:
    """Find the nearest landmark in the plane (centres in world metres); None where there is no direction."""
    if len(landmarks_m) == 0:
        return None
    offset = np.asarray(centre_m)[:2] - np.asarray(landmarks_m)[:, :2]
    # Rounded to millimetres, so that the result does not depend on floating-point noise.
    nearest = int(np.argmin(np.round(np.hypot(offset[:, 0], offset[:, 1]), 3)))
    dx, dy = float(offset[nearest, 0]), float(offset[nearest, 1])
    if dx == 0.0 and dy == 0.0:
        return None
    direction = compass_direction(dx, dy)
    return Bearing(nearest, direction, lies_towards(offset[nearest], direction, _HALF_DEG - BORDER_DEG))


def lies_towards(offset_m: ArrayLike, direction: str, most_deg: float = _HALF_DEG) -> bool:
    """Whether a displacement in metres is at most so many degrees off the middle of an octant."""
    dx, dy = (float(c) for c in np.asarray(offset_m)[:2])
    return (dx, dy) != (0.0, 0.0) and _off_octant_rad(math.atan2(dy, dx), direction) <= math.radians(most_deg)


def _off_octant_rad(bearing_rad: float, direction: str) -> float:
    return abs(float(wrap_angle_rad(bearing_rad - math.radians(45.0 * DIRECTIONS.index(direction)))))


class SceneGeometry:
    """Distances and relations between the instances of a scene, computed lazily."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.index = {instance.node: i for i, instance in enumerate(scene.instances)}
        self.boxes: Floats = np.array([instance.bounds for instance in scene.instances]).reshape(-1, 2, 3)
        self.centres: Floats = self.boxes.mean(axis=1)
        self._heights_m: list[list[float]] = self.boxes[:, :, 2].tolist()

    @classmethod
    def of(cls, scene: Scene) -> SceneGeometry:
        """Return the scene context's geometry."""
        return context_of(scene).part("geometry", lambda: cls(scene))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        low, high = self.boxes[:, 0], self.boxes[:, 1]
        return shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))

    # One thing or pair is asked for by several relations, and by claims of other things.

    @cached_method
    def outline(self, i: int) -> shapely.Geometry:
        """The outline of an instance on the ground, metres."""
        instance = self.scene.instances[i]
        xy = instance.vertices[:, :2]
        # A line, because GEOS makes an object of every one of several points.
        outline = shapely.convex_hull(shapely.linestrings(xy))
        if np.ptp(xy, axis=0).max() >= _LARGE_M and len(instance.faces) <= _MANY_FACES:
            triangles = shapely.polygons(xy[instance.faces])
            solid = shapely.area(triangles) > 1e-6
            outline = shapely.union_all(triangles[solid], grid_size=_GRID_M) if solid.any() else outline
        shapely.prepare(outline)
        return outline

    def _within(self, i: int, j: int, reach_m: float) -> bool:
        """Whether two instances are at most `reach_m` apart; boxes decide most cases without outlines."""
        (low_i, high_i), (low_j, high_j) = self.boxes[i].tolist(), self.boxes[j].tolist()
        gaps = [max(low_j[k] - high_i[k], low_i[k] - high_j[k], 0.0) for k in (0, 1)]
        return math.hypot(*gaps) <= reach_m + _GRID_SLACK_M and self.gap_m(i, j) <= reach_m

    def gap_m(self, i: int, j: int) -> float:
        """Distance between two instances: horizontally between outlines, vertically between height ranges."""
        return math.hypot(self.level_gap_m(i, j), self._rise_m(i, j))

    @cached_method
    def level_gap_m(self, i: int, j: int) -> float:
        """Horizontal distance between the outlines of two instances, metres."""
        return float(shapely.distance(self.outline(i), self.outline(j)))

    def _rise_m(self, i: int, j: int) -> float:
        (low_i, high_i), (low_j, high_j) = self._heights_m[i], self._heights_m[j]
        return max(0.0, low_j - high_i, low_i - high_j)

    @cached_method
    def neighbours(self, i: int, radius_m: float) -> list[int]:
        """Other instances whose boxes are within a distance of an instance's box."""
        (x0, y0, z0), (x1, y1, z1) = self.boxes[i]
        r = radius_m
        hits = np.sort(self._tree.query(shapely.box(x0 - r, y0 - r, x1 + r, y1 + r)))
        level = (self.boxes[hits, 0, 2] <= z1 + r) & (self.boxes[hits, 1, 2] >= z0 - r)
        return [j for j in hits[level].tolist() if j != i]

    @cached_method
    def support(self, i: int) -> int | None:
        """The supporting instance: the highest surface close to the bottom."""
        low = float(self.boxes[i, 0, 2])
        best: tuple[float, int] | None = None
        for x, y in self.probes(i):
            for j, heights in self.columns(i, x, y):
                below = heights[heights <= low + _TOUCH_M]
                if len(below) and below.max() >= low - _TOUCH_M and (best is None or below.max() > best[0]):
                    best = (float(below.max()), j)
        return None if best is None else best[1]

    def rests_on(self, i: int, j: int) -> bool:
        """Whether `j` supports `i` over an area and does not rise next to it: a truck is not on a tower."""
        low = float(self.boxes[i, 0, 2])
        if float(self.boxes[j, 1, 2]) > low + LEVEL_M:
            return False
        held = 0
        for x, y in self.probes(i):
            own, under = self._heights(i, x, y), self._heights(j, x, y)
            foot = float(own.min()) if len(own) else math.inf
            held += foot <= low + _TOUCH_M and bool((np.abs(under - foot) <= _TOUCH_M).any())
        return held >= _HELD

    @cached_method
    def covers(self, i: int) -> frozenset[int]:
        """Instances with a surface overhead, at most `COVER_M` above the instance's top."""
        high = float(self.boxes[i, 1, 2])
        x, y = self.centres[i, :2]
        lowest: dict[int, float] = {}
        for j, heights in self.columns(i, float(x), float(y)):
            overhead = heights[(heights >= high - 0.05) & (heights <= high + COVER_M)]
            if len(overhead):
                lowest[j] = float(overhead.min())
        # Things on top of the ceiling do not count.
        limit = min(lowest.values(), default=0.0) + 1.0
        return frozenset(j for j, z in lowest.items() if z <= limit)

    def probes(self, i: int) -> list[tuple[float, float]]:
        """Points at which to look for the support: the centre and four around it."""
        (x, y), (rx, ry) = self.centres[i, :2], 0.3 * (self.boxes[i, 1, :2] - self.boxes[i, 0, :2])
        return [(x, y), (x - rx, y - ry), (x + rx, y - ry), (x - rx, y + ry), (x + rx, y + ry)]

    def columns(self, i: int, x: float, y: float) -> list[tuple[int, Floats]]:
        """Other instances with surfaces above or below a point, and their heights."""
        return [(j, heights) for j, heights in self._column(x, y) if j != i]

    @cached_method
    def _column(self, x: float, y: float) -> list[tuple[int, Floats]]:
        things = np.sort(self._tree.query(shapely.Point(x, y))).tolist()
        return [(j, heights) for j in things if len(heights := self._heights(j, x, y))]

    def surfaces(self, j: int, x: float, y: float) -> list[tuple[str, Floats]]:
        """Materials of an instance above or below a point, and their heights, metres."""
        heights, faces = self._crossed(j, x, y)
        if not len(heights):
            return []
        ends = np.cumsum([len(part.faces) for part in self.scene.instances[j].parts])
        owners = np.searchsorted(ends, faces, side="right")
        parts = self.scene.instances[j].parts
        return [(parts[k].material, heights[owners == k]) for k in np.unique(owners)]

    def _heights(self, j: int, x: float, y: float) -> Floats:
        return self._crossed(j, x, y)[0]

    def _crossed(self, j: int, x: float, y: float) -> tuple[Floats, NDArray[np.intp]]:
        """Heights of an instance's triangles at a point, and their face indices."""
        triangles, faces = self._not_vertical(j)
        z, which = _heights_at(triangles, x, y)
        return z, faces[which]

    @cached_method
    def _not_vertical(self, j: int) -> tuple[Floats, NDArray[np.intp]]:
        """Corners of the triangles that are not vertical, and twice their signed areas from above, (n, 10); faces."""
        instance = self.scene.instances[j]
        a, b, c = np.moveaxis(instance.vertices[instance.faces], 1, 0)
        det = (b[:, 1] - c[:, 1]) * (a[:, 0] - c[:, 0]) + (c[:, 0] - b[:, 0]) * (a[:, 1] - c[:, 1])
        flat = np.abs(det) > 1e-12
        return np.column_stack([a[flat], b[flat], c[flat], det[flat]]), np.flatnonzero(flat)

    @cached_method
    def bearing_rad(self, i: int, j: int) -> float | None:
        """Direction from the nearest point of `j`'s outline to the centre of `i`; None inside the outline."""
        x, y = self.centres[i, :2].tolist()
        line = shapely.get_coordinates(shapely.shortest_line(self.outline(j), shapely.points(x, y)))
        far = len(line) > 0 and math.dist(*line) >= 0.05
        return math.atan2(y - line[0, 1], x - line[0, 0]) if far else None

    def beside(self, i: int, j: int, slack: float = 1.0) -> bool:
        """`i` is close to `j`, not on, under or over it."""
        if (
            not self._level(i, j, slack)
            or not self._within(i, j, BESIDE_M * slack)
            or j in self.covers(i)
            or i in self.covers(j)
        ):
            return False
        stacked = self.support(i) == j or self.support(j) == i
        within = self.level_gap_m(i, j) == 0.0 and float(np.ptp(self.boxes[j, :, :2], axis=0).max()) > _LARGE_M
        return not stacked and not within

    def near(self, i: int, j: int, slack: float = 1.0, most_m: float = NEAR_M) -> bool:
        """`i` is a few steps from `j`, or at most that far, at about the same level."""
        return self._level(i, j, slack) and self._within(i, j, most_m * slack)

    def front(self, i: int, j: int, slack: float = 1.0) -> bool:
        """`i` is in front of `j`; for things without a front, close to it."""
        return self._before(i, j, slack, 0.0)

    def behind(self, i: int, j: int, slack: float = 1.0) -> bool:
        """`i` is behind `j`; for things without a front, close to it."""
        return self._before(i, j, slack, math.pi)

    def _before(self, i: int, j: int, slack: float, turn_rad: float) -> bool:
        if not self.near(i, j, slack, AT_M):
            return False
        anatomy = self.scene.instances[j].anatomy
        fronts = anatomy.fronts_rad if anatomy is not None else ()
        # Things with two fronts have no back: both other sides count.
        if not fronts or (turn_rad and len(fronts) > 1):
            return True
        bearing = self.bearing_rad(i, j)
        most = math.radians(FRONT_DEG) * slack
        return bearing is not None and any(abs(wrap_angle_rad(bearing - f - turn_rad)) <= most for f in fronts)

    def _level(self, i: int, j: int, slack: float) -> bool:
        return self._rise_m(i, j) <= LEVEL_M * slack

    def on(self, i: int, j: int, slack: float = 1.0) -> bool:
        """`i` stands on `j`."""
        return self.support(i) == j

    def under(self, i: int, j: int, slack: float = 1.0) -> bool:
        """`j` has a surface above `i`."""
        return j in self.covers(i)

    def above(self, i: int, j: int, slack: float = 1.0) -> bool:
        """`i` is above `j`, or on it."""
        return i in self.covers(j) or self.support(i) == j

    def side(self, i: int, j: int, direction: str, slack: float = 1.0) -> bool:
        """`i` is in that compass direction of `j`, not far away."""
        if not (self._level(i, j, slack) and self._within(i, j, SIDE_M * slack)):
            return False
        bearing = self.bearing_rad(i, j)
        return bearing is not None and _off_octant_rad(bearing, direction) <= math.radians(_HALF_DEG) * slack

    def between(self, i: int, j: int, k: int, slack: float = 1.0) -> bool:
        """`i` is between `j` and `k`: close to both, on opposite sides."""
        if not (self._level(i, j, slack) and self._level(i, k, slack)):
            return False
        if j == k or not all(self._within(i, other, BETWEEN_M * slack) for other in (j, k)):
            return False
        a, b = self.bearing_rad(i, j), self.bearing_rad(i, k)
        return a is not None and b is not None and bool(
            abs(float(wrap_angle_rad(a - b))) >= math.radians(BETWEEN_DEG) / slack
        )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _heights_at(triangles: Floats, x: float, y: float) -> tuple[Floats, NDArray[np.int64]]:
    """Heights of the triangles above or below a point, and their indices."""
    z, which = np.empty(len(triangles)), np.empty(len(triangles), dtype=np.int64)
    n = 0
    for k in range(len(triangles)):
        ax, ay, az, bx, by, bz, cx, cy, cz, det = triangles[k]
        u = ((by - cy) * (x - cx) + (cx - bx) * (y - cy)) / det
        if not 0.0 <= u <= 1.0:
            continue
        v = ((cy - ay) * (x - cx) + (ax - cx) * (y - cy)) / det
        if v >= 0.0 and u + v <= 1.0:
            z[n], which[n] = u * az + v * bz + (1.0 - u - v) * cz, k
            n += 1
    return z[:n], which[:n]
