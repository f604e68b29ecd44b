"""The part of a goal's cost-to-go that the search from one start looks at, for single queries.

A search with the weight w takes an edge off its list while metres flown + w · cost-to-go is least. What it flies from
the start to a cell is no less than the straight way there, in the action metric. So cells of which

    straight way from the start + w · cost-to-go > reach

are never looked at, or on edges that are never taken: they stay infinite. The others form, with the goal and the
start, a thing like an ellipsoid, and hold the whole of every cheapest path from each of them: their costs are those
of the whole field, to the bit. How far it has to reach is told by a grid path (`aerialdojo_gen.planning.grid_path`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.column_kernels import FLAT, KIND_OF, KINDS, UP, leave, move_lengths, push, settle
from aerialdojo_gen.planning.connectivity import MOVE_LENGTHS, MOVES
from aerialdojo_gen.planning.grid_kernels import GridArrays
from aerialdojo_gen.planning.grid_path import grid_metric

# Columns wait in bins half a cell wide for their turn; the longest move is not quite five bins long.
_BINS = 8
_DELAY = (2.0 * MOVE_LENGTHS).astype(np.int64)
# Ranges of cells begin and end at multiples of this, the width of vector instructions.
_LANES = 8
# A last straight Approach is shorter than its way in the grid's metric by less than this share of its length.
_APPROACH_SAVES = 0.45


class QueryArrays(NamedTuple):
    """Memory of single queries; as `make_query_arrays` made it between them."""

    cost: NDArray[np.float32]  # (nx, ny, nz) float32; cost-to-go, metres; infinite
    first: NDArray[np.int16]  # (nx, ny) int16
    last: NDArray[np.int16]
    limit: NDArray[np.float32]  # (nx, ny) float32; most that these cells may cost, metres
    waiting: NDArray[np.bool_]  # (nx, ny) bool; columns that may have something to pass on
    next: NDArray[np.int32]  # (nx * ny,) int32; columns in bins, as linked lists
    columns: NDArray[np.int32]  # (nx * ny,) int32; columns that were come to


def make_query_arrays(shape: tuple[int, ...]) -> QueryArrays:
    """Reserve memory for the single queries in a grid."""
    nx, ny, _ = shape
    return QueryArrays(
        np.full(shape, np.inf, np.float32), np.zeros((nx, ny), np.int16), np.zeros((nx, ny), np.int16),
        np.empty((nx, ny), np.float32), np.zeros((nx, ny), np.bool_), np.empty(nx * ny, np.int32),
        np.empty(nx * ny, np.int32),
    )  # fmt: skip


def reach_margin(cell: float, weight: float) -> float:
    """How much farther the field has to reach than what the search takes off its list costs, metres.

    An edge is as dear as the cells that its cost-to-go is interpolated between. These lie within a cell's diagonal of
    its end in the action metric, and interpolated are only costs that differ by less than four cells.
    """
    return (math.sqrt(2.0) + 1.0) * cell + 4.0 * weight * cell


@njit(cache=True, error_model="numpy")
def _span(
    i: int, j: int, start: NDArray[np.float64], goal: NDArray[np.float64], approach: float, reach: float,
    weight: float, grid: GridArrays,
) -> tuple[int, int, float]:  # fmt: skip
    """Range of a column's cells that may lie within reach, and the most that they may cost; a last of -1 for none."""
    cell, nz = grid.cell, grid.field.shape[2]
    x, y, oz = grid.origin[0] + (i + 0.5) * cell, grid.origin[1] + (j + 0.5) * cell, grid.origin[2]
    from_start = math.sqrt((x - start[0]) ** 2 + (y - start[1]) ** 2)
    to_goal = grid_metric(x - goal[0], y - goal[1], 0.0) - _APPROACH_SAVES * approach
    left = reach - from_start - weight * to_goal
    low, high = min(start[2], goal[2]), max(start[2], goal[2])
    if left < high - low:
        return 0, -1, 0.0
    # Where |z - start| + weight · |z - goal| is what is left, outside of the two; between them nothing is cut off.
    low = min(low, (start[2] + weight * goal[2] - left) / (1.0 + weight))
    high = max(high, (start[2] + weight * goal[2] + left) / (1.0 + weight))
    first = max(0, int((low - oz) / cell - 0.5)) // _LANES * _LANES
    last = (max(0, int((high - oz) / cell + 0.5)) // _LANES + 1) * _LANES
    return min(first, nz - 1), min(last, nz), (reach - from_start) / weight


@njit(cache=True, error_model="numpy")
def expand_query(
    seeds: NDArray[np.int32], start: NDArray[np.float64], goal: NDArray[np.float64], approach: float, reach: float,
    weight: float, bound: float, grid: GridArrays, moves: NDArray[np.uint32], clearance_cost: NDArray[np.float32],
    arrays: QueryArrays,
) -> int:  # fmt: skip
    """Costs as `expand_cost` finds them, of the cells within reach of one start.

    Returns columns to be cleared again.
    """
    nx, ny, nz = arrays.cost.shape
    costs, flat_moves, flat_narrow = arrays.cost.reshape(-1), moves.reshape(-1), clearance_cost.reshape(-1)
    first, last, limit, waiting, nexts, columns = (
        arrays.first, arrays.last, arrays.limit, arrays.waiting, arrays.next, arrays.columns
    )  # fmt: skip
    lengths, coarse = move_lengths(grid.cell)
    departed = np.empty(len(KINDS) * nz, np.float32)
    bins = np.full(_BINS, -1, np.int32)
    n, left, now = 0, 0, 0
    for seed in seeds:
        c = seed // nz
        i, j = c // ny, c % ny
        if last[i, j] == 0:
            first[i, j], last[i, j], most = _span(i, j, start, goal, approach, reach, weight, grid)
            limit[i, j], columns[n] = min(bound, most), c
            n += 1
        if last[i, j] > 0 and not waiting[i, j]:
            waiting[i, j], nexts[c], bins[0] = True, bins[0], c
            left += 1
    while left > 0:
        while bins[now % _BINS] < 0:
            now += 1
        c = bins[now % _BINS]
        bins[now % _BINS] = nexts[c]
        left -= 1
        i, j = c // ny, c % ny
        waiting[i, j] = False
        k0, k1, base = first[i, j], last[i, j], c * nz
        settle(costs, flat_moves, flat_narrow, base + k0, base + k1, lengths[UP], coarse[UP])
        for kind in range(len(KINDS)):
            m = KINDS[kind]
            leave(costs, flat_narrow, base + k0, k1 - k0, lengths[m], coarse[m], departed, kind * nz + k0)
        for m in FLAT:
            u, v = i + MOVES[m, 0], j + MOVES[m, 1]
            if not (0 <= u < nx and 0 <= v < ny) or last[u, v] < 0:
                continue
            d = u * ny + v
            if last[u, v] == 0:
                first[u, v], last[u, v], most = _span(u, v, start, goal, approach, reach, weight, grid)
                limit[u, v], columns[n] = min(bound, most), d
                n += 1
            b0, b1 = max(k0, first[u, v]), min(k1, last[u, v])
            if (
                b0 < b1
                and push(
                    departed, KIND_OF[m] * nz + b0, flat_moves, base + b0, costs, d * nz + b0, b1 - b0, m, limit[u, v]
                )
                and not waiting[u, v]
            ):
                b = (now + _DELAY[m]) % _BINS
                waiting[u, v], nexts[d], bins[b] = True, bins[b], d
                left += 1
    return n


@njit(cache=True)
def clear_query(n: int, seeds: NDArray[np.int32], arrays: QueryArrays) -> None:
    """Bring the memory of a query that wrote n columns back to what it was."""
    ny, nz = arrays.cost.shape[1], arrays.cost.shape[2]
    for seed in seeds:
        arrays.cost[seed // nz // ny, seed // nz % ny, seed % nz] = np.inf
    for a in range(n):
        i, j = arrays.columns[a] // ny, arrays.columns[a] % ny
        if arrays.last[i, j] > 0:
            arrays.cost[i, j, arrays.first[i, j] : arrays.last[i, j]] = np.inf
        arrays.last[i, j] = 0
