"""Relaxation of moves between the grid's columns: a column is contiguous in memory, so the loops are vectorised."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.connectivity import MOVE_LENGTHS, MOVES, N_HALF
from aerialdojo_gen.planning.preference import CLEARANCE_COST_UNIT

# Costs are multiples of this, so that float32 adds them without rounding and equal costs compare equal.
QUANTUM_M = 2.0**-12
# Quantum of the lengths that the clearance cost is multiplied by, for the same reason.
_COARSE_M = QUANTUM_M / CLEARANCE_COST_UNIT
UP = N_HALF - 1
DOWN = UP + N_HALF
FLAT = np.flatnonzero(MOVES[:, 2] == 0)
# Kinds of moves (axis, diagonal, knight's): the first move of each kind, and the kind of every move.
_, KINDS, KIND_OF = np.unique(MOVE_LENGTHS, return_index=True, return_inverse=True)


@njit(cache=True)
def move_lengths(cell: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lengths of the moves, and the factors of the clearance cost of the cell that they leave; metres."""
    lengths = (np.rint(MOVE_LENGTHS * cell / QUANTUM_M) * QUANTUM_M).astype(np.float32)
    return lengths, (np.rint(MOVE_LENGTHS * cell / _COARSE_M) * _COARSE_M).astype(np.float32)


@njit(cache=True, error_model="numpy")
def relax_vertical(
    costs: NDArray[np.float32], moves: NDArray[np.uint32], clearance_cost: NDArray[np.float32], first: int, last: int,
    length: np.float32, coarse: np.float32,
) -> None:  # fmt: skip
    """Relax the vertical moves between the cells from `first` to before `last`, up and then down."""
    one = np.uint32(1)
    below = costs[first]
    for k in range(first + 1, last):
        current = costs[k]
        reached = below + (length + coarse * clearance_cost[k - 1])
        if reached < current and (moves[k - 1] >> np.uint32(UP)) & one:
            costs[k] = current = reached
        below = current
    above = costs[last - 1]
    for k in range(last - 2, first - 1, -1):
        current = costs[k]
        reached = above + (length + coarse * clearance_cost[k + 1])
        if reached < current and (moves[k + 1] >> np.uint32(DOWN)) & one:
            costs[k] = current = reached
        above = current


@njit(cache=True, error_model="numpy")
def departure_costs(
    costs: NDArray[np.float32], clearance_cost: NDArray[np.float32], first: int, n: int, length: np.float32,
    coarse: np.float32, departures: NDArray[np.float32], at: int,
) -> None:  # fmt: skip
    """Costs of n cells with those of a move that leads from them, into `departures` from `at` on."""
    # Unsigned: a check for negative indices would prevent vectorisation.
    a, b = np.uint64(first), np.uint64(at)
    for k in range(np.uint64(n)):
        departures[b + k] = costs[a + k] + (length + coarse * clearance_cost[a + k])


@njit(cache=True, error_model="numpy")
def relax(
    departures: NDArray[np.float32], at: int, moves: NDArray[np.uint32], source: int, costs: NDArray[np.float32],
    target: int, n: int, move: int, bound: np.float32,
) -> bool:  # fmt: skip
    """Relax one move from n cells of a column to those of another; return whether any cost decreased."""
    bit, infinite, improved = np.uint32(1) << np.uint32(move), np.float32(np.inf), np.uint32(0)
    a, b, c = np.uint64(at), np.uint64(source), np.uint64(target)
    for k in range(np.uint64(n)):
        reached = departures[a + k] if (moves[b + k] & bit) != 0 else infinite
        reached = reached if reached <= bound else infinite
        current = costs[c + k]
        improved |= np.uint32(1) if reached < current else np.uint32(0)
        costs[c + k] = reached if reached < current else current
    return improved != 0
