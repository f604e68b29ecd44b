"""Coordinate frames, and angles and orientations in them.

World (ENU): right-handed, x east, y north, z up, metres; yaw in radians, counter-clockwise from +x.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.geometry.arrays import Floats
from aerialdojo_gen.geometry.portable import atan2


def compass_direction(dx_m: float, dy_m: float) -> str:
    """Name the compass direction of a displacement; a border belongs to the counter-clockwise sector."""
    if dx_m == 0.0 and dy_m == 0.0:
        raise ValueError("no compass direction between two places that coincide in the plane")
    sector = math.floor((math.degrees(math.atan2(dy_m, dx_m)) + 22.5) / 45.0)
    return DIRECTIONS[sector % 8]


def compass_heading(yaw_rad: float) -> tuple[str, int]:
    """Compass direction and whole degrees clockwise from north of a yaw in radians counter-clockwise from east."""
    heading = round(90.0 - math.degrees(yaw_rad)) % 360
    return DIRECTIONS[math.floor((90.0 - heading + 22.5) / 45.0) % 8], heading


def yaw_to_quaternion_xyzw(yaw_rad: ArrayLike) -> Floats:
    """Unit quaternions (..., 4), xyzw with w >= 0, of turns about +z in radians."""
    half = wrap_angle_rad(yaw_rad) / 2.0
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


def quaternion_xyzw_to_yaw(quaternion: ArrayLike) -> Floats:
    """Yaw in radians, in (-π, π], of orientations (..., 4) xyzw: where the body's x axis points in the plane."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    return wrap_angle_rad(atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))


def wrap_angle_rad(angle_rad: ArrayLike) -> Floats:
    """Bring angles in radians, of any shape, into (-π, π]."""
    if isinstance(angle_rad, float) and -math.pi < angle_rad <= math.pi:
        return np.asarray(angle_rad)
    angle = np.asarray(angle_rad, dtype=np.float64)
    inside = (angle > -math.pi) & (angle <= math.pi)
    wrapped = math.pi - np.mod(math.pi - angle, 2.0 * math.pi)
    # np.mod may round up to the modulus itself, which would give -π; angles already inside stay exact.
    wrapped = np.where(wrapped <= -math.pi, math.pi, wrapped)
    return np.asarray(np.where(inside, angle, wrapped))


def yaw_towards(position: ArrayLike, target: ArrayLike) -> Floats:
    """Yaw in radians, in (-π, π], that faces a target in the plane; 0 where the two stand on one vertical line."""
    p, q = np.asarray(position, dtype=np.float64), np.asarray(target, dtype=np.float64)
    yaw = atan2(q[..., 1] - p[..., 1], q[..., 0] - p[..., 0])
    # A difference of -0.0 makes arctan2 answer -π for due west.
    return np.asarray(np.where(yaw <= -math.pi, math.pi, yaw))


def wrap_turned_rad(yaw_rad: Floats) -> Floats:
    """Bring yaws into (-π, π] as the motion model does: by one formula, also those that are inside already.

    `wrap_angle_rad` leaves these exact, this may move their last bit. Stored poses are made by this one, so that a
    replay meets them to the bit.
    """
    return np.asarray(math.pi - np.mod(math.pi - yaw_rad, 2.0 * math.pi), np.float64)


def wrap_one_rad(yaw_rad: float) -> float:
    """`wrap_turned_rad` of a number, for loops that step a pose."""
    return math.pi - (math.pi - yaw_rad) % (2.0 * math.pi)
