"""Hybrid A* over the 4-DoF action set (paper, section on reference trajectories), as a numba kernel.

A state is (x, y, z, heading): positions are continuous, headings 15° apart from the start's yaw, duplicates are
states of one cell and heading sector. An edge is a translation together with the turns that it needs: to fly in any
of the 24 directions the body turns until that direction lies ahead, to its left or to its right, whichever takes
fewer turns. Turning adds nothing to the length, so every action carries a small cost that breaks ties. The Approach,
with the turns before it, is an edge to the goal like any other.

Edges are put on the open list unchecked and tested for collisions when they are taken off it, for most never are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.planning.cost_to_go import cost_at
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, segment_free
from aerialdojo_gen.planning.primitives import N_HEADINGS, QUARTER, TURN_RAD

# A translation is direction * 3 + step for the horizontal ones, then up 1 and 2 m, down 1 and 2 m, then the Approach.
STEPS_M = np.array([1.0, 3.0, 5.0])
N_STEPS = 3
N_FLAT = N_HEADINGS * N_STEPS
LIFTS_M = np.array([1.0, 2.0, -1.0, -2.0])
N_TRANSLATIONS = N_FLAT + 4
_TO_GOAL = N_TRANSLATIONS

FOUND, EXHAUSTED, BUDGET = 0, 1, 2

_BUCKET_M = 0.02
_N_BUCKETS = 8192
_HASH = np.uint64(0x9E3779B97F4A7C15)


class SearchArrays(NamedTuple):
    """Memory of a search, made once and used again for every plan.

    Attributes
    ----------
    pose : (n, 3) float64
        Position of every expanded state, metres.
    cost : (n,) float64
        Cost from the start.
    heading, move : (n,) int8
        Heading, and the translation that led here.
    parent : (n,) int32
        Expanded state before it, -1 for the start.
    edge_parent, edge_move, edge_next : arrays
        Open edges, as linked lists.
    heads : (_N_BUCKETS,) int32
        First edge of every bucket, -1 for none.
    keys : (power of two,) int64
        Hash table of closed states.
    stamps : (power of two,) int32
        Search that wrote a slot of the table.
    clock : (1,) int32
        Number of the search.
    """

    pose: NDArray[np.float64]
    cost: NDArray[np.float64]
    heading: NDArray[np.int8]
    move: NDArray[np.int8]
    parent: NDArray[np.int32]
    edge_parent: NDArray[np.int32]
    edge_move: NDArray[np.int8]
    edge_next: NDArray[np.int32]
    heads: NDArray[np.int32]
    keys: NDArray[np.int64]
    stamps: NDArray[np.int32]
    clock: NDArray[np.int32]


class SearchOptions(NamedTuple):
    """How to search.

    Attributes
    ----------
    radius : float
        Radius that must stay clear, metres.
    weight : float
        Of the cost-to-go; 1 is plain A*.
    action_cost : float
        Cost of an action beside the metres that it flies.
    approach : float
        Longest Approach, metres.
    budget : int
        Most expansions.
    cell : float
        Edge of the cells that tell duplicates, metres.
    sectors : int
        Heading sectors that tell duplicates, a divisor of 24.
    """

    radius: float
    weight: float
    action_cost: float
    approach: float
    budget: int
    cell: float
    sectors: int


def make_search_arrays(budget: int) -> SearchArrays:
    """Reserve memory for searches of up to `budget` expansions; pages never written cost nothing."""
    n, edges = budget + 2, (budget + 2) * (N_TRANSLATIONS + 1)
    slots = 1 << max(10, math.ceil(math.log2(4 * n)))
    return SearchArrays(
        np.empty((n, 3)), np.empty(n), np.empty(n, np.int8), np.empty(n, np.int8), np.empty(n, np.int32),
        np.empty(edges, np.int32), np.empty(edges, np.int8), np.empty(edges, np.int32),
        np.full(_N_BUCKETS, -1, np.int32), np.empty(slots, np.int64), np.zeros(slots, np.int32),
        np.zeros(1, np.int32),
    )  # fmt: skip


@njit(cache=True, inline="always")
def turns_between(a: int, b: int) -> int:
    """Fewest turns from heading a to heading b."""
    d = (b - a) % N_HEADINGS
    return min(d, N_HEADINGS - d)


@njit(cache=True, inline="always")
def _heading_for(heading: int, direction: int) -> tuple[int, int]:
    """Heading, and number of turns, from which a body at `heading` can fly in `direction`; ahead wins ties."""
    best, turns = direction, turns_between(heading, direction)
    for side in (-QUARTER, QUARTER):
        candidate = (direction + side) % N_HEADINGS
        n = turns_between(heading, candidate)
        if n < turns:
            best, turns = candidate, n
    return best, turns


@njit(cache=True)
def _close(key: int, s: SearchArrays, insert: bool) -> bool:
    """Whether a key is closed in this search; with `insert` it is closed afterwards."""
    mask = s.keys.shape[0] - 1
    slot = int((np.uint64(key) * _HASH) >> np.uint64(32)) & mask
    now = s.clock[0]
    while s.stamps[slot] == now:
        if s.keys[slot] == key:
            return True
        slot = (slot + 1) & mask
    if insert:
        s.stamps[slot] = now
        s.keys[slot] = key
    return False


@njit(cache=True, inline="always")
def _key(x: float, y: float, z: float, heading: int, low: NDArray[np.float64], o: SearchOptions) -> int:
    i = int((x - low[0]) / o.cell + 1.0)
    j = int((y - low[1]) / o.cell + 1.0)
    k = int((z - low[2]) / o.cell + 1.0)
    return (((i << 20) | j) << 20 | k) * N_HEADINGS + heading * o.sectors // N_HEADINGS


@njit(cache=True, inline="always")
def _step(move: int, cos: NDArray[np.float64], sin: NDArray[np.float64]) -> tuple[float, float, float]:
    if move < N_FLAT:
        d, length = move // N_STEPS, STEPS_M[move % N_STEPS]
        return cos[d] * length, sin[d] * length, 0.0
    return 0.0, 0.0, LIFTS_M[move - N_FLAT]


@njit(cache=True)
def search(
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    goal_heading: int,
    cost_to_go: NDArray[np.float32],
    grid: GridArrays,
    s: SearchArrays,
    o: SearchOptions,
) -> tuple[int, int, NDArray[np.int8]]:
    """Find a short way from a start pose to the goal.

    Parameters
    ----------
    start : (4,) float64
        x, y, z in metres, and yaw in radians; free.
    goal : (3,) float64
        Metres; free.
    goal_heading : int
        Heading to end with, counted from the start's yaw.
    cost_to_go : (nx, ny, nz) float32
        Of the goal, metres.
    grid : GridArrays
        The clearance grid.
    s : SearchArrays
        Memory.
    o : SearchOptions
        How to search.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED (no state is left) or BUDGET.
    expansions : int
        Expanded states.
    moves : (n,) int8
        Translations from the start to within reach of the goal, without the Approach.
    """
    cos, sin = np.empty(N_HEADINGS), np.empty(N_HEADINGS)
    for d in range(N_HEADINGS):
        cos[d], sin[d] = math.cos(start[3] + d * TURN_RAD), math.sin(start[3] + d * TURN_RAD)
    s.clock[0] += 1
    s.heads[:] = -1
    f0 = o.weight * cost_at(start[0], start[1], start[2], grid, cost_to_go) - 5.0
    lowest = _N_BUCKETS
    n_edges = 0
    n = 0
    # The start is an edge from nowhere.
    s.edge_parent[0], s.edge_move[0], s.edge_next[0] = -1, 0, -1
    s.heads[0] = 0
    n_edges, lowest = 1, 0
    none = np.empty(0, np.int8)
    while True:
        while lowest < _N_BUCKETS and s.heads[lowest] < 0:
            lowest += 1
        if lowest == _N_BUCKETS:
            return EXHAUSTED, n, none
        edge = s.heads[lowest]
        s.heads[lowest] = s.edge_next[edge]
        parent, move = s.edge_parent[edge], int(s.edge_move[edge])
        if move == _TO_GOAL:
            count = 0
            node = parent
            while s.parent[node] >= 0:
                count += 1
                node = s.parent[node]
            moves = np.empty(count, np.int8)
            node = parent
            while s.parent[node] >= 0:
                count -= 1
                moves[count] = s.move[node]
                node = s.parent[node]
            return FOUND, n, moves
        x, y, z, heading, g = start[0], start[1], start[2], 0, 0.0
        if parent >= 0:
            dx, dy, dz = _step(move, cos, sin)
            px, py, pz = s.pose[parent, 0], s.pose[parent, 1], s.pose[parent, 2]
            x, y, z = px + dx, py + dy, pz + dz
            heading, turns = int(s.heading[parent]), 0
            length = abs(dz)
            if move < N_FLAT:
                heading, turns = _heading_for(heading, move // N_STEPS)
                length = STEPS_M[move % N_STEPS]
            g = s.cost[parent] + length + o.action_cost * (turns + 1)
            key = _key(x, y, z, heading, grid.lower, o)
            if _close(key, s, False) or not segment_free(px, py, pz, x, y, z, o.radius, grid, False):
                continue
        if n >= o.budget:
            return BUDGET, n, none
        _close(_key(x, y, z, heading, grid.lower, o), s, True)
        s.pose[n, 0], s.pose[n, 1], s.pose[n, 2] = x, y, z
        s.cost[n], s.heading[n], s.move[n], s.parent[n] = g, heading, move, parent
        gap = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2 + (z - goal[2]) ** 2)
        if gap <= o.approach and segment_free(x, y, z, goal[0], goal[1], goal[2], o.radius, grid, False):
            f = g + gap + o.action_cost * (turns_between(heading, goal_heading) + 1)
            bucket = min(_N_BUCKETS - 1, max(0, int((f - f0) / _BUCKET_M)))
            s.edge_parent[n_edges], s.edge_move[n_edges] = n, _TO_GOAL
            s.edge_next[n_edges] = s.heads[bucket]
            s.heads[bucket] = n_edges
            n_edges += 1
            lowest = min(lowest, bucket)
        for m in range(N_TRANSLATIONS):
            dx, dy, dz = _step(m, cos, sin)
            u, v, w = x + dx, y + dy, z + dz
            if not inside(u, v, w, grid.lower, grid.upper):
                continue
            turns, length = 0, abs(dz)
            if m < N_FLAT:
                _, turns = _heading_for(heading, m // N_STEPS)
                length = STEPS_M[m % N_STEPS]
            h = cost_at(u, v, w, grid, cost_to_go)
            f = g + length + o.action_cost * (turns + 1) + o.weight * h - f0
            if not f < (_N_BUCKETS - 1) * _BUCKET_M:
                continue
            bucket = max(0, int(f / _BUCKET_M))
            s.edge_parent[n_edges], s.edge_move[n_edges] = n, m
            s.edge_next[n_edges] = s.heads[bucket]
            s.heads[bucket] = n_edges
            n_edges += 1
            lowest = min(lowest, bucket)
        n += 1
