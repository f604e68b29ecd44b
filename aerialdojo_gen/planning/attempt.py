"""One planning attempt as a single kernel: search, order the legs, fly them, measure clearance.

Passing arrays to a kernel takes longer than a short search, so they are passed once.

Translations commute: in any order they end in the same place after the same length. So equal directions are joined,
opposite ones cancelled, the order with the best clearance is chosen, and headings are chosen by dynamic programming:
few actions, and few metres flown sideways, because the front camera should see where the drone is going.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import APPROACH, MOVE_DOWN_1, MOVE_UP_1, STOP, TURN_LEFT, TURN_RIGHT
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Ints, Singles
from aerialdojo_gen.geometry.motion import N_HEADINGS, QUARTER, TURN_RAD, fly
from aerialdojo_gen.planning.certify import ClearanceProfile, clearance_profile
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, segment_free
from aerialdojo_gen.planning.hybrid_astar import FOUND, SearchArrays, SearchOptions, search
from aerialdojo_gen.planning.preference import Preference, leg_penalty
from aerialdojo_gen.planning.translations import DOWN, UP, fewest_moves, turns_between

# No Approach is needed for a goal nearer than this.
_ON_GOAL_M = 1e-9


class PlanResult(NamedTuple):
    """Result of one planning attempt."""

    status: int  # One of `aerialdojo_gen.planning.hybrid_astar`: FOUND, EXHAUSTED, BUDGET
    expansions: int
    poses: Floats  # (K + 1, 4) float64; x, y, z in metres and yaw in (-pi, pi]; no rows unless FOUND
    actions: NDArray[np.int8]  # (K + 1,) int8; action at every pose, Stop at the last
    length: float  # The paper's L, metres
    profile: ClearanceProfile  # Of the route; meaningless unless FOUND


@njit(cache=True)
def plan_once(
    start: Floats,
    goal: Floats,
    goal_heading: int,
    cost_to_go: Singles,
    grid: GridArrays,
    memory: SearchArrays,
    options: SearchOptions,
    radius: float,
    bound: float,
) -> PlanResult:
    """Search a route from a pose (4,) to a goal (3,), order its moves, fly it and measure its clearance, metres."""
    status, expansions, directions, metres = search(start, goal, goal_heading, cost_to_go, grid, memory, options)
    if status != FOUND:
        no_profile = ClearanceProfile(np.empty((0, 3)), False, np.empty(0, np.bool_), 0.0)
        return PlanResult(status, expansions, np.empty((0, 4)), np.empty(0, np.int8), 0.0, no_profile)
    moved = legs_to_actions(start, directions, metres, goal_heading, options, grid)
    poses = fly(start, moved)
    n = len(moved)
    dx, dy, dz = goal[0] - poses[n, 0], goal[1] - poses[n, 1], goal[2] - poses[n, 2]
    approach = 1 if math.sqrt(dx * dx + dy * dy + dz * dz) > _ON_GOAL_M else 0
    route = np.empty((n + 1 + approach, 4))
    actions = np.empty(n + 1 + approach, np.int8)
    route[: n + 1], actions[:n], actions[n] = poses, moved, APPROACH
    route[n + approach, :3], route[n + approach, 3] = goal, poses[n, 3]
    actions[n + approach] = STOP
    length = 0.0
    for k in range(n + approach):
        ax, ay, az = route[k + 1, 0] - route[k, 0], route[k + 1, 1] - route[k, 1], route[k + 1, 2] - route[k, 2]
        length += math.sqrt(ax * ax + ay * ay + az * az)
    profile = clearance_profile(np.ascontiguousarray(route[:, :3]), radius, bound, grid)
    return PlanResult(status, expansions, route, actions, length, profile)


_MOVE_FORWARD_1, _MOVE_LEFT_1, _MOVE_RIGHT_1 = 1, 4, 7
_MAX_PASSES = 50
_ARRIVAL_M = 3
_MIN_ACTION_COST_M, _MIN_GAIN_M = 1e-4, 1e-6


@njit(cache=True, inline="always")
def _opposite(a: int, b: int) -> bool:
    if a >= N_HEADINGS or b >= N_HEADINGS:
        return a != b and a >= N_HEADINGS and b >= N_HEADINGS
    return (a - b) % N_HEADINGS == N_HEADINGS // 2


@njit(cache=True)
def _merge(direction: Ints, metres: Ints, n: int) -> int:
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


@njit(cache=True)
def _headings(
    direction: Ints, metres: Ints, n: int, goal_heading: int, sideways: float,
    chosen: Ints, best: Floats, back: Ints, at: Ints,
) -> float:  # fmt: skip
    """Choose the heading of every leg, so that turns and metres flown sideways cost least; return that cost.

    A leg is flown ahead, to the left or to the right; on a tie ahead. A vertical leg keeps the heading. The last
    metres cost nothing sideways: there the front camera should see the goal.
    """
    to_fly = 0
    for i in range(n):
        to_fly += metres[i]
    best[0], at[0] = 0.0, 0
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
            for previous in range(3):
                cost = best[i - 1, previous] + turns_between(at[i - 1, previous], at[i, side]) + own
                if cost < best[i, side]:
                    best[i, side], back[i, side] = cost, previous
    total, side = np.inf, 0
    for last in range(3):
        cost = best[n, last] + turns_between(at[n, last], goal_heading)
        if cost < total:
            total, side = cost, last
    for i in range(n, 0, -1):
        chosen[i - 1] = at[i, side]
        side = back[i, side]
    return total


@njit(cache=True, inline="always")
def _leg_end(x: float, y: float, z: float, yaw: float, d: int, metres: int) -> tuple[float, float, float]:
    if d == UP:
        return x, y, z + metres
    if d == DOWN:
        return x, y, z - metres
    return x + math.cos(yaw + d * TURN_RAD) * metres, y + math.sin(yaw + d * TURN_RAD) * metres, z


@njit(cache=True)
def _fly_legs(
    start: Floats, direction: Ints, metres: Ints, n: int,
    prefer: Preference, grid: GridArrays, points: Floats, cost_before: Floats,
) -> None:  # fmt: skip
    """Write every leg's start, and the clearance cost of the legs before it."""
    x, y, z = start[0], start[1], start[2]
    points[0, 0], points[0, 1], points[0, 2], cost_before[0] = x, y, z, 0.0
    for i in range(n):
        u, v, w = _leg_end(x, y, z, start[3], direction[i], metres[i])
        cost_before[i + 1] = cost_before[i] + leg_penalty(x, y, z, u, v, w, prefer, grid)
        x, y, z = u, v, w
        points[i + 1, 0], points[i + 1, 1], points[i + 1, 2] = x, y, z


@njit(cache=True)
def _with_leg_moved(
    direction: Ints, metres: Ints, n: int, source: int, target: int, new_direction: Ints, new_metres: Ints
) -> int:
    """Write the legs with one moved elsewhere, joined where possible; return their number."""
    for k in range(n):
        i = k - int(k > target)
        i = source if k == target else i + int(i >= source)
        new_direction[k], new_metres[k] = direction[i], metres[i]
    return _merge(new_direction, new_metres, n)


@njit(cache=True)
def _reorder(
    start: Floats, direction: Ints, metres: Ints, n: int, goal_heading: int, options: SearchOptions, grid: GridArrays
) -> int:
    """Move single legs within the sequence while that is free and makes the route cheaper, in place.

    Only the legs between the old and the new place move, so only they are checked again.
    """
    size = len(direction)
    new_direction, new_metres, chosen = np.empty_like(direction), np.empty_like(metres), np.empty_like(direction)
    best, back, at = np.empty((size + 1, 3)), np.empty((size + 1, 3), np.int64), np.empty((size + 1, 3), np.int64)
    points, cost_before = np.empty((size + 1, 3)), np.empty(size + 1)
    # With free actions, fewer of them still break ties.
    action, prefer = max(options.action_cost, _MIN_ACTION_COST_M), options.prefer
    _fly_legs(start, direction, metres, n, prefer, grid, points, cost_before)
    cost = cost_before[n]
    for i in range(n):
        cost += metres[i] + action * fewest_moves(direction[i], metres[i])
    cost += action * _headings(direction, metres, n, goal_heading, options.sideways, chosen, best, back, at)
    for _ in range(_MAX_PASSES):
        improved = False
        for source in range(n):
            for target in range(n):
                # Swap neighbours only once.
                if target == source or target == source - 1:
                    continue
                m = _with_leg_moved(direction, metres, n, source, target, new_direction, new_metres)
                lead, tail = 0, 0
                while lead < min(n, m) and (
                    new_direction[lead] == direction[lead] and new_metres[lead] == metres[lead]
                ):
                    lead += 1
                while tail < min(n, m) - lead and (
                    new_direction[m - 1 - tail] == direction[n - 1 - tail]
                    and new_metres[m - 1 - tail] == metres[n - 1 - tail]
                ):
                    tail += 1
                cost_limit = cost - _MIN_GAIN_M
                new_cost = cost_before[lead] + cost_before[n] - cost_before[n - tail]
                for i in range(m):
                    new_cost += new_metres[i] + action * fewest_moves(new_direction[i], new_metres[i])
                if new_cost >= cost_limit:
                    continue
                new_cost += action * _headings(
                    new_direction, new_metres, m, goal_heading, options.sideways, chosen, best, back, at
                )
                x, y, z = points[lead, 0], points[lead, 1], points[lead, 2]
                for i in range(lead, m - tail):
                    if new_cost >= cost_limit:
                        break
                    u, v, w = _leg_end(x, y, z, start[3], new_direction[i], new_metres[i])
                    new_cost += leg_penalty(x, y, z, u, v, w, prefer, grid)
                    x, y, z = u, v, w
                if new_cost >= cost_limit:
                    continue
                x, y, z, free = points[lead, 0], points[lead, 1], points[lead, 2], True
                for i in range(lead, m - tail):
                    u, v, w = _leg_end(x, y, z, start[3], new_direction[i], new_metres[i])
                    if not inside(u, v, w, grid.lower, grid.upper) or not segment_free(
                        x, y, z, u, v, w, options.radius, grid, False
                    ):
                        free = False
                        break
                    x, y, z = u, v, w
                if not free:
                    continue
                direction[:m], metres[:m] = new_direction[:m], new_metres[:m]
                n, cost = m, new_cost
                _fly_legs(start, direction, metres, n, prefer, grid, points, cost_before)
                improved = True
                break
            if improved:
                break
        if not improved:
            break
    return n


@njit(cache=True, inline="always")
def _turn(actions: NDArray[np.int8], k: int, heading: int, target: int) -> int:
    left = (target - heading) % N_HEADINGS
    count, action = (left, TURN_LEFT) if left <= N_HEADINGS // 2 else (N_HEADINGS - left, TURN_RIGHT)
    actions[k : k + count] = action
    return k + count


@njit(cache=True)
def _write_moves(actions: NDArray[np.int8], k: int, first: int, steps: tuple[int, ...], metres: int) -> int:
    """Write the fewest moves that add up to `metres`, the longest first; `first` is the action of the shortest."""
    for s in range(len(steps) - 1, -1, -1):
        count = metres // steps[s]
        actions[k : k + count] = first + s
        metres -= count * steps[s]
        k += count
    return k


@njit(cache=True)
def legs_to_actions(
    start: Floats, direction: Ints, metres: Ints, goal_heading: int, options: SearchOptions, grid: GridArrays
) -> NDArray[np.int8]:
    """Turn legs (n,), in place, into actions (m,), including the turns to the final heading."""
    total = metres.sum()
    n = _merge(direction, metres, len(direction))
    n = _reorder(start, direction, metres, n, goal_heading, options, grid)
    chosen, best = np.empty(n + 1, np.int64), np.empty((n + 1, 3))
    back, at = np.empty((n + 1, 3), np.int64), np.empty((n + 1, 3), np.int64)
    _headings(direction, metres, n, goal_heading, options.sideways, chosen, best, back, at)
    actions = np.empty(total + N_HEADINGS * (n + 1), np.int8)
    k, heading = 0, 0
    for i in range(n):
        k = _turn(actions, k, heading, chosen[i])
        heading = chosen[i]
        d = direction[i]
        if d == UP:
            k = _write_moves(actions, k, MOVE_UP_1, (1, 2), metres[i])
        elif d == DOWN:
            k = _write_moves(actions, k, MOVE_DOWN_1, (1, 2), metres[i])
        else:
            side = (d - heading) % N_HEADINGS
            first = _MOVE_FORWARD_1 if side == 0 else (_MOVE_LEFT_1 if side == QUARTER else _MOVE_RIGHT_1)
            k = _write_moves(actions, k, first, (1, 3, 5), metres[i])
    k = _turn(actions, k, heading, goal_heading)
    return actions[:k].copy()
