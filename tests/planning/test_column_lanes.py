"""Groups of sixteen cells against the loops over single cells, to the bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.column_kernels import (
    DOWN,
    FLAT,
    QUANTUM_M,
    UP,
    move_lengths,
)
from aerialdojo_gen.planning.column_lanes import LANES, MIN_CELLS, relax_column, relax_flat
from aerialdojo_gen.planning.preference import CLEARANCE_COST_UNIT

LENGTHS, COARSE = move_lengths(0.5)
LIMIT = np.float32(60.0)


def columns(seed, count, n):
    """Costs, passable moves and clearance costs of some columns of n cells: obstacles, gaps, unreached cells."""
    rng = np.random.default_rng(seed)
    costs = (rng.integers(0, int(70 / QUANTUM_M), (count, n)) * QUANTUM_M).astype(np.float32)
    costs[rng.random((count, n)) < rng.choice([0.0, 0.3, 0.9])] = np.inf
    passable = rng.integers(0, 2**18, (count, n), dtype=np.uint32)
    passable[rng.random((count, n)) < rng.random()] = 2**18 - 1
    clearance = (rng.integers(0, 8, (count, n)) * CLEARANCE_COST_UNIT).astype(np.float32)
    return costs.ravel(), passable.ravel(), clearance.ravel()


def relax_vertical(costs, moves, clearance_cost, first, last, length, coarse):
    """Relax the vertical moves between the cells from `first` to before `last`, up and then down."""
    for k in range(first + 1, last):
        if moves[k - 1] >> UP & 1:
            costs[k] = min(costs[k], costs[k - 1] + (length + coarse * clearance_cost[k - 1]))
    for k in range(last - 2, first - 1, -1):
        if moves[k + 1] >> DOWN & 1:
            costs[k] = min(costs[k], costs[k + 1] + (length + coarse * clearance_cost[k + 1]))


def relax(costs, moves, clearance_cost, target, n, m):
    """Relax one level move from the first n cells to those from `target` on; return whether any cost decreased."""
    reached = costs[:n] + (LENGTHS[m] + COARSE[m] * clearance_cost[:n])
    better = (moves[:n] >> m & 1 == 1) & (reached <= LIMIT) & (reached < costs[target : target + n])
    costs[target : target + n][better] = reached[better]
    return bool(better.any())


@njit
def flat_by_groups(costs, passable, clearance, n, lengths, coarse, targets, limits, improved):
    for k in range(0, n, LANES):
        k = min(k, n - LANES)
        relax_flat(costs, passable, clearance, k, k, lengths, coarse, targets, limits, improved)


@given(st.integers(0, 2**32), st.integers(MIN_CELLS, 70))
def test_vertical_moves(seed, n):
    costs, passable, clearance = columns(seed, 3, n)
    expected = costs.copy()
    relax_vertical(expected, passable, clearance, n, 2 * n, LENGTHS[UP], COARSE[UP])
    relax_column(costs, passable, clearance, n, n, LENGTHS[UP], COARSE[UP])
    np.testing.assert_array_equal(costs, expected)


@given(st.integers(0, 2**32), st.integers(MIN_CELLS, 70))
def test_level_moves(seed, n):
    costs, passable, clearance = columns(seed, len(FLAT) + 1, n)
    expected, targets = costs.copy(), np.arange(1, len(FLAT) + 1) * n
    targets[seed % len(FLAT)] = -1
    better = [
        target >= 0 and relax(expected, passable, clearance, target, n, m)
        for m, target in zip(FLAT, targets, strict=True)
    ]
    improved = np.zeros(len(FLAT), np.uint8)
    flat_by_groups(costs, passable, clearance, n, LENGTHS, COARSE, targets, np.full(len(FLAT), LIMIT), improved)
    np.testing.assert_array_equal(costs, expected)
    assert improved.tolist() == better
