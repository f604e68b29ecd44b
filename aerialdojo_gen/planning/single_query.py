"""The cost-to-go of a single query: how far it has to reach, and its memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.grid_path import GAVE_UP, make_path_arrays, short_path_cost
from aerialdojo_gen.planning.query_field import clear_query, expand_query, make_query_arrays, reach_margin

# What a search takes off its list is seldom dearer than the known grid path and the weight make by more than this:
# for actions, and for what the lattice cannot fly as the grid can.
_SURPLUS_M = 1.1


class Found(NamedTuple):
    """What is known of the way from a start to a goal."""

    cost: NDArray[np.float32] | None  # (nx, ny, nz) float32 or None
    none: bool  # There is no grid path
    sure_m: float


class NearField:
    """Finds the cost-to-go, metres, between one start and one goal at a time."""

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
        least: float,
    ) -> Iterator[Found]:
        """Yield the costs that a search from a start (4,) to a goal (4,) needs; they hold until the block ends."""
        cost, cells, moves = self._arrays.cost, self.grid.arrays, self.grid.moves
        seeds = seed(goal, cost)
        seeded = cost.ravel()[seeds]
        # The start is not dearer than the bound as soon as one of the cells is not that it lies between.
        farthest = bound + reach_margin(cells.cell, 1.0)
        path = short_path_cost(seeds, *start[:3], farthest, cells, moves, self.clearance_cost, cost, self._path)
        if path == GAVE_UP or not math.isfinite(path):
            yield Found(None, path != GAVE_UP, 0.0)
            return
        cost.reshape(-1)[seeds] = seeded
        sure = max(weight * path + _SURPLUS_M, least)
        written = expand_query(
            seeds, start[:3], goal[:3], approach, sure + reach_margin(cells.cell, weight), weight, bound, cells,
            moves, self.clearance_cost, self._arrays,
        )  # fmt: skip
        try:
            yield Found(cost, False, sure)
        finally:
            clear_query(written, seeds, self._arrays)
