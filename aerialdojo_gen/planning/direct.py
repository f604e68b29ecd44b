"""The direct way to a goal, tried from every expanded state (Hybrid A*'s analytic expansion).

Where nothing stands between a state and the goal, the shortest way in the action set's metric is known without a
search: metres along the two directions of the 24 on either side of the goal, metres up or down, and the Approach.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.geometry.motion import N_HEADINGS, TURN_RAD
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, segment_free
from aerialdojo_gen.planning.preference import Preference, astray, squeeze

# Orders of the three legs: along the nearer direction clockwise, counter-clockwise, vertical.
_ORDERS = np.array([(2, 0, 1), (0, 1, 2), (2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0)], np.int64)
UP, DOWN = N_HEADINGS, N_HEADINGS + 1
# A cost-to-go above this many times the direct way's length, and so many metres more, says that something is there.
_DETOUR, _DETOUR_M = 1.03, 1.0
_SPLITS = 4


@njit(cache=True, error_model="numpy")
def direct_legs(
    x: float, y: float, z: float, start_yaw: float, goal: NDArray[np.float64], goal_yaw: float, h: float,
    radius: float, approach: float, prefer: Preference, grid: GridArrays,
    directions: NDArray[np.int64], metres: NDArray[np.int64],
) -> float:  # fmt: skip
    """Find the direct way from a state to the goal.

    Parameters
    ----------
    x, y, z : float
        The state, metres.
    start_yaw : float
        Yaw that headings are counted from, radians.
    goal : (3,) float64
        Metres.
    goal_yaw : float
        Final heading, radians.
    h : float
        Cost-to-go of the state, metres: where it tells of a detour, nothing is tried.
    radius : float
        Radius that must stay clear, metres.
    approach : float
        Longest Approach, metres.
    prefer : Preference
        What costs beside metres.
    grid : GridArrays
        The clearance grid.
    directions, metres : (3,) int64
        Filled: headings counted from the start's yaw, `UP` or `DOWN`, and how far; 0 metres for a leg that is not
        needed.

    Returns
    -------
    float
        Metres and what costs beside them, but for actions; infinite where the grid does not prove a way free.
    """
    dx, dy, dz = goal[0] - x, goal[1] - y, goal[2] - z
    flat = math.sqrt(dx * dx + dy * dy)
    if h > _DETOUR * (1.01 * flat + abs(dz)) + _DETOUR_M:
        return np.inf
    turn = math.atan2(dy, dx) - start_yaw
    a = math.floor(turn / TURN_RAD)
    beyond = turn - a * TURN_RAD
    along_a = flat * math.sin(TURN_RAD - beyond) / math.sin(TURN_RAD)
    along_b = flat * math.sin(beyond) / math.sin(TURN_RAD)
    if h > _DETOUR * (along_a + along_b + abs(dz)) + _DETOUR_M:
        return np.inf
    ax, ay = math.cos(start_yaw + a * TURN_RAD), math.sin(start_yaw + a * TURN_RAD)
    bx, by = math.cos(start_yaw + (a + 1) * TURN_RAD), math.sin(start_yaw + (a + 1) * TURN_RAD)
    sign = 1.0 if dz >= 0.0 else -1.0
    cos_yaw, sin_yaw = math.cos(goal_yaw), math.sin(goal_yaw)
    best, na, nb, nz = np.inf, 0, 0, 0
    least = max(0, math.ceil(along_a + along_b - approach))
    share = along_a / max(along_a + along_b, 1e-9)
    for total in range(least, least + 4):
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
                cost = total + q + gap + (prefer.astray if ahead < prefer.ahead_cos * gap else 0.0)
                if cost < best:
                    best, na, nb, nz = cost, p, total - p, q
    if best == np.inf:
        return np.inf
    ux, uy, uz = x + na * ax + nb * bx, y + na * ay + nb * by, z + sign * nz
    if not inside(ux, uy, uz, grid.lower, grid.upper) or not segment_free(
        ux, uy, uz, goal[0], goal[1], goal[2], radius, grid, False
    ):
        return np.inf
    gx, gy, gz, cell = grid.origin[0], grid.origin[1], grid.origin[2], grid.cell
    length = na + nb + nz + math.sqrt((goal[0] - ux) ** 2 + (goal[1] - uy) ** 2 + (goal[2] - uz) ** 2)
    length += astray(goal[0] - ux, goal[1] - uy, goal_yaw, length - na - nb - nz, prefer.ahead_cos, prefer.astray)
    length += squeeze(
        ux, uy, uz, goal[0], goal[1], goal[2], prefer.clearance, prefer.weight, gx, gy, gz, cell, grid.field
    )  # fmt: skip
    least_extra, order = np.inf, 0
    for o in range(_ORDERS.shape[0]):
        px, py, pz, extra = x, y, z, 0.0
        for i in range(3):
            leg = _ORDERS[o, i]
            qx, qy, qz = px, py, pz
            if leg == 0:
                qx, qy = px + na * ax, py + na * ay
            elif leg == 1:
                qx, qy = px + nb * bx, py + nb * by
            else:
                qz = pz + sign * nz
            if qx == px and qy == py and qz == pz:
                continue
            if not inside(qx, qy, qz, grid.lower, grid.upper) or not segment_free(
                px, py, pz, qx, qy, qz, radius, grid, True
            ):
                extra = np.inf
                break
            extra += squeeze(
                px, py, pz, qx, qy, qz, prefer.clearance, prefer.weight, gx, gy, gz, cell, grid.field
            )  # fmt: skip
            if extra >= least_extra:
                break
            px, py, pz = qx, qy, qz
        if extra < least_extra:
            least_extra, order = extra, o
            if extra == 0.0:
                break
    for i in range(3):
        leg = _ORDERS[order, i]
        directions[i] = (UP if sign > 0 else DOWN) if leg == 2 else (a + leg) % N_HEADINGS
        metres[i] = nz if leg == 2 else (nb if leg == 1 else na)
    return length + least_extra
