"""Which of the 16 actions lead nowhere from a pose: they touch a surface, or would leave the flight volume."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.geometry.motion import DISPLACEMENTS
from aerialdojo_gen.planning.flight_space import FlightSpace

Floats = NDArray[np.float64]


def blocked(space: FlightSpace, poses: ArrayLike) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Floats]:
    """For poses (n, 4) and the 16 actions.

    Whether each collides or is refused, (n, 16), and where it leads, (n, 16, 3).
    """
    p = np.asarray(poses, np.float64).reshape(-1, 4)
    c, s = np.cos(p[:, 3])[:, None], np.sin(p[:, 3])[:, None]
    ahead, left, up = DISPLACEMENTS[:N_ACTIONS].T
    ends = np.stack([p[:, :1] + (c * ahead - s * left), p[:, 1:2] + (s * ahead + c * left), p[:, 2:3] + up], axis=2)
    collides, refused = np.zeros((2, len(p), N_ACTIONS), np.bool_)
    moves = np.flatnonzero(DISPLACEMENTS[:N_ACTIONS].any(axis=1)).tolist()
    for k, here in enumerate(map(tuple, p[:, :3].tolist())):
        for a in moves:
            collides[k, a], refused[k, a] = space.motion_outcome(here, tuple(ends[k, a].tolist()))
    ends[refused] = np.broadcast_to(p[:, None, :3], ends.shape)[refused]
    return collides, refused, ends
