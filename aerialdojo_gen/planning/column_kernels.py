"""Kinds and lengths of the moves between the grid's cells, as whole quanta."""

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
