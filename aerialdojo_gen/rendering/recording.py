"""Record one trajectory: render its views, check them, and encode them while the next ones are drawn."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.geometry.arrays import Bytes, Floats
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.checks import Solid, ViewChecks
from aerialdojo_gen.rendering.codecs import PngWriter, VideoWriter, to_stored
from aerialdojo_gen.rendering.picture import Picture, Renderer
from aerialdojo_gen.rendering.placement import TILED, Place, columns, modalities, places, tiled
from aerialdojo_gen.rendering.trajectory import FramePoses, by_steps, by_time
from aerialdojo_gen.rendering.video import Video


def frame_poses(route: dict[str, Any], config: RenderConfig) -> FramePoses:
    """Poses of a recording's frames."""
    position = np.stack([route["x_m"], route["y_m"], route["z_m"]], axis=1)
    if config.sampling == "steps":
        return by_steps(position, route["yaw_rad"], route["action"], config.fps)
    return by_time(position, route["yaw_rad"], route["action"], config.fps, config.cruise_m_s, config.yaw_rate_deg_s)


def record_views(
    renderer: Renderer, solid: Solid, views: Sequence[str], poses: FramePoses, config: RenderConfig, folder: Path
) -> dict[str, set[str]]:
    """Render and encode views of a trajectory, with frames of at most two poses in memory; return flags by view."""
    camera = Camera(config.width, config.height, config.fov_deg)
    checks = {view: ViewChecks(camera, solid) for view in views}
    with ExitStack() as stack:
        write = _writers(stack, folder, views, camera, config)
        # One thread keeps the frames in order.
        encoder = stack.enter_context(ThreadPoolExecutor(1))
        pending: Future[None] | None = None
        for position, yaw in zip(poses.position, poses.yaw_rad, strict=True):
            camera_poses = [camera_pose(position, float(yaw), view, config) for view in views]
            pictures = renderer.render_views(camera, camera_poses, config.instances)
            if pending is not None:
                pending.result()
            pending = encoder.submit(write, dict(zip(views, pictures, strict=True)))
            for view, picture, pose in zip(views, pictures, camera_poses, strict=True):
                checks[view].add(picture, pose)
        if pending is not None:
            pending.result()
    flags = {view: check.flags for view, check in checks.items()}
    for place in places(config):
        if place.view in flags and not _complete(folder / place.file, place.stream, len(poses.time_s)):
            flags[place.view].add("missing")
    return flags


def _writers(
    stack: ExitStack, folder: Path, views: Sequence[str], camera: Camera, config: RenderConfig
) -> Callable[[dict[str, Picture]], None]:
    """Open the writers; return the function that encodes the pictures of a pose, by view."""
    comments = {view: camera_comment(camera, view, config) for view in views}
    own = [place for place in places(config) if place.view in comments]
    writers: list[tuple[str, VideoWriter | PngWriter]] = []
    if config.layout == "tiled":
        size = config.width * columns(config), config.height * -(-len(config.views) // columns(config))
        one = VideoWriter(
            folder / TILED, modalities(config), *size, config.fps, config.crf, config.preset,
            tiles_comment(own, comments),
        )  # fmt: skip
        writers.append((TILED, stack.enter_context(one)))
    else:
        for place in own:
            writer = _writer(folder, place, comments, config)
            stack.enter_context(writer)
            writers.append((place.view, writer))

    def write(pictures: dict[str, Picture]) -> None:
        stored = {view: _encodable(picture, config) for view, picture in pictures.items()}
        if config.layout == "tiled":
            of = {m: {view: frames[m] for view, frames in stored.items()} for m in modalities(config)}
            stored = {TILED: {m: tiled(frames, config) for m, frames in of.items()}}
        for key, writer in writers:
            writer.write(stored[key])

    return write


def _writer(folder: Path, place: Place, comments: dict[str, str], config: RenderConfig) -> VideoWriter | PngWriter:
    path, comment = folder / place.file, comments[place.view]
    if config.frames == "png":
        return PngWriter(path, place.modality, comment)
    return VideoWriter(
        path, [place.modality], config.width, config.height, config.fps, config.crf, config.preset, comment
    )


def _encodable(picture: Picture, config: RenderConfig) -> dict[str, Bytes | NDArray[np.uint16]]:
    frames: dict[str, Bytes | NDArray[np.uint16]] = {
        "rgb": picture.rgb,
        "depth": to_stored(picture.depth_m, config.depth_step),
    }
    if picture.instance is not None:
        frames["instance"] = (picture.instance + 1).astype(np.uint16)
    return frames


def _complete(path: Path, stream: int, n_frames: int) -> bool:
    try:
        return len(Video(path, stream)) == n_frames
    except RenderError:
        return False


def camera_pose(position: ArrayLike, yaw_rad: float, view: str, config: RenderConfig) -> Floats:
    """Pose (4, 4) of a view's camera, with the configured offset from the body's centre."""
    pose = view_pose(position, yaw_rad, view)
    if view in config.offsets_m:
        forward, left, up = config.offsets_m[view]
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        pose[:3, 3] += (c * forward - s * left, s * forward + c * left, up)
    return pose


def camera_comment(camera: Camera, view: str, config: RenderConfig) -> str:
    """Camera parameters as JSON, for a recording's files."""
    factor = 1.0 + config.depth_step
    depth = f"metres = 0.1 * {factor!r} ** (value - 1)" if config.depth_step else "millimetres"
    return json.dumps(
        {
            "view": view,
            "width": camera.width,
            "height": camera.height,
            "K": camera.matrix.round(9).tolist(),
            "body_from_camera": camera_pose((0.0, 0.0, 0.0), 0.0, view, config).tolist(),
            "fov_deg": camera.fov_deg,
            "pixel_centre": "centre of the top-left pixel is (0.5, 0.5)",
            "axes": "camera x right, y down, z forward; body x forward, y left, z up",
            "depth": f"planar, {depth}; 0 = nothing within 65.535 m",
            "depth_step": config.depth_step,
            "instance": "number of the node in the scene's mesh, plus 1; 0 = nothing",
        }
    )


def tiles_comment(own: Sequence[Place], comments: dict[str, str]) -> str:
    """Views of a tiled file as JSON: every view's camera and place, and the streams' modalities."""
    return json.dumps(
        {
            "tiles": {
                place.view: {"left_px": place.left_px, "top_px": place.top_px, **json.loads(comments[place.view])}
                for place in own
            },
            "streams": list(dict.fromkeys(place.modality for place in own)),
        }
    )
