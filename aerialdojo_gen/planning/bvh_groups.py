"""The tree of `aerialdojo_gen.planning.bvh` walked three levels at a time, for the collision tests of searches.

The eight descendants three levels below a node are tested at once, by vector instructions in float32. Their boxes are
rounded outwards and the segment is a little thicker, so that no triangle is missed; triangles are tested exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Singles
from aerialdojo_gen.geometry.triangles import segment_triangle_d2
from aerialdojo_gen.planning.bvh import LEAF
from aerialdojo_gen.planning.vectors import constant, data_of, floats, load, splat

_WIDTH = 8
_FLOATS, _INDEX = floats(_WIDTH), ir.IntType(64)
# Added to the radius, and per metre of a coordinate: eight times float32's rounding.
_PAD_M, _PAD_PER_M = 1e-3, 1e-6
# A segment shorter than this along an axis counts as a point there, and this in place of its reciprocal length.
_SHORT_M, _STEEP = 1e-3, 1e30
_LOWEST_BIT = np.array([0] + [(k & -k).bit_length() - 1 for k in range(1, 1 << _WIDTH)], np.int64)


def group_boxes(boxes: Floats) -> Singles:
    """Boxes of the descendants three levels below every node, (n, 6, 8) float32 metres; lower x, y, z, upper ones."""
    groups = boxes[: len(boxes) // _WIDTH * _WIDTH].reshape(-1, _WIDTH, 6).transpose(0, 2, 1).astype(np.float32)
    away = np.array([-np.inf] * 3 + [np.inf] * 3, np.float32)
    return np.ascontiguousarray(np.nextafter(groups, away[:, None]))


@intrinsic
def _met(_: Any, groups: Any, node: Any, planes: Any, upper: Any) -> tuple[Any, Callable[..., Any]]:
    """Bits of the boxes of a node's group that a segment meets; `_along` makes `planes` and `upper`."""

    def emit(context: Any, b: Any, signature: Any, args: Any) -> Any:
        (data,) = data_of(context, b, signature, args, 0)
        first = b.mul(args[1], ir.Constant(_INDEX, 6))

        def number(k: int) -> Any:
            """One of `planes` in all lanes."""
            return splat(b, b.extract_value(args[2], k), _FLOATS)

        def crossed(row: Any, at: int, axis: int) -> Any:
            """Where the segment, 0 to 1, crosses a plane of every box."""
            place = b.mul(b.add(first, row), ir.Constant(_INDEX, _WIDTH))
            return b.fmul(b.fsub(load(b, data, place, _FLOATS), number(at)), number(6 + axis))

        begin, end = constant(_FLOATS, 0.0), constant(_FLOATS, 1.0)
        for axis in range(3):
            enters = b.add(b.extract_value(args[3], axis), ir.Constant(_INDEX, axis))
            leaves = b.sub(ir.Constant(_INDEX, 3 + 2 * axis), enters)
            entered, left = crossed(enters, axis, axis), crossed(leaves, 3 + axis, axis)
            begin = b.select(b.fcmp_ordered(">", entered, begin), entered, begin)
            end = b.select(b.fcmp_ordered("<", left, end), left, end)
        met = b.bitcast(b.fcmp_ordered("<=", begin, end), ir.IntType(_WIDTH))
        return b.zext(met, _INDEX)

    return types.intp(groups, types.intp, planes, upper), emit


@njit(cache=True, inline="always")
def _along(p: float, d: float, radius: float) -> tuple[np.float32, np.float32, np.float32, int]:
    """Where a segment enters and leaves boxes along an axis.

    What the planes are measured from, the reciprocal of its length there, and 3 if it enters by the upper plane.
    """
    reach = radius + _PAD_M + _PAD_PER_M * (abs(p) + abs(d))
    if d < -_SHORT_M:
        return np.float32(p - reach), np.float32(p + reach), np.float32(1.0 / d), 3
    return np.float32(p + reach), np.float32(p - reach), np.float32(1.0 / d if d > _SHORT_M else _STEEP), 0


@njit(cache=True, error_model="numpy")
def segment_blocker(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, radius: float, tri: Floats, groups: Singles
) -> int:
    """Row of a triangle that lies within `radius` of the segment pq, -1 if there is none.

    `groups` are those of the tree whose sorted triangles are `tri`.
    """
    enter_x, leave_x, per_x, upper_x = _along(px, qx - px, radius)
    enter_y, leave_y, per_y, upper_y = _along(py, qy - py, radius)
    enter_z, leave_z, per_z, upper_z = _along(pz, qz - pz, radius)
    planes = enter_x, enter_y, enter_z, leave_x, leave_y, leave_z, per_x, per_y, per_z
    upper = upper_x, upper_y, upper_z
    n, leaves, r2 = tri.shape[0], max(1, 4 * groups.shape[0]), radius * radius
    while leaves * LEAF < n:
        leaves *= 2
    # The walk ends at leaves, so it may begin one or two levels below the root.
    roots = leaves
    while roots >= _WIDTH:
        roots //= _WIDTH
    for root in range(roots, 2 * roots):
        # Children still to visit of the node and of those above it: eight bits for each level.
        node, level, waiting = root // _WIDTH, 0, 1 << root % _WIDTH
        while True:
            bits = waiting >> _WIDTH * level & 255
            if bits == 0:
                if level == 0:
                    break
                node, level = node // _WIDTH, level - 1
                continue
            waiting ^= (bits & -bits) << _WIDTH * level
            child = node * _WIDTH + _LOWEST_BIT[bits]
            if child < leaves:
                node, level = child, level + 1
                waiting |= _met(groups, node, planes, upper) << _WIDTH * level
                continue
            first = (child - leaves) * LEAF
            for k in range(first, min(first + LEAF, n)):
                if segment_triangle_d2(px, py, pz, qx, qy, qz, tri, k, radius) <= r2:
                    return k
    return -1
