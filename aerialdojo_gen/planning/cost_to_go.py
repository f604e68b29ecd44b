"""The cost-to-go of a goal: lengths of shortest grid paths from everywhere, shared by all starts of a target.

The metric is the action set's: horizontal and vertical motion are separate moves, so that up to the grid's 16
directions the cost of a free displacement is |horizontal| + |vertical| (at most 2.7 % above it).

Paths near surfaces cost more than their metres (`aerialdojo_gen.planning.preference`), and so do paths that end in an
Approach that does not fly ahead.

Cells are relaxed a column at a time: a column is contiguous in memory, so the loops are vectorised.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Int32s, Singles
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.column_lanes import LANES, MIN_CELLS, relax_column, relax_flat
from aerialdojo_gen.planning.connectivity import (
    FLAT,
    MOVE_LENGTHS,
    MOVES,
    QUANTUM_M,
    UP,
    cell_centre,
    grid_metric,
    move_lengths,
)
from aerialdojo_gen.planning.grid_kernels import GridArrays, segment_free
from aerialdojo_gen.planning.preference import NO_PREFERENCE, Preference, approach_penalty, leg_penalty

# Columns are queued in bins half a cell wide; the longest move is just under five bins.
_BINS = 8
_DELAY = (2.0 * MOVE_LENGTHS).astype(np.int64)
# A straight Approach is shorter than in the grid's metric by less than this share of its length.
_APPROACH_SAVING = 0.45
_EVERYWHERE_M = 1e6


class Area(NamedTuple):
    """The part of a grid in which costs are computed."""

    start: Floats  # (3,) float64; cells are left out where the straight way from here
    goal: Floats  # and `weight` times that to the goal, less what an Approach saves,
    approach: float
    weight: float
    reach: float  # exceed this, metres
    bound: float  # No level move leads to a larger cost, metres
    columns: float  # Columns farther from the goal's are written, but nothing goes on from there; cells


class Memory(NamedTuple):
    """Working memory of an expansion, by column."""

    first: NDArray[np.int16]  # (nx, ny) int16; range of its cells within reach
    last: NDArray[np.int16]  # 0 where that is not known yet, -1 for none
    limit: Singles  # (nx, ny) float32; maximum cost of these cells, metres
    waiting: Flags  # (nx, ny) bool; queued columns
    next: Int32s  # (nx * ny,) int32; columns in bins, as linked lists
    written: Int32s  # (nx * ny,) int32; columns in the order in which they were reached


def make_memory(shape: tuple[int, ...]) -> Memory:
    """Reserve memory for expansions in a grid, one at a time."""
    nx, ny, _ = shape
    return Memory(
        np.zeros((nx, ny), np.int16), np.zeros((nx, ny), np.int16), np.empty((nx, ny), np.float32),
        np.zeros((nx, ny), np.bool_), np.empty(nx * ny, np.int32), np.empty(nx * ny, np.int32),
    )  # fmt: skip


def cost_to_go(
    goal: Floats, grid: ClearanceGrid, approach: float, bound: float, reach: float,
    prefer: Preference = NO_PREFERENCE, clearance_cost: Singles | None = None,
    cost: Singles | None = None,
) -> Singles:  # fmt: skip
    """Cheapest costs over passable moves to a goal (4,) from cells up to `bound`, (nx, ny, nz) metres; inf elsewhere.

    `prefer` is what the Approach costs and `clearance_cost` what the cells do; `reach` metres from the goal's column
    the expansion ends.
    """
    moves = grid.moves
    cost = np.empty(moves.shape, np.float32) if cost is None else cost
    clearance_cost = np.zeros(moves.shape, np.float32) if clearance_cost is None else clearance_cost
    cost.fill(np.inf)
    seeds = seed_goal(*goal, approach, grid.radius_m, grid.arrays, moves, cost, prefer)
    expand_cost(seeds, bound, reach, grid.arrays, moves, cost, clearance_cost)
    return cost


@njit(cache=True, inline="always")
def _cells_about(place: float, reach: float, origin: float, cell: float, n: int) -> tuple[int, int]:
    """First cell and end of those whose centres lie within reach along an axis of n cells."""
    first = math.ceil((place - reach - origin) / cell - 0.5)
    return max(0, first), min(n - 1, math.floor((place + reach - origin) / cell - 0.5)) + 1


@njit(cache=True)
def seed_goal(
    gx: float, gy: float, gz: float, yaw: float, reach: float, radius: float,
    grid: GridArrays, moves: NDArray[np.uint32], cost: Singles, prefer: Preference,
) -> Int32s:  # fmt: skip
    """Write the cost of the straight path to the goal into the free cells within `reach`; return their indices."""
    nx, ny, nz = cost.shape
    found = np.empty(4096, np.int32)
    n = 0
    i0, i1 = _cells_about(gx, reach, grid.origin[0], grid.cell, nx)
    j0, j1 = _cells_about(gy, reach, grid.origin[1], grid.cell, ny)
    k0, k1 = _cells_about(gz, reach, grid.origin[2], grid.cell, nz)
    for i in range(i0, i1):
        for j in range(j0, j1):
            for k in range(k0, k1):
                if moves[i, j, k] == 0 or n == found.shape[0]:
                    continue
                x, y, z = cell_centre(i, j, k, grid)
                d = math.sqrt((x - gx) ** 2 + (y - gy) ** 2 + (z - gz) ** 2)
                if d <= reach and segment_free(x, y, z, gx, gy, gz, radius, grid, False):
                    d += approach_penalty(gx - x, gy - y, yaw, d, prefer.ahead_cos, prefer.approach_penalty)
                    d += leg_penalty(x, y, z, gx, gy, gz, prefer, grid)
                    cost[i, j, k] = round(d / QUANTUM_M) * QUANTUM_M
                    found[n] = (i * ny + j) * nz + k
                    n += 1
    return found[:n]


def expand_cost(
    seeds: Int32s, bound: float, reach: float, grid: GridArrays, moves: NDArray[np.uint32],
    cost: Singles, clearance_cost: Singles,
) -> int:  # fmt: skip
    """Write the costs from seeded cells on into `cost` (nx, ny, nz); return the column visits."""
    lacking = max(0, MIN_CELLS - cost.shape[2])
    # Impassable cells on top make a low grid's columns long enough.
    high = [
        np.pad(a, ((0, 0), (0, 0), (0, lacking)), constant_values=v) if lacking else a
        for a, v in ((moves, 0), (cost, np.inf), (clearance_cost, 0))
    ]
    column, k = np.divmod(seeds, cost.shape[2])
    nowhere = np.zeros(3)
    area = Area(nowhere, nowhere, 0.0, 1.0, _EVERYWHERE_M, bound, float(math.ceil(reach / grid.cell)))
    _, visits = expand(
        (column * high[1].shape[2] + k).astype(np.int32), area, grid, *high, make_memory(high[1].shape)
    )
    if lacking:
        cost[:] = high[1][:, :, :-lacking]
    return int(visits)


@njit(cache=True, error_model="numpy")
def _span(i: int, j: int, area: Area, grid: GridArrays, nz: int) -> tuple[int, int, float]:
    """Range of a column's cells within reach, and their maximum cost; a last of -1 for none."""
    cell, start, goal, weight = grid.cell, area.start, area.goal, area.weight
    x, y, oz = grid.origin[0] + (i + 0.5) * cell, grid.origin[1] + (j + 0.5) * cell, grid.origin[2]
    from_start = math.sqrt((x - start[0]) ** 2 + (y - start[1]) ** 2)
    to_goal = grid_metric(x - goal[0], y - goal[1], 0.0) - _APPROACH_SAVING * area.approach
    remaining = area.reach - from_start - weight * to_goal
    low, high = min(start[2], goal[2]), max(start[2], goal[2])
    if remaining < high - low:
        return 0, -1, 0.0
    # Solve |z - start| + weight · |z - goal| = left outside of the two; between them nothing is cut off.
    low = min(low, (start[2] + weight * goal[2] - remaining) / (1.0 + weight))
    high = max(high, (start[2] + weight * goal[2] + remaining) / (1.0 + weight))
    first = max(0, int((low - oz) / cell - 0.5))
    last = min(max(int((high - oz) / cell + 0.5) + 1, first + MIN_CELLS), nz)
    return min(first, last - MIN_CELLS), last, min(area.bound, (area.reach - from_start) / weight)


@njit(cache=True, error_model="numpy")
def expand(
    seeds: Int32s, area: Area, grid: GridArrays, moves: NDArray[np.uint32], cost: Singles,
    clearance_cost: Singles, memory: Memory,
) -> tuple[int, int]:  # fmt: skip
    """Write the costs from seeded cells on, a column at a time; return how many columns are written, and visits.

    Label-correcting, with columns queued by their distance; equal to Dijkstra's to the bit as quanta add up exactly.
    """
    nx, ny, nz = cost.shape
    costs, flat_moves, flat_clearance = cost.reshape(-1), moves.reshape(-1), clearance_cost.reshape(-1)
    first, last, limit, waiting, nexts, written = memory
    lengths, coarse = move_lengths(grid.cell)
    targets, limits = np.empty(len(FLAT), np.int64), np.empty(len(FLAT), np.float32)
    improved = np.empty(len(FLAT), np.uint8)
    bins = np.full(_BINS, -1, np.int32)
    n, visits, remaining, bin_number, middle_i, middle_j = 0, 0, 0, 0, 0, 0
    for seed in seeds:
        c = seed // nz
        i, j = middle_i, middle_j = c // ny, c % ny
        if last[i, j] == 0:
            first[i, j], last[i, j], limit[i, j] = _span(i, j, area, grid, nz)
            written[n] = c
            n += 1
        if last[i, j] > 0 and not waiting[i, j]:
            waiting[i, j], nexts[c], bins[0] = True, bins[0], c
            remaining += 1
    while remaining > 0:
        while bins[bin_number % _BINS] < 0:
            bin_number += 1
        c = bins[bin_number % _BINS]
        bins[bin_number % _BINS] = nexts[c]
        remaining, visits = remaining - 1, visits + 1
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
                first[u, v], last[u, v], limit[u, v] = _span(u, v, area, grid, nz)
                written[n] = u * ny + v
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
            if improved[m] and not waiting[u, v] and grid_metric(u - middle_i, v - middle_j, 0.0) <= area.columns:
                d, b = u * ny + v, (bin_number + _DELAY[FLAT[m]]) % _BINS
                waiting[u, v], nexts[d], bins[b] = True, bins[b], d
                remaining += 1
    return n, visits


@njit(cache=True)
def extra_cost(
    x: float, y: float, z: float, goal: Floats, grid: GridArrays, moves: NDArray[np.uint32],
    cost: Singles, clearance_cost: Singles,
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
def cost_at(x: float, y: float, z: float, grid: GridArrays, cost: Singles) -> float:
    """Cost-to-go of a point, metres: trilinear between the 8 nearest cells if they agree, else via the cheapest."""
    return cost_between(x, y, z, grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, cost)


@njit(cache=True, error_model="numpy")
def cost_between(x: float, y: float, z: float, ox: float, oy: float, oz: float, cell: float, cost: Singles) -> float:
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


@njit(cache=True)
def lengths_at(
    points: Floats, goal: Floats, grid: GridArrays, moves: NDArray[np.uint32], cost: Singles, clearance_cost: Singles
) -> Floats:
    """Lengths of the cheapest grid paths from points, (n, 3) float64 metres; (n,) float64 metres."""
    values = np.empty(len(points))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        values[i] = cost_at(x, y, z, grid, cost)
        if values[i] < np.inf:
            values[i] -= extra_cost(x, y, z, goal, grid, moves, cost, clearance_cost)
    return values


@njit(cache=True)
def costs_at(points: Floats, grid: GridArrays, cost: Singles) -> Floats:
    """Cost-to-go of points, (n, 3) float64 metres; (n,) float64 metres."""
    values = np.empty(len(points))
    for i in range(len(points)):
        values[i] = cost_at(points[i, 0], points[i, 1], points[i, 2], grid, cost)
    return values
