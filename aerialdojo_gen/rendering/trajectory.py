"""From a route's poses to the poses of a recording's frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.arrays import Floats, Int32s
from aerialdojo_gen.geometry.frames import wrap_angle_rad


@dataclass(frozen=True, eq=False)
class FramePoses:
    """Where the body is in every frame."""

    time_s: Floats  # (n,) float64; since the first frame
    step: Int32s  # (n,) int32; the frame's trajectory pose: the last one reached
    action: NDArray[np.int8]  # (n,) int8; the action at that pose
    position: Floats  # (n, 3) float64; the body's centre, metres, world frame
    yaw_rad: Floats  # (n,) float64; in (-π, π] if interpolated, else as stored


def by_steps(position: ArrayLike, yaw_rad: ArrayLike, action: ArrayLike, fps: float) -> FramePoses:
    """One frame a trajectory pose: positions (n, 3) world metres, yaws (n,) radians, actions (n,)."""
    p = np.asarray(position, dtype=np.float64)
    step = np.arange(len(p), dtype=np.int32)
    yaw = np.asarray(yaw_rad, dtype=np.float64)
    return FramePoses(step / fps, step, np.asarray(action, dtype=np.int8), p, yaw)


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
