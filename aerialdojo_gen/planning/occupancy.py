"""Occupancy of a scene: the cells of the planner's clearance grid that its surfaces touch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.model import Scene

# Cells are taken so much larger on every side: a surface point rounded to float32 stays in a touched cell.
SLACK_M = 1e-4


@dataclass(frozen=True, eq=False)
class Occupancy:
    """A grid over a scene's flight volume; cell (i, j, k) begins at ``origin_m + voxel_m * (i, j, k)``."""

    occupied: Flags  # (X, Y, Z) bool; cells that a surface touches, to `SLACK_M`
    reachable: Flags  # (X, Y, Z) bool; cells from whose centre the planner's body can fly to the ceiling
    origin_m: Floats  # (3,) float64; metres, world frame
    voxel_m: float  # Edge of a cell, metres

    @classmethod
    def of(cls, scene: Scene, voxel_m: float = 0.5) -> Occupancy:
        """Compute it; at 0.5 m its cells are those that reference trajectories are planned on."""
        grid = ClearanceGrid.build(scene, voxel_m)
        occupied = np.zeros(grid.sky.shape, np.bool_)
        _mark_touched(grid.arrays.real_tri, grid.arrays.origin, voxel_m, SLACK_M, occupied)
        return cls(occupied, grid.sky, grid.arrays.origin, voxel_m)


@njit(cache=True)
def _separates(ax: float, ay: float, az: float, corners: Floats, x: float, y: float, z: float, half: float) -> bool:
    """Whether an axis separates a triangle (3, 3) from the cube about (x, y, z)."""
    low, high = np.inf, -np.inf
    for k in range(3):
        d = ax * (corners[k, 0] - x) + ay * (corners[k, 1] - y) + az * (corners[k, 2] - z)
        low, high = min(low, d), max(high, d)
    reach = half * (abs(ax) + abs(ay) + abs(az))
    return low > reach or high < -reach


@njit(cache=True, nogil=True)
def _mark_touched(tri: Floats, origin: Floats, cell: float, slack: float, occupied: Flags) -> None:
    """Mark the cells that triangles (n, 9) touch, by the separating axes of a triangle and a cube."""
    half = cell / 2 + slack
    first, last, n = np.empty(3, np.int64), np.empty(3, np.int64), occupied.shape
    for t in range(tri.shape[0]):
        p = tri[t].reshape(3, 3)
        for a in range(3):
            low, high = min(p[0, a], p[1, a], p[2, a]) - origin[a], max(p[0, a], p[1, a], p[2, a]) - origin[a]
            first[a] = max(0, math.ceil((low - slack) / cell) - 1)
            last[a] = min(n[a] - 1, math.floor((high + slack) / cell))
        u, v = p[1] - p[0], p[2] - p[0]
        nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        for i in range(first[0], last[0] + 1):
            x = origin[0] + (i + 0.5) * cell
            for j in range(first[1], last[1] + 1):
                y = origin[1] + (j + 0.5) * cell
                for k in range(first[2], last[2] + 1):
                    z = origin[2] + (k + 0.5) * cell
                    separate = occupied[i, j, k] or _separates(nx, ny, nz, p, x, y, z, half)
                    for m in range(3):
                        if separate:
                            break
                        ex, ey, ez = (
                            p[(m + 1) % 3, 0] - p[m, 0], p[(m + 1) % 3, 1] - p[m, 1], p[(m + 1) % 3, 2] - p[m, 2],
                        )  # fmt: skip
                        separate = (
                            _separates(0.0, -ez, ey, p, x, y, z, half)
                            or _separates(ez, 0.0, -ex, p, x, y, z, half)
                            or _separates(-ey, ex, 0.0, p, x, y, z, half)
                        )
                    if not separate:
                        occupied[i, j, k] = True
