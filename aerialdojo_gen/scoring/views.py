"""Take the pictures that scorers look at."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.rendering.raycast import RayRenderer, pixel_rays
from aerialdojo_gen.scoring.base import AnchorView

Floats = NDArray[np.float64]

# A part that takes this share of the picture is large enough: a square of a fourteenth of its edge.
_LARGE = 0.005
# What is nearer than the object's nearest part stands before it; a surface this level is a floor, seen from above.
_NEARER, _FLOOR = 0.95, 0.8


def take_view(
    renderer: RayRenderer,
    alone: TriangleRayCaster,
    own_instance: int,
    camera: Camera,
    position_m: Floats,
    yaw_rad: float,
    *,
    shown: float,
    elevation_deg: float,
    clearance_m: float,
    told: Sequence[float] = (),
    tells: Sequence[NDArray[np.int64]] = (),
    off_front_rad: float | None = None,
    framed: float = 1.0,
) -> AnchorView:
    """Take the front view of an object from a candidate anchor.

    Parameters
    ----------
    renderer : RayRenderer
        Of the scene; every machine gives the same instance mask.
    alone : TriangleRayCaster
        The object by itself.
    own_instance : int
        The object's index in the scene.
    camera : Camera
    position_m : (3,) float64
        The body's centre, metres, world frame.
    yaw_rad : float
        Counter-clockwise from +x.
    shown, elevation_deg, clearance_m : float
        See `AnchorView`.
    told : sequence of float
        By ray casts: how much of each telling part is seen, over what the best viewpoint sees.
    tells : sequence of (k,) int64
        The faces of each of those parts: indices into the object's. One that is small in the picture counts less.
    off_front_rad, framed
        See `AnchorView`.

    Returns
    -------
    AnchorView
    """
    pose = view_pose(position_m, yaw_rad, "front")
    picture = renderer.render(camera, pose)
    assert picture.instance is not None
    visible = picture.instance == own_instance
    # Whether the object is behind what is nearer: where it is seen there is nothing to ask.
    hidden = np.flatnonzero(~visible & (picture.instance >= 0))
    silhouette = visible.copy()
    directions = pixel_rays(camera)[0][hidden] @ pose[:3, :3].T
    if len(hidden):
        silhouette.flat[hidden] = alone.first_hit(position_m, directions)[1] >= 0
    shares = part_shares(alone, tells, camera, pose, visible)
    marks = tuple(seen * min(1.0, math.sqrt(share / _LARGE)) for seen, share in zip(told, shares, strict=True))
    return AnchorView(
        picture.rgb,
        visible,
        silhouette,
        picture.instance < 0,
        shown,
        elevation_deg,
        clearance_m,
        marks,
        off_front_rad,
        framed,
        standing_nearer(
            picture.depth_m, visible, (picture.instance >= 0) & renderer.wide[picture.instance], camera, pose
        ),
    )


def standing_nearer(
    depth: NDArray[np.float32],
    visible: NDArray[np.bool_],
    wide: NDArray[np.bool_],
    camera: Camera,
    world_from_camera: Floats,
) -> NDArray[np.bool_]:
    """Tell which pixels show what stands between a camera and an object.

    Parameters
    ----------
    depth : (H, W) float32
        Metres along the camera's axis; infinite where there is nothing.
    visible : (H, W) bool
        Pixels that show the object.
    wide : (H, W) bool
        Pixels that show something wide enough to stand on.
    camera : Camera
    world_from_camera : (4, 4) float64

    Returns
    -------
    (H, W) bool
        Of what is nearer than the object's nearest part, all but level surfaces of what is wide.
    """
    if not visible.any():
        return np.zeros_like(visible)
    nearer = (depth < _NEARER * np.percentile(depth[visible], 2.0)) & ~visible
    if nearer.any():
        local = pixel_rays(camera)[0].reshape(*depth.shape, 3)
        points = np.where(np.isfinite(depth), depth, 1e3)[..., None] * local @ world_from_camera[:3, :3].T
        normal = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
        level = np.abs(normal[..., 2]) >= _FLOOR * np.maximum(np.linalg.norm(normal, axis=-1), 1e-12)
        nearer &= ~(level & wide)
    return np.asarray(nearer)


def part_shares(
    alone: TriangleRayCaster,
    parts: Sequence[NDArray[np.int64]],
    camera: Camera,
    world_from_camera: Floats,
    visible: NDArray[np.bool_],
) -> list[float]:
    """Share of a picture's pixels that show parts of an object.

    Parameters
    ----------
    alone : TriangleRayCaster
        The object by itself.
    parts : sequence of (k,) int64
        Faces of each part: indices into the object's.
    camera : Camera
    world_from_camera : (4, 4) float64
    visible : (H, W) bool
        Pixels that show the object.

    Returns
    -------
    list of float
        In [0, 1], one a part.
    """
    pixels = np.flatnonzero(visible)
    if not len(parts) or not len(pixels):
        return [0.0] * len(parts)
    directions = pixel_rays(camera)[0][pixels] @ world_from_camera[:3, :3].T
    face = alone.first_hit(world_from_camera[:3, 3], directions)[1]
    return [float(np.isin(face, part).sum()) / visible.size for part in parts]
