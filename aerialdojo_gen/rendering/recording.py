"""Record one trajectory: render its views, check them, and encode them while the next ones are drawn."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.geometry.arrays import Bytes, Floats, Int32s
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.rendering.checks import Solid, ViewChecks
from aerialdojo_gen.rendering.codecs import PngWriter, VideoWriter, to_stored
from aerialdojo_gen.rendering.picture import Picture, Renderer
from aerialdojo_gen.rendering.placement import TILED, Place, columns, modalities, places, tiled
from aerialdojo_gen.rendering.reader import Video


@dataclass(frozen=True, eq=False)
class FramePoses:
    """Where the body is in every frame."""

    time_s: Floats  # (n,) float64; since the first frame
    step: Int32s  # (n,) int32; the frame's trajectory pose: the last one reached
    action: NDArray[np.int8]  # (n,) int8; the action at that pose
    position: Floats  # (n, 3) float64; the body's centre, metres, world frame
    yaw_rad: Floats  # (n,) float64; in (-π, π] if interpolated, else as stored


def frame_poses(route: dict[str, Any], config: RenderConfig) -> FramePoses:
    """Poses of a recording's frames: one a trajectory pose, or at a constant rate."""
    position = np.stack([route["x_m"], route["y_m"], route["z_m"]], axis=1)
    if config.sampling == "steps":
        step, yaw = np.arange(len(position), dtype=np.int32), np.asarray(route["yaw_rad"], dtype=np.float64)
        return FramePoses(step / config.fps, step, np.asarray(route["action"], dtype=np.int8), position, yaw)
    return by_time(position, route["yaw_rad"], route["action"], config.fps, config.cruise_m_s, config.yaw_rate_deg_s)


def by_time(
    position: ArrayLike, yaw_rad: ArrayLike, action: ArrayLike, fps: float, cruise_m_s: float, yaw_rate_deg_s: float
) -> FramePoses:
    """Frames at a constant rate along the path; a segment takes the longer of flying and turning the short way."""
    p, yaw = np.asarray(position, dtype=np.float64), np.asarray(yaw_rad, dtype=np.float64)
    turn = wrap_angle_rad(np.diff(yaw))
    seconds = np.maximum(
        np.linalg.norm(np.diff(p, axis=0), axis=1) / cruise_m_s, np.abs(np.degrees(turn)) / yaw_rate_deg_s
    )
    arrival = np.concatenate([[0.0], np.cumsum(seconds)])
    # Ignore rounding above a whole number of frames.
    n = int(np.ceil(arrival[-1] * fps - 1e-9)) + 1
    time = np.arange(n) / fps
    flown = np.minimum(time, arrival[-1])
    step = np.searchsorted(arrival, flown + 1e-12, side="right") - 1
    step[-1] = len(p) - 1
    k = np.minimum(step, len(p) - 2) if len(p) > 1 else np.zeros(n, dtype=np.int64)
    if len(p) == 1:
        at, heading = np.repeat(p, n, axis=0), np.repeat(yaw, n)
    else:
        share = np.divide(flown - arrival[k], seconds[k], out=np.ones(n), where=seconds[k] > 0)
        share = np.clip(share, 0.0, 1.0)
        at = p[k] + share[:, None] * (p[k + 1] - p[k])
        heading = np.asarray(wrap_angle_rad(yaw[k] + share * turn[k]))
        at[-1], heading[-1] = p[-1], yaw[-1]
    return FramePoses(time, step.astype(np.int32), np.asarray(action, dtype=np.int8)[step], at, heading)


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
            path, comment = folder / place.file, comments[place.view]
            if config.frames == "png":
                writers.append((place.view, PngWriter(path, place.modality, comment)))
                continue
            one = VideoWriter(
                path, [place.modality], config.width, config.height, config.fps, config.crf, config.preset, comment
            )
            writers.append((place.view, stack.enter_context(one)))

    def write(pictures: dict[str, Picture]) -> None:
        stored = {view: _encodable(picture, config) for view, picture in pictures.items()}
        if config.layout == "tiled":
            of = {m: {view: frames[m] for view, frames in stored.items()} for m in modalities(config)}
            stored = {TILED: {m: tiled(frames, config) for m, frames in of.items()}}
        for key, writer in writers:
            writer.write(stored[key])

    return write


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
