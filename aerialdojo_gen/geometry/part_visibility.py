"""What viewpoints see of the parts that make an object's name true."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.geometry.arrays import Flags, Floats
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.portable import atan2, dot, norm
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.geometry.surface import Surface

# Within it an object counts as seen from its front: a step in the marks, which a little more light must not outweigh.
FRONT_RAD = math.radians(60.0)
# What the sun does not reach is seen by the light of the sky, and recognised less easily.
_SHADE = 0.8
_OFF_SURFACE_M = 2e-3


def in_picture(positions: Floats, yaw_rad: Floats, points: Floats, fov_deg: float) -> Flags:
    """Whether points (m, 3) lie in the front camera's picture from n poses, whatever hides them; (n, m) bool."""
    ray = points[None] - positions[:, None]
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    ahead = ray[..., 0] * cos + ray[..., 1] * sin
    across = ray[..., 0] * sin - ray[..., 1] * cos
    reach = ahead * math.tan(math.radians(fov_deg) / 2.0)
    return np.asarray((ahead > 0.0) & (np.abs(across) <= reach) & (np.abs(ray[..., 2]) <= reach))


def off_front_rad(positions: Floats, centroid: ArrayLike, fronts_rad: Sequence[float]) -> Floats:
    """Angle in the plan, (n,) in [0, π], between viewpoints (n, 3), seen from the centroid, and the nearest front."""
    away = positions - np.asarray(centroid)
    azimuth = atan2(away[:, 1], away[:, 0])
    return np.asarray(np.min([np.abs(wrap_angle_rad(azimuth - front)) for front in fronts_rad], axis=0))


@dataclass(frozen=True, eq=False)
class Patch:
    """Points of a part's surface."""

    points: Floats  # (m, 3) float64; metres, world frame
    normals: Floats  # (m, 3) float64; unit vectors; the side that they point to has no meaning
    lit: Flags  # Whether the sun reaches the side that the normal points to, and the other one
    area_m2: float  # Of the part's faces, each counted from one side

    @classmethod
    def of(cls, surface: Surface, n: int, rng: np.random.Generator, scene: RayCaster, sun: ArrayLike) -> Patch:
        """Draw n points by area from a part's surface and find which are in the sun."""
        points, normals = surface.sample_normals(n, rng)
        towards = np.asarray(sun, dtype=np.float64)
        facing = dot(normals, towards)
        start = points + normals * np.where(facing > 0.0, _OFF_SURFACE_M, -_OFF_SURFACE_M)[:, None]
        reached = np.isinf(scene.first_hit(start, np.broadcast_to(towards, start.shape))[0])
        lit = np.column_stack([reached & (facing > 0.0), reached & (facing < 0.0)])
        return cls(points, normals, lit, float(surface.areas_m2.sum()))


def visible_shares(
    positions: Floats, yaw_rad: Floats, patches: Sequence[Patch], scene: RayCaster, fov_deg: float
) -> Floats:
    """Share (n, parts), 0 to 1, of each part that viewpoints see, by incidence, less in the shade."""
    out = np.zeros((len(positions), len(patches)))
    for k, patch in enumerate(patches):
        pose, point = np.nonzero(in_picture(positions, yaw_rad, patch.points, fov_deg))
        if not len(pose):
            continue
        seen = scene.visible(positions[pose], patch.points[point])
        pose, point = pose[seen], point[seen]
        ray = positions[pose] - patch.points[point]
        cosine = (ray * patch.normals[point]).sum(axis=1) / norm(ray)
        lit = np.where(cosine > 0.0, patch.lit[point, 0], patch.lit[point, 1])
        weight = np.abs(cosine) * np.where(lit, 1.0, _SHADE)
        out[:, k] = np.bincount(pose, weight, minlength=len(positions)) / len(patch.points)
    return out
