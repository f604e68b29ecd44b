"""The collision world: FCL, one bounding-volume hierarchy an instance under a dynamic AABB tree.

FCL is asked for what must be right beyond doubt: the certificate of every route, and the distance to a surface.
Surfaces are what it knows: a point deep inside a closed solid is far from every surface and not in collision here
(`aerialdojo_gen.planning.clearance.ClearanceGrid.reachable` tells such points apart).
"""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Sequence

import fcl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Instance, Scene

# A ball of no size: FCL measures distances between shapes, and has no point.
_POINT_RADIUS_M = 1e-6


def _bvh(instance: Instance) -> fcl.BVHModel:
    vertices, faces = instance.vertices, instance.faces
    model = fcl.BVHModel()
    model.beginModel(len(faces), len(vertices))
    model.addSubModel(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64))
    model.endModel()
    return model


def _along_z(ux: float, uy: float, uz: float) -> NDArray[np.float64]:
    """Rotation matrix whose third column is the unit vector u: FCL's capsules lie along z."""
    if abs(uz) > 1.0 - 1e-12:
        return np.eye(3)  # a capsule looks the same from both ends
    h = math.hypot(ux, uy)
    cx, cy = -uy / h, ux / h
    return np.array([[cx, -uz * cy, ux], [cy, uz * cx, uy], [0.0, h, uz]])


class _Shapes(threading.local):
    """What queries move about: a thread's own, for two threads may ask one world."""

    def __init__(self) -> None:
        self.spheres: dict[float, fcl.CollisionObject] = {}
        self.capsules: dict[tuple[float, float], fcl.CollisionObject] = {}


class CollisionWorld:
    """Collision and distance queries against all instances of a scene.

    Parameters
    ----------
    scene : Scene
        World coordinates, metres.
    """

    def __init__(self, scene: Scene) -> None:
        self._objects = {i.node: fcl.CollisionObject(_bvh(i), fcl.Transform()) for i in scene.instances}
        self._manager = fcl.DynamicAABBTreeCollisionManager()
        self._manager.registerObjects(list(self._objects.values()))
        self._manager.setup()
        self._request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
        self._shapes = _Shapes()

    def sphere_in_collision(self, p: ArrayLike, radius_m: float) -> bool:
        """Whether a ball touches a surface.

        Parameters
        ----------
        p : (3,) float
            Centre, world frame, metres.
        radius_m : float
            Radius of the ball.

        Returns
        -------
        bool
            True for a collision.
        """
        return self._collides(self._sphere(p, radius_m))

    def segment_in_collision(self, p: ArrayLike, q: ArrayLike, radius_m: float) -> bool:
        """Whether a ball that moves straight from `p` to `q` touches a surface anywhere on its way.

        The ball's sweep is exactly a capsule, so that nothing is sampled.

        Parameters
        ----------
        p, q : (3,) float
            Ends of the centre's way, world frame, metres.
        radius_m : float
            Radius of the ball.

        Returns
        -------
        bool
            True for a collision.
        """
        ax, ay, az = np.asarray(p, np.float64).tolist()
        bx, by, bz = np.asarray(q, np.float64).tolist()
        dx, dy, dz = bx - ax, by - ay, bz - az
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length < 1e-9:
            return self.sphere_in_collision(p, radius_m)
        key = (radius_m, round(length, 9))
        capsules = self._shapes.capsules
        capsule = capsules.get(key)
        if capsule is None:
            if len(capsules) > 256:
                capsules.clear()
            capsule = capsules[key] = fcl.CollisionObject(fcl.Capsule(radius_m, key[1]))
        capsule.setRotation(_along_z(dx / length, dy / length, dz / length))
        capsule.setTranslation(np.array([(ax + bx) / 2, (ay + by) / 2, (az + bz) / 2]))
        return self._collides(capsule)

    def distance_m(self, p: ArrayLike) -> float:
        """Distance from a point to the nearest surface of the scene, metres; infinite in an empty scene.

        Parameters
        ----------
        p : (3,) float
            World frame, metres.
        """
        if not self._objects:
            return float("inf")
        data = fcl.DistanceData()
        self._manager.distance(self._sphere(p, _POINT_RADIUS_M), data, fcl.defaultDistanceCallback)
        return max(float(data.result.min_distance), 0.0) + _POINT_RADIUS_M

    def instance_distance_m(self, node: str, p: ArrayLike) -> float:
        """Distance from a point to the surface of one instance, metres.

        Parameters
        ----------
        node : str
            Node name of the instance.
        p : (3,) float
            World frame, metres.

        Raises
        ------
        KeyError
            There is no such node.
        """
        request, result = fcl.DistanceRequest(), fcl.DistanceResult()
        distance = fcl.distance(self._sphere(p, _POINT_RADIUS_M), self._objects[node], request, result)
        return max(float(distance), 0.0) + _POINT_RADIUS_M

    def route_in_collision(self, points: Sequence[ArrayLike] | NDArray[np.float64], radius_m: float) -> bool:
        """Whether a ball that follows a polyline touches a surface.

        Parameters
        ----------
        points : (n, 3) float
            Corners of the way, world frame, metres.
        radius_m : float
            Radius of the ball.

        Returns
        -------
        bool
            True for a collision.
        """
        p = np.asarray(points, np.float64)
        if len(p) == 1:
            return self.sphere_in_collision(p[0], radius_m)
        return any(self.segment_in_collision(a, b, radius_m) for a, b in itertools.pairwise(p))

    def _sphere(self, p: ArrayLike, radius_m: float) -> fcl.CollisionObject:
        spheres = self._shapes.spheres
        sphere = spheres.get(radius_m)
        if sphere is None:
            sphere = spheres[radius_m] = fcl.CollisionObject(fcl.Sphere(radius_m))
        sphere.setTranslation(np.asarray(p, np.float64))
        return sphere

    def _collides(self, shape: fcl.CollisionObject) -> bool:
        data = fcl.CollisionData(self._request, fcl.CollisionResult())
        self._manager.collide(shape, data, fcl.defaultCollisionCallback)
        return bool(data.result.is_collision)


def collision_world(scene: Scene) -> CollisionWorld:
    """Return the scene's one collision world; two threads may ask it."""
    return context_of(scene).part("collision world", lambda: CollisionWorld(scene))
