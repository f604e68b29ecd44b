"""Numba kernels over the clearance grid: collision and clearance of segments."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Singles
from aerialdojo_gen.geometry.triangles import segment_triangle_d2
from aerialdojo_gen.planning.bvh import segment_distance
from aerialdojo_gen.planning.bvh_groups import segment_blocker

FREE, UNKNOWN = -1, -2


class GridArrays(NamedTuple):
    """Arrays of a clearance grid, for kernels."""

    field: Singles  # Lower bound of the distance from a cell's centre to the nearest surface, metres
    origin: Floats  # (3,) float64; lower corner of cell (0, 0, 0), metres
    cell: float  # Edge of a cell, metres
    tri: Floats
    groups: Singles  # `aerialdojo_gen.planning.bvh_groups.group_boxes` of the tree of `tri`
    real_tri: Floats
    real_boxes: Floats
    lower: Floats  # (3,) float64; where the body's centre may be, metres
    upper: Floats


@njit(cache=True, inline="always")
def inside(x: float, y: float, z: float, lower: Floats, upper: Floats) -> bool:
    """Whether a point lies in the closed box (lower, upper), within a nanometre of rounding."""
    e = 1e-9
    return (
        lower[0] - e <= x <= upper[0] + e and lower[1] - e <= y <= upper[1] + e and lower[2] - e <= z <= upper[2] + e
    )


@njit(cache=True, error_model="numpy")
def bound_at(x: float, y: float, z: float, ox: float, oy: float, oz: float, cell: float, field: Singles) -> float:
    """Lower bound of the distance from a point to the nearest surface, metres; may be negative.

    Scalars and the field: passing a tuple of arrays costs more than the work.
    """
    i = min(max(int((x - ox) / cell), 0), field.shape[0] - 1)
    j = min(max(int((y - oy) / cell), 0), field.shape[1] - 1)
    k = min(max(int((z - oz) / cell), 0), field.shape[2] - 1)
    dx, dy, dz = x - ox - (i + 0.5) * cell, y - oy - (j + 0.5) * cell, z - oz - (k + 0.5) * cell
    return field[i, j, k] - math.sqrt(dx * dx + dy * dy + dz * dz)


@njit(cache=True, error_model="numpy")
def find_blocker(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float,
    radius: float, grid: GridArrays, prove_only: bool, guess: int,
) -> int:  # fmt: skip
    """Row of a triangle that a ball moving from p to q touches, FREE, or UNKNOWN with `prove_only`.

    The grid's 1-Lipschitz bound skips open space.
    """
    field, cell = grid.field, grid.cell
    ox, oy, oz = grid.origin[0], grid.origin[1], grid.origin[2]
    dx, dy, dz = qx - px, qy - py, qz - pz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length == 0.0:
        if bound_at(px, py, pz, ox, oy, oz, cell, field) > radius:
            return FREE
        return UNKNOWN if prove_only else segment_blocker(px, py, pz, qx, qy, qz, radius, grid.tri, grid.groups)
    ux, uy, uz = dx / length, dy / length, dz / length
    t, t0 = 0.0, -1.0  # t0: start of the undecided part, negative for none
    while t < length:
        slack = bound_at(px + t * ux, py + t * uy, pz + t * uz, ox, oy, oz, cell, field) - radius
        if slack > 0.1 * cell:
            reached = t + slack
        else:
            reached = min(t + cell, length)
            m = 0.5 * (t + reached)
            if bound_at(px + m * ux, py + m * uy, pz + m * uz, ox, oy, oz, cell, field) - radius <= 0.5 * (
                reached - t
            ):
                if prove_only:
                    return UNKNOWN
                if guess >= 0:
                    if segment_triangle_d2(px, py, pz, qx, qy, qz, grid.tri, guess, radius) <= radius * radius:
                        return guess
                    guess = -1
                if t0 < 0.0:
                    t0 = t
                t = reached
                if t < length:
                    continue
        if t0 >= 0.0:
            found = segment_blocker(
                px + t0 * ux, py + t0 * uy, pz + t0 * uz, px + t * ux, py + t * uy, pz + t * uz,
                radius, grid.tri, grid.groups,
            )  # fmt: skip
            if found >= 0:
                return found
            t0 = -1.0
        t = max(t, reached)
    return FREE


@njit(cache=True, inline="always")
def segment_free(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float,
    radius: float, grid: GridArrays, prove_only: bool,
) -> bool:  # fmt: skip
    """Whether a ball moving from p to q stays clear; with `prove_only` False means undecided."""
    return find_blocker(px, py, pz, qx, qy, qz, radius, grid, prove_only, -1) == FREE


@njit(cache=True, error_model="numpy")
def polyline_clearance(points: Floats, bound: float, grid: GridArrays) -> float:
    """Smallest distance, metres, from a polyline (n, 3) to any surface, at most `bound`; least clear pieces first."""
    n, last = 0, points.shape[0] - 1
    longest = 2.0 * grid.cell
    for i in range(last):
        n += _n_pieces(points, i, longest)
    if n == 0:
        p = points[last]
        return segment_distance(p[0], p[1], p[2], p[0], p[1], p[2], bound, grid.real_tri, grid.real_boxes)
    ends, lower_bounds = np.empty((n, 6)), np.empty(n)
    k = 0
    for i in range(last):
        m = _n_pieces(points, i, longest)
        for piece in range(m):
            for axis in range(3):
                p, d = points[i, axis], points[i + 1, axis] - points[i, axis]
                ends[k, axis], ends[k, axis + 3] = p + piece / m * d, p + (piece + 1) / m * d
            e = ends[k]
            half = math.sqrt((e[3] - e[0]) ** 2 + (e[4] - e[1]) ** 2 + (e[5] - e[2]) ** 2) / 2
            x, y, z = (e[0] + e[3]) / 2, (e[1] + e[4]) / 2, (e[2] + e[5]) / 2
            middle = bound_at(x, y, z, grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, grid.field)
            lower_bounds[k] = middle - half
            k += 1
    best = bound
    for k in np.argsort(lower_bounds, kind="mergesort"):
        if lower_bounds[k] >= best:
            break
        e = ends[k]
        best = segment_distance(e[0], e[1], e[2], e[3], e[4], e[5], best, grid.real_tri, grid.real_boxes)
    return best


@njit(cache=True, inline="always")
def _n_pieces(points: Floats, i: int, longest: float) -> int:
    dx, dy, dz = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1], points[i + 1, 2] - points[i, 2]
    return max(1, math.ceil(math.sqrt(dx * dx + dy * dy + dz * dz) / longest))
