"""Hybrid A* over the 4-DoF action set (paper, section on reference trajectories), as a numba kernel.

A state is (x, y, z, heading): positions are continuous, headings 15° apart from the start's yaw, duplicates are
states of one cell and heading sector. An edge is a translation together with the turns that it needs: to fly in any
of the 24 directions the body turns until that direction lies ahead, to its left or to its right, whichever takes
fewer turns. Turning adds nothing to the length, so every action carries a small cost that breaks ties. The Approach,
with the turns before it, is an edge to the goal like any other, and so is the direct way
(`aerialdojo_gen.planning.direct`), which ends most searches long before they would have walked there.

Edges are put on the open list unchecked and tested for collisions when they are taken off it, for most never are.
What they cost beside their metres, for flying near surfaces, is found out then too: an edge that costs more goes back
on the list, to where it belongs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.motion import N_HEADINGS, TURN_RAD
from aerialdojo_gen.planning.cost_to_go import cost_at, cost_between
from aerialdojo_gen.planning.direct import direct_legs
from aerialdojo_gen.planning.grid_kernels import FREE, GridArrays, segment_free, what_blocks
from aerialdojo_gen.planning.preference import Preference, approach_penalty, clearance_penalty
from aerialdojo_gen.planning.translations import (
    LIFTS_M,
    N_FLAT,
    N_STEPS,
    N_TRANSLATIONS,
    N_TURNS,
    STEPS_M,
    TURN_BY,
    actions_of,
    turns_between,
    with_legs,
    wrap_heading,
)

# Ways to the goal: the Approach alone, and the direct way.
_TO_GOAL, _DIRECT = N_TRANSLATIONS, N_TRANSLATIONS + 1
# Once one is known, others are looked for where they may be cheaper by this.
_BETTER_M = 0.1
# It is tried from states that are nearer than all before, and from one in so many others.
_TRIED = 4
# What it costs for the surfaces that it comes near counts so many times: the search may yet find more room.
_CARE = 3.0
# A step that leads away from where the search goes, by so much: longer ones that way are thought of when it is taken.
_LONGER, _SPREAD_M = 100, 0.3

FOUND, EXHAUSTED, BUDGET = 0, 1, 2

_BUCKET_M = 0.02
_N_BUCKETS = 8192
# As `grid_kernels.inside` allows.
_ROUNDING_M = 1e-9
# Most edges that the grid does not prove free are blocked, four in five of them by what blocked one close by before.
_N_BLOCKERS = 4096
_HASH = np.uint64(0x9E3779B97F4A7C15)


class SearchArrays(NamedTuple):
    """Memory of a search, made once and used again for every plan."""

    pose: NDArray[np.float64]  # (n, 3) float64; position of every expanded state, metres
    cost: NDArray[np.float64]  # (n,) float64; cost from the start
    heading: NDArray[np.int8]  # (n,) int8; heading, and the translation that led here
    move: NDArray[np.int8]
    parent: NDArray[np.int32]  # (n,) int32; expanded state before it, -1 for the start
    edge_parent: NDArray[np.int32]
    edge_move: NDArray[np.int8]
    edge_next: NDArray[np.int32]
    edge_extra: NDArray[np.float32]  # (m,) float32; what such an edge costs beside its metres
    heads: NDArray[np.int32]  # (_N_BUCKETS,) int32; first edge of every bucket, -1 for none
    keys: NDArray[np.int64]  # (power of two,) int64; hash table of closed states
    stamps: NDArray[np.int32]  # (power of two,) int32; search that wrote a slot of the table
    clock: NDArray[np.int32]  # (1,) int32; number of the search
    highest: NDArray[np.float64]  # (1,) float64
    blockers: NDArray[np.int32]  # Triangle that blocked an edge last, by where the edge's middle is; -1 for none


class SearchOptions(NamedTuple):
    """How to search."""

    radius: float  # Radius that must stay clear, metres
    weight: float  # Of the cost-to-go; 1 is plain A*
    action_cost: float  # Cost of an action beside the metres that it flies
    approach: float  # Longest Approach, metres
    budget: int  # Most expansions
    cell: float  # Edge of the cells that tell duplicates, metres
    sectors: int  # Heading sectors that tell duplicates, a divisor of 24
    sideways: float
    prefer: Preference  # What costs beside metres and actions
    goal_tolerance: float  # A way to the goal is taken though another may be cheaper by this, metres


def make_search_arrays(budget: int) -> SearchArrays:
    """Reserve memory for searches of up to `budget` expansions; pages never written cost nothing."""
    n, edges = budget + 2, (budget + 2) * (N_TRANSLATIONS + 2)
    slots = 1 << max(10, math.ceil(math.log2(4 * n)))
    return SearchArrays(
        np.empty((n, 3)), np.empty(n), np.empty(n, np.int8), np.empty(n, np.int8), np.empty(n, np.int32),
        np.empty(edges, np.int32), np.empty(edges, np.int8), np.empty(edges, np.int32), np.empty(edges, np.float32),
        np.full(_N_BUCKETS, -1, np.int32), np.empty(slots, np.int64), np.zeros(slots, np.int32),
        np.zeros(1, np.int32), np.zeros(1), np.empty(_N_BLOCKERS, np.int32),
    )  # fmt: skip


@njit(cache=True)
def _slot(key: int, now: int, keys: NDArray[np.int64], stamps: NDArray[np.int32]) -> int:
    """Where in the table of closed states a key stands, as it is written, or ~slot of where it would."""
    mask = keys.shape[0] - 1
    # The high bits of the product are the well mixed ones.
    slot = int((np.uint64(key) * _HASH) >> np.uint64(40)) & mask
    while stamps[slot] == now:
        if keys[slot] == key:
            return slot
        slot = (slot + 1) & mask
    return ~slot


@njit(cache=True, inline="always")
def _place(x: float, y: float, z: float) -> int:
    """Where the triangle that blocked an edge is remembered, given the edge's middle in metres."""
    return (int(x) * 73 + int(y) * 7919 + int(z) * 104729) & (_N_BLOCKERS - 1)


@njit(cache=True)
def _moves_to(node: int, parents: NDArray[np.int32], moves: NDArray[np.int8]) -> NDArray[np.int8]:
    """Translations from the start to an expanded state."""
    count, last = 0, node
    while parents[last] >= 0:
        count += 1
        last = parents[last]
    found = np.empty(count, np.int8)
    while parents[node] >= 0:
        count -= 1
        found[count] = moves[node]
        node = parents[node]
    return found


@njit(cache=True, error_model="numpy")
def search(
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    goal_heading: int,
    cost_to_go: NDArray[np.float32],
    grid: GridArrays,
    s: SearchArrays,
    o: SearchOptions,
) -> tuple[int, int, NDArray[np.int8]]:
    """Search a short way from a pose (4,) to a goal (3,): status, expansions and moves (n,) without the Approach."""
    flights = np.zeros((N_TRANSLATIONS, 4))  # dx, dy, dz and length of every translation
    for m in range(N_FLAT):
        angle, length = start[3] + m // N_STEPS * TURN_RAD, STEPS_M[m % N_STEPS]
        flights[m, 0], flights[m, 1], flights[m, 3] = math.cos(angle) * length, math.sin(angle) * length, length
    for m in range(N_FLAT, N_TRANSLATIONS):
        flights[m, 2], flights[m, 3] = LIFTS_M[m - N_FLAT], abs(LIFTS_M[m - N_FLAT])
    # Scalars and plain arrays: a tuple of arrays costs more to hand over than the inner loop's work.
    pose, cost, headings, moves, parents = s.pose, s.cost, s.heading, s.move, s.parent
    edge_parent, edge_move, edge_next, edge_extra, heads, keys, stamps, blockers = (
        s.edge_parent, s.edge_move, s.edge_next, s.edge_extra, s.heads, s.keys, s.stamps, s.blockers
    )  # fmt: skip
    room, tightness, field = o.prefer.clearance, o.prefer.weight, grid.field
    goal_yaw = start[3] + goal_heading * TURN_RAD
    ox, oy, oz, edge = grid.origin[0], grid.origin[1], grid.origin[2], grid.cell
    lx, ly, lz = grid.lower[0] - _ROUNDING_M, grid.lower[1] - _ROUNDING_M, grid.lower[2] - _ROUNDING_M
    hx, hy, hz = grid.upper[0] + _ROUNDING_M, grid.upper[1] + _ROUNDING_M, grid.upper[2] + _ROUNDING_M
    s.clock[0] += 1
    now = s.clock[0]
    heads[:], blockers[:] = -1, -1
    f0 = o.weight * cost_at(start[0], start[1], start[2], grid, cost_to_go) - 5.0
    f_most = (_N_BUCKETS - 1) * _BUCKET_M
    # The start is an edge from nowhere.
    edge_parent[0], edge_move[0], edge_next[0], heads[0] = -1, 0, -1, 0
    n, n_edges, lowest, highest = 0, 1, 0, -1
    nearest = np.inf
    legs, metres = np.zeros(3, np.int64), np.zeros(3, np.int64)
    none = np.empty(0, np.int8)
    while True:
        while lowest < _N_BUCKETS and heads[lowest] < 0:
            lowest += 1
        if lowest == _N_BUCKETS:
            return EXHAUSTED, n, none
        if lowest > highest:
            highest = lowest
            s.highest[0] = f0 + (lowest + 1) * _BUCKET_M
        taken, level = heads[lowest], lowest
        heads[lowest] = edge_next[taken]
        parent, move = edge_parent[taken], int(edge_move[taken])
        if move == _TO_GOAL:
            return FOUND, n, _moves_to(parent, parents, moves)
        if move == _DIRECT:
            x, y, z = pose[parent, 0], pose[parent, 1], pose[parent, 2]
            direct_legs(
                x, y, z, start[3], goal, goal_yaw, 0.0, np.inf, o.radius, o.approach, o.prefer, grid, legs, metres
            )  # fmt: skip
            return FOUND, n, with_legs(_moves_to(parent, parents, moves), legs, metres)
        known = move < 0
        if known:
            move = ~move
        if move >= _LONGER:
            move = (move - _LONGER) * N_STEPS
            px, py, pz = pose[parent, 0], pose[parent, 1], pose[parent, 2]
            turns = N_TURNS[wrap_heading(move // N_STEPS - int(headings[parent]))]
            for m in range(move + 1, move + N_STEPS):
                u, v = px + flights[m, 0], py + flights[m, 1]
                if not (lx <= u <= hx and ly <= v <= hy):
                    break
                h = cost_between(u, v, pz, ox, oy, oz, edge, cost_to_go)
                f = cost[parent] + flights[m, 3] + o.action_cost * (turns + 1) + o.weight * h - f0
                if f < f_most:
                    bucket = max(0, int(f / _BUCKET_M))
                    edge_parent[n_edges], edge_move[n_edges], edge_next[n_edges] = parent, m, heads[bucket]
                    heads[bucket] = n_edges
                    n_edges += 1
                    lowest = min(lowest, bucket)
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
        if known:
            g += edge_extra[taken]
        elif parent >= 0:
            place = _place((px + x) / 2 - ox, (py + y) / 2 - oy, (pz + z) / 2 - oz)
            found = what_blocks(px, py, pz, x, y, z, o.radius, grid, False, blockers[place])
            if found != FREE:
                blockers[place] = found
                continue
            if tightness > 0.0:
                extra = clearance_penalty(px, py, pz, x, y, z, room, tightness, ox, oy, oz, edge, field)
                g += extra
                bucket = min(level + int(extra / _BUCKET_M), _N_BUCKETS - 1)
                if bucket > level:
                    edge_move[taken], edge_extra[taken] = ~move, extra
                    edge_next[taken], heads[bucket] = heads[bucket], taken
                    continue
        if n >= o.budget:
            return BUDGET, n, none
        keys[slot], stamps[slot] = key, now
        pose[n, 0], pose[n, 1], pose[n, 2] = x, y, z
        cost[n], headings[n], moves[n], parents[n] = g, heading, move, parent
        gap = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2 + (z - goal[2]) ** 2)
        if gap <= o.approach and segment_free(x, y, z, goal[0], goal[1], goal[2], o.radius, grid, False):
            f = g + gap + o.action_cost * (turns_between(heading, goal_heading) + 1) - f0
            f += approach_penalty(
                goal[0] - x, goal[1] - y, goal_yaw, gap, o.prefer.ahead_cos, o.prefer.approach_penalty
            )
            f += clearance_penalty(x, y, z, goal[0], goal[1], goal[2], room, tightness, ox, oy, oz, edge, field)
            f -= o.goal_tolerance
            if f < f_most:
                f_most, bucket = f, max(0, int(f / _BUCKET_M))
                edge_parent[n_edges], edge_move[n_edges], edge_next[n_edges] = n, _TO_GOAL, heads[bucket]
                heads[bucket] = n_edges
                n_edges += 1
                lowest = min(lowest, bucket)
        h = cost_between(x, y, z, ox, oy, oz, edge, cost_to_go)
        direct, extra = np.inf, 0.0
        most = f_most + f0 + o.goal_tolerance - g - _BETTER_M
        if h <= most and (h < nearest or n % _TRIED == 0):
            direct, extra = direct_legs(
                x, y, z, start[3], goal, goal_yaw, h, most, o.radius, o.approach, o.prefer, grid, legs, metres
            )  # fmt: skip
        nearest = min(nearest, h)
        if direct < np.inf:
            f = g + direct + _CARE * extra - f0 - o.goal_tolerance
            f += o.action_cost * actions_of(heading, goal_heading, legs, metres)
            if f < f_most:
                f_most, bucket = f, max(0, int(f / _BUCKET_M))
                edge_parent[n_edges], edge_move[n_edges], edge_next[n_edges] = n, _DIRECT, heads[bucket]
                heads[bucket] = n_edges
                n_edges += 1
                lowest = min(lowest, bucket)
        f_near = g + o.weight * h - f0 + _SPREAD_M
        for m in range(0, N_FLAT, N_STEPS):
            turns = N_TURNS[wrap_heading(m // N_STEPS - heading)]
            for step in range(N_STEPS):
                u, v = x + flights[m + step, 0], y + flights[m + step, 1]
                if not (lx <= u <= hx and ly <= v <= hy):
                    break
                h = cost_between(u, v, z, ox, oy, oz, edge, cost_to_go)
                f = g + flights[m + step, 3] + o.action_cost * (turns + 1) + o.weight * h - f0
                later = step == 0 and f > f_near
                if f < f_most:
                    bucket = max(0, int(f / _BUCKET_M))
                    edge_parent[n_edges], edge_next[n_edges] = n, heads[bucket]
                    edge_move[n_edges] = _LONGER + m // N_STEPS if later else m + step
                    heads[bucket] = n_edges
                    n_edges += 1
                    lowest = min(lowest, bucket)
                if later:
                    break
        for m in range(N_FLAT, N_TRANSLATIONS):
            w = z + flights[m, 2]
            if not lz <= w <= hz:
                continue
            h = cost_between(x, y, w, ox, oy, oz, edge, cost_to_go)
            f = g + flights[m, 3] + o.action_cost + o.weight * h - f0
            if not f < f_most:
                continue
            bucket = max(0, int(f / _BUCKET_M))
            edge_parent[n_edges], edge_move[n_edges], edge_next[n_edges] = n, m, heads[bucket]
            heads[bucket] = n_edges
            n_edges += 1
            lowest = min(lowest, bucket)
        n += 1
