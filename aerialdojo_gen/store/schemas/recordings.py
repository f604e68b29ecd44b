"""The tables of recordings: a row a video, and a row a frame."""

from __future__ import annotations

import pyarrow as pa

from aerialdojo_gen.store.schemas.columns import SCENE, column, list_of, table, xyz

RECORDINGS = table(
    "recordings", ["scene", "nav_id", "view", "modality"],
    SCENE,
    column("nav_id", pa.string(), "navigation task"),
    column("view", pa.string(), "front, left, right or down"),
    column("modality", pa.string(), "rgb, depth or instance"),
    column("path", pa.string(), "video, or folder of PNG files; relative to the data directory"),
    column("stream", pa.int8(), "which of the file's videos; 0 where it has one"),
    column("left_px", pa.int32(), "leftmost column of the view in the file's frames", "px"),
    column("top_px", pa.int32(), "topmost row of the view in the file's frames", "px"),
    column("sampling", pa.string(), "steps: one frame a trajectory pose; time: constant frame rate"),
    column("n_frames", pa.int32(), "number of frames"),
    column("fps", pa.float64(), "frames a second", "1/s"),
    column("width", pa.int32(), "columns of the view", "px"),
    column("height", pa.int32(), "rows of the view", "px"),
    column("fov_deg", pa.float64(), "horizontal field of view", "deg"),
    column("depth_step", pa.float64(), "share by which stored depths grow, 0: millimetres; null: no depth", "", True),
    column("codec", pa.string(), "h264, ffv1 or png"),
    column("renderer", pa.string(), "gl or pybullet"),
    column("device", pa.string(), "what drew, in the driver's words"),
    column("bytes", pa.int64(), "size of the file, or of the folder's files; rows may share a file", "B"),
    column("sha256", pa.string(), "SHA-256 of the file, hexadecimal; of a folder, of its files one after the other"),
    column("ok", pa.bool_(), "no quality flag is set"),
    column("flags", list_of(pa.string()), "quality flags, empty where all is well"),
    command="render",
)  # fmt: skip

FRAMES = table(
    "frames", ["scene", "nav_id", "frame"],
    SCENE,
    column("nav_id", pa.string(), "navigation task"),
    column("frame", pa.int32(), "index of the frame in every video of the recording"),
    column("time_s", pa.float64(), "time since the first frame", "s"),
    column("step", pa.int32(), "trajectory pose that the frame belongs to"),
    column("action", pa.int8(), "action under way"),
    *xyz("position of the body's centre"),
    column("yaw_rad", pa.float64(), "yaw", "rad"),
    command="render",
)  # fmt: skip
