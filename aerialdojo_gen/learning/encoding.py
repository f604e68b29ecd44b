"""A policy's observations and goals as arrays: the same in training and in flight."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.agents.base import Odometer
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS, Sensors
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, N_HEADINGS, TURN_RAD, TURNS
from aerialdojo_gen.store.schemas import ACTION_NAMES, STOP

# Edge of the patches of pixels that networks begin with.
PATCH_PX = 4
# Edge of the cells whose places are one, metres.
_SAME_M = 0.25


def packed(rgb: NDArray[np.uint8], depth_m: NDArray[np.float32], sensors: Sensors) -> NDArray[np.uint8]:
    """Join colours (..., H, W, 3) and depth, as 255 times the root of depth over range, to (..., H, W, 4) uint8."""
    near = np.sqrt(np.clip(depth_m / np.float32(sensors.max_depth_m), 0.0, 1.0), dtype=np.float32)
    return np.concatenate([rgb, np.rint(near * 255.0).astype(np.uint8)[..., None]], axis=-1)


def in_patches(values: NDArray[Any]) -> NDArray[Any]:
    """Cut pictures into patches, view after view and row after row: (views, H, W) to (patches, pixels of a patch)."""
    views, height, width = values.shape
    cut = values.reshape(views, height // PATCH_PX, PATCH_PX, width // PATCH_PX, PATCH_PX)
    return cut.transpose(0, 1, 3, 2, 4).reshape(-1, PATCH_PX**2)


def goal_picture(image: NDArray[np.uint8] | None, size_px: int) -> NDArray[np.uint8]:
    """Make a goal's picture as small as a view, without depth: (size, size, 4) uint8; black where there is none."""
    out = np.zeros((size_px, size_px, 4), np.uint8)
    if image is not None:
        fits = image.shape[:2] == (size_px, size_px)
        out[..., :3] = image if fits else cv2.resize(image, (size_px, size_px), interpolation=cv2.INTER_AREA)
    return out


class DeadReckoning(Odometer):
    """Where a body is that adds up its own actions, and where it has been."""

    def __init__(self) -> None:
        super().__init__()
        self._turns = 0
        self._been = {_pose(self.place, 0)}

    def add(self, action: int, refused: bool = False) -> None:
        """Add an action; one that was refused moved nothing, and its end counts as a pose where the body has been."""
        self._been.add(self._pose_after(action))
        super().add(action, refused)
        if not refused:
            self._turns = self._turns + 1 if TURNS[action] else 0

    @property
    def back(self) -> NDArray[np.bool_]:
        """Actions, (16,) bool, that no route has here: to earlier poses, or turns beyond half a circle in place."""
        turned = self._turns >= N_HEADINGS // 2
        found = [(turned and bool(TURNS[a])) or self._pose_after(a) in self._been for a in range(N_ACTIONS)]
        found[STOP] = False
        return np.array(found)

    def _pose_after(self, action: int) -> tuple[int, int, int, int]:
        return _pose(self.place + self.displacement(action), self.headings + int(TURNS[action]))

    @property
    def odometry(self) -> NDArray[np.float32]:
        """X ahead, y left, z up in metres and yaw in radians: (4,) float32."""
        return np.array([*self.place, self.yaw_rad], np.float32)


def _pose(place: NDArray[np.float64], headings: int) -> tuple[int, int, int, int]:
    """Tell poses apart by heading and by cells of 0.25 m: who comes so near has been there."""
    x, y, z = np.rint(place / _SAME_M).astype(int).tolist()
    return x, y, z, headings % N_HEADINGS


def actions_fingerprint() -> str:
    """SHA-256 of the action set: names, magnitudes and turns."""
    facts = [ACTION_NAMES[:N_ACTIONS], DISPLACEMENTS[:N_ACTIONS].tolist(), TURNS[:N_ACTIONS].tolist(), TURN_RAD]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()
