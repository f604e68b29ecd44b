"""Ray casts against a whole scene, over Embree."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import ArrayLike

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Int32s, Ints, Singles
from aerialdojo_gen.geometry.soup import Body, SceneLike, soup


@njit(cache=True)
def _rays(origins: Floats, directions: Floats, centre: Floats) -> tuple[Floats, Singles, Singles]:
    """Unit directions, and origins and directions in Embree's format."""
    n = len(directions)
    unit, start, aim = np.empty((n, 3)), np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    for i in range(n):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        for a in range(3):
            unit[i, a] = directions[i, a] / length
            aim[i, a] = unit[i, a]
            start[i, a] = origins[i, a] - centre[a]
    return unit, start, aim


@njit(cache=True)
def _hits(
    which: Int32s, rough: Singles, origins: Floats, unit: Floats, corner: Floats, normal: Floats, faces: Int32s
) -> tuple[Floats, Int32s]:
    """Distances along rays from the planes of the triangles that they hit, and the faces that these are."""
    n = len(which)
    distance, face = np.full(n, np.inf), np.full(n, -1, np.int32)
    for i in range(n):
        k = which[i]
        if k < 0:
            continue
        facing = height = 0.0
        for a in range(3):
            facing += normal[k, a] * unit[i, a]
            height += normal[k, a] * (corner[k, a] - origins[i, a])
        # A ray along the triangle's plane has no point on it: there Embree's own distance stands.
        near = np.float64(rough[i])
        exact = height / facing if facing != 0.0 else near
        distance[i] = max(exact, 0.0) if abs(exact - near) < 1e-2 else near
        face[i] = faces[k]
    return distance, face


@njit(cache=True, error_model="numpy")
def _towards(
    origins: Floats, points: Floats, row: Int32s, column: Int32s, centre: Floats, least_m: float
) -> tuple[Ints, Floats, Floats, Singles, Singles]:
    """Rays between rows of origins and points beyond `least_m`: which, lengths, directions, and Embree's input."""
    n, k = len(row), 0
    which, length = np.empty(n, np.int64), np.empty(n)
    unit, start, aim = np.empty((n, 3)), np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    for i in range(n):
        o, p = origins[row[i]], points[column[i]]
        x, y, z = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        away = np.sqrt(x * x + y * y + z * z)
        if not away > least_m:
            continue
        which[k], length[k] = i, away
        unit[k, 0], unit[k, 1], unit[k, 2] = x / away, y / away, z / away
        for a in range(3):
            aim[k, a], start[k, a] = unit[k, a], o[a] - centre[a]
        k += 1
    return which[:k], length[:k], unit[:k], start[:k], aim[:k]


class TriangleRayCaster:
    """First hits of rays on a heap of triangles.

    Embree works in float32: it finds the triangle, and the distance is then computed in float64 from that triangle's
    plane, so that it is exact to about 1e-9 m. Coordinates are centred first; over 400 m Embree itself is good to
    about 0.02 mm, which decides only which of two triangles a ray at their very edge takes.
    """

    def __init__(self, vertices: Floats, faces: Int32s) -> None:
        triangles = np.asarray(vertices, dtype=np.float64)[faces]
        # A hit's distance comes from its triangle's plane: a sliver without a normal has none.
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        self._face = np.flatnonzero((normals != 0.0).any(axis=1)).astype(np.int32)
        if not len(self._face):
            raise ValueError("no triangle with an area to cast rays at")
        self._corner, self._normal = triangles[self._face, 0], normals[self._face]
        self._corners, self._normals = triangles, normals
        self._centre = (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1))) / 2.0
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(
            self._scene,
            (np.asarray(vertices, dtype=np.float64) - self._centre).astype(np.float32),
            np.ascontiguousarray(faces[self._face], dtype=np.int32),
        )

    @cached_property
    def triangles(self) -> tuple[Floats, Floats]:
        """Corners (n, 3, 3), world metres, and unit normals (n, 3) of all faces: of a face without area, zeros."""
        length = np.linalg.norm(self._normals, axis=1, keepdims=True)
        return self._corners, self._normals / np.where(length > 0.0, length, 1.0)

    def first_hit(self, origins: ArrayLike, directions: ArrayLike) -> tuple[Floats, Int32s]:
        """First hit along rays, (n, 3) world metres: distance (inf for none) and face (-1 for none), (n,) each."""
        d = np.asarray(directions, dtype=np.float64)
        if not len(d):
            return np.zeros(0), np.zeros(0, np.int32)
        o = np.broadcast_to(np.asarray(origins, dtype=np.float64), d.shape)
        unit, start, aim = _rays(o, np.broadcast_to(d, d.shape), self._centre)
        hit = self._scene.run(start, aim, output=True)
        distance, face = _hits(hit["primID"], hit["tfar"], o, unit, self._corner, self._normal, self._face)
        return distance, face

    def unobstructed(
        self,
        origins: ArrayLike,
        points: ArrayLike,
        tolerance_m: float = 5e-3,
        ends: tuple[Int32s, Int32s] | None = None,
    ) -> Flags:
        """Whether segments from origins to points, (n, 3) world metres, are free but for the last `tolerance_m`.

        (n,) bool. `ends` names the rows of origins and points that each segment joins, where these are not in pairs.
        """
        if ends is None:
            o, p, row = _pairs(origins, points)
            ends = row, row
        else:
            o, p = np.ascontiguousarray(origins, dtype=np.float64), np.ascontiguousarray(points, dtype=np.float64)
        free = np.ones(len(ends[0]), dtype=np.bool_)
        far, length, _, start, aim = _towards(o, p, *ends, self._centre, tolerance_m)
        if len(far):
            # Any hit will do, and Embree need not find the first one: twice as fast as `first_hit`.
            dists = (length - tolerance_m).astype(np.float32)
            free[far] = np.asarray(self._scene.run(start, aim, dists=dists, query="OCCLUDED")) < 0
        return free

    def first_between(
        self, origins: ArrayLike, points: ArrayLike, least_m: float
    ) -> tuple[Ints, Floats, Floats, Int32s]:
        """First hit towards points further than `least_m`: which (k,), and length, distance and face of the hit."""
        o, p, row = _pairs(origins, points)
        far, length, unit, start, aim = _towards(o, p, row, row, self._centre, least_m)
        if not len(far):
            return far, length, np.zeros(0), np.zeros(0, np.int32)
        hit = self._scene.run(start, aim, output=True)
        origin = o if len(far) == len(o) else o[far]
        return far, length, *_hits(hit["primID"], hit["tfar"], origin, unit, self._corner, self._normal, self._face)


def _pairs(origins: ArrayLike, points: ArrayLike) -> tuple[Floats, Floats, Int32s]:
    o, p = np.broadcast_arrays(np.asarray(origins, dtype=np.float64), np.asarray(points, dtype=np.float64))
    o, p = np.ascontiguousarray(np.atleast_2d(o)), np.ascontiguousarray(np.atleast_2d(p))
    return o, p, np.arange(len(p), dtype=np.int32)


class RayCaster:
    """First hits of rays on the instances of a scene."""

    def __init__(self, scene: SceneLike, triangles: TriangleRayCaster | None = None) -> None:
        self.nodes = tuple(i.node for i in scene.instances)
        self._owner = np.repeat(np.arange(len(self.nodes), dtype=np.int32), [len(i.faces) for i in scene.instances])
        self._triangles = triangles or TriangleRayCaster(*soup(scene.instances))

    def first_hit(self, origins: ArrayLike, directions: ArrayLike) -> tuple[Floats, Int32s]:
        """First hit along rays, world metres: distance (n,) and index of the instance (-1 for none)."""
        distance, face = self._triangles.first_hit(origins, directions)
        return distance, np.where(face >= 0, self._owner[face], np.int32(-1))

    def visible(
        self,
        origins: ArrayLike,
        points: ArrayLike,
        own_instance: int | Int32s | None = None,
        tolerance_m: float = 5e-3,
    ) -> Flags:
        """Whether points (n, 3) are seen from origins: nothing is hit before the point but its own instance."""
        shape = np.broadcast_shapes(np.shape(origins), np.shape(points))
        seen = np.ones(1 if len(shape) == 1 else shape[0], dtype=np.bool_)
        far, length, distance, face = self._triangles.first_between(origins, points, tolerance_m)
        reached = distance >= length - tolerance_m
        if own_instance is None:
            seen[far] = reached
        else:
            instance = np.where(face >= 0, self._owner[face], np.int32(-1))
            seen[far] = reached | (instance == np.broadcast_to(own_instance, seen.shape)[far])
        return seen


def instance_caster(instance: Body) -> TriangleRayCaster:
    """Cast rays at one instance as if it stood alone."""
    return TriangleRayCaster(instance.vertices, instance.faces)
