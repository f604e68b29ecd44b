"""Relaxation of moves between columns, sixteen cells at a time.

LLVM turns a loop over a column into groups of 32 cells and leaves the others to a scalar loop, and cannot vectorise
vertical moves, where each cell waits for the one below. So these functions emit vector instructions themselves. The
last group of a column overlaps the one before: a relaxation may be repeated. Costs are whole quanta, so that sums do
not depend on their order, and results are those of loops over single cells, to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Singles
from aerialdojo_gen.planning.connectivity import DOWN, FLAT, KIND_OF, KINDS, UP
from aerialdojo_gen.planning.vectors import INT32, constant, data_of, floats, load, pointer, splat

LANES = 16
# A column needs a cell more than a group has.
MIN_CELLS = LANES + 1

_INT64, _INT16, _INT8 = (ir.IntType(bits) for bits in (64, LANES, 8))
_FLOATS, _INTS = floats(LANES), ir.VectorType(INT32, LANES)
_INFINITE, _ZERO, _NO_BITS = constant(_FLOATS, float("inf")), constant(_FLOATS, 0.0), constant(_INTS, 0)


def _passes(b: Any, moves: Any, move: int) -> Any:
    """Lanes in which a move is passable."""
    return b.icmp_unsigned("!=", b.and_(moves, constant(_INTS, 1 << move)), _NO_BITS)


def _any(b: Any, lanes: Any) -> Any:
    return b.icmp_unsigned("!=", b.bitcast(lanes, _INT16), ir.Constant(_INT16, 0))


def _leaving_costs(b: Any, length: Any, coarse: Any, clearance: Any) -> Any:
    """Costs of a move: `length + coarse * clearance`, in this order of rounding."""
    return b.fadd(splat(b, length, _FLOATS), b.fmul(splat(b, coarse, _FLOATS), clearance))


@intrinsic
def relax_flat(
    _: Any, costs: Any, passable: Any, clearance: Any, at: Any, k: Any, lengths: Any, coarse: Any, targets: Any,
    limits: Any, improved: Any,
) -> tuple[Any, Callable[..., Any]]:  # fmt: skip
    """Relax the level moves from the group of cells at `at`, which is at height `k` of its column.

    `targets` has the first cell of the column that each move leads to, negative for none, and `limits` the largest
    cost that is written there; `improved` is set to 1 where a cost decreased.
    """

    def emit(context: Any, b: Any, signature: Any, args: Any) -> Any:
        costs, passable, clearance, lengths, coarse, targets, limits, improved = data_of(
            context, b, signature, args, 0, 1, 2, 5, 6, 7, 8, 9
        )
        at, k = args[3], args[4]
        cost, moves = load(b, costs, at, _FLOATS), load(b, passable, at, _INTS)
        near = load(b, clearance, at, _FLOATS)
        reached = []
        for move in KINDS.tolist():
            place = [ir.Constant(_INT64, move)]
            leaving = _leaving_costs(b, b.load(b.gep(lengths, place)), b.load(b.gep(coarse, place)), near)
            reached.append(b.fadd(cost, leaving))
        for number, move in enumerate(FLAT.tolist()):
            place, new = [ir.Constant(_INT64, number)], reached[KIND_OF[move]]
            target = b.load(b.gep(targets, place))
            with b.if_then(b.icmp_signed(">=", target, ir.Constant(_INT64, 0))):
                there = pointer(b, costs, b.add(target, k), _FLOATS)
                old = b.load(there, align=4)
                limit = splat(b, b.load(b.gep(limits, place)), _FLOATS)
                better = b.and_(_passes(b, moves, move), b.fcmp_ordered("<", new, old))
                better = b.and_(better, b.fcmp_ordered("<=", new, limit))
                with b.if_then(_any(b, better)):
                    b.store(b.select(better, new, old), there, align=4)
                    b.store(ir.Constant(_INT8, 1), b.gep(improved, place))
        return context.get_dummy_value()

    places = types.intp
    return types.void(costs, passable, clearance, places, places, lengths, coarse, targets, limits, improved), emit


def _scan(move: int) -> Any:
    """Make the relaxation of one vertical move over a group of cells."""
    upward = move == UP

    def shifted(b: Any, x: Any, n: int, fill: Any) -> Any:
        """Lanes moved on by n cells, with `fill` in those that nothing moves to."""
        from_lanes = [k - n if upward else k + n for k in range(LANES)]
        return b.shuffle_vector(x, fill, ir.Constant(_INTS, [k if 0 <= k < LANES else LANES for k in from_lanes]))

    def least(b: Any, x: Any, y: Any) -> Any:
        return b.select(b.fcmp_ordered("<", x, y), x, y)

    @intrinsic
    def scan(
        _: Any, costs: Any, passable: Any, clearance: Any, at: Any, length: Any, coarse: Any, before: Any
    ) -> tuple[Any, Callable[..., Any]]:
        def emit(context: Any, b: Any, signature: Any, args: Any) -> Any:
            costs, passable, clearance = data_of(context, b, signature, args, 0, 1, 2)
            at, length, coarse, before = args[3:]
            neighbours = b.add(at, ir.Constant(_INT64, -1 if upward else 1))
            moves = load(b, passable, neighbours, _INTS)
            leaving = _leaving_costs(b, length, coarse, load(b, clearance, neighbours, _FLOATS))
            old = load(b, costs, at, _FLOATS)
            # Minima over the nearest 2, 4, 8 and 16 cells, and the costs of as many steps.
            new, steps, n = old, b.select(_passes(b, moves, move), leaving, _INFINITE), 1
            while n < LANES:
                new = least(b, b.fadd(shifted(b, new, n, _INFINITE), steps), new)
                steps = b.fadd(steps, shifted(b, steps, n, _ZERO))
                n *= 2
            new = least(b, b.fadd(splat(b, before, _FLOATS), steps), new)
            with b.if_then(_any(b, b.fcmp_ordered("<", new, old))):
                b.store(new, pointer(b, costs, at, _FLOATS), align=4)
            return b.extract_element(new, ir.Constant(INT32, LANES - 1 if upward else 0))

        cost = types.float32
        return cost(costs, passable, clearance, types.intp, cost, cost, cost), emit

    return scan


# Relax a vertical move into the group of cells at `at`, from a neighbour of cost `before` and from cell to cell, and
# return the cost of the last one.
_scan_up, _scan_down = _scan(UP), _scan(DOWN)


@njit(cache=True, error_model="numpy")
def relax_column(
    costs: Singles, passable: NDArray[np.uint32], clearance: Singles, first: int, n: int,
    length: np.float32, coarse: np.float32,
) -> None:  # fmt: skip
    """Relax the vertical moves between n cells from `first` on, up and then down; n is at least `MIN_CELLS`."""
    for k in range(1, n, LANES):
        at = first + min(k, n - LANES)
        _scan_up(costs, passable, clearance, at, length, coarse, costs[at - 1])
    for k in range(n - 1 - LANES, -LANES, -LANES):
        at = first + max(k, 0)
        _scan_down(costs, passable, clearance, at, length, coarse, costs[at + LANES])
