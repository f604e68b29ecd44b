"""What viewpoints see of the parts that make an object's name true."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.angles import wrap_angle_rad
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.geometry.surface import Surface

Floats = NDArray[np.float64]

# Within it an object counts as seen from its front: a step in the marks, which a little more light must not outweigh.
FRONT_RAD = math.radians(60.0)
# What the sun does not reach is seen by the light of the sky, and told less easily.
_SHADE = 0.8
_OFF_SURFACE_M = 2e-3


def in_picture(positions: Floats, yaw_rad: Floats, points: Floats, fov_deg: float) -> NDArray[np.bool_]:
    """Whether points lie in the front camera's picture, whatever hides them.

    The camera is level, at the body's centre, its picture square.

    Parameters
    ----------
    positions : (n, 3) float64
        Metres, world frame.
    yaw_rad : (n,) float64
        Counter-clockwise from +x.
    points : (m, 3) float64
        Metres, world frame.
    fov_deg : float
        Horizontal and vertical.

    Returns
    -------
    (n, m) bool
    """
    ray = points[None] - positions[:, None]
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    ahead = ray[..., 0] * cos + ray[..., 1] * sin
    across = ray[..., 0] * sin - ray[..., 1] * cos
    reach = ahead * math.tan(math.radians(fov_deg) / 2.0)
    return np.asarray((ahead > 0.0) & (np.abs(across) <= reach) & (np.abs(ray[..., 2]) <= reach))


def off_front_rad(positions: Floats, centroid: ArrayLike, fronts_rad: Sequence[float]) -> Floats:
    """Angle in the plane between where viewpoints are, seen from the centroid, and the nearest front.

    Parameters
    ----------
    positions : (n, 3) float64
        Metres, world frame.
    centroid : (3,) array_like
        The object's, metres, world frame.
    fronts_rad : sequence of float
        Directions of its fronts, world frame, at least one.

    Returns
    -------
    (n,) float64
        In [0, π].
    """
    away = positions - np.asarray(centroid)
    azimuth = np.arctan2(away[:, 1], away[:, 0])
    return np.asarray(np.min([np.abs(wrap_angle_rad(azimuth - front)) for front in fronts_rad], axis=0))


@dataclass(frozen=True, eq=False)
class Patch:
    """Points of a part's surface.

    Attributes
    ----------
    points : (m, 3) float64
        Metres, world frame.
    normals : (m, 3) float64
        Unit vectors; the side that they point to has no meaning.
    lit : (m, 2) bool
        Whether the sun reaches the side that the normal points to, and the other one.
    area_m2 : float
        Of the part's faces, each counted from one side.
    """

    points: Floats
    normals: Floats
    lit: NDArray[np.bool_]
    area_m2: float

    @classmethod
    def of(cls, surface: Surface, n: int, rng: np.random.Generator, scene: RayCaster, sun: ArrayLike) -> Patch:
        """Draw points by area.

        Parameters
        ----------
        surface : Surface
            The part's, world frame.
        n : int
            How many.
        rng : numpy.random.Generator
        scene : RayCaster
            What may be in the sun's way.
        sun : (3,) array_like
            Unit vector towards the sun.
        """
        points, normals = surface.sample_normals(n, rng)
        towards = np.asarray(sun, dtype=np.float64)
        facing = normals @ towards
        start = points + normals * np.where(facing > 0.0, _OFF_SURFACE_M, -_OFF_SURFACE_M)[:, None]
        reached = np.isinf(scene.first_hit(start, np.broadcast_to(towards, start.shape))[0])
        lit = np.column_stack([reached & (facing > 0.0), reached & (facing < 0.0)])
        return cls(points, normals, lit, float(surface.areas_m2.sum()))


def seen_share(
    positions: Floats, yaw_rad: Floats, patches: Sequence[Patch], scene: RayCaster, fov_deg: float
) -> Floats:
    """Tell how much of parts viewpoints see: not hidden, in the picture, not edge-on, and rather in the sun.

    Parameters
    ----------
    positions : (n, 3) float64
        Metres, world frame.
    yaw_rad : (n,) float64
        Counter-clockwise from +x.
    patches : sequence of Patch
        One a part.
    scene : RayCaster
        Everything, the object included.
    fov_deg : float
        Of the front camera.

    Returns
    -------
    (n, len(patches)) float64
        In [0, 1]: mean over a part's points of the cosine at which they are seen, 0 for those that are not, four
        fifths of it for those in the shade.
    """
    out = np.zeros((len(positions), len(patches)))
    for k, patch in enumerate(patches):
        who, what = np.nonzero(in_picture(positions, yaw_rad, patch.points, fov_deg))
        if not len(who):
            continue
        seen = scene.visible(positions[who], patch.points[what])
        who, what = who[seen], what[seen]
        ray = positions[who] - patch.points[what]
        cosine = (ray * patch.normals[what]).sum(axis=1) / np.linalg.norm(ray, axis=1)
        lit = np.where(cosine > 0.0, patch.lit[what, 0], patch.lit[what, 1])
        worth = np.abs(cosine) * np.where(lit, 1.0, _SHADE)
        out[:, k] = np.bincount(who, worth, minlength=len(positions)) / len(patch.points)
    return out
