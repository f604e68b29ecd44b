"""The features of an export as LeRobotDataset v3, as ``meta/info.json`` declares them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.exchange.samples import ExportOptions
from aerialdojo_gen.exchange.video_clips import DEPTH_MIN_M, DEPTH_SHIFT_M, KEY_EVERY
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD
from aerialdojo_gen.store.schemas import STOP, TURN_LEFT, TURN_RIGHT

# Steps have no duration: a frame a step, at the rate of the recordings.
FPS = 15
VERSION = "v3.0"
FILES_A_CHUNK = 1000
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
GOAL = "observation.images.goal"
STATE = ("x_ahead_m", "y_left_m", "z_up_m", "yaw_rad", "remaining_actions")
ACTION = ("forward_m", "left_m", "up_m", "turn_rad", "stop")
# Features that are no videos: their type, and the names of their numbers where they have several.
_NUMBERS: dict[str, tuple[str, tuple[str, ...] | None]] = {
    "observation.state": ("float32", STATE),
    "action": ("float32", ACTION),
    "discrete_action": ("int64", None),
    "next.done": ("bool", None),
    "timestamp": ("float32", None),
    **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), ("int64", None)),
}


def _of_actions() -> NDArray[np.float32]:
    table = np.zeros((TURN_RIGHT + 1, len(ACTION)), np.float32)
    table[:, :3] = DISPLACEMENTS[: TURN_RIGHT + 1]
    table[TURN_LEFT, 3], table[TURN_RIGHT, 3] = TURN_RAD, -TURN_RAD
    table[STOP, 4] = 1.0
    return table


# What each of the 16 actions does in the body's frame, (16, 5) float32: see `ACTION`.
OF_ACTION = _of_actions()


def view_key(view: str) -> str:
    """Name the feature of a view's pictures."""
    return f"observation.images.{view}"


def depth_key(view: str) -> str:
    """Name the feature of a view's depth."""
    return f"observation.depth.{view}"


def video_kinds(options: ExportOptions) -> dict[str, str]:
    """Return the features that are videos, and of which kind each is: ``rgb`` or ``depth``."""
    s = options.sensors
    pictures = {view_key(view): "rgb" for view in s.views} if s.rgb else {}
    depths = {depth_key(view): "depth" for view in s.views} if s.depth else {}
    return pictures | ({GOAL: "rgb"} if "image" in options.goal else {}) | depths


def features(options: ExportOptions) -> dict[str, dict[str, Any]]:
    """Return the features of frames: their types, shapes, names, and how videos are to be read."""
    videos = {key: _video(options, kind) for key, kind in video_kinds(options).items()}
    numbers = {
        name: {"dtype": dtype, "shape": [len(names) if names else 1], "names": names and [*names]}
        for name, (dtype, names) in _NUMBERS.items()
    }
    return {**videos, **numbers}


def frame_schema() -> pa.Schema:
    """Return the columns of ``data/``: all features that are no videos."""
    kinds = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}
    return pa.schema(
        (name, pa.list_(kinds[dtype], len(names)) if names else kinds[dtype])
        for name, (dtype, names) in _NUMBERS.items()
    )


def _video(options: ExportOptions, kind: str) -> dict[str, Any]:
    s = options.sensors
    depth = kind == "depth"
    told: dict[str, Any] = {
        "video.height": s.height,
        "video.width": s.width,
        "video.codec": "hevc" if depth else "h264",
        "video.pix_fmt": "gray12le" if depth else "yuv420p",
        "video.fps": FPS,
        "video.channels": 1 if depth else 3,
        "video.g": KEY_EVERY,
        # The first is LeRobot's name of today, the second that of 0.4 and 0.5.
        "is_depth_map": depth,
        "video.is_depth_map": depth,
        "has_audio": False,
    }
    if depth:
        told |= {
            "video.depth_min": DEPTH_MIN_M,
            "video.depth_max": s.max_depth_m,
            "video.shift": DEPTH_SHIFT_M,
            "video.use_log": True,
            "depth_unit": "m",
        }
    shape = [s.height, s.width, 1 if depth else 3]
    return {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"], "info": told}
