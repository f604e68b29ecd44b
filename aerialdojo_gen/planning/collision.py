"""The collision world: FCL, one bounding-volume hierarchy per instance, built on first use.

FCL decides the certificate of every route, and distances to surfaces. It knows surfaces only: a point deep inside a
closed solid is not in collision here (`aerialdojo_gen.planning.clearance.ClearanceGrid.reachable` detects it).
"""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Sequence
from functools import cached_property

import fcl
import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Ints
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Instance, Scene

# FCL has no point shape: distances are measured from a tiny ball.
_POINT_RADIUS_M = 1e-6
# A margin above FCL's rounding of boxes.
_BOX_MARGIN_M = 1e-6


def _bvh(instance: Instance) -> fcl.BVHModel:
    vertices, faces = instance.vertices, instance.faces
    model = fcl.BVHModel()
    model.beginModel(len(faces), len(vertices))
    model.addSubModel(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64))
    model.endModel()
    return model


def _along_z(ux: float, uy: float, uz: float) -> Floats:
    """Rotation matrix whose third column is the unit vector u: FCL's capsules lie along z."""
    if abs(uz) > 1.0 - 1e-12:
        return np.eye(3)  # a capsule looks the same from both ends
    h = math.hypot(ux, uy)
    cx, cy = -uy / h, ux / h
    return np.array([[cx, -uz * cy, ux], [cy, uz * cx, uy], [0.0, h, uz]])


class _Shapes(threading.local):
    """Query shapes, one set per thread: two threads may query one world."""

    def __init__(self) -> None:
        self._made: dict[tuple[float, float], fcl.CollisionObject] = {}

    def of(self, radius_m: float, length_m: float = 0.0) -> fcl.CollisionObject:
        """Return a capsule of that length between the middles of its ends; a ball for none."""
        key = (radius_m, length_m)
        if key not in self._made:
            if len(self._made) > 256:
                self._made.clear()
            self._made[key] = fcl.CollisionObject(fcl.Capsule(*key) if length_m else fcl.Sphere(radius_m))
        return self._made[key]


@njit(cache=True)
def _boxes_on_the_way(
    boxes: Floats, ax: float, ay: float, az: float, bx: float, by: float, bz: float, r: float
) -> Ints:
    """Rows of boxes (n, 6) that the segment ab enters once they are wider by r on all sides."""
    found = np.empty(len(boxes), np.int64)
    n = 0
    for k in range(len(boxes)):
        b = boxes[k]
        # Slabs: the part of the segment, 0 to 1, that is between the planes of each axis.
        first, last = 0.0, 1.0
        for a, way, low, high in (
            (ax, bx - ax, b[0] - r, b[3] + r), (ay, by - ay, b[1] - r, b[4] + r), (az, bz - az, b[2] - r, b[5] + r),
        ):  # fmt: skip
            if abs(way) < 1e-12:
                if a < low or a > high:
                    last = -1.0
            else:
                enter, leave = (low - a) / way, (high - a) / way
                first, last = max(first, min(enter, leave)), min(last, max(enter, leave))
        if first <= last:
            found[n] = k
            n += 1
    return found[:n]


class CollisionWorld:
    """Collision and distance queries, world metres, against all instances of a scene."""

    def __init__(self, scene: Scene) -> None:
        self._instances = scene.instances
        self._boxes = np.array([i.bounds for i in scene.instances], np.float64).reshape(-1, 6)
        # A hierarchy takes milliseconds to build, and most instances are never near a route.
        self._objects: dict[int, fcl.CollisionObject] = {}
        self._lock = threading.RLock()
        self._request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
        self._distances = fcl.DistanceRequest()
        self._shapes = _Shapes()

    def _object(self, k: int) -> fcl.CollisionObject:
        with self._lock:
            if k not in self._objects:
                self._objects[k] = fcl.CollisionObject(_bvh(self._instances[k]), fcl.Transform())
            return self._objects[k]

    @cached_property
    def _manager(self) -> fcl.DynamicAABBTreeCollisionManager:
        with self._lock:
            manager = fcl.DynamicAABBTreeCollisionManager()
            manager.registerObjects([self._object(k) for k in range(len(self._instances))])
            manager.setup()
            return manager

    def within(self, one: int, other: int, reach_m: float) -> bool:
        """Whether the surfaces of two instances, by their index, meet or are no further apart than `reach_m`."""
        a, b = self._object(one), self._object(other)
        if fcl.collide(a, b, self._request, fcl.CollisionResult()):
            return True
        return bool(fcl.distance(a, b, self._distances, fcl.DistanceResult()) <= reach_m)

    def sphere_in_collision(self, p: ArrayLike, radius_m: float) -> bool:
        """Whether a ball (centre (3,), world metres) touches a surface."""
        x, y, z = np.asarray(p, np.float64).tolist()
        return self._collides(self._sphere(p, radius_m), x, y, z, x, y, z, radius_m)

    def segment_in_collision(self, p: ArrayLike, q: ArrayLike, radius_m: float) -> bool:
        """Whether a ball moving straight from `p` to `q` touches a surface: its exact sweep, a capsule."""
        ax, ay, az = np.asarray(p, np.float64).tolist()
        bx, by, bz = np.asarray(q, np.float64).tolist()
        dx, dy, dz = bx - ax, by - ay, bz - az
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length < 1e-9:
            return self.sphere_in_collision(p, radius_m)
        capsule = self._shapes.of(radius_m, round(length, 9))
        capsule.setRotation(_along_z(dx / length, dy / length, dz / length))
        capsule.setTranslation(np.array([(ax + bx) / 2, (ay + by) / 2, (az + bz) / 2]))
        return self._collides(capsule, ax, ay, az, bx, by, bz, radius_m)

    def distance_m(self, p: ArrayLike) -> float:
        """Distance, metres, from a point to the nearest surface; inf if there is none."""
        if not self._instances:
            return float("inf")
        data = fcl.DistanceData()
        self._manager.distance(self._sphere(p, _POINT_RADIUS_M), data, fcl.defaultDistanceCallback)
        return max(float(data.result.min_distance), 0.0) + _POINT_RADIUS_M

    def route_in_collision(self, points: Sequence[ArrayLike] | Floats, radius_m: float) -> bool:
        """Whether a ball that follows a polyline (n, 3), world metres, touches a surface."""
        p = np.asarray(points, np.float64)
        if len(p) == 1:
            return self.sphere_in_collision(p[0], radius_m)
        return any(self.segment_in_collision(a, b, radius_m) for a, b in itertools.pairwise(p))

    def _sphere(self, p: ArrayLike, radius_m: float) -> fcl.CollisionObject:
        sphere = self._shapes.of(radius_m)
        sphere.setTranslation(np.asarray(p, np.float64))
        return sphere

    def _collides(
        self, shape: fcl.CollisionObject, ax: float, ay: float, az: float, bx: float, by: float, bz: float,
        radius_m: float,
    ) -> bool:  # fmt: skip
        """Whether a shape, all of it within a radius of the segment ab, touches a surface."""
        r = radius_m + _BOX_MARGIN_M
        candidates = _boxes_on_the_way(self._boxes, ax, ay, az, bx, by, bz, r)
        return any(fcl.collide(self._object(k), shape, self._request) for k in candidates.tolist())


def collision_world(scene: Scene) -> CollisionWorld:
    """Return the scene's one collision world; it may be used from several threads."""
    return context_of(scene).part("collision world", lambda: CollisionWorld(scene))
