"""The action set as motion primitives, its motion model, and polylines.

Body frame: x forward, y left, z up. Headings are 15° apart and counted from the start's yaw, so that a replay of the
actions from the start pose meets the stored poses exactly.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import ACTION_NAMES, APPROACH, STOP, TURN_LEFT, TURN_RIGHT
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Ints
from aerialdojo_gen.geometry.frames import wrap_one_rad

N_HEADINGS = 24
TURN_RAD = 2 * math.pi / N_HEADINGS
# Headings in a right angle: between the direction flown and the heading of who strafes there.
QUARTER = N_HEADINGS // 4

_AXES = {"Forward": (1.0, 0.0, 0.0), "Left": (0.0, 1.0, 0.0), "Right": (0.0, -1.0, 0.0),
         "Up": (0.0, 0.0, 1.0), "Down": (0.0, 0.0, -1.0)}  # fmt: skip


def _displacement(name: str) -> tuple[float, float, float]:
    for axis, (x, y, z) in _AXES.items():
        if name.startswith(f"Move{axis}"):
            step = float(name.removeprefix(f"Move{axis}"))
            return x * step, y * step, z * step
    return 0.0, 0.0, 0.0


# (17, 3) float64: displacement of every action in the body frame, metres; zero for turns, Stop and Approach.
DISPLACEMENTS = np.array([_displacement(name) for name in ACTION_NAMES])
# (17,) int64: how many headings an action turns to the left.
TURNS = np.array([(a == TURN_LEFT) - (a == TURN_RIGHT) for a in range(len(ACTION_NAMES))], np.int64)


_wrapped = njit(cache=True, inline="always")(wrap_one_rad)


def replay(start: ArrayLike, actions: ArrayLike) -> Floats:
    """Replay actions (n,) from a start pose (world) without collisions: poses (n + 1, 4), yaw in (-π, π]."""
    a = np.asarray(actions, np.int64).reshape(-1)
    if ((a < STOP) | (a > APPROACH)).any():
        raise ValueError(f"actions are numbers from {STOP} to {APPROACH}")
    return fly(np.asarray(start, np.float64), a.astype(np.int8))


@njit(cache=True)
def fly(start: Floats, actions: NDArray[np.int8]) -> Floats:
    """`replay` for kernels: (4,) float64 and (n,) int8 that are known to be actions, to (n + 1, 4) float64."""
    poses = np.empty((len(actions) + 1, 4))
    poses[0] = start
    poses[0, 3] = _wrapped(start[3])
    heading = 0
    for k in range(len(actions)):
        dx, dy, dz = DISPLACEMENTS[actions[k]]
        yaw = start[3] + heading * TURN_RAD
        c, s = math.cos(yaw), math.sin(yaw)
        poses[k + 1, 0] = poses[k, 0] + (c * dx - s * dy)
        poses[k + 1, 1] = poses[k, 1] + (s * dx + c * dy)
        poses[k + 1, 2] = poses[k, 2] + dz
        heading += TURNS[actions[k]]
        poses[k + 1, 3] = _wrapped(start[3] + heading * TURN_RAD)
    return poses


def route_length_m(points: Floats) -> float:
    """Length of a polyline, (n, 3) float64 metres: the paper's L, in which yaw adds nothing."""
    return float(np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum())


def nearest_heading(start_yaw: float, yaw: float) -> int:
    """Number of the heading, of those that `start_yaw` fixes, nearest to `yaw` (radians): at most 7.5° off."""
    return round((yaw - start_yaw) / TURN_RAD) % N_HEADINGS


def sampled(points: Floats, step_m: float = 0.5) -> tuple[Floats, Ints]:
    """Points along a polyline, at most `step_m` metres apart, corners included, and the segment of each."""
    pieces, owners = [], []
    for k in range(len(points) - 1):
        n = max(1, int(np.ceil(np.linalg.norm(points[k + 1] - points[k]) / step_m - 1e-9)))
        share = np.arange(n)[:, None] / n
        pieces.append(points[k] + share * (points[k + 1] - points[k]))
        owners += [k] * n
    return np.concatenate([*pieces, points[-1:]]), np.array([*owners, max(0, len(points) - 2)], dtype=np.int64)
