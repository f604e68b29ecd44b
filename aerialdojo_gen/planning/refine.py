"""From translations to actions: put a found route in its best order and fly it with the fewest actions.

Translations commute: flown in another order they end in the same place, after the same length. So equal directions
are brought together, there and back cancels out, the order is chosen that keeps away from surfaces, and the headings
are chosen by dynamic programming: few actions, and few metres flown sideways, for the front camera should see where
the drone is going.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.common.terms import MOVE_DOWN_1, MOVE_UP_1, TURN_LEFT, TURN_RIGHT
from aerialdojo_gen.geometry.motion import N_HEADINGS, QUARTER, TURN_RAD
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, segment_free
from aerialdojo_gen.planning.hybrid_astar import LIFTS_M, N_FLAT, N_STEPS, STEPS_M, SearchOptions, turns_between
from aerialdojo_gen.planning.preference import Preference, squeeze

# Directions of a leg beyond the horizontal ones.
_UP, _DOWN = N_HEADINGS, N_HEADINGS + 1
_MOVE_FORWARD_1, _MOVE_LEFT_1, _MOVE_RIGHT_1 = 1, 4, 7
_MAX_PASSES = 50
_ARRIVAL_M = 3
_LEAST_ACTION_M, _WORTH_M = 1e-4, 1e-6


@njit(cache=True, inline="always")
def _opposite(a: int, b: int) -> bool:
    if a >= N_HEADINGS or b >= N_HEADINGS:
        return a != b and a >= N_HEADINGS and b >= N_HEADINGS
    return (a - b) % N_HEADINGS == N_HEADINGS // 2


@njit(cache=True)
def _merge(direction: NDArray[np.int64], metres: NDArray[np.int64], n: int) -> int:
    """Join neighbouring legs of one direction and cancel opposite ones, in place; return how many are left."""
    m = 0
    for i in range(n):
        d, length = direction[i], metres[i]
        while length > 0 and m > 0:
            if direction[m - 1] == d:
                length += metres[m - 1]
                m -= 1
            elif _opposite(direction[m - 1], d):
                rest = metres[m - 1] - length
                m -= 1
                length = abs(rest)
                if rest > 0:
                    d = direction[m]
            else:
                break
        if length > 0:
            direction[m], metres[m] = d, length
            m += 1
    return m


@njit(cache=True, inline="always")
def _fewest_moves(direction: int, metres: int) -> int:
    if direction >= N_HEADINGS:
        return (metres + 1) // 2
    rest = metres % 5
    return metres // 5 + rest // 3 + rest % 3


@njit(cache=True)
def _headings(
    direction: NDArray[np.int64], metres: NDArray[np.int64], n: int, goal_heading: int, sideways: float,
    chosen: NDArray[np.int64],
) -> float:  # fmt: skip
    """Choose the heading of every leg, so that turns and metres flown sideways cost least; return that cost.

    A leg is flown ahead, to the left or to the right; on a tie ahead. A vertical leg keeps the heading. The last
    metres may be flown sideways for nothing: what the front camera should see there is the goal.
    """
    to_fly = 0
    for i in range(n):
        to_fly += metres[i]
    best = np.zeros((n + 1, 3))
    back = np.zeros((n + 1, 3), np.int64)
    at = np.zeros((n + 1, 3), np.int64)
    for i in range(1, n + 1):
        d = direction[i - 1]
        to_fly -= metres[i - 1]
        for side in range(3):
            if d >= N_HEADINGS:
                at[i, side], best[i, side], back[i, side] = at[i - 1, side], best[i - 1, side], side
                continue
            offset = 0 if side == 0 else (-QUARTER if side == 1 else QUARTER)
            at[i, side] = (d + offset) % N_HEADINGS
            own = 0.0 if side == 0 else sideways * (metres[i - 1] - min(metres[i - 1], max(0, _ARRIVAL_M - to_fly)))
            best[i, side] = np.inf
            for before in range(3):
                cost = best[i - 1, before] + turns_between(at[i - 1, before], at[i, side]) + own
                if cost < best[i, side]:
                    best[i, side], back[i, side] = cost, before
    total, side = np.inf, 0
    for last in range(3):
        cost = best[n, last] + turns_between(at[n, last], goal_heading)
        if cost < total:
            total, side = cost, last
    for i in range(n, 0, -1):
        chosen[i - 1] = at[i, side]
        side = back[i, side]
    return total


@njit(cache=True)
def _effort(direction: NDArray[np.int64], metres: NDArray[np.int64], n: int, goal_heading: int, sideways: float,
            chosen: NDArray[np.int64]) -> float:  # fmt: skip
    """Actions, and what metres flown sideways count as."""
    total = _headings(direction, metres, n, goal_heading, sideways, chosen)
    for i in range(n):
        total += _fewest_moves(direction[i], metres[i])
    return total


@njit(cache=True, inline="always")
def _leg_end(x: float, y: float, z: float, yaw: float, d: int, metres: int) -> tuple[float, float, float]:
    if d == _UP:
        return x, y, z + metres
    if d == _DOWN:
        return x, y, z - metres
    return x + math.cos(yaw + d * TURN_RAD) * metres, y + math.sin(yaw + d * TURN_RAD) * metres, z


@njit(cache=True)
def _legs_free(
    start: NDArray[np.float64], direction: NDArray[np.int64], metres: NDArray[np.int64], n: int,
    radius: float, grid: GridArrays,
) -> bool:  # fmt: skip
    x, y, z = start[0], start[1], start[2]
    for i in range(n):
        u, v, w = _leg_end(x, y, z, start[3], direction[i], metres[i])
        if not inside(u, v, w, grid.lower, grid.upper) or not segment_free(x, y, z, u, v, w, radius, grid, False):
            return False
        x, y, z = u, v, w
    return True


@njit(cache=True)
def _squeezed(
    start: NDArray[np.float64], direction: NDArray[np.int64], metres: NDArray[np.int64], n: int, most: float,
    prefer: Preference, grid: GridArrays,
) -> float:  # fmt: skip
    """What legs cost beside their metres for the surfaces that they come near; beyond `most` any number above it."""
    if prefer.weight == 0.0:
        return 0.0
    x, y, z, total = start[0], start[1], start[2], 0.0
    for i in range(n):
        u, v, w = _leg_end(x, y, z, start[3], direction[i], metres[i])
        total += squeeze(
            x, y, z, u, v, w, prefer.clearance, prefer.weight,
            grid.origin[0], grid.origin[1], grid.origin[2], grid.cell, grid.field,
        )  # fmt: skip
        if total > most:
            break
        x, y, z = u, v, w
    return total


@njit(cache=True)
def _reorder(
    start: NDArray[np.float64], direction: NDArray[np.int64], metres: NDArray[np.int64], n: int, goal_heading: int,
    options: SearchOptions, grid: GridArrays,
) -> int:  # fmt: skip
    """Move single legs elsewhere in the sequence as long as that is free and makes the route cheaper, in place."""
    new_direction, new_metres, chosen = np.empty_like(direction), np.empty_like(metres), np.empty_like(direction)
    # Where actions cost nothing, fewer of them still decide between ways that cost the same.
    action, prefer = max(options.action_cost, _LEAST_ACTION_M), options.prefer
    cost = metres[:n].sum() + action * _effort(direction, metres, n, goal_heading, options.sideways, chosen)
    cost += _squeezed(start, direction, metres, n, np.inf, prefer, grid)
    for _ in range(_MAX_PASSES):
        improved = False
        for source in range(n):
            for target in range(n):
                if target == source:
                    continue
                k = 0
                for i in range(n):
                    if i == source:
                        continue
                    if k == target:
                        new_direction[k], new_metres[k] = direction[source], metres[source]
                        k += 1
                    new_direction[k], new_metres[k] = direction[i], metres[i]
                    k += 1
                if k == target:
                    new_direction[k], new_metres[k] = direction[source], metres[source]
                    k += 1
                m = _merge(new_direction, new_metres, k)
                wanted = cost - _WORTH_M
                new_cost = float(new_metres[:m].sum())
                if new_cost >= wanted:
                    continue
                new_cost += action * _effort(new_direction, new_metres, m, goal_heading, options.sideways, chosen)
                if new_cost >= wanted:
                    continue
                new_cost += _squeezed(start, new_direction, new_metres, m, wanted - new_cost, prefer, grid)
                if new_cost >= wanted:
                    continue
                if not _legs_free(start, new_direction, new_metres, m, options.radius, grid):
                    continue
                direction[:m], metres[:m] = new_direction[:m], new_metres[:m]
                n, cost = m, new_cost
                improved = True
                break
            if improved:
                break
        if not improved:
            break
    return n


@njit(cache=True, inline="always")
def _turn(actions: NDArray[np.int8], k: int, heading: int, wanted: int) -> int:
    left = (wanted - heading) % N_HEADINGS
    count, action = (left, TURN_LEFT) if left <= N_HEADINGS // 2 else (N_HEADINGS - left, TURN_RIGHT)
    actions[k : k + count] = action
    return k + count


@njit(cache=True)
def _write(actions: NDArray[np.int8], k: int, first: int, steps: tuple[int, ...], metres: int) -> int:
    """Write the fewest moves that add up to `metres`, the longest first; `first` is the action of the shortest."""
    for s in range(len(steps) - 1, -1, -1):
        count = metres // steps[s]
        actions[k : k + count] = first + s
        metres -= count * steps[s]
        k += count
    return k


@njit(cache=True)
def moves_to_actions(
    start: NDArray[np.float64],
    moves: NDArray[np.int8],
    goal_heading: int,
    options: SearchOptions,
    grid: GridArrays,
) -> NDArray[np.int8]:
    """Turn the search's translations into actions.

    Parameters
    ----------
    start : (4,) float64
        x, y, z in metres, and yaw in radians.
    moves : (n,) int8
        Translations, as `aerialdojo_gen.planning.hybrid_astar.search` returns them.
    goal_heading : int
        Heading to end with, counted from the start's yaw.
    options : SearchOptions
        Of the search.
    grid : GridArrays
        The clearance grid.

    Returns
    -------
    (m,) int8
        Actions, the turns to the final heading included, Approach and Stop not.
    """
    direction, metres = np.empty(len(moves) + 1, np.int64), np.empty(len(moves) + 1, np.int64)
    total = 0
    for i in range(len(moves)):
        move = int(moves[i])
        if move < N_FLAT:
            direction[i], metres[i] = move // N_STEPS, int(STEPS_M[move % N_STEPS])
        else:
            lift = LIFTS_M[move - N_FLAT]
            direction[i], metres[i] = (_UP if lift > 0 else _DOWN), int(abs(lift))
        total += metres[i]
    n = _merge(direction, metres, len(moves))
    n = _reorder(start, direction, metres, n, goal_heading, options, grid)
    chosen = np.empty(n + 1, np.int64)
    _headings(direction, metres, n, goal_heading, options.sideways, chosen)
    actions = np.empty(total + N_HEADINGS * (n + 1), np.int8)
    k, heading = 0, 0
    for i in range(n):
        k = _turn(actions, k, heading, chosen[i])
        heading = chosen[i]
        d = direction[i]
        if d == _UP:
            k = _write(actions, k, MOVE_UP_1, (1, 2), metres[i])
        elif d == _DOWN:
            k = _write(actions, k, MOVE_DOWN_1, (1, 2), metres[i])
        else:
            side = (d - heading) % N_HEADINGS
            first = _MOVE_FORWARD_1 if side == 0 else (_MOVE_LEFT_1 if side == QUARTER else _MOVE_RIGHT_1)
            k = _write(actions, k, first, (1, 3, 5), metres[i])
    k = _turn(actions, k, heading, goal_heading)
    return actions[:k].copy()
