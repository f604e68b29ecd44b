"""A short grid path between a goal and one start, by weighted A*: an upper bound of the shortest.

A single query derives from it how far its cost-to-go has to reach.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.column_kernels import move_lengths
from aerialdojo_gen.planning.connectivity import MOVES
from aerialdojo_gen.planning.grid_kernels import GridArrays

# Slightly above 1, so that one of many paths of equal cost is followed to its end.
_WEIGHT = 1.05
_N_BUCKETS = 4096
_N_ENTRIES = 1 << 20
_SQRT2, _SQRT5 = math.sqrt(2.0), math.sqrt(5.0)

GAVE_UP = -1.0


class PathArrays(NamedTuple):
    """Working memory of a search for a grid path; untouched pages cost nothing."""

    heads: NDArray[np.int32]  # (_N_BUCKETS,) int32; first open entry of every bucket, -1 for none
    cell: NDArray[np.int32]  # (n,) arrays
    cost: NDArray[np.float32]
    next: NDArray[np.int32]
    touched: NDArray[np.int32]  # (n,) int32; cells whose cost was written


def make_path_arrays() -> PathArrays:
    """Reserve memory for searches of one grid."""
    return PathArrays(
        np.full(_N_BUCKETS, -1, np.int32), np.empty(_N_ENTRIES, np.int32), np.empty(_N_ENTRIES, np.float32),
        np.empty(_N_ENTRIES, np.int32), np.empty(_N_ENTRIES, np.int32),
    )  # fmt: skip


@njit(cache=True, inline="always")
def grid_metric(dx: float, dy: float, dz: float) -> float:
    """Length of a displacement in the grid's 16 directions and the vertical; in the displacement's unit."""
    a, b = abs(dx), abs(dy)
    high, low = max(a, b), min(a, b)
    flat = (
        high - 2.0 * low + _SQRT5 * low if 2.0 * low <= high else _SQRT5 * (high - low) + _SQRT2 * (2.0 * low - high)
    )
    return flat + abs(dz)


@njit(cache=True, error_model="numpy")
def short_path_cost(
    seeds: NDArray[np.int32], x: float, y: float, z: float, bound: float, grid: GridArrays, moves: NDArray[np.uint32],
    clearance_cost: NDArray[np.float32], costs: NDArray[np.float32], arrays: PathArrays,
) -> float:  # fmt: skip
    """Cost, metres, of a short grid path from a start to the seeds, within `_WEIGHT` of the least; inf or GAVE_UP."""
    nx, ny, nz = costs.shape
    flat, flat_moves, flat_clearance_cost = costs.reshape(-1), moves.reshape(-1), clearance_cost.reshape(-1)
    heads, cells, entry_costs, nexts, touched = arrays.heads, arrays.cell, arrays.cost, arrays.next, arrays.touched
    edge = grid.cell
    lengths, coarse = move_lengths(edge)
    n_moves = MOVES.shape[0]
    steps = MOVES[:, 0] * (ny * nz) + MOVES[:, 1] * nz + MOVES[:, 2]
    fx, fy, fz = (
        (x - grid.origin[0]) / edge - 0.5,
        (y - grid.origin[1]) / edge - 0.5,
        (z - grid.origin[2]) / edge - 0.5,
    )
    # The cells between which the start's cost-to-go is interpolated, as in `cost_between`.
    i0 = max(0, min(int(max(fx, 0.0)), nx - 2))
    j0 = max(0, min(int(max(fy, 0.0)), ny - 2))
    k0 = max(0, min(int(max(fz, 0.0)), nz - 2))
    width = _WEIGHT * bound / (_N_BUCKETS - 2)
    n, n_touched, lowest, found = 0, 0, _N_BUCKETS, np.inf
    for seed in seeds:
        h = edge * grid_metric(seed // (ny * nz) - fx, seed // nz % ny - fy, seed % nz - fz)
        touched[n_touched] = seed
        n_touched += 1
        if flat[seed] + h <= bound:
            bucket = int((flat[seed] + _WEIGHT * h) / width)
            cells[n], entry_costs[n], nexts[n], heads[bucket] = seed, flat[seed], heads[bucket], n
            lowest = min(lowest, bucket)
            n += 1
    while True:
        while lowest < _N_BUCKETS and heads[lowest] < 0:
            lowest += 1
        if lowest == _N_BUCKETS:
            break
        entry = heads[lowest]
        heads[lowest] = nexts[entry]
        c, g = cells[entry], entry_costs[entry]
        if g > flat[c]:
            continue
        i, j, k = c // (ny * nz), c // nz % ny, c % nz
        if 0 <= i - i0 <= 1 and 0 <= j - j0 <= 1 and 0 <= k - k0 <= 1:
            found = g + edge * (math.sqrt((i - fx) ** 2 + (j - fy) ** 2) + abs(k - fz))
            break
        if n + n_moves > cells.shape[0] or n_touched + n_moves > touched.shape[0]:
            found = GAVE_UP
            break
        bits, clearance_term = flat_moves[c], flat_clearance_cost[c]
        for m in range(n_moves):
            if not (bits >> np.uint32(m)) & np.uint32(1):
                continue
            d = c + steps[m]
            reached = g + (lengths[m] + coarse[m] * clearance_term)
            if reached >= flat[d]:
                continue
            h = edge * grid_metric(i + MOVES[m, 0] - fx, j + MOVES[m, 1] - fy, k + MOVES[m, 2] - fz)
            if reached + h > bound:
                continue
            if flat[d] == np.inf:
                touched[n_touched] = d
                n_touched += 1
            flat[d] = reached
            bucket = int((reached + _WEIGHT * h) / width)
            cells[n], entry_costs[n], nexts[n], heads[bucket] = d, reached, heads[bucket], n
            lowest = min(lowest, bucket)
            n += 1
    heads[:] = -1
    for t in range(n_touched):
        flat[touched[t]] = np.inf
    return found
