"""Moves between cells of the clearance grid: lengths, which are passable, and the cells connected with the sky."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Singles
from aerialdojo_gen.planning.grid_kernels import GridArrays, segment_free
from aerialdojo_gen.planning.preference import CLEARANCE_COST_UNIT

# Half of the moves between cells: neighbours in the plane, knight's moves in the plane, up. Move k + 9 undoes move k.
_HALF = ((1, 0, 0), (0, 1, 0), (1, 1, 0), (-1, 1, 0), (2, 1, 0), (1, 2, 0), (-1, 2, 0), (-2, 1, 0), (0, 0, 1))
N_HALF = len(_HALF)
MOVES = np.array(_HALF + tuple((-x, -y, -z) for x, y, z in _HALF), np.int64)
MOVE_LENGTHS = np.sqrt((MOVES**2).sum(axis=1))
# The two shorter moves that make up a diagonal or knight's move; -1 for the axes.
_PARTS = np.array([(-1, -1), (-1, -1), (0, 1), (9, 1), (0, 2), (1, 2), (1, 3), (9, 3), (-1, -1)], np.int64)
_ONE = np.uint32(1)
# Costs are multiples of this, so that float32 adds them without rounding and equal costs compare equal.
QUANTUM_M = 2.0**-12
# Quantum of the lengths that the clearance cost is multiplied by, for the same reason.
_COARSE_M = QUANTUM_M / CLEARANCE_COST_UNIT
UP = N_HALF - 1
DOWN = UP + N_HALF
FLAT = np.flatnonzero(MOVES[:, 2] == 0)
# Kinds of moves (axis, diagonal, knight's): the first move of each kind, and the kind of every move.
_, KINDS, KIND_OF = np.unique(MOVE_LENGTHS, return_index=True, return_inverse=True)
_SQRT2, _SQRT5 = math.sqrt(2.0), math.sqrt(5.0)


@njit(cache=True)
def move_lengths(cell: float) -> tuple[Singles, Singles]:
    """Lengths of moves, and factors of the clearance cost of the cell that they leave; metres, whole quanta."""
    lengths = (np.rint(MOVE_LENGTHS * cell / QUANTUM_M) * QUANTUM_M).astype(np.float32)
    return lengths, (np.rint(MOVE_LENGTHS * cell / _COARSE_M) * _COARSE_M).astype(np.float32)


@njit(cache=True, inline="always")
def grid_metric(dx: float, dy: float, dz: float) -> float:
    """Length of a displacement in the grid's 16 directions and the vertical; in the displacement's unit."""
    a, b = abs(dx), abs(dy)
    high, low = max(a, b), min(a, b)
    flat = (
        high - 2.0 * low + _SQRT5 * low if 2.0 * low <= high else _SQRT5 * (high - low) + _SQRT2 * (2.0 * low - high)
    )
    return flat + abs(dz)


@njit(cache=True, inline="always")
def cell_centre(i: int, j: int, k: int, grid: GridArrays) -> tuple[float, float, float]:
    """Centre of a cell, world frame, metres."""
    return (
        grid.origin[0] + (i + 0.5) * grid.cell,
        grid.origin[1] + (j + 0.5) * grid.cell,
        grid.origin[2] + (k + 0.5) * grid.cell,
    )


@njit(cache=True, inline="always")
def _is_passable(moves: NDArray[np.uint32], i: int, j: int, k: int, m: int) -> bool:
    return (moves[i, j, k] >> np.uint32(m)) & _ONE != 0


@njit(cache=True)
def _both_detours_passable(moves: NDArray[np.uint32], i: int, j: int, k: int, m: int) -> bool:
    """Whether both detours by the two shorter moves are passable."""
    a, b = _PARTS[m, 0], _PARTS[m, 1]
    return (
        _is_passable(moves, i, j, k, a)
        and _is_passable(moves, i, j, k, b)
        and _is_passable(moves, i + MOVES[a, 0], j + MOVES[a, 1], k, b)
        and _is_passable(moves, i + MOVES[b, 0], j + MOVES[b, 1], k, a)
    )


@njit(cache=True)
def _passable(moves: NDArray[np.uint32], i: int, j: int, k: int, m: int, radius: float, grid: GridArrays) -> bool:
    """Whether a move that the distance field does not prove free is passable."""
    # Both detours pass half a cell from the middle of the square: a thinner body would leave room for a pole there.
    if 2.0 * radius >= grid.cell:
        if _PARTS[m, 0] >= 0 and _both_detours_passable(moves, i, j, k, m):
            return True
        if 4 <= m < 8:
            return False
    x, y, z = cell_centre(i, j, k, grid)
    u, v, w = cell_centre(i + MOVES[m, 0], j + MOVES[m, 1], k + MOVES[m, 2], grid)
    return segment_free(x, y, z, u, v, w, radius, grid, False)


@njit(cache=True, nogil=True)
def passable_moves(grid: GridArrays, radius: float) -> NDArray[np.uint32]:
    """Bits of passable ``MOVES`` of every cell, (nx, ny, nz) uint32; axis moves are exact."""
    field, cell = grid.field, grid.cell
    nx, ny, nz = field.shape
    moves = np.zeros((nx, ny, nz), np.uint32)
    # Where the body can be: no surface near, inside the bounds give or take a nanometre.
    free = field >= np.float32(radius)
    for axis in range(3):
        for c in range(field.shape[axis]):
            middle = grid.origin[axis] + (c + 0.5) * cell
            if not grid.lower[axis] - 1e-9 <= middle <= grid.upper[axis] + 1e-9:
                if axis == 0:
                    free[c] = False
                elif axis == 1:
                    free[:, c] = False
                else:
                    free[:, :, c] = False
    # The order matters: diagonals are composed of axis moves, knight's moves of both.
    for m in (0, 1, 8, 2, 3, 4, 5, 6, 7):
        dx, dy, dz = MOVES[m]
        needed = MOVE_LENGTHS[m] * cell + 2 * radius
        forward_bit, backward_bit = _ONE << np.uint32(m), _ONE << np.uint32(m + N_HALF)
        for i in range(max(0, -dx), min(nx, nx - dx)):
            for j in range(ny - dy):
                for k in range(nz - dz):
                    if not (free[i, j, k] and free[i + dx, j + dy, k + dz]):
                        continue
                    # Both balls together cover the move if the gap between them is no wider than this.
                    if field[i, j, k] + field[i + dx, j + dy, k + dz] < needed and not _passable(
                        moves, i, j, k, m, radius, grid
                    ):
                        continue
                    moves[i, j, k] |= forward_bit
                    moves[i + dx, j + dy, k + dz] |= backward_bit
    return moves


@njit(cache=True, nogil=True)
def connected_with_ceiling(moves: NDArray[np.uint32]) -> Flags:
    """Cells, (nx, ny, nz) bool, that `passable_moves` connects with the highest layer that has any."""
    nx, ny, nz = moves.shape
    visited = np.zeros((nx, ny, nz), np.bool_)
    flat_moves, flat_visited = moves.ravel(), visited.ravel()
    stack = np.empty(nx * ny * nz, np.int32)
    top = 0
    for k in range(nz - 1, -1, -1):
        for c in range(k, nx * ny * nz, nz):
            if flat_moves[c]:
                flat_visited[c] = True
                stack[top] = c
                top += 1
        if top > 0:
            break
    steps = MOVES[:, 0] * (ny * nz) + MOVES[:, 1] * nz + MOVES[:, 2]
    while top > 0:
        top -= 1
        c = stack[top]
        bits = flat_moves[c]
        for m in range(steps.shape[0]):
            if (bits >> np.uint32(m)) & _ONE and not flat_visited[c + steps[m]]:
                flat_visited[c + steps[m]] = True
                stack[top] = c + steps[m]
                top += 1
    return visited


@njit(cache=True)
def reaches_marked_cell(x: float, y: float, z: float, radius: float, marked: Flags, grid: GridArrays) -> bool:
    """Whether the body at a point can move straight to one of the 64 nearest cells that is marked."""
    nx, ny, nz = marked.shape
    i0 = math.floor((x - grid.origin[0]) / grid.cell - 0.5)
    j0 = math.floor((y - grid.origin[1]) / grid.cell - 0.5)
    k0 = math.floor((z - grid.origin[2]) / grid.cell - 0.5)
    for i in range(max(0, i0 - 1), min(nx, i0 + 3)):
        for j in range(max(0, j0 - 1), min(ny, j0 + 3)):
            for k in range(max(0, k0 - 1), min(nz, k0 + 3)):
                if marked[i, j, k]:
                    u, v, w = cell_centre(i, j, k, grid)
                    if segment_free(x, y, z, u, v, w, radius, grid, False):
                        return True
    return False
