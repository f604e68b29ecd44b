"""The frames of foreign task files, and the one way from each into the world.

World: x east, y north, z up, metres; yaw counter-clockwise from +x. All frames here are right-handed, so that a way
between them is a turn: distances, angles and handedness stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.geometry.frames import quaternion_xyzw_to_yaw, wrap_angle_rad, yaw_to_quaternion_xyzw

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """A right-handed frame whose z axis is vertical."""

    name: str  # Where its x, y and z axes point, e.g. ``ned`` for north, east, down
    to_world: tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]  # (3, 3) tuple

    @property
    def matrix(self) -> Floats:
        """(3, 3) float64: world = matrix @ frame; a turn."""
        return np.array(self.to_world, np.float64)

    def positions_to_world(self, xyz_m: ArrayLike) -> Floats:
        """Turn positions, (..., 3) metres, into the world; exact, as it only reorders and changes signs."""
        return np.asarray(np.asarray(xyz_m, np.float64) @ self.matrix.T + 0.0)

    def positions_from_world(self, xyz_m: ArrayLike) -> Floats:
        """Turn world positions, (..., 3) metres, into the frame: the inverse of `positions_to_world`."""
        return np.asarray(np.asarray(xyz_m, np.float64) @ self.matrix + 0.0)

    @property
    def _sense_and_turn(self) -> tuple[np.float64, np.float64]:
        """Which way the frame's yaws count, 1 or -1, and the world yaw of its x axis."""
        m = self.matrix
        return m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0], np.arctan2(m[1, 0], m[0, 0])

    def yaw_to_world(self, yaw_rad: ArrayLike) -> Floats:
        """Turn yaws about the frame's own z axis, counted from its x towards its y, into world yaws in (-π, π]."""
        sense, turn = self._sense_and_turn
        return wrap_angle_rad(sense * np.asarray(yaw_rad, np.float64) + turn)

    def yaw_from_world(self, yaw_rad: ArrayLike) -> Floats:
        """Turn world yaws into the frame's: the inverse of `yaw_to_world`."""
        sense, turn = self._sense_and_turn
        return wrap_angle_rad(sense * (np.asarray(yaw_rad, np.float64) - turn))

    def quaternion_to_world_yaw(self, quaternion_xyzw: ArrayLike) -> Floats:
        """World yaw of attitudes, (..., 4) xyzw of any length but zero: where the body's x axis points."""
        return self.yaw_to_world(quaternion_xyzw_to_yaw(quaternion_xyzw))

    def quaternion_from_world_yaw(self, yaw_rad: ArrayLike) -> Floats:
        """Attitudes, (..., 4) unit xyzw in the frame, of upright bodies with these world yaws."""
        return yaw_to_quaternion_xyzw(self.yaw_from_world(yaw_rad))


NED = Frame("ned", ((0, 1, 0), (1, 0, 0), (0, 0, -1)))
_ENU = Frame("enu", ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
_NWU = Frame("nwu", ((0, -1, 0), (1, 0, 0), (0, 0, 1)))
_ESD = Frame("esd", ((1, 0, 0), (0, -1, 0), (0, 0, -1)))
FRAMES = {frame.name: frame for frame in (_ENU, _NWU, NED, _ESD)}


def frame_named(name: str) -> Frame:
    """Look a frame up by its name."""
    if name not in FRAMES:
        raise UsageError(f"no frame {name!r}: it is one of {', '.join(FRAMES)} (the directions of x, y and z)")
    return FRAMES[name]


def world_to_habitat(xyz_m: ArrayLike) -> Floats:
    """Turn world positions, (..., 3) metres, into Habitat's frame: x east, y up, z south."""
    p = np.asarray(xyz_m, np.float64)
    return np.stack([p[..., 0], p[..., 2], -p[..., 1]], axis=-1) + 0.0


def yaw_to_habitat_quaternion_xyzw(yaw_rad: ArrayLike) -> Floats:
    """Attitudes, (..., 4) unit xyzw, of upright bodies in Habitat, where a body at rest looks along -z (north)."""
    half = wrap_angle_rad(np.asarray(yaw_rad, np.float64) - np.pi / 2) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, np.sin(half), zero, np.cos(half)], axis=-1)
