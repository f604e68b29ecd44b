"""The cost-to-go of a goal: lengths of shortest grid paths from everywhere, shared by all starts of a target.

The metric is the action set's: horizontal and vertical motion are separate moves, so that up to the grid's 16
directions the cost of a free displacement is |horizontal| + |vertical| (at most 2.7 % above it).

Paths near surfaces cost more than their metres (`aerialdojo_gen.planning.preference`), and so do paths that end in an
Approach that does not fly ahead.

Cells are relaxed a column at a time: a column is contiguous in memory, so the loops are vectorised.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.column_kernels import FLAT, QUANTUM_M, UP, move_lengths
from aerialdojo_gen.planning.column_lanes import LANES, MIN_CELLS, relax_column, relax_flat
from aerialdojo_gen.planning.connectivity import MOVES, cell_centre
from aerialdojo_gen.planning.grid_kernels import GridArrays, segment_free
from aerialdojo_gen.planning.preference import Preference, approach_penalty, clearance_penalty


@lru_cache(maxsize=4)
def columns_by_distance(reach: int) -> NDArray[np.int32]:
    """Offsets (n, 2) of the columns around a column, the nearest first."""
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    high, low = np.maximum(abs(i), abs(j)), np.minimum(abs(i), abs(j))
    distance = np.where(
        2 * low <= high,
        high - 2 * low + math.sqrt(5) * low,
        math.sqrt(5) * (high - low) + math.sqrt(2) * (2 * low - high),
    ).ravel()
    near = np.flatnonzero(distance <= reach)
    near = near[np.argsort(distance[near], kind="stable")]
    return np.stack([i.ravel()[near], j.ravel()[near]], axis=1).astype(np.int32)


@njit(cache=True)
def seed_goal(
    gx: float, gy: float, gz: float, yaw: float, reach: float, radius: float,
    grid: GridArrays, moves: NDArray[np.uint32], cost: NDArray[np.float32], prefer: Preference,
) -> NDArray[np.int32]:  # fmt: skip
    """Write the cost of the straight path to the goal into the free cells within `reach`; return their indices."""
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
                    d += approach_penalty(gx - x, gy - y, yaw, d, prefer.ahead_cos, prefer.approach_penalty)
                    d += clearance_penalty(x, y, z, gx, gy, gz, prefer.clearance, prefer.weight,
                                 grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, grid.field)  # fmt: skip
                    cost[i, j, k] = round(d / QUANTUM_M) * QUANTUM_M
                    found[n] = (i * ny + j) * nz + k
                    n += 1
    return found[:n]


def expand_cost(
    seeds: NDArray[np.int32],
    order: NDArray[np.int32],
    bound: float,
    cell: float,
    moves: NDArray[np.uint32],
    cost: NDArray[np.float32],
    clearance_cost: NDArray[np.float32],
) -> int:
    """Cheapest costs over passable moves from seeded cells, into `cost` (nx, ny, nz); return the column visits.

    Label-correcting by columns, equal to Dijkstra's to the bit as quanta add up exactly.
    """
    lacking = MIN_CELLS - cost.shape[2]
    if lacking <= 0:
        return int(_expand(seeds, order, bound, cell, moves, cost, clearance_cost))
    # Impassable cells on top make a low grid's columns long enough.
    high = [
        np.pad(a, ((0, 0), (0, 0), (0, lacking)), constant_values=v)
        for a, v in ((moves, 0), (cost, np.inf), (clearance_cost, 0))
    ]
    column, k = np.divmod(seeds, cost.shape[2])
    visits = int(_expand((column * MIN_CELLS + k).astype(np.int32), order, bound, cell, *high))
    cost[:] = high[1][:, :, :-lacking]
    return visits


@njit(cache=True, error_model="numpy")
def _expand(
    seeds: NDArray[np.int32], order: NDArray[np.int32], bound: float, cell: float, moves: NDArray[np.uint32],
    cost: NDArray[np.float32], clearance_cost: NDArray[np.float32],
) -> int:  # fmt: skip
    nx, ny, nz = cost.shape
    lengths, coarse = move_lengths(cell)
    limits = np.full(len(FLAT), bound, np.float32)
    queued = np.zeros((nx, ny), np.bool_)
    costs, passable, clearance = cost.reshape(-1), moves.reshape(-1), clearance_cost.reshape(-1)
    targets, improved = np.empty(len(FLAT), np.int64), np.empty(len(FLAT), np.uint8)
    n_queued, visits = 0, 0
    middle_i, middle_j = 0, 0
    for seed in seeds:
        middle_i, middle_j = seed // nz // ny, seed // nz % ny
        if not queued[middle_i, middle_j]:
            queued[middle_i, middle_j] = True
            n_queued += 1
    n = order.shape[0]
    outward = True
    while n_queued > 0:
        visits_before = visits
        for a in range(n):
            b = a if outward else n - 1 - a
            i, j = middle_i + order[b, 0], middle_j + order[b, 1]
            if i < 0 or j < 0 or i >= nx or j >= ny or not queued[i, j]:
                continue
            queued[i, j] = False
            n_queued -= 1
            visits += 1
            base = (i * ny + j) * nz
            relax_column(costs, passable, clearance, base, nz, lengths[UP], coarse[UP])
            for m in range(len(FLAT)):
                u, v = i + MOVES[FLAT[m], 0], j + MOVES[FLAT[m], 1]
                targets[m] = (u * ny + v) * nz if 0 <= u < nx and 0 <= v < ny else -1
            improved[:] = 0
            for k in range(0, nz, LANES):
                k = min(k, nz - LANES)
                relax_flat(costs, passable, clearance, base + k, k, lengths, coarse, targets, limits, improved)
            for m in range(len(FLAT)):
                u, v = i + MOVES[FLAT[m], 0], j + MOVES[FLAT[m], 1]
                if improved[m] and not queued[u, v]:
                    queued[u, v] = True
                    n_queued += 1
        if visits == visits_before:
            break  # the columns still queued lie beyond the reach
        outward = not outward
    return visits


@njit(cache=True)
def extra_cost(
    x: float, y: float, z: float, goal: NDArray[np.float64], grid: GridArrays, moves: NDArray[np.uint32],
    cost: NDArray[np.float32], clearance_cost: NDArray[np.float32],
) -> float:  # fmt: skip
    """The part of a point's cost-to-go that is not length, along the cheapest grid path; 0 if unreached."""
    nx, ny, nz = cost.shape
    lengths, coarse = move_lengths(grid.cell)
    ci = math.floor((x - grid.origin[0]) / grid.cell - 0.5)
    cj = math.floor((y - grid.origin[1]) / grid.cell - 0.5)
    ck = math.floor((z - grid.origin[2]) / grid.cell - 0.5)
    low, i, j, k = np.inf, -1, -1, -1
    for u in range(max(0, ci), min(nx, ci + 2)):
        for v in range(max(0, cj), min(ny, cj + 2)):
            for w in range(max(0, ck), min(nz, ck + 2)):
                px, py, pz = cell_centre(u, v, w, grid)
                through = cost[u, v, w] + math.hypot(px - x, py - y) + abs(pz - z)
                if through < low:
                    low, i, j, k = through, u, v, w
    if i < 0:
        return 0.0
    total, advanced = 0.0, True
    while advanced:
        advanced = False
        for m in range(MOVES.shape[0]):
            # Move m back is passable where move m is.
            if not (moves[i, j, k] >> np.uint32(m)) & np.uint32(1):
                continue
            u, v, w = i + MOVES[m, 0], j + MOVES[m, 1], k + MOVES[m, 2]
            extra = coarse[m] * clearance_cost[u, v, w]
            if cost[u, v, w] + (lengths[m] + extra) == cost[i, j, k]:
                total += extra
                i, j, k, advanced = u, v, w, True
                break
    px, py, pz = cell_centre(i, j, k, grid)
    return total + cost[i, j, k] - math.sqrt((px - goal[0]) ** 2 + (py - goal[1]) ** 2 + (pz - goal[2]) ** 2)


@njit(cache=True)
def cost_at(x: float, y: float, z: float, grid: GridArrays, cost: NDArray[np.float32]) -> float:
    """Cost-to-go of a point, metres: trilinear between the 8 nearest cells if they agree, else via the cheapest."""
    return cost_between(x, y, z, grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, cost)


@njit(cache=True, error_model="numpy")
def cost_between(
    x: float, y: float, z: float, ox: float, oy: float, oz: float, cell: float, cost: NDArray[np.float32]
) -> float:  # fmt: skip
    """`cost_at` for inner loops, where passing a tuple of arrays costs more than the work; inf if unreached."""
    nx, ny, nz = cost.shape
    fx, fy, fz = (x - ox) / cell - 0.5, (y - oy) / cell - 0.5, (z - oz) / cell - 0.5
    i = max(0, min(int(max(fx, 0.0)), nx - 2))
    j = max(0, min(int(max(fy, 0.0)), ny - 2))
    k = max(0, min(int(max(fz, 0.0)), nz - 2))
    # Extrapolate up to half a cell beyond the border.
    fx = min(max(fx - i, -0.5), 1.5)
    fy = min(max(fy - j, -0.5), 1.5)
    fz = min(max(fz - k, -0.5), 1.5)
    i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    a, b, c, d = cost[i, j, k], cost[i, j, k1], cost[i, j1, k], cost[i, j1, k1]
    e, f, g, h = cost[i1, j, k], cost[i1, j, k1], cost[i1, j1, k], cost[i1, j1, k1]
    low = min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
    high = max(max(max(a, b), max(c, d)), max(max(e, f), max(g, h)))
    if high - low < 4.0 * cell:
        p = (a + (b - a) * fz) * (1 - fy) + (c + (d - c) * fz) * fy
        q = (e + (f - e) * fz) * (1 - fy) + (g + (h - g) * fz) * fy
        return p * (1 - fx) + q * fx
    if low == np.inf:
        return np.inf
    # Unrolled: this runs for every state next to a surface.
    r00, r01 = math.sqrt(fx * fx + fy * fy), math.sqrt(fx * fx + (1 - fy) * (1 - fy))
    r10, r11 = math.sqrt((1 - fx) * (1 - fx) + fy * fy), math.sqrt((1 - fx) * (1 - fx) + (1 - fy) * (1 - fy))
    r00, r01, r10, r11, s, t = (
        r00 * cell, r01 * cell, r10 * cell, r11 * cell, abs(fz) * cell, abs(fz - 1) * cell
    )  # fmt: skip
    return min(
        min(min(a + r00 + s, b + r00 + t), min(c + r01 + s, d + r01 + t)),
        min(min(e + r10 + s, f + r10 + t), min(g + r11 + s, h + r11 + t)),
    )
