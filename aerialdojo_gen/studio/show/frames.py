"""Front camera frames along a route: from the recording if there is one, else rendered."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.dataset.lookup import FoundTask
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, is_outside

SIZE_PX = 320


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame at a pose of the route."""

    step: int  # Index of the pose
    action: str  # The action taken there
    rgb: NDArray[np.uint8]  # (SIZE_PX, SIZE_PX, 3) uint8; front view, sRGB
    recorded: bool  # Whether it comes from a recording


def frames_along(task: FoundTask, count: int) -> list[Frame]:
    """Return front views at evenly spaced poses of a route, including start and goal."""
    if count == 0:
        return []
    route = task.route
    poses = np.column_stack([route["x_m"], route["y_m"], route["z_m"], route["yaw_rad"]])
    steps = sorted({round(k) for k in np.linspace(0, len(poses) - 1, count)})
    pictures = _recorded(task, steps)
    recorded = pictures is not None
    if pictures is None:
        pictures = _rendered(task, poses[steps])
    return [
        Frame(step, schemas.ACTION_NAMES[route["action"][step]], picture, recorded)
        for step, picture in zip(steps, pictures, strict=True)
    ]


def _rendered(task: FoundTask, poses: NDArray[np.float64]) -> list[NDArray[np.uint8]]:
    from aerialdojo_gen.rendering.backend import open_renderer

    camera = Camera(SIZE_PX, SIZE_PX, 90.0)
    with open_renderer(task.scene.model) as world:
        return [world.render(camera, view_pose(pose[:3], pose[3], "front")).rgb for pose in poses]


def _recorded(task: FoundTask, steps: list[int]) -> list[NDArray[np.uint8]] | None:
    """Return recorded frames at the poses; None if the task was not recorded."""
    root, scene = task.scene.root, task.scene.name
    if not store.shards(root, "recordings", scene):
        return None
    rows = store.read_scene(root, "recordings", scene)
    rows = rows.filter(pc.equal(rows["nav_id"], task.nav_id)).to_pylist()
    path = next((row["path"] for row in rows if (row["view"], row["modality"]) == ("front", "rgb")), None)
    if path is None:
        return None
    from aerialdojo_gen.rendering.reader import open_view

    frames = store.read_scene(root, "frames", scene, ["nav_id", "frame", "step"])
    frames = frames.filter(pc.equal(frames["nav_id"], task.nav_id))
    first: dict[int, int] = {}
    for frame, step in zip(frames["frame"].to_pylist(), frames["step"].to_pylist(), strict=True):
        first[step] = min(frame, first.get(step, frame))
    if any(step not in first for step in steps):
        return None
    video = open_view(_local_video(root, path), "front", "rgb")
    return [
        np.asarray(cv2.resize(video[first[step]], (SIZE_PX, SIZE_PX), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        for step in steps
    ]


def _local_video(root: DataRoot, path: str) -> Path:
    if is_outside(root, path):
        raise StoreError(f"recordings: path {path!r} leads out of {root}")
    try:
        return root.local_copy(path)
    except FileNotFoundError:
        raise StoreError(f"the recording {root.at(path)} is missing: run {command('render')}") from None
