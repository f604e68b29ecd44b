"""The part of a goal's cost-to-go that the search from one start needs, for single queries.

A search with weight w pops the edge with the least metres flown + w · cost-to-go. The metres flown from the start
to a cell are at least the straight distance in the action metric. So cells with

    straight distance from the start + w · cost-to-go > reach

are never needed, and stay infinite. The others form something like an ellipsoid around start and goal, and contain
every cheapest path from each of them: their costs equal those of the whole field, to the bit. The reach follows
from a grid path, an upper bound of the shortest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Int32s, Singles
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.connectivity import MOVES, grid_metric, move_lengths
from aerialdojo_gen.planning.cost_to_go import Area, Memory, expand, make_memory
from aerialdojo_gen.planning.grid_kernels import GridArrays

# Slightly above 1, so that one of many paths of equal cost is followed to its end.
_WEIGHT = 1.05
_N_BUCKETS = 4096
_N_ENTRIES = 1 << 20
_GAVE_UP = -1.0


class PathArrays(NamedTuple):
    """Working memory of a search for a grid path; untouched pages cost nothing."""

    heads: Int32s  # (_N_BUCKETS,) int32; first open entry of every bucket, -1 for none
    cell: Int32s  # (n,) arrays
    cost: Singles
    next: Int32s
    touched: Int32s  # (n,) int32; cells whose cost was written


def make_path_arrays() -> PathArrays:
    """Reserve memory for searches of one grid."""
    return PathArrays(
        np.full(_N_BUCKETS, -1, np.int32), np.empty(_N_ENTRIES, np.int32), np.empty(_N_ENTRIES, np.float32),
        np.empty(_N_ENTRIES, np.int32), np.empty(_N_ENTRIES, np.int32),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def short_path_cost(
    seeds: Int32s, x: float, y: float, z: float, bound: float, grid: GridArrays, moves: NDArray[np.uint32],
    clearance_cost: Singles, costs: Singles, arrays: PathArrays,
) -> float:  # fmt: skip
    """Metres of a short grid path from a start to the seeds, within `_WEIGHT` of the least; inf, or `_GAVE_UP`."""
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
            found = _GAVE_UP
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


def reach_margin(cell: float, weight: float) -> float:
    """Margin of the field's reach over the cost of the edges that the search pops, metres.

    An edge's cost-to-go is interpolated between cells within a cell's diagonal of its end in the action metric, whose
    costs differ by less than four cells.
    """
    return (math.sqrt(2.0) + 1.0) * cell + 4.0 * weight * cell


@njit(cache=True)
def _clear(n: int, seeds: Int32s, cost: Singles, memory: Memory) -> None:
    """Reset the costs and the memory of an expansion that wrote n columns."""
    ny, nz = cost.shape[1], cost.shape[2]
    for seed in seeds:
        cost[seed // nz // ny, seed // nz % ny, seed % nz] = np.inf
    for c in memory.written[:n]:
        i, j = c // ny, c % ny
        if memory.last[i, j] > 0:
            cost[i, j] = np.inf
        memory.last[i, j] = 0


# The search rarely exceeds weight · grid path by more than this, metres: action costs, and detours of the lattice.
_SURPLUS_M = 1.1


class QueryResult(NamedTuple):
    """Cost-to-go between a start and a goal."""

    cost: Singles | None  # (nx, ny, nz) float32 or None
    unreachable: bool  # There is no grid path
    reach_m: float  # Costs are complete up to this


class NearField:
    """Computes the cost-to-go, metres, between one start and one goal at a time, for a search with a weight.

    `seed` writes the costs about a goal (4,) as `seed_goal` does.
    """

    def __init__(
        self, grid: ClearanceGrid, clearance_cost: Singles, weight: float, approach: float, bound: float,
        seed: Callable[[Floats, Singles], Int32s],
    ) -> None:  # fmt: skip
        self._grid, self._clearance_cost, self._seed = grid, clearance_cost, seed
        self._weight, self._approach, self._bound = weight, approach, bound
        self._cost = np.full(grid.moves.shape, np.inf, np.float32)
        self._memory, self._path = make_memory(grid.moves.shape), make_path_arrays()
        self._last = (0, np.empty(0, np.int32))  # Columns that the last query wrote, and its seeds

    def between(self, goal: Floats, start: Floats, min_reach: float) -> QueryResult:
        """Compute the costs that a search from a start (4,) to a goal (4,) needs; valid until the next call."""
        cost, cells, moves, weight = self._cost, self._grid.arrays, self._grid.moves, self._weight
        _clear(*self._last, cost, self._memory)
        seeds = self._seed(goal, cost)
        self._last = (0, seeds)
        seeded = cost.ravel()[seeds]
        # The start is within the bound if one of the cells around it is.
        max_cost = self._bound + reach_margin(cells.cell, 1.0)
        path = short_path_cost(seeds, *start[:3], max_cost, cells, moves, self._clearance_cost, cost, self._path)
        if path == _GAVE_UP or not math.isfinite(path):
            return QueryResult(None, path != _GAVE_UP, 0.0)
        cost.reshape(-1)[seeds] = seeded
        reach = max(weight * path + _SURPLUS_M, min_reach)
        whole = reach + reach_margin(cells.cell, weight)
        area = Area(start[:3], goal[:3], self._approach, weight, whole, self._bound, math.inf)
        written, _ = expand(seeds, area, cells, moves, cost, self._clearance_cost, self._memory)
        self._last = (written, seeds)
        return QueryResult(cost, False, reach)
