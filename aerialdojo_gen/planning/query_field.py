"""The part of a goal's cost-to-go that the search from one start needs, for single queries.

A search with weight w pops the edge with the least metres flown + w · cost-to-go. The metres flown from the start
to a cell are at least the straight distance in the action metric. So cells with

    straight distance from the start + w · cost-to-go > reach

are never needed, and stay infinite. The others form something like an ellipsoid around start and goal, and contain
every cheapest path from each of them: their costs equal those of the whole field, to the bit. The reach follows
from a grid path (`aerialdojo_gen.planning.grid_path`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.column_kernels import FLAT, UP, move_lengths
from aerialdojo_gen.planning.column_lanes import LANES, MIN_CELLS, relax_column, relax_flat
from aerialdojo_gen.planning.connectivity import MOVE_LENGTHS, MOVES
from aerialdojo_gen.planning.grid_kernels import GridArrays
from aerialdojo_gen.planning.grid_path import GAVE_UP, grid_metric, make_path_arrays, short_path_cost

# Columns are queued in bins half a cell wide; the longest move is just under five bins.
_BINS = 8
_DELAY = (2.0 * MOVE_LENGTHS).astype(np.int64)
# A straight Approach is shorter than in the grid's metric by less than this share of its length.
_APPROACH_SAVING = 0.45


class QueryArrays(NamedTuple):
    """Working memory of single queries; cleared after each one."""

    cost: NDArray[np.float32]  # (nx, ny, nz) float32; cost-to-go, metres; infinite
    first: NDArray[np.int16]  # (nx, ny) int16
    last: NDArray[np.int16]
    limit: NDArray[np.float32]  # (nx, ny) float32; maximum cost of these cells, metres
    waiting: NDArray[np.bool_]  # (nx, ny) bool; queued columns
    next: NDArray[np.int32]  # (nx * ny,) int32; columns in bins, as linked lists
    columns: NDArray[np.int32]  # (nx * ny,) int32; visited columns


def make_query_arrays(shape: tuple[int, ...]) -> QueryArrays:
    """Reserve memory for the single queries in a grid."""
    nx, ny, _ = shape
    return QueryArrays(
        np.full(shape, np.inf, np.float32), np.zeros((nx, ny), np.int16), np.zeros((nx, ny), np.int16),
        np.empty((nx, ny), np.float32), np.zeros((nx, ny), np.bool_), np.empty(nx * ny, np.int32),
        np.empty(nx * ny, np.int32),
    )  # fmt: skip


def reach_margin(cell: float, weight: float) -> float:
    """Margin of the field's reach over the cost of the edges that the search pops, metres.

    An edge's cost-to-go is interpolated between cells within a cell's diagonal of its end in the action metric, whose
    costs differ by less than four cells.
    """
    return (math.sqrt(2.0) + 1.0) * cell + 4.0 * weight * cell


@njit(cache=True, error_model="numpy")
def _span(
    i: int, j: int, start: NDArray[np.float64], goal: NDArray[np.float64], approach: float, reach: float,
    weight: float, grid: GridArrays,
) -> tuple[int, int, float]:  # fmt: skip
    """Range of a column's cells within reach, and their maximum cost; a last of -1 for none."""
    cell, nz = grid.cell, grid.field.shape[2]
    x, y, oz = grid.origin[0] + (i + 0.5) * cell, grid.origin[1] + (j + 0.5) * cell, grid.origin[2]
    from_start = math.sqrt((x - start[0]) ** 2 + (y - start[1]) ** 2)
    to_goal = grid_metric(x - goal[0], y - goal[1], 0.0) - _APPROACH_SAVING * approach
    remaining = reach - from_start - weight * to_goal
    low, high = min(start[2], goal[2]), max(start[2], goal[2])
    if remaining < high - low:
        return 0, -1, 0.0
    # Solve |z - start| + weight · |z - goal| = left outside of the two; between them nothing is cut off.
    low = min(low, (start[2] + weight * goal[2] - remaining) / (1.0 + weight))
    high = max(high, (start[2] + weight * goal[2] + remaining) / (1.0 + weight))
    first = max(0, int((low - oz) / cell - 0.5))
    last = min(max(int((high - oz) / cell + 0.5) + 1, first + MIN_CELLS), nz)
    return min(first, last - MIN_CELLS), last, (reach - from_start) / weight


@njit(cache=True, error_model="numpy")
def expand_query(
    seeds: NDArray[np.int32], start: NDArray[np.float64], goal: NDArray[np.float64], approach: float, reach: float,
    weight: float, bound: float, grid: GridArrays, moves: NDArray[np.uint32], clearance_cost: NDArray[np.float32],
    arrays: QueryArrays,
) -> int:  # fmt: skip
    """Costs as of `expand_cost` for the cells within reach of one start; return the number of columns written."""
    nx, ny, nz = arrays.cost.shape
    costs, flat_moves, flat_clearance = arrays.cost.reshape(-1), moves.reshape(-1), clearance_cost.reshape(-1)
    first, last, limit, waiting, nexts, columns = (
        arrays.first, arrays.last, arrays.limit, arrays.waiting, arrays.next, arrays.columns
    )  # fmt: skip
    lengths, coarse = move_lengths(grid.cell)
    targets, limits = np.empty(len(FLAT), np.int64), np.empty(len(FLAT), np.float32)
    improved = np.empty(len(FLAT), np.uint8)
    bins = np.full(_BINS, -1, np.int32)
    n, remaining, bin_number = 0, 0, 0
    for seed in seeds:
        c = seed // nz
        i, j = c // ny, c % ny
        if last[i, j] == 0:
            first[i, j], last[i, j], most = _span(i, j, start, goal, approach, reach, weight, grid)
            limit[i, j], columns[n] = min(bound, most), c
            n += 1
        if last[i, j] > 0 and not waiting[i, j]:
            waiting[i, j], nexts[c], bins[0] = True, bins[0], c
            remaining += 1
    while remaining > 0:
        while bins[bin_number % _BINS] < 0:
            bin_number += 1
        c = bins[bin_number % _BINS]
        bins[bin_number % _BINS] = nexts[c]
        remaining -= 1
        i, j = c // ny, c % ny
        waiting[i, j] = False
        k0, k1, base = first[i, j], last[i, j], c * nz
        relax_column(costs, flat_moves, flat_clearance, base + k0, k1 - k0, lengths[UP], coarse[UP])
        for m in range(len(FLAT)):
            u, v = i + MOVES[FLAT[m], 0], j + MOVES[FLAT[m], 1]
            targets[m], improved[m] = -1, 0
            if not (0 <= u < nx and 0 <= v < ny) or last[u, v] < 0:
                continue
            if last[u, v] == 0:
                first[u, v], last[u, v], most = _span(u, v, start, goal, approach, reach, weight, grid)
                limit[u, v], columns[n] = min(bound, most), u * ny + v
                n += 1
            if last[u, v] > 0:
                targets[m], limits[m] = (u * ny + v) * nz, limit[u, v]
        for k in range(k0, k1, LANES):
            k = min(k, k1 - LANES)
            relax_flat(
                costs, flat_moves, flat_clearance, base + k, k, lengths, coarse, targets, limits, improved
            )  # fmt: skip
        for m in range(len(FLAT)):
            u, v = i + MOVES[FLAT[m], 0], j + MOVES[FLAT[m], 1]
            if improved[m] and not waiting[u, v]:
                d, b = u * ny + v, (bin_number + _DELAY[FLAT[m]]) % _BINS
                waiting[u, v], nexts[d], bins[b] = True, bins[b], d
                remaining += 1
    return n


@njit(cache=True)
def clear_query(n: int, seeds: NDArray[np.int32], arrays: QueryArrays) -> None:
    """Reset the memory of a query that wrote n columns."""
    ny, nz = arrays.cost.shape[1], arrays.cost.shape[2]
    for seed in seeds:
        arrays.cost[seed // nz // ny, seed // nz % ny, seed % nz] = np.inf
    for a in range(n):
        i, j = arrays.columns[a] // ny, arrays.columns[a] % ny
        if arrays.last[i, j] > 0:
            arrays.cost[i, j] = np.inf
        arrays.last[i, j] = 0


# The search rarely exceeds weight · grid path by more than this, metres: action costs, and detours of the lattice.
_SURPLUS_M = 1.1


class QueryResult(NamedTuple):
    """Cost-to-go between a start and a goal."""

    cost: NDArray[np.float32] | None  # (nx, ny, nz) float32 or None
    unreachable: bool  # There is no grid path
    reach_m: float  # Costs are complete up to this


class NearField:
    """Computes the cost-to-go, metres, between one start and one goal at a time."""

    def __init__(self, grid: ClearanceGrid, clearance_cost: NDArray[np.float32]) -> None:
        self.grid = grid
        self.clearance_cost = clearance_cost
        self._arrays = make_query_arrays(grid.moves.shape)
        self._path = make_path_arrays()

    @contextmanager
    def between(
        self,
        goal: NDArray[np.float64],
        start: NDArray[np.float64],
        weight: float,
        seed: Callable[[NDArray[np.float64], NDArray[np.float32]], NDArray[np.int32]],
        approach: float,
        bound: float,
        min_reach: float,
    ) -> Iterator[QueryResult]:
        """Yield the costs that a search from a start (4,) to a goal (4,) needs; valid until the block ends."""
        cost, cells, moves = self._arrays.cost, self.grid.arrays, self.grid.moves
        seeds = seed(goal, cost)
        seeded = cost.ravel()[seeds]
        # The start is within the bound if one of the cells around it is.
        max_cost = bound + reach_margin(cells.cell, 1.0)
        path = short_path_cost(seeds, *start[:3], max_cost, cells, moves, self.clearance_cost, cost, self._path)
        if path == GAVE_UP or not math.isfinite(path):
            yield QueryResult(None, path != GAVE_UP, 0.0)
            return
        cost.reshape(-1)[seeds] = seeded
        reach = max(weight * path + _SURPLUS_M, min_reach)
        written = expand_query(
            seeds, start[:3], goal[:3], approach, reach + reach_margin(cells.cell, weight), weight, bound, cells,
            moves, self.clearance_cost, self._arrays,
        )  # fmt: skip
        try:
            yield QueryResult(cost, False, reach)
        finally:
            clear_query(written, seeds, self._arrays)
