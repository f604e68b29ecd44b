"""What the cameras of many bodies see at once: small pictures of one scene, as arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import Renderer

Floats = NDArray[np.float64]


def draw_bodies(
    renderer: Renderer, camera: Camera, poses: Floats, views: Sequence[str]
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Take the pictures of all views at some poses.

    Parameters
    ----------
    renderer : Renderer
    camera : Camera
        Of every view.
    poses : (n, 4) float64
        x, y, z in metres and yaw in radians, world frame, of the body's centre.
    views : sequence of str
        Of `aerialdojo_gen.store.schemas.VIEWS`.

    Returns
    -------
    rgb : (n, views, H, W, 3) uint8
        sRGB; what `Renderer.render` gives for each alone.
    depth_m : (n, views, H, W) float32
        Planar depth, metres; inf where nothing is hit.
    """
    shape = (len(poses), len(views), camera.height, camera.width)
    rgb, depth_m = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
    for k, pose in enumerate(poses):
        for v, view in enumerate(views):
            picture = renderer.render(camera, view_pose(pose[:3], float(pose[3]), view))
            rgb[k, v], depth_m[k, v] = picture.rgb, picture.depth_m
    return rgb, depth_m
