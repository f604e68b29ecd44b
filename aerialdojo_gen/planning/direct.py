"""The direct path to a goal, tried from expanded states (Hybrid A*'s analytic expansion).

Without obstacles between a state and the goal, the shortest path in the action set's metric needs no search: metres
along the two of the 24 directions on either side of the goal, metres up or down, and the Approach.
"""

from __future__ import annotations

import math

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Ints, Singles
from aerialdojo_gen.geometry.motion import N_HEADINGS, TURN_RAD
from aerialdojo_gen.planning.grid_kernels import GridArrays, bound_at, inside, segment_free
from aerialdojo_gen.planning.preference import AHEAD_ROUNDING_M, Preference, approach_penalty, leg_penalty
from aerialdojo_gen.planning.translations import DOWN, UP

# Orders of the three legs: along the nearer direction clockwise, counter-clockwise, vertical.
_ORDERS = np.array([(2, 0, 1), (0, 1, 2), (2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0)], np.int64)
# A cost-to-go above the direct path's length by this factor and margin means that an obstacle is in between.
_DETOUR, _DETOUR_M = 1.03, 1.0
# Longest lattice path per level distance, and the most that an Approach shortens it by per metre.
_MAX_LATTICE_RATIO, _APPROACH_SAVING = 1.01, 0.45
_SPLITS = 4
_COS, _SIN, _COS_HALF = math.cos(TURN_RAD), math.sin(TURN_RAD), math.cos(TURN_RAD / 2)


@njit(cache=True, error_model="numpy")
def _proven_free(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, radius: float,
    ox: float, oy: float, oz: float, cell: float, field: Singles,
) -> bool:  # fmt: skip
    """Whether the grid proves a segment free; for inner loops, weaker than `segment_free`."""
    dx, dy, dz = qx - px, qy - py, qz - pz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length == 0.0:
        return True
    ux, uy, uz, t = dx / length, dy / length, dz / length, 0.0
    while t < length:
        slack = bound_at(px + t * ux, py + t * uy, pz + t * uz, ox, oy, oz, cell, field) - radius
        if slack <= 0.1 * cell:
            half = 0.5 * min(cell, length - t)
            m = t + half
            if bound_at(px + m * ux, py + m * uy, pz + m * uz, ox, oy, oz, cell, field) - radius <= half:
                return False
            slack = 2.0 * half
        t += slack
    return True


@njit(cache=True, inline="always")
def _leg_end(
    leg: int, x: float, y: float, z: float, ax: float, ay: float, bx: float, by: float, lift: float
) -> tuple[float, float, float]:
    """End of one of three legs: two level displacements and a lift."""
    if leg == 2:
        return x, y, z + lift
    return (x + ax, y + ay, z) if leg == 0 else (x + bx, y + by, z)


@njit(cache=True, error_model="numpy")
def _any_order_proven_free(
    x: float, y: float, z: float, ax: float, ay: float, bx: float, by: float, lift: float, radius: float,
    grid: GridArrays,
) -> bool:  # fmt: skip
    """Whether the grid proves three legs free in some order, given as two level displacements and a lift.

    The paths run along the edges of a box; every edge is checked once.
    """
    ox, oy, oz, cell, field = grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, grid.field
    reached = 1
    for corner in range(7):
        if not (reached >> corner) & 1:
            continue
        px, py, pz = x, y, z
        if corner & 1:
            px, py = px + ax, py + ay
        if corner & 2:
            px, py = px + bx, py + by
        if corner & 4:
            pz += lift
        for leg in range(3):
            beyond = corner | (1 << leg)
            if beyond == corner or (reached >> beyond) & 1:
                continue
            qx, qy, qz = _leg_end(leg, px, py, pz, ax, ay, bx, by, lift)
            if _proven_free(px, py, pz, qx, qy, qz, radius, ox, oy, oz, cell, field):
                reached |= 1 << beyond
                if beyond == 7:
                    return True
    return False


@njit(cache=True, error_model="numpy")
def direct_legs(
    x: float, y: float, z: float, start_yaw: float, goal: Floats, goal_yaw: float, h: float,
    max_length: float, radius: float, approach: float, prefer: Preference, grid: GridArrays,
    directions: Ints, metres: Ints,
) -> tuple[float, float]:  # fmt: skip
    """Write the direct path to the goal, at most three legs, into `directions` and `metres`.

    Returns its length (inf if not proved free) and extra cost, metres.
    """
    dx, dy, dz = goal[0] - x, goal[1] - y, goal[2] - z
    flat = math.sqrt(dx * dx + dy * dy)
    if (
        h > _DETOUR * (_MAX_LATTICE_RATIO * flat + abs(dz)) + _DETOUR_M
        or flat + abs(dz) - _APPROACH_SAVING * approach > max_length
    ):
        return np.inf, 0.0
    turn = math.atan2(dy, dx) - start_yaw
    a = math.floor(turn / TURN_RAD)
    ax, ay = math.cos(start_yaw + a * TURN_RAD), math.sin(start_yaw + a * TURN_RAD)
    bx, by = ax * _COS - ay * _SIN, ay * _COS + ax * _SIN
    along_a, along_b = (dx * by - dy * bx) / _SIN, (ax * dy - ay * dx) / _SIN
    if not _any_order_proven_free(
        x, y, z, along_a * ax, along_a * ay, along_b * bx, along_b * by, dz, radius, grid
    ):  # fmt: skip
        return np.inf, 0.0
    sign = 1.0 if dz >= 0.0 else -1.0
    cos_yaw, sin_yaw = math.cos(goal_yaw), math.sin(goal_yaw)
    best, na, nb, nz = np.inf, 0, 0, 0
    # An Approach along the bisector of both directions saves more metres of them than it is long.
    min_total = max(0, math.ceil(along_a + along_b - approach / _COS_HALF))
    max_total = max(3, math.ceil(along_a + along_b - approach) + 3)
    share = along_a / max(along_a + along_b, 1e-9)
    for total in range(min_total, max_total + 1):
        middle = round(share * total)
        for p in range(max(0, middle - _SPLITS), min(total, middle + _SPLITS) + 1):
            ex, ey = dx - p * ax - (total - p) * bx, dy - p * ay - (total - p) * by
            flat2 = ex * ex + ey * ey
            if flat2 > approach * approach:
                continue
            ahead = ex * cos_yaw + ey * sin_yaw
            for q in range(max(0, math.ceil(abs(dz) - approach)), math.floor(abs(dz) + approach) + 1):
                ez = dz - sign * q
                gap = math.sqrt(flat2 + ez * ez)
                if gap > approach:
                    continue
                cost = total + q + gap
                if ahead < prefer.ahead_cos * gap - AHEAD_ROUNDING_M:
                    cost += prefer.approach_penalty
                if cost < best:
                    best, na, nb, nz = cost, p, total - p, q
    if best == np.inf:
        return np.inf, 0.0
    ux, uy, uz = x + na * ax + nb * bx, y + na * ay + nb * by, z + sign * nz
    if not inside(ux, uy, uz, grid.lower, grid.upper) or not segment_free(
        ux, uy, uz, goal[0], goal[1], goal[2], radius, grid, False
    ):
        return np.inf, 0.0
    length = na + nb + nz + math.sqrt((goal[0] - ux) ** 2 + (goal[1] - uy) ** 2 + (goal[2] - uz) ** 2)
    length += approach_penalty(
        goal[0] - ux, goal[1] - uy, goal_yaw, length - na - nb - nz, prefer.ahead_cos, prefer.approach_penalty
    )
    last = leg_penalty(ux, uy, uz, goal[0], goal[1], goal[2], prefer, grid)
    min_extra, order = np.inf, 0
    for o in range(_ORDERS.shape[0]):
        px, py, pz, extra = x, y, z, 0.0
        for i in range(3):
            leg = _ORDERS[o, i]
            qx, qy, qz = _leg_end(leg, px, py, pz, na * ax, na * ay, nb * bx, nb * by, sign * nz)
            if qx == px and qy == py and qz == pz:
                continue
            if not inside(qx, qy, qz, grid.lower, grid.upper) or not segment_free(
                px, py, pz, qx, qy, qz, radius, grid, True
            ):
                extra = np.inf
                break
            extra += leg_penalty(px, py, pz, qx, qy, qz, prefer, grid)
            if extra >= min_extra:
                break
            px, py, pz = qx, qy, qz
        if extra < min_extra:
            min_extra, order = extra, o
            if extra == 0.0:
                break
    if min_extra == np.inf:
        return np.inf, 0.0
    for i in range(3):
        leg = _ORDERS[order, i]
        directions[i] = (UP if sign > 0 else DOWN) if leg == 2 else (a + leg) % N_HEADINGS
        metres[i] = nz if leg == 2 else (nb if leg == 1 else na)
    return length, last + min_extra
