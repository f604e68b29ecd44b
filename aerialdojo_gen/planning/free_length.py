"""The shortest route there could be: a task's length in the action set's metric, were there no obstacles.

An agent flies along 24 headings, up and down, and the reference ends with a straight Approach. Without obstacles the
shortest length of a displacement (h, v) is therefore

    min over |a| <= A of  N(h - a_h) + |v - a_v| + |a|,

N the gauge of the regular 24-gon whose corners are the headings, a the Approach, A its longest. Moves of a metre are
taken for moves of any length, so that no route on the lattice is shorter.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.motion import TURN_RAD

Floats = NDArray[np.float64]

# Half a side of the dual 24-gon, whose sides touch the unit circle: its corners lie between two headings.
_HALF_SIDE = math.tan(TURN_RAD / 2)


def free_lengths_m(starts: ArrayLike, goals: ArrayLike, max_approach_m: float) -> Floats:
    """Shortest lengths (n,) without obstacles, metres.

    By duality the maximum of a concave function over a prism, in closed form.
    """
    s, g = np.asarray(starts, np.float64).reshape(-1, 4), np.asarray(goals, np.float64)
    way = (g - s[:, :3]) / max_approach_m
    flat, lift = np.hypot(way[:, 0], way[:, 1]), np.abs(way[:, 2])
    bearing = np.arctan2(way[:, 1], way[:, 0]) - s[:, 3]
    # Components along the nearest heading and across it; a side of the dual 24-gon is perpendicular to a heading.
    off = np.abs(bearing - np.rint(bearing / TURN_RAD) * TURN_RAD)
    along, across = flat * np.cos(off), flat * np.sin(off)

    def side(u: Floats, w: Floats) -> Floats:
        u, w = np.clip(u, 0.0, _HALF_SIDE), np.clip(w, 0.0, 1.0)
        return np.asarray(along + u * across + w * lift - (np.sqrt(1.0 + u * u + w * w) - 1.0))

    def over_root(value: Floats, of: Floats) -> Floats:
        """Divide by sqrt(1 - of²); infinite from of = 1."""
        root = np.sqrt(np.maximum(1.0 - of * of, 0.0))
        return np.asarray(np.divide(value, root, out=np.full_like(value, np.inf), where=root > 0.0))

    straight, beyond = np.hypot(flat, lift), np.hypot(across, lift)
    candidates = [
        straight,
        side(over_root(across, beyond), over_root(lift, beyond)),
        side(np.full_like(flat, _HALF_SIDE), over_root(lift, lift) * math.hypot(1.0, _HALF_SIDE)),
        side(over_root(across, across) * math.sqrt(2.0), np.ones_like(flat)),
        # The goal lies above or below, but for what the Approach alone flies aside.
        np.where(flat <= math.sqrt(0.5), lift + 1.0 - np.sqrt(np.maximum(1.0 - flat * flat, 0.0)), 0.0),
    ]
    return np.asarray(max_approach_m * np.maximum.reduce(candidates), np.float64)
