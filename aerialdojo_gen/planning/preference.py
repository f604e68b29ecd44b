"""Soft costs of a route: clearance from surfaces, and an Approach that flies ahead.

A metre flown below the preferred clearance costs more than a metre, the more the nearer the surface is; an Approach
that does not fly ahead costs some metres. The cost-to-go includes both; the stored length L does not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Singles
from aerialdojo_gen.planning.grid_kernels import GridArrays

# Step of the integration of clearance cost: the grid's cells are half a metre.
_STEP_M = 0.5
# Cells' costs are multiples of this, so that float32 adds them without rounding.
CLEARANCE_COST_UNIT = 1.0 / 16
AHEAD_ROUNDING_M = 1e-9  # Of the way ahead in an Approach, which may have no length


class Preference(NamedTuple):
    """Costs on top of length."""

    clearance: float  # Clearance from which on a path costs its length only, metres
    weight: float
    ahead_cos: float
    approach_penalty: float  # Extra cost of an Approach that does not fly ahead, metres


NO_PREFERENCE = Preference(1.0, 0.0, -1.0, 0.0)


def clearance_cost_field(field: Singles, prefer: Preference) -> Singles:
    """Extra cost of a metre in each cell near surfaces, (nx, ny, nz) float32, multiples of `CLEARANCE_COST_UNIT`."""
    share = np.float32(1.0) - np.clip(field, 0.0, prefer.clearance) / np.float32(prefer.clearance)
    units = np.rint(share * np.float32(prefer.weight / CLEARANCE_COST_UNIT))
    return np.asarray(units * np.float32(CLEARANCE_COST_UNIT), np.float32)


@njit(cache=True, error_model="numpy", inline="always")
def _clearance(x: float, y: float, z: float, ox: float, oy: float, oz: float, cell: float, field: Singles) -> float:
    """Distance of a point to the nearest surface, trilinear between cells; metres."""
    nx, ny, nz = field.shape
    fx = min(max((x - ox) / cell - 0.5, 0.0), nx - 1.0)
    fy = min(max((y - oy) / cell - 0.5, 0.0), ny - 1.0)
    fz = min(max((z - oz) / cell - 0.5, 0.0), nz - 1.0)
    i, j, k = int(fx), int(fy), int(fz)
    fx, fy, fz = fx - i, fy - j, fz - k
    u, v, w = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    p = (field[i, j, k] * (1 - fz) + field[i, j, w] * fz) * (1 - fy) + (
        field[i, v, k] * (1 - fz) + field[i, v, w] * fz
    ) * fy
    q = (field[u, j, k] * (1 - fz) + field[u, j, w] * fz) * (1 - fy) + (
        field[u, v, k] * (1 - fz) + field[u, v, w] * fz
    ) * fy
    return p * (1 - fx) + q * fx


@njit(cache=True, error_model="numpy")
def clearance_penalty(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, clearance: float, weight: float,
    ox: float, oy: float, oz: float, cell: float, field: Singles,
) -> float:  # fmt: skip
    """Extra cost, metres, of a straight segment for low clearance."""
    dx, dy, dz = qx - px, qy - py, qz - pz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if weight == 0.0 or length == 0.0:
        return 0.0
    ux, uy, uz = dx / length, dy / length, dz / length
    t, total = 0.0, 0.0
    while t < length:
        step = min(_STEP_M, length - t)
        m = t + 0.5 * step
        lack = clearance - _clearance(px + m * ux, py + m * uy, pz + m * uz, ox, oy, oz, cell, field)
        t += step
        if lack > 0.0:
            total += step * lack
        else:
            # Clearance is 1-Lipschitz: skip as far as it must stay above the preferred one.
            t = max(t, m - lack)
    return weight * total / clearance


@njit(cache=True, inline="always")
def leg_penalty(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, prefer: Preference, grid: GridArrays
) -> float:
    """`clearance_penalty` outside of inner loops, where passing tuples of arrays costs more than the work."""
    return clearance_penalty(
        px, py, pz, qx, qy, qz, prefer.clearance, prefer.weight,
        grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, grid.field,
    )  # fmt: skip


@njit(cache=True, inline="always")
def approach_penalty(dx: float, dy: float, yaw: float, length: float, ahead_cos: float, cost: float) -> float:
    """Extra cost, metres, of an Approach that does not fly ahead."""
    return cost if dx * math.cos(yaw) + dy * math.sin(yaw) < ahead_cos * length - AHEAD_ROUNDING_M else 0.0
