"""Record one view of one trajectory: render, encode, check."""

from __future__ import annotations

import json
import math
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.config.sections import RenderConfig
from aerialdojo_gen.errors import RenderError
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import Renderer
from aerialdojo_gen.rendering.checks import Solid, ViewChecks
from aerialdojo_gen.rendering.codecs import PngWriter, VideoWriter, to_millimetres
from aerialdojo_gen.rendering.reader import Video
from aerialdojo_gen.rendering.trajectory import FramePoses, by_steps, by_time

Floats = NDArray[np.float64]


def frame_poses(route: dict[str, Any], config: RenderConfig) -> FramePoses:
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
    renderer: Renderer, solid: Solid, view: str, poses: FramePoses, config: RenderConfig, files: dict[str, Path]
) -> set[str]:
    """Render and encode one view; frames are never held together in memory.

    Parameters
    ----------
    renderer : Renderer
    solid : Solid
        The same scene.
    view : str
        One of `aerialdojo_gen.store.schemas.VIEWS`.
    poses : FramePoses
    config : RenderConfig
    files : dict of str to Path
        What to write, by modality: ``rgb``, ``depth``, and ``instance`` where it is wanted. A file each, or with
        ``frames = "png"`` a folder.

    Returns
    -------
    set of str
        Quality flags (`aerialdojo_gen.rendering.checks.FLAGS`).
    """
    camera = Camera(config.width, config.height, config.fov_deg)
    comment = camera_comment(camera, view, config)
    checks = ViewChecks(camera, solid)
    with ExitStack() as stack:
        writers: dict[str, VideoWriter | PngWriter] = {}
        for modality, path in files.items():
            writers[modality] = _writer(path, modality, config, comment)
            stack.enter_context(writers[modality])
        for position, yaw in zip(poses.position, poses.yaw_rad, strict=True):
            pose = camera_pose(position, float(yaw), view, config)
            picture = renderer.render(camera, pose, "instance" in writers)
            checks.add(picture, pose)
            writers["rgb"].write(picture.rgb)
            writers["depth"].write(to_millimetres(picture.depth_m))
            if picture.instance is not None and "instance" in writers:
                writers["instance"].write((picture.instance + 1).astype(np.uint16))
    if not all(_complete(path, len(poses.time_s)) for path in files.values()):
        checks.flags.add("missing")
    return checks.flags


def _writer(path: Path, modality: str, config: RenderConfig, comment: str) -> VideoWriter | PngWriter:
    if config.frames == "png":
        return PngWriter(path, comment)
    return VideoWriter(path, modality, config.width, config.height, config.fps, config.crf, comment)


def _complete(path: Path, n_frames: int) -> bool:
    try:
        return len(Video(path)) == n_frames
    except RenderError:
        return False


def camera_pose(position: ArrayLike, yaw_rad: float, view: str, config: RenderConfig) -> Floats:
    """Pose of a view's camera, world_from_camera, with the configured offset from the body's centre.

    Parameters
    ----------
    position : (3,) array_like
        The body's centre, metres, world frame.
    yaw_rad : float
    view : str
    config : RenderConfig

    Returns
    -------
    (4, 4) float64
    """
    pose = view_pose(position, yaw_rad, view)
    if view in config.offsets_m:
        forward, left, up = config.offsets_m[view]
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        pose[:3, 3] += (c * forward - s * left, s * forward + c * left, up)
    return pose


def camera_comment(camera: Camera, view: str, config: RenderConfig) -> str:
    """Describe a camera in the words that a recording's files carry: JSON."""
    return json.dumps(
        {
            "view": view,
            "K": camera.matrix.round(9).tolist(),
            "body_from_camera": camera_pose((0.0, 0.0, 0.0), 0.0, view, config).tolist(),
            "fov_deg": camera.fov_deg,
            "pixel_centre": "centre of the top-left pixel is (0.5, 0.5)",
            "axes": "camera x right, y down, z forward; body x forward, y left, z up",
            "depth": "planar, millimetres; 0 = nothing within 65.535 m",
            "instance": "number of the node in the scene's mesh, plus 1; 0 = nothing",
        }
    )
