"""Distances to a mesh's surface, points on it, and the way from outside to a given distance.

Exact in float64 and brute force over the triangles with a bounding-sphere test: an object has hundreds of them, and
a tree would cost more to build than all of its queries. Whole scenes are `aerialdojo_gen.planning.collision`'s.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Int32s, Ints
from aerialdojo_gen.geometry.portable import dot
from aerialdojo_gen.geometry.soup import Body
from aerialdojo_gen.geometry.triangles import closest_point_d2

_LEAST_AREA_M2 = 1e-12


@njit(cache=True)
def _distance(p: Floats, triangles: Floats, spheres: Floats, guess: int) -> tuple[float, int]:
    """Distance to the nearest triangle and its index, searched from a guess that prunes the rest."""
    nearest = guess
    best_sq = closest_point_d2(p, triangles[guess])
    best = np.sqrt(best_sq)
    for k in range(len(triangles)):
        x, y, z = p[0] - spheres[k, 0], p[1] - spheres[k, 1], p[2] - spheres[k, 2]
        reach = best + spheres[k, 3]
        if x * x + y * y + z * z < reach * reach:
            d_sq = closest_point_d2(p, triangles[k])
            if d_sq < best_sq:
                best_sq, nearest = d_sq, k
                best = np.sqrt(d_sq)
    return best, nearest


@njit(cache=True)
def _distances(points: Floats, triangles: Floats, spheres: Floats) -> tuple[Floats, Ints]:
    out = np.empty(len(points))
    which = np.empty(len(points), dtype=np.int64)
    nearest = 0
    for i in range(len(points)):
        out[i], nearest = _distance(points[i], triangles, spheres, nearest)
        which[i] = nearest
    return out, which


@njit(cache=True)
def _march(
    origins: Floats, directions: Floats, travel: Floats, triangles: Floats, spheres: Floats, offset: float, tol: float
) -> Floats:
    """Sphere tracing: a step of (distance - offset) can never jump over the surface at that offset."""
    out = np.full(len(origins), np.nan)
    p = np.empty(3)
    nearest = 0
    for i in range(len(origins)):
        t = 0.0
        for _ in range(200):
            for a in range(3):
                p[a] = origins[i, a] + t * directions[i, a]
            d, nearest = _distance(p, triangles, spheres, nearest)
            step = d - offset
            if step < tol:
                out[i] = t
                break
            t += step
            if t > travel[i]:
                break
    return out


class Surface:
    """The surface of one mesh."""

    def __init__(self, vertices: Floats, faces: Int32s) -> None:
        corners = np.asarray(vertices, dtype=np.float64)[faces]
        edges = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.areas_m2: Floats = np.linalg.norm(edges, axis=1) / 2.0
        # A triangle without area lies on its neighbours' edges in a sound mesh, and divides by zero in the kernel.
        sound = self.areas_m2 > _LEAST_AREA_M2
        corners, self.areas_m2 = corners[sound], self.areas_m2[sound]
        if not len(corners):
            raise ValueError("a surface needs a triangle with an area")
        self._corners = corners
        self._triangles = np.ascontiguousarray(corners.reshape(-1, 9))
        centre = (corners.min(axis=1) + corners.max(axis=1)) / 2.0
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        # Rounding must not prune a triangle that is as near as the best one.
        self._spheres = np.ascontiguousarray(np.column_stack([centre, radius * (1 + 1e-9) + 1e-9]))

    @classmethod
    def of(cls, instance: Body) -> Surface:
        """Take the surface of an instance."""
        return cls(instance.vertices, instance.faces)

    def distance_m(self, points: ArrayLike) -> Floats:
        """Unsigned distance, (n,) metres, from points (n, 3) to the surface."""
        p = np.ascontiguousarray(np.atleast_2d(np.asarray(points, dtype=np.float64)))
        return np.asarray(_distances(p, self._triangles, self._spheres)[0])

    def sample(self, n: int, rng: np.random.Generator) -> Floats:
        """Draw n points (n, 3) evenly by area, stratified, world metres."""
        return self.sample_normals(n, rng)[0]

    def sample_normals(self, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Draw the points that `sample` draws, with the unit normals of their triangles; (n, 3) each."""
        total = np.cumsum(self.areas_m2)
        place = (np.arange(n) + rng.random(n)) / n * total[-1]
        which = np.minimum(np.searchsorted(total, place, side="right"), len(total) - 1)
        r, s = np.sqrt(rng.random(n))[:, None], rng.random(n)[:, None]
        a, b, c = np.moveaxis(self._corners[which], 1, 0)
        normals = np.cross(b - a, c - a) / (2.0 * self.areas_m2[which, None])
        return np.asarray((1 - r) * a + r * (1 - s) * b + r * s * c), np.asarray(normals)

    def standoff(self, aims: ArrayLike, directions: ArrayLike, offset_m: float, tolerance_m: float = 1e-4) -> Floats:
        """First point on each line from outside towards its aim at `offset_m` from the surface; NaN where none."""
        d = np.ascontiguousarray(directions, dtype=np.float64)
        aim = np.broadcast_to(np.asarray(aims, dtype=np.float64), d.shape)
        corners = self._triangles.reshape(-1, 3)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        far = np.linalg.norm(corners - middle, axis=1).max() + np.linalg.norm(aim - middle, axis=1) + offset_m + 1e-3
        origins = aim + far[:, None] * d
        t = _march(np.ascontiguousarray(origins), -d, far, self._triangles, self._spheres, offset_m, tolerance_m)
        return np.asarray(origins - t[:, None] * d)

    def nearest_point(self, point: ArrayLike) -> Floats:
        """A nearest point of the surface, (3,) world metres."""
        p = np.asarray(point, dtype=np.float64)
        _, which = _distances(p[None], self._triangles, self._spheres)
        return _closest_on_triangle(p, self._corners[int(which[0])])


def _closest_on_triangle(p: Floats, t: Floats) -> Floats:
    """Nearest point of a triangle: inside it, else on one of its edges."""
    a, b, c = t
    n = np.cross(b - a, c - a)
    q = p - n * (dot(p - a, n) / dot(n, n))
    if all(dot(np.cross(v - u, q - u), n) >= 0.0 for u, v in ((a, b), (b, c), (c, a))):
        return np.asarray(q)
    ends = [u + (v - u) * np.clip(dot(p - u, v - u) / dot(v - u, v - u), 0.0, 1.0)
            for u, v in ((a, b), (b, c), (c, a))]  # fmt: skip
    return np.asarray(min(ends, key=lambda e: float(dot(p - e, p - e))))
