"""Yaws and differences of yaws: radians, counter-clockwise from +x."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def wrap_angle_rad(angle_rad: ArrayLike) -> Floats:
    """Bring angles in radians, of any shape, into (-π, π]."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    inside = (angle > -math.pi) & (angle <= math.pi)
    wrapped = math.pi - np.mod(math.pi - angle, 2.0 * math.pi)
    # np.mod may round up to the modulus itself, which would give -π; angles already inside stay exact.
    wrapped = np.where(wrapped <= -math.pi, math.pi, wrapped)
    return np.asarray(np.where(inside, angle, wrapped))


def yaw_towards(position: ArrayLike, target: ArrayLike) -> Floats:
    """Yaw in radians, in (-π, π], that faces a target in the world's plane.

    0 where the two stand on one vertical line.
    """
    p, q = np.asarray(position, dtype=np.float64), np.asarray(target, dtype=np.float64)
    yaw = np.arctan2(q[..., 1] - p[..., 1], q[..., 0] - p[..., 0])
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
