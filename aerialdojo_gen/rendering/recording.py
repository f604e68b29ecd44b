"""Record one view of one trajectory: render, encode, check."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from aerialdojo_gen.config import RenderConfig
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.checks import Solid, ViewChecks
from aerialdojo_gen.rendering.codecs import VideoWriter, to_millimetres
from aerialdojo_gen.rendering.trajectory import FramePoses, by_steps, by_time
from aerialdojo_gen.rendering.world import RenderWorld


def frame_poses(route: dict[str, list[float]], config: RenderConfig) -> FramePoses:
    """Poses of a recording's frames.

    Parameters
    ----------
    route : dict
        With the lists ``x_m``, ``y_m``, ``z_m``, ``yaw_rad`` and ``action`` of a row of `routes`.
    config : RenderConfig

    Returns
    -------
    FramePoses
    """
    position = np.stack([route["x_m"], route["y_m"], route["z_m"]], axis=1)
    if config.sampling == "steps":
        return by_steps(position, route["yaw_rad"], route["action"], config.fps)
    return by_time(
        position, route["yaw_rad"], route["action"], config.fps, config.cruise_m_s, config.yaw_rate_deg_s
    )  # fmt: skip


def record_view(
    world: RenderWorld,
    solid: Solid,
    view: str,
    poses: FramePoses,
    config: RenderConfig,
    rgb_path: Path,
    depth_path: Path,
) -> set[str]:
    """Render and encode one view; frames are never held together in memory.

    Parameters
    ----------
    world : RenderWorld
    solid : Solid
        The same scene.
    view : str
        One of `aerialdojo_gen.schemas.VIEWS`.
    poses : FramePoses
    config : RenderConfig
    rgb_path, depth_path : Path
        Files to write.

    Returns
    -------
    set of str
        Quality flags (`aerialdojo_gen.rendering.checks.FLAGS`).
    """
    camera = Camera(config.width, config.height, config.fov_deg)
    comment = camera_comment(camera, view)
    checks = ViewChecks(camera, solid)
    size = (config.width, config.height, config.fps)
    with (
        VideoWriter(rgb_path, "rgb", *size, crf=config.crf, comment=comment) as rgb,
        VideoWriter(depth_path, "depth", *size, comment=comment) as depth,
    ):
        for position, yaw in zip(poses.position, poses.yaw_rad, strict=True):
            pose = view_pose(position, float(yaw), view)
            picture = world.render(camera, pose)
            checks.add(picture, pose)
            rgb.write(picture.rgb)
            depth.write(to_millimetres(picture.depth_m))
    return checks.flags


def camera_comment(camera: Camera, view: str) -> str:
    """Describe a camera in the words that a recording's files carry: JSON."""
    return json.dumps(
        {
            "view": view,
            "K": camera.matrix.round(9).tolist(),
            "body_from_camera": view_pose((0.0, 0.0, 0.0), 0.0, view).tolist(),
            "fov_deg": camera.fov_deg,
            "pixel_centre": "centre of the top-left pixel is (0.5, 0.5)",
            "axes": "camera x right, y down, z forward; body x forward, y left, z up",
            "depth": "planar, millimetres; 0 = nothing within 65.535 m",
        }
    )
