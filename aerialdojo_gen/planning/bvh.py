"""A bounding-volume hierarchy of triangles for queries inside numba kernels.

The tree is implicit: node i has children 2i and 2i + 1, the leaves are the last level, and leaf j holds triangles
``LEAF*j`` to ``LEAF*(j+1)`` of a sorted array: two plain arrays, no pointers. Every node's triangles are split in the
middle of its longest axis: a query visits half the nodes of a tree along a Morton curve, which is built faster.
"""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Ints
from aerialdojo_gen.geometry.columns import plumb_height
from aerialdojo_gen.geometry.triangles import point_triangle_d2, segment_triangle_d2

LEAF = 4
_STACK = 64


def build_bvh(triangles: Floats) -> tuple[Floats, Floats, Ints]:
    """Sort triangles (n, 9) into a tree: sorted triangles, node boxes (2 m, 6; row 0 unused) and the order."""
    leaves = 1
    while leaves * LEAF < len(triangles):
        leaves *= 2
    order = _split_at_medians(triangles.reshape(-1, 3, 3).mean(axis=1), leaves)
    triangles = np.ascontiguousarray(triangles[order])
    return triangles, _node_boxes(triangles, leaves), order


@njit(cache=True)
def _split_at_medians(centres: Floats, leaves: int) -> Ints:
    """Order of the triangles with these centres (n, 3) in a tree of so many leaves; all but the last are full."""
    order = np.arange(len(centres))
    stack = np.empty((_STACK, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, len(centres), leaves
    top = 1
    while top > 0:
        top -= 1
        first, last, slots = stack[top]
        middle = first + slots // 2 * LEAF
        if slots == 1 or first >= last:
            continue
        if middle < last:
            _partition(order, centres[:, _longest_axis(order[first:last], centres)], first, last, middle)
        stack[top, 0], stack[top, 1], stack[top, 2] = first, min(middle, last), slots // 2
        stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2] = middle, last, slots // 2
        top += 2
    return order


@njit(cache=True)
def _longest_axis(rows: Ints, centres: Floats) -> int:
    """Axis along which some centres lie furthest apart."""
    best, longest = 0, -1.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in rows:
            low, high = min(low, centres[k, axis]), max(high, centres[k, axis])
        if high - low > longest:
            best, longest = axis, high - low
    return best


@njit(cache=True)
def _partition(order: Ints, keys: Floats, first: int, last: int, middle: int) -> None:
    """Put the smallest keys of a range of `order` before `middle`, and the others from there on (quickselect)."""
    last -= 1
    while first < last:
        pivot = keys[order[(first + last) // 2]]
        i, j = first, last
        while i <= j:
            while keys[order[i]] < pivot:
                i += 1
            while keys[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            last = j
        elif middle >= i:
            first = i
        else:
            return


@njit(cache=True)
def _node_boxes(triangles: Floats, leaves: int) -> Floats:
    """Boxes of the tree's nodes, leaves last."""
    boxes = np.empty((2 * leaves, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for k in range(len(triangles)):
        box = boxes[leaves + k // LEAF]
        for c in range(9):
            axis = c % 3
            box[axis] = min(box[axis], triangles[k, c])
            box[axis + 3] = max(box[axis + 3], triangles[k, c])
    for node in range(leaves - 1, 0, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node, axis], boxes[2 * node + 1, axis])
            boxes[node, axis + 3] = max(boxes[2 * node, axis + 3], boxes[2 * node + 1, axis + 3])
    return boxes


@njit(cache=True, inline="always")
def _box_gap2(lx: float, ly: float, lz: float, hx: float, hy: float, hz: float, boxes: Floats, node: int) -> float:
    """Squared distance between the box (l, h) and a node's box."""
    gx = max(0.0, max(boxes[node, 0] - hx, lx - boxes[node, 3]))
    gy = max(0.0, max(boxes[node, 1] - hy, ly - boxes[node, 4]))
    gz = max(0.0, max(boxes[node, 2] - hz, lz - boxes[node, 5]))
    return gx * gx + gy * gy + gz * gz


@njit(cache=True)
def segment_distance(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, bound: float, tri: Floats, boxes: Floats
) -> float:
    """Distance from the segment pq, or a point, to the nearest triangle, or `bound` where that is less; metres."""
    is_point = px == qx and py == qy and pz == qz
    lx, ly, lz = min(px, qx), min(py, qy), min(pz, qz)
    hx, hy, hz = max(px, qx), max(py, qy), max(pz, qz)
    leaves = boxes.shape[0] // 2
    best2 = bound * bound
    stack = np.empty(_STACK, np.int64)
    stack[0] = 1
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        if _box_gap2(lx, ly, lz, hx, hy, hz, boxes, node) >= best2:
            continue
        if node < leaves:
            left, right = 2 * node, 2 * node + 1
            gl = _box_gap2(lx, ly, lz, hx, hy, hz, boxes, left)
            gr = _box_gap2(lx, ly, lz, hx, hy, hz, boxes, right)
            # The nearer child goes on top, so that the bound shrinks early.
            stack[top] = right if gl <= gr else left
            stack[top + 1] = left if gl <= gr else right
            top += 2
            continue
        first = (node - leaves) * LEAF
        for k in range(first, min(first + LEAF, tri.shape[0])):
            if is_point:
                best2 = min(best2, point_triangle_d2(px, py, pz, tri, k))
            else:
                best2 = min(best2, segment_triangle_d2(px, py, pz, qx, qy, qz, tri, k, np.sqrt(best2)))
    return np.sqrt(best2)


@njit(cache=True)
def crossings_above(px: float, py: float, pz: float, tri: Floats, boxes: Floats) -> int:
    """Surfaces crossed straight up from p, outward +1, inward -1.

    Positive inside a solid or below an upward surface.
    """
    leaves = boxes.shape[0] // 2
    stack = np.empty(_STACK, np.int64)
    stack[0] = 1
    top = 1
    count = 0
    while top > 0:
        top -= 1
        node = stack[top]
        if (
            px < boxes[node, 0] or px > boxes[node, 3]
            or py < boxes[node, 1] or py > boxes[node, 4]
            or pz > boxes[node, 5]
        ):  # fmt: skip
            continue
        if node < leaves:
            stack[top] = 2 * node
            stack[top + 1] = 2 * node + 1
            top += 2
            continue
        first = (node - leaves) * LEAF
        for k in range(first, min(first + LEAF, tri.shape[0])):
            height, area = plumb_height(px, py, tri, k)
            if height > pz:
                count += 1 if area > 0.0 else -1
    return count


@njit(cache=True)
def point_distances(points: Floats, bound: float, tri: Floats, boxes: Floats) -> Floats:
    """Distances of points, (n, 3) float64 metres, to the nearest triangle, or `bound` where that is less; metres."""
    out = np.empty(len(points))
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        out[n] = segment_distance(x, y, z, x, y, z, bound, tri, boxes)
    return out
