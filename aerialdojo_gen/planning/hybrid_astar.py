"""Hybrid A* over the 4-DoF action set (paper, section on reference trajectories), as a numba kernel.

A state is (x, y, z, heading): positions are continuous, headings 15° apart from the start's yaw, duplicates are
states of one cell and heading sector. An edge is a translation together with the turns that it needs: to fly in any
of the 24 directions the body turns until that direction lies ahead, to its left or to its right, whichever takes
fewer turns. Turning adds nothing to the length, so every action carries a small cost that breaks ties.

The Approach, with the turns before it, is an edge to the goal, and so is the direct path
(`aerialdojo_gen.planning.direct`), which ends most searches early. Two thirds of the expansions would go into proving
that the best one found is the best there is, which it mostly is: so the search ends where no other can be cheaper by
a tolerance that grows with the expansions.

Edges are pushed unchecked and tested for collisions when they are popped (lazy evaluation): most never are. Their
clearance cost is computed then too, and an edge that costs more is pushed again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Int32s, Ints, Singles
from aerialdojo_gen.geometry.motion import N_HEADINGS, TURN_RAD
from aerialdojo_gen.planning.cost_to_go import cost_at, cost_between
from aerialdojo_gen.planning.direct import direct_legs
from aerialdojo_gen.planning.grid_kernels import FREE, GridArrays, find_blocker, segment_free
from aerialdojo_gen.planning.preference import Preference, approach_penalty, clearance_penalty
from aerialdojo_gen.planning.translations import (
    DOWN,
    LIFTS_M,
    N_FLAT,
    N_STEPS,
    N_TRANSLATIONS,
    N_TURNS,
    STEPS_M,
    TURN_BY,
    UP,
    count_actions,
    turns_between,
    wrap_heading,
)

# Once a way to the goal is known, a direct path must be cheaper by this to be tried.
_MIN_GAIN_M = 0.1
# The direct path is tried from states nearer than all before, and from every fourth of the others.
_DIRECT_EVERY = 4
# Factor on the direct path's clearance cost: the search may still find a clearer one.
_CLEARANCE_FACTOR = 3.0
_MAX_TOLERANCE_M = 1.0
# When a direction's shortest step is worse than the state by this, its longer steps are pushed when it is popped.
_DEFERRED, _DEFER_MARGIN_M = 100, 0.3

FOUND, EXHAUSTED, BUDGET = 0, 1, 2

_BUCKET_M = 0.02
_N_BUCKETS = 8192
# As `grid_kernels.inside` allows.
_ROUNDING_M = 1e-9
# Most edges that the grid does not prove free are blocked, four in five by the last blocker of a nearby edge.
_N_BLOCKERS = 4096
_HASH = np.uint64(0x9E3779B97F4A7C15)


class SearchArrays(NamedTuple):
    """Working memory of a search, reused by every plan."""

    pose: Floats  # (n, 3) float64; position of every expanded state, metres
    cost: Floats  # (n,) float64; cost from the start
    heading: NDArray[np.int8]  # (n,) int8; heading, and the translation that led to the state
    move: NDArray[np.int8]
    parent: Int32s  # (n,) int32; expanded state before it, -1 for the start
    edge_parent: Int32s
    edge_move: NDArray[np.int8]
    edge_next: Int32s
    edge_extra: Singles  # (m,) float32; clearance cost of a popped edge
    heads: Int32s  # (_N_BUCKETS,) int32; first edge of every bucket, -1 for none
    keys: Ints  # (power of two,) int64; hash table of closed states
    stamps: Int32s  # (power of two,) int32; search that wrote a slot of the table
    clock: Int32s  # (1,) int32; number of the search
    highest: Floats  # (1,) float64
    blockers: Int32s  # Last triangle that blocked an edge, by hash of the edge's middle; -1 for none


class SearchOptions(NamedTuple):
    """How to search."""

    radius: float  # Radius that must stay clear, metres
    weight: float  # Of the cost-to-go; 1 is plain A*
    action_cost: float  # Cost of an action on top of its metres
    approach: float  # Longest Approach, metres
    budget: int  # Maximum number of expansions
    cell: float  # Edge of the duplicate-detection cells, metres
    sectors: int  # Heading sectors of duplicate detection, a divisor of 24
    sideways: float
    prefer: Preference  # Costs other than metres and actions
    goal_tolerance: float  # An edge to the goal is accepted though another may be cheaper by this, metres
    tolerance_growth: float  # Added to it by every expansion, up to `_MAX_TOLERANCE_M`


def make_search_arrays(budget: int) -> SearchArrays:
    """Reserve memory for searches of up to `budget` expansions; untouched pages cost nothing."""
    n, edges = budget + 2, (budget + 2) * N_TRANSLATIONS
    slots = 1 << max(10, math.ceil(math.log2(4 * n)))
    return SearchArrays(
        np.empty((n, 3)), np.empty(n), np.empty(n, np.int8), np.empty(n, np.int8), np.empty(n, np.int32),
        np.empty(edges, np.int32), np.empty(edges, np.int8), np.empty(edges, np.int32), np.empty(edges, np.float32),
        np.full(_N_BUCKETS, -1, np.int32), np.empty(slots, np.int64), np.zeros(slots, np.int32),
        np.zeros(1, np.int32), np.zeros(1), np.empty(_N_BLOCKERS, np.int32),
    )  # fmt: skip


@njit(cache=True)
def _slot(key: int, now: int, keys: Ints, stamps: Int32s) -> int:
    """Slot of a key in the table of closed states, or ~slot of its insertion point."""
    mask = keys.shape[0] - 1
    # The high bits of the product are the well mixed ones.
    slot = int((np.uint64(key) * _HASH) >> np.uint64(40)) & mask
    while stamps[slot] == now:
        if keys[slot] == key:
            return slot
        slot = (slot + 1) & mask
    return ~slot


@njit(cache=True)
def _legs_to(node: int, parents: Int32s, moves: NDArray[np.int8]) -> tuple[Ints, Ints]:
    """Directions and metres of the translations from the start to a state, and of three more legs of 0 m."""
    count, last = 0, node
    while parents[last] >= 0:
        count += 1
        last = parents[last]
    directions, metres = np.zeros(count + 3, np.int64), np.zeros(count + 3, np.int64)
    while parents[node] >= 0:
        count -= 1
        move = int(moves[node])
        if move < N_FLAT:
            directions[count], metres[count] = move // N_STEPS, int(STEPS_M[move % N_STEPS])
        else:
            lift = LIFTS_M[move - N_FLAT]
            directions[count], metres[count] = (UP if lift > 0 else DOWN), int(abs(lift))
        node = parents[node]
    return directions, metres


@njit(cache=True, inline="always")
def _flights(yaw: float) -> Floats:
    """Step (dx, dy, dz) and length of every translation from a start's yaw; (N_TRANSLATIONS, 4), metres."""
    flights = np.zeros((N_TRANSLATIONS, 4))
    for m in range(N_FLAT):
        angle, length = yaw + m // N_STEPS * TURN_RAD, STEPS_M[m % N_STEPS]
        flights[m, 0], flights[m, 1], flights[m, 3] = math.cos(angle) * length, math.sin(angle) * length, length
    for m in range(N_FLAT, N_TRANSLATIONS):
        flights[m, 2], flights[m, 3] = LIFTS_M[m - N_FLAT], abs(LIFTS_M[m - N_FLAT])
    return flights


@njit(cache=True, inline="always")
def _push(
    f: float,
    parent: int,
    move: int,
    entry: int,
    edge_parent: Int32s,
    edge_move: NDArray[np.int8],
    edge_next: Int32s,
    heads: Int32s,
) -> int:
    """Write an edge as entry `entry` and put it first in the bucket of its cost; return the bucket."""
    bucket = max(0, int(f / _BUCKET_M))
    edge_parent[entry], edge_move[entry], edge_next[entry] = parent, move, heads[bucket]
    heads[bucket] = entry
    return bucket


@njit(cache=True, error_model="numpy")
def search(
    start: Floats,
    goal: Floats,
    goal_heading: int,
    cost_to_go: Singles,
    grid: GridArrays,
    s: SearchArrays,
    o: SearchOptions,
) -> tuple[int, int, Ints, Ints]:
    """Search a short way from a pose (4,) to a goal (3,), without the Approach.

    Status, expansions, and directions and metres of its legs, (n,) each.
    """
    flights = _flights(start[3])
    # Scalars and plain arrays: passing a tuple of arrays costs more than the inner loop's work.
    pose, cost, headings, moves, parents = s.pose, s.cost, s.heading, s.move, s.parent
    edge_parent, edge_move, edge_next, edge_extra, heads, keys, stamps, blockers = (
        s.edge_parent, s.edge_move, s.edge_next, s.edge_extra, s.heads, s.keys, s.stamps, s.blockers
    )  # fmt: skip
    near_m, near_weight, field = o.prefer.clearance, o.prefer.weight, grid.field
    goal_yaw = start[3] + goal_heading * TURN_RAD
    ox, oy, oz, edge = grid.origin[0], grid.origin[1], grid.origin[2], grid.cell
    lx, ly, lz = grid.lower[0] - _ROUNDING_M, grid.lower[1] - _ROUNDING_M, grid.lower[2] - _ROUNDING_M
    hx, hy, hz = grid.upper[0] + _ROUNDING_M, grid.upper[1] + _ROUNDING_M, grid.upper[2] + _ROUNDING_M
    s.clock[0] += 1
    now = s.clock[0]
    heads[:], blockers[:] = -1, -1
    f0 = o.weight * cost_at(start[0], start[1], start[2], grid, cost_to_go) - 5.0
    f_max = (_N_BUCKETS - 1) * _BUCKET_M
    # The start is an edge from nowhere.
    edge_parent[0], edge_move[0], edge_next[0], heads[0] = -1, 0, -1, 0
    n, n_edges, lowest, highest = 0, 1, 0, -1
    nearest, best, best_parent, best_is_direct = np.inf, np.inf, -1, False
    legs, metres = np.zeros(3, np.int64), np.zeros(3, np.int64)
    no_legs = np.empty(0, np.int64)
    while True:
        # 1. Find the cheapest edge, and end the search if the best one to the goal is as good.
        while lowest < _N_BUCKETS and heads[lowest] < 0:
            lowest += 1
        tolerance = min(o.goal_tolerance + o.tolerance_growth * n, _MAX_TOLERANCE_M)
        if best - tolerance < (lowest + 1) * _BUCKET_M:
            way, way_metres = _legs_to(best_parent, parents, moves)
            if best_is_direct:
                x, y, z = pose[best_parent, 0], pose[best_parent, 1], pose[best_parent, 2]
                direct_legs(
                    x, y, z, start[3], goal, goal_yaw, 0.0, np.inf, o.radius, o.approach, o.prefer, grid,
                    way[-3:], way_metres[-3:],
                )  # fmt: skip
            return FOUND, n, way, way_metres
        if lowest == _N_BUCKETS:
            return EXHAUSTED, n, no_legs, no_legs
        # 2. Take it.
        if lowest > highest:
            highest = lowest
            s.highest[0] = f0 + (lowest + 1) * _BUCKET_M
        entry, level = heads[lowest], lowest
        heads[lowest] = edge_next[entry]
        parent, move = edge_parent[entry], int(edge_move[entry])
        # 3. Of a direction whose longer steps were deferred, push them now.
        clearance_known = move < 0
        if clearance_known:
            move = ~move
        if move >= _DEFERRED:
            move = (move - _DEFERRED) * N_STEPS
            px, py, pz = pose[parent, 0], pose[parent, 1], pose[parent, 2]
            turns = N_TURNS[wrap_heading(move // N_STEPS - int(headings[parent]))]
            for m in range(move + 1, move + N_STEPS):
                u, v = px + flights[m, 0], py + flights[m, 1]
                if not (lx <= u <= hx and ly <= v <= hy):
                    break
                h = cost_between(u, v, pz, ox, oy, oz, edge, cost_to_go)
                f = cost[parent] + flights[m, 3] + o.action_cost * (turns + 1) + o.weight * h - f0
                if f < f_max:
                    lowest = min(lowest, _push(f, parent, m, n_edges, edge_parent, edge_move, edge_next, heads))
                    n_edges += 1
        # 4. Follow the edge to its state; one that is closed already is not expanded again.
        x, y, z, heading, g = start[0], start[1], start[2], 0, 0.0
        if parent >= 0:
            px, py, pz, heading = pose[parent, 0], pose[parent, 1], pose[parent, 2], int(headings[parent])
            x, y, z, turns = px + flights[move, 0], py + flights[move, 1], pz + flights[move, 2], 0
            if move < N_FLAT:
                relative = wrap_heading(move // N_STEPS - heading)
                turns, heading = N_TURNS[relative], wrap_heading(heading + TURN_BY[relative] - N_HEADINGS)
            g = cost[parent] + flights[move, 3] + o.action_cost * (turns + 1)
        key = int((x - lx) / o.cell + 1.0)
        key = (key << 20) | int((y - ly) / o.cell + 1.0)
        key = (key << 20) | int((z - lz) / o.cell + 1.0)
        key = key * N_HEADINGS + heading * o.sectors // N_HEADINGS
        slot = ~_slot(key, now, keys, stamps)
        if slot < 0:
            continue
        # 5. Test the edge for collisions, and push it again if its clearance cost makes it dearer.
        if clearance_known:
            g += edge_extra[entry]
        elif parent >= 0:
            u, v, w = int((px + x) / 2 - ox), int((py + y) / 2 - oy), int((pz + z) / 2 - oz)
            blocker_slot = (u * 73 + v * 7919 + w * 104729) & (_N_BLOCKERS - 1)
            found = find_blocker(px, py, pz, x, y, z, o.radius, grid, False, blockers[blocker_slot])
            if found != FREE:
                blockers[blocker_slot] = found
                continue
            if near_weight > 0.0:
                extra = clearance_penalty(px, py, pz, x, y, z, near_m, near_weight, ox, oy, oz, edge, field)
                g += extra
                bucket = min(level + int(extra / _BUCKET_M), _N_BUCKETS - 1)
                if bucket > level:
                    edge_move[entry], edge_extra[entry] = ~move, extra
                    edge_next[entry], heads[bucket] = heads[bucket], entry
                    continue
        # 6. Close the state.
        if n >= o.budget:
            return BUDGET, n, no_legs, no_legs
        keys[slot], stamps[slot] = key, now
        pose[n, 0], pose[n, 1], pose[n, 2] = x, y, z
        cost[n], headings[n], moves[n], parents[n] = g, heading, move, parent
        # 7. Keep the best edge to the goal: the Approach, or the direct path.
        gap = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2 + (z - goal[2]) ** 2)
        if gap <= o.approach and segment_free(x, y, z, goal[0], goal[1], goal[2], o.radius, grid, False):
            f = g + gap + o.action_cost * (turns_between(heading, goal_heading) + 1) - f0
            f += approach_penalty(
                goal[0] - x, goal[1] - y, goal_yaw, gap, o.prefer.ahead_cos, o.prefer.approach_penalty
            )
            f += clearance_penalty(x, y, z, goal[0], goal[1], goal[2], near_m, near_weight, ox, oy, oz, edge, field)
            if f < best:
                best, best_parent, best_is_direct = f, n, False
        h = cost_between(x, y, z, ox, oy, oz, edge, cost_to_go)
        direct, extra = np.inf, 0.0
        max_direct = best + f0 - g - _MIN_GAIN_M
        if h <= max_direct and (h < nearest or n % _DIRECT_EVERY == 0):
            direct, extra = direct_legs(
                x, y, z, start[3], goal, goal_yaw, h, max_direct, o.radius, o.approach, o.prefer, grid, legs, metres
            )  # fmt: skip
        nearest = min(nearest, h)
        if direct < np.inf:
            f = g + direct + _CLEARANCE_FACTOR * extra - f0
            f += o.action_cost * count_actions(heading, goal_heading, legs, metres)
            if f < best:
                best, best_parent, best_is_direct = f, n, True
        f_max = min(f_max, best - tolerance)
        # 8. Push the translations: in every direction the steps that stay inside, then up and down.
        f_near = g + o.weight * h - f0 + _DEFER_MARGIN_M
        for m in range(0, N_FLAT, N_STEPS):
            turns = N_TURNS[wrap_heading(m // N_STEPS - heading)]
            for step in range(N_STEPS):
                u, v = x + flights[m + step, 0], y + flights[m + step, 1]
                if not (lx <= u <= hx and ly <= v <= hy):
                    break
                h = cost_between(u, v, z, ox, oy, oz, edge, cost_to_go)
                f = g + flights[m + step, 3] + o.action_cost * (turns + 1) + o.weight * h - f0
                deferred = step == 0 and f > f_near
                if f < f_max:
                    kind = _DEFERRED + m // N_STEPS if deferred else m + step
                    lowest = min(lowest, _push(f, n, kind, n_edges, edge_parent, edge_move, edge_next, heads))
                    n_edges += 1
                if deferred:
                    break
        for m in range(N_FLAT, N_TRANSLATIONS):
            w = z + flights[m, 2]
            if not lz <= w <= hz:
                continue
            h = cost_between(x, y, w, ox, oy, oz, edge, cost_to_go)
            f = g + flights[m, 3] + o.action_cost + o.weight * h - f0
            if f < f_max:
                lowest = min(lowest, _push(f, n, m, n_edges, edge_parent, edge_move, edge_next, heads))
                n_edges += 1
        n += 1
