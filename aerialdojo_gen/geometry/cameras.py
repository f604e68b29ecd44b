"""Pinhole cameras: intrinsics, the poses of the four views, projection.

Camera frame (OpenCV): x right, y down, z forward along the optical axis. Pixels: u to the right, v down, and the
centre of the top-left pixel is (0.5, 0.5); the image spans [0, width] x [0, height], and the optical axis meets it at
(width / 2, height / 2). Depth is planar: the z of a point in the camera frame, metres.

World and body frames: `aerialdojo_gen.geometry.frames`. The four views share the body's centre: front looks along
the yaw, left and right are turned by +90° and -90°, down looks at the ground, the body's forward at the image's top.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.base.constants import FOV_DEG
from aerialdojo_gen.geometry.arrays import Floats
from aerialdojo_gen.geometry.portable import norm, product

# Columns are the camera's x, y and z axes in the body frame (x forward, y left, z up).
_BODY_FROM_CAMERA = {
    "front": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "left": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "right": np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]]),
    "down": np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
}


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with square pixels.

    Attributes
    ----------
    width, height : int
        Pixels.
    fov_deg : float
        Horizontal field of view, degrees, in (0, 180).
    """

    width: int = 640
    height: int = 640
    fov_deg: float = FOV_DEG

    def __post_init__(self) -> None:
        """Refuse what is no picture."""
        if self.width < 1 or self.height < 1 or not 0.0 < self.fov_deg < 180.0:
            raise ValueError(f"no camera has {self.width} x {self.height} pixels and a view of {self.fov_deg}°")

    @property
    def focal_px(self) -> float:
        """Focal length, pixels, the same along u and v."""
        return self.width / 2.0 / math.tan(math.radians(self.fov_deg) / 2.0)

    @cached_property
    def matrix(self) -> Floats:
        """Intrinsics K, (3, 3) float64: pixels = K @ (camera point / its z)."""
        f = self.focal_px
        return np.array([[f, 0.0, self.width / 2.0], [0.0, f, self.height / 2.0], [0.0, 0.0, 1.0]])

    def rays(self) -> Floats:
        """Directions through the pixel centres, camera frame, (height, width, 3) float64, z = 1: scaled by depth."""
        u, v = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        f = self.focal_px
        return np.stack([(u - self.width / 2.0) / f, (v - self.height / 2.0) / f, np.ones_like(u)], axis=-1)


def view_pose(position: ArrayLike, yaw_rad: float, view: str) -> Floats:
    """Pose of one of the body's cameras.

    Parameters
    ----------
    position : (3,) array_like
        The body's centre, metres, world frame.
    yaw_rad : float
        The body's yaw, counter-clockwise from +x.
    view : str
        One of `aerialdojo_gen.store.schemas.VIEWS`.

    Returns
    -------
    (4, 4) float64
        world_from_camera.

    Raises
    ------
    KeyError
        If there is no such view.
    """
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    world_from_body = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    pose = np.eye(4)
    pose[:3, :3] = product(world_from_body, _BODY_FROM_CAMERA[view])
    pose[:3, 3] = np.asarray(position, dtype=np.float64)
    return pose


def look_at_pose(eye: ArrayLike, target: ArrayLike) -> Floats:
    """Pose (4, 4) of an upright camera that looks at a point; straight up or down, north is at the image's top."""
    e, t = np.asarray(eye, dtype=np.float64), np.asarray(target, dtype=np.float64)
    distance = float(norm(t - e))
    if distance < 1e-9:
        raise ValueError("a camera cannot look at the point that it stands in")
    forward = (t - e) / distance
    right = np.array([forward[1], -forward[0], 0.0])
    if norm(right) < 1e-6:
        right = np.array([1.0, 0.0, 0.0])
        forward = np.array([0.0, 0.0, math.copysign(1.0, forward[2])])
        if forward[2] > 0:
            right = -right
    right /= norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = e
    return pose


def project(camera: Camera, world_from_camera: Floats, points: ArrayLike) -> tuple[Floats, Floats]:
    """Project world points (..., 3): pixels (..., 2), meaningless where depth is not positive, and planar depth."""
    p = np.asarray(points, dtype=np.float64)
    local = product(p - world_from_camera[:3, 3], world_from_camera[:3, :3])
    depth = local[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        uv = camera.focal_px * local[..., :2] / depth[..., None]
    return uv + np.array([camera.width / 2.0, camera.height / 2.0]), depth
