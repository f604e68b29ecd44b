"""The cost-to-go of a goal: lengths of shortest grid paths from everywhere, shared by all starts of a target.

The metric is the action set's: horizontal and vertical motion are separate moves, so that up to the grid's 16
directions the cost of a free displacement is |horizontal| + |vertical| (at most 2.7 % above it).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.planning.connectivity import MOVE_LENGTHS, MOVES, OPEN, cell_centre
from aerialdojo_gen.planning.grid_kernels import GridArrays, segment_free

# The longest move is sqrt(5) cells, and levels are a cell wide: what a level pushes lies in the next three.
_RING = 4
# Costs are multiples of this, so that float32 adds them without rounding and equal costs compare equal.
_QUANTUM_M = 2.0**-12


def _canonical() -> NDArray[np.uint32]:
    """For every move, as bits, the moves that may follow it where nothing is near.

    Moves commute there, so one order of them is enough: knight's moves, then neighbours in the plane, then the
    vertical. Two moves in the plane that are not next to each other in angle are never part of a shortest path.
    """
    after = np.zeros(len(MOVES), np.uint32)
    flat = np.flatnonzero(MOVES[:, 2] == 0)
    angles = np.arctan2(MOVES[flat, 1], MOVES[flat, 0])
    around = flat[np.argsort(angles)]
    lifts = np.flatnonzero(MOVES[:, 2] != 0)
    for position, m in enumerate(around):
        knight = MOVE_LENGTHS[m] > 2
        beside = [around[position - 1], around[(position + 1) % len(around)]] if knight else []
        for follower in (m, *beside, *lifts):
            after[m] |= np.uint32(1 << int(follower))
    for m in lifts:
        after[m] = np.uint32(1 << int(m))
    return after


_AFTER = _canonical()


@njit(cache=True)
def _grown(entries: NDArray[np.int32]) -> NDArray[np.int32]:
    larger = np.empty((entries.shape[0], 2 * entries.shape[1]), np.int32)
    larger[:, : entries.shape[1]] = entries
    return larger


@njit(cache=True)
def seed_goal(
    gx: float, gy: float, gz: float, reach: float, radius: float,
    grid: GridArrays, moves: NDArray[np.uint32], cost: NDArray[np.float32],
) -> NDArray[np.int32]:  # fmt: skip
    """Write the straight distance to the goal into the cells that see it within `reach`; return their numbers."""
    nx, ny, nz = cost.shape
    found = np.empty(4096, np.int32)
    n = 0
    i0, i1 = (
        math.ceil((gx - reach - grid.origin[0]) / grid.cell - 0.5),
        (gx + reach - grid.origin[0]) / grid.cell - 0.5,
    )
    j0, j1 = (
        math.ceil((gy - reach - grid.origin[1]) / grid.cell - 0.5),
        (gy + reach - grid.origin[1]) / grid.cell - 0.5,
    )
    k0, k1 = (
        math.ceil((gz - reach - grid.origin[2]) / grid.cell - 0.5),
        (gz + reach - grid.origin[2]) / grid.cell - 0.5,
    )
    for i in range(max(0, i0), min(nx - 1, math.floor(i1)) + 1):
        for j in range(max(0, j0), min(ny - 1, math.floor(j1)) + 1):
            for k in range(max(0, k0), min(nz - 1, math.floor(k1)) + 1):
                if moves[i, j, k] == 0 or n == found.shape[0]:
                    continue
                x, y, z = cell_centre(i, j, k, grid)
                d = math.sqrt((x - gx) ** 2 + (y - gy) ** 2 + (z - gz) ** 2)
                if d <= reach and segment_free(x, y, z, gx, gy, gz, radius, grid, False):
                    cost[i, j, k] = round(d / _QUANTUM_M) * _QUANTUM_M
                    found[n] = (i * ny + j) * nz + k
                    n += 1
    return found[:n]


@njit(cache=True)
def expand_cost(
    seeds: NDArray[np.int32],
    starts: NDArray[np.float64],
    bound: float,
    slack: float,
    grid: GridArrays,
    moves: NDArray[np.uint32],
    cost: NDArray[np.float32],
) -> float:
    """Dijkstra's algorithm over the grid's passable moves, outwards from seeded cells.

    Levels are as wide as the shortest move: whatever stands in the lowest level is final (Dinitz), so that a ring of
    stacks does in place of a heap. In the open only one of the orders of a path's moves is followed (a canonical
    ordering, as in jump point search); the costs are the same.

    Parameters
    ----------
    seeds : (n,) int32
        Flat numbers of cells whose `cost` is set.
    starts : (m, 3) float64
        The expansion ends when all of them are reached, metres; with none it does not end before the bound.
    bound : float
        … or when the cost exceeds this, metres.
    slack : float
        How much further to go once all starts are reached, metres.
    grid : GridArrays
        The clearance grid.
    moves : (nx, ny, nz) uint32
        Passable moves.
    cost : (nx, ny, nz) float32
        Infinite but for the seeds; filled in place, metres.

    Returns
    -------
    float
        Costs up to this are final, metres.
    """
    nx, ny, nz = cost.shape
    flat_cost, flat_moves = cost.ravel(), moves.ravel()
    lengths = (np.rint(MOVE_LENGTHS * grid.cell / _QUANTUM_M) * _QUANTUM_M).astype(np.float32)
    steps = (MOVES[:, 0] * (ny * nz) + MOVES[:, 1] * nz + MOVES[:, 2]).astype(np.int32)
    n_moves = steps.shape[0]
    follow = np.empty(nx * ny * nz, np.uint32)
    entries = np.empty((_RING, 1 << 15), np.int32)
    tops = np.zeros(_RING, np.int64)
    inverse = np.float32(1.0 / grid.cell)
    for c in seeds:
        slot = int(flat_cost[c] * inverse) % _RING
        entries[slot, tops[slot]] = c
        tops[slot] += 1
        follow[c] = ~np.uint32(0)
    waiting = np.arange(starts.shape[0])
    n_waiting = starts.shape[0]
    end = bound
    level = 0
    one = np.uint32(1)
    idle = 0
    while level * grid.cell <= end and idle < _RING:
        slot = level % _RING
        idle = idle + 1 if tops[slot] == 0 else 0
        while tops[slot] > 0:
            tops[slot] -= 1
            c = entries[slot, tops[slot]]
            d = flat_cost[c]
            followers = follow[c]
            if followers == 0:
                continue  # done already
            follow[c] = 0
            bits = flat_moves[c]
            if bits & OPEN:
                bits &= followers
            for m in range(n_moves):
                if (bits >> np.uint32(m)) & one:
                    e = c + steps[m]
                    reached = d + lengths[m]
                    if reached < flat_cost[e]:
                        flat_cost[e] = reached
                        follow[e] = _AFTER[m]
                        to = int(reached * inverse) & (_RING - 1)
                        if tops[to] == entries.shape[1]:
                            entries = _grown(entries)
                        entries[to, tops[to]] = e
                        tops[to] += 1
                    elif reached == flat_cost[e]:
                        follow[e] |= _AFTER[m]
        level += 1
        if n_waiting > 0:
            kept = 0
            for w in range(n_waiting):
                s = waiting[w]
                if cost_at(starts[s, 0], starts[s, 1], starts[s, 2], grid, cost) > level * grid.cell:
                    waiting[kept] = s
                    kept += 1
            n_waiting = kept
            if n_waiting == 0:
                end = min(end, level * grid.cell + slack)
    return level * grid.cell


@njit(cache=True)
def cost_at(x: float, y: float, z: float, grid: GridArrays, cost: NDArray[np.float32]) -> float:
    """Cost-to-go of a point: trilinear between the 8 nearest cells, where they agree; metres.

    Where a cell is blocked, or the cells lie on two sides of something, it is the cheapest way through one of them.
    """
    nx, ny, nz = cost.shape
    fx, fy, fz = (
        (x - grid.origin[0]) / grid.cell - 0.5,
        (y - grid.origin[1]) / grid.cell - 0.5,
        (z - grid.origin[2]) / grid.cell - 0.5,
    )
    i = max(0, min(int(max(fx, 0.0)), nx - 2))
    j = max(0, min(int(max(fy, 0.0)), ny - 2))
    k = max(0, min(int(max(fz, 0.0)), nz - 2))
    # Points within half a cell of the border are extrapolated to, others outside are not.
    fx = min(max(fx - i, -0.5), 1.5)
    fy = min(max(fy - j, -0.5), 1.5)
    fz = min(max(fz - k, -0.5), 1.5)
    i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    a, b, c, d = cost[i, j, k], cost[i, j, k1], cost[i, j1, k], cost[i, j1, k1]
    e, f, g, h = cost[i1, j, k], cost[i1, j, k1], cost[i1, j1, k], cost[i1, j1, k1]
    low = min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
    high = max(max(max(a, b), max(c, d)), max(max(e, f), max(g, h)))
    if high - low < 4.0 * grid.cell:
        p = (a + (b - a) * fz) * (1 - fy) + (c + (d - c) * fz) * fy
        q = (e + (f - e) * fz) * (1 - fy) + (g + (h - g) * fz) * fy
        return p * (1 - fx) + q * fx
    if low == np.inf:
        return np.inf
    best = np.inf
    for u in range(2):
        for v in range(2):
            for w in range(2):
                value = cost[min(i + u, nx - 1), min(j + v, ny - 1), min(k + w, nz - 1)]
                flat = math.sqrt((fx - u) ** 2 + (fy - v) ** 2)
                best = min(best, value + (flat + abs(fz - w)) * grid.cell)
    return best
