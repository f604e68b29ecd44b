import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from support.flying import town
from support.handmade import box, instance, scene

from aerialdojo_gen.planning.attempt import lengths_at
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.connectivity import MOVE_LENGTHS, MOVES
from aerialdojo_gen.planning.cost_to_go import columns_by_distance, cost_at, expand_cost, seed_goal
from aerialdojo_gen.planning.preference import NO_PREFERENCE, Preference, clearance_cost_field


def field(grid, goal, bound=200.0, prefer=NO_PREFERENCE):
    cost = np.full(grid.moves.shape, np.inf, np.float32)
    seeds = seed_goal(*goal, 0.0, 1.0, grid.radius_m, grid.arrays, grid.moves, cost, prefer)
    order = columns_by_distance(math.ceil((bound + 2.0) / grid.arrays.cell))
    clearance_cost = clearance_cost_field(grid.arrays.field, prefer)
    visits = expand_cost(seeds, order, bound, grid.arrays.cell, grid.moves, cost, clearance_cost)
    return cost, seeds, visits


@pytest.mark.parametrize("prefer", [NO_PREFERENCE, Preference(1.0, 2.0, 0.5, 3.0)])
@pytest.mark.parametrize("ceiling", [6.0, 8.0, 13.0])
def test_it_is_dijkstras_on_the_same_graph(prefer, ceiling):
    """Visits to columns, lower and higher than a group of cells, against scipy's heap over every passable move."""
    grid = ClearanceGrid.build(town(half=12.0, ceiling=ceiling, n=16))
    goal = next(p for p in [(0.1, 0.2, 1.4), (4, 4, 1.4), (-7, 2, 3.4)] if grid.reachable(p))
    cost, seeds, _ = field(grid, goal, prefer=prefer)
    clearance_cost = clearance_cost_field(grid.arrays.field, prefer).ravel()
    shape = grid.moves.shape
    n = grid.moves.size
    i, j, k = np.indices(shape).reshape(3, -1)
    rows, columns, lengths = [], [], []
    for m, (dx, dy, dz) in enumerate(MOVES):
        has = ((grid.moves.ravel() >> np.uint32(m)) & 1).astype(bool)
        rows.append(np.flatnonzero(has))
        columns.append(np.ravel_multi_index((i[has] + dx, j[has] + dy, k[has] + dz), shape))
        lengths.append(MOVE_LENGTHS[m] * grid.arrays.cell * (1.0 + clearance_cost[has]))
    again = np.full(shape, np.inf, np.float32)
    seed_goal(*goal, 0.0, 1.0, grid.radius_m, grid.arrays, grid.moves, again, prefer)
    source = np.full(len(seeds), n)
    rows.append(source)
    columns.append(seeds)
    lengths.append(again.ravel()[seeds] + 1e-9)
    graph = coo_array(
        (np.concatenate(lengths), (np.concatenate(rows), np.concatenate(columns))), shape=(n + 1, n + 1)
    ).tocsr()
    expected = dijkstra(graph, indices=n)[:n].reshape(shape)
    assert (np.isfinite(expected) == np.isfinite(cost)).all()
    finite = np.isfinite(expected)
    assert finite.mean() > 0.5
    # Move lengths are rounded to 2^-12 m, and a path has a few hundred of them; what narrowness adds, to a hundredth.
    assert np.abs(expected[finite] - cost[finite]).max() < (0.02 if prefer.weight == 0.0 else 0.1)


def test_what_is_not_metres_is_told_apart():
    """A cheapest path is no shorter than the shortest, and no dearer than the shortest is when it is paid for."""
    grid, prefer = ClearanceGrid.build(town(half=12.0, ceiling=8.0, n=16)), Preference(1.0, 1.0, 0.5, 3.0)
    goal = next(p for p in [(0.1, 0.2, 1.4), (4, 4, 1.4), (-7, 2, 3.4)] if grid.reachable(p))
    plain, _, _ = field(grid, goal)
    cost, _, _ = field(grid, goal, prefer=prefer)
    clearance_cost = clearance_cost_field(grid.arrays.field, prefer)
    centres = np.argwhere(np.isfinite(plain))[::37]
    points = grid.arrays.origin + (centres + 0.5) * grid.arrays.cell
    values = lengths_at(points, np.array(goal, float), grid.arrays, grid.moves, cost, clearance_cost)
    shortest = np.array([cost_at(*p, grid.arrays, plain) for p in points])
    dearest = np.array([cost_at(*p, grid.arrays, cost) for p in points])
    assert len(points) > 200
    assert (values >= shortest - 1e-3).all()
    assert (values <= dearest + 1e-3).all()
    assert (values < dearest - 0.1).mean() > 0.3
    # No preference, nothing to tell apart.
    zero = clearance_cost_field(grid.arrays.field, NO_PREFERENCE)
    assert lengths_at(points, np.array(goal, float), grid.arrays, grid.moves, plain, zero) == pytest.approx(
        shortest, abs=1e-3
    )


def test_in_the_open_it_is_the_action_metric_up_to_the_grids_directions():
    grid = ClearanceGrid.build(scene(half=20.0, ceiling=15.0))
    goal = np.array([3.3, -2.1, 4.2])
    cost, _, _ = field(grid, goal)
    points = np.random.default_rng(0).uniform([-19, -19, 1], [19, 19, 14], (400, 3))
    delta = np.abs(points - goal)
    metric = np.hypot(delta[:, 0], delta[:, 1]) + delta[:, 2]
    value = np.array([cost_at(*p, grid.arrays, cost) for p in points])
    far = metric > 3
    # The last metre goes straight, which can save (sqrt 2 - 1) m; 16 directions cost up to 2.8 % of the flat way.
    assert (value[far] >= metric[far] - 0.45).all()
    assert (value[far] <= metric[far] * 1.028 + 0.1).all()


def test_a_sealed_box_is_never_entered():
    walls = [box((2, 2, -0.1), (8, 2.2, 4)), box((2, 7.8, -0.1), (8, 8, 4)), box((2, 2, -0.1), (2.2, 8, 4)),
             box((7.8, 2, -0.1), (8, 8, 4)), box((2, 2, 3.8), (8, 8, 4))]  # fmt: skip
    grid = ClearanceGrid.build(scene(instance("room", *walls)))
    cost, _, _ = field(grid, (5.0, 5.0, 1.5))
    inside = cost[np.isfinite(cost)]
    assert len(inside) > 100
    assert inside.max() < 12
    assert not np.isfinite(cost_at(0.0, 0.0, 1.5, grid.arrays, cost))


def test_the_bound_is_kept_and_what_lies_within_is_final():
    grid = ClearanceGrid.build(scene(half=20.0, ceiling=10.0))
    full, _, _ = field(grid, (0.0, 0.0, 3.0))
    some, _, _ = field(grid, (0.0, 0.0, 3.0), bound=8.0)
    assert (some[full <= 8.0] == full[full <= 8.0]).all()
    # Beyond the bound only the vertical goes on, in columns that hold something within it.
    beyond = np.isfinite(some) & (some > 8.0)
    assert (some.min(axis=2)[beyond.any(axis=2)] <= 8.0).all()


def test_in_the_open_a_column_is_visited_once():
    grid = ClearanceGrid.build(scene(half=20.0, ceiling=10.0))
    cost, _, visits = field(grid, (0.3, 0.2, 3.0))
    reached = np.isfinite(cost).any(axis=2).sum()
    assert reached <= visits <= 1.03 * reached


def test_ways_back_round_a_wall_are_found():
    """Into a court with its gate on the far side: there visits must run against their first order."""
    walls = [box((3, -5, 0), (3.4, 5, 9.9)), box((3, -5, 0), (13, -4.6, 9.9)), box((3, 4.6, 0), (13, 5, 9.9)),
             box((3, -5, 7), (13, 5, 7.4)), box((12.6, -5, 0), (13, 3, 9.9))]  # fmt: skip
    grid = ClearanceGrid.build(scene(instance("court", *walls), half=20.0, ceiling=10.0))
    cost, _, _ = field(grid, (0.0, 0.0, 3.0))
    # Round the corner at (13, 5) and in by the gate between y = 3 and 4.6.
    assert 25 < cost_at(5.0, 0.0, 3.0, grid.arrays, cost) < 40
    assert cost_at(5.0, 0.0, 3.0, grid.arrays, cost) > cost_at(12.0, 3.8, 3.0, grid.arrays, cost) + 6
