"""Frames, and how an orientation is said in them.

World (ENU): right-handed, x east, y north, z up, metres; yaw in radians, counter-clockwise from +x.
NED, the frame of most autopilots and of AirSim: x north, y east, z down; yaw clockwise from north.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.common.terms import DIRECTIONS
from aerialdojo_gen.geometry.angles import wrap_angle_rad

Floats = NDArray[np.float64]


def compass_direction(dx_m: float, dy_m: float) -> str:
    """Name the compass direction of a displacement; north is +y.

    Sectors are 45° wide and centred on the eight directions; a boundary (22.5° and so on) belongs to the sector
    counter-clockwise of it.

    Parameters
    ----------
    dx_m, dy_m : float
        Displacement towards east and north, metres.

    Returns
    -------
    str
        One of `aerialdojo_gen.common.terms.DIRECTIONS`.

    Raises
    ------
    ValueError
        If both are zero: no displacement has no direction.
    """
    if dx_m == 0.0 and dy_m == 0.0:
        raise ValueError("no compass direction between two places that coincide in the plane")
    sector = math.floor((math.degrees(math.atan2(dy_m, dx_m)) + 22.5) / 45.0)
    return DIRECTIONS[sector % 8]


def compass_heading(yaw_rad: float) -> tuple[str, int]:
    """Say a yaw as a compass shows it.

    Parameters
    ----------
    yaw_rad : float
        Radians, counter-clockwise from +x (east).

    Returns
    -------
    direction : str
        The nearest of `aerialdojo_gen.common.terms.DIRECTIONS`, of the degrees as they are said.
    heading_deg : int
        Clockwise from north (+y), whole degrees, 0 to 359.
    """
    heading = round(90.0 - math.degrees(yaw_rad)) % 360
    return DIRECTIONS[math.floor((90.0 - heading + 22.5) / 45.0) % 8], heading


def enu_to_ned(xyz_m: ArrayLike) -> Floats:
    """Turn world positions into NED.

    Parameters
    ----------
    xyz_m : (..., 3) array_like
        Metres, east-north-up.

    Returns
    -------
    (..., 3) ndarray of float64
        Metres, north-east-down, about the same origin.
    """
    p = np.asarray(xyz_m, dtype=np.float64)
    return np.stack([p[..., 1], p[..., 0], -p[..., 2]], axis=-1)


def ned_to_enu(ned_m: ArrayLike) -> Floats:
    """Turn NED positions into the world frame: the inverse of `enu_to_ned`, which is its own inverse.

    Parameters
    ----------
    ned_m : (..., 3) array_like
        Metres, north-east-down.

    Returns
    -------
    (..., 3) ndarray of float64
        Metres, east-north-up, about the same origin.
    """
    return enu_to_ned(ned_m)


def yaw_enu_to_ned(yaw_rad: ArrayLike) -> Floats:
    """Turn a world yaw (counter-clockwise from east) into a heading (clockwise from north).

    Parameters
    ----------
    yaw_rad : array_like
        Radians, any shape.

    Returns
    -------
    ndarray of float64
        π/2 - yaw, in (-π, π].
    """
    return wrap_angle_rad(math.pi / 2.0 - np.asarray(yaw_rad, dtype=np.float64))


def yaw_ned_to_enu(heading_rad: ArrayLike) -> Floats:
    """Turn a heading (clockwise from north) into a world yaw: the inverse of `yaw_enu_to_ned`.

    Parameters
    ----------
    heading_rad : array_like
        Radians, any shape.

    Returns
    -------
    ndarray of float64
        π/2 - heading, in (-π, π].
    """
    return yaw_enu_to_ned(heading_rad)


def yaw_to_quaternion_xyzw(yaw_rad: ArrayLike) -> Floats:
    """Unit quaternion of a turn about +z.

    Parameters
    ----------
    yaw_rad : array_like
        Radians, shape (...).

    Returns
    -------
    (..., 4) ndarray of float64
        x, y, z, w; w is not negative.
    """
    half = wrap_angle_rad(yaw_rad) / 2.0
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


def quaternion_xyzw_to_yaw(quaternion: ArrayLike) -> Floats:
    """Yaw of an orientation: where its body's x axis points in the plane.

    Parameters
    ----------
    quaternion : (..., 4) array_like
        x, y, z, w; any length but zero, either sign.

    Returns
    -------
    (...) ndarray of float64
        Radians in (-π, π]. A body with roll and pitch has a yaw as well, unless it points straight up or down.
    """
    x, y, z, w = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    return wrap_angle_rad(np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))
