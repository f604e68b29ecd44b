import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from support.flying import town
from support.handmade import scene

from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.connectivity import MOVES, move_lengths
from aerialdojo_gen.planning.cost_to_go import cost_at, expand_cost, lengths_at, seed_goal
from aerialdojo_gen.planning.preference import NO_PREFERENCE, Preference, clearance_cost_field


def field(grid, goal, bound=200.0, prefer=NO_PREFERENCE):
    cost = np.full(grid.moves.shape, np.inf, np.float32)
    seeds = seed_goal(*goal, 0.0, 1.0, grid.radius_m, grid.arrays, grid.moves, cost, prefer)
    clearance_cost = clearance_cost_field(grid.arrays.field, prefer)
    visits = expand_cost(seeds, bound, bound + 2.0, grid.arrays, grid.moves, cost, clearance_cost)
    return cost, seeds, visits


def small_town(ceiling):
    grid = ClearanceGrid.build(town(half=12.0, ceiling=ceiling, n=16))
    return grid, next(p for p in [(0.1, 0.2, 1.4), (4, 4, 1.4), (-7, 2, 3.4)] if grid.reachable(p))


@pytest.mark.parametrize("prefer", [NO_PREFERENCE, Preference(1.0, 2.0, 0.5, 3.0)])
@pytest.mark.parametrize("ceiling", [6.0, 8.0, 13.0])
def test_it_is_dijkstras_on_the_same_graph_to_the_bit(prefer, ceiling):
    """Visits to columns, lower and higher than a group of cells, against scipy's heap over every passable move."""
    grid, goal = small_town(ceiling)
    cost, seeds, _ = field(grid, goal, prefer=prefer)
    clearance_cost = clearance_cost_field(grid.arrays.field, prefer)
    again = np.full(cost.shape, np.inf, np.float32)
    seed_goal(*goal, 0.0, 1.0, grid.radius_m, grid.arrays, grid.moves, again, prefer)
    lengths, factors = (values.astype(float) for values in move_lengths(grid.arrays.cell))
    # From a node of its own the seeds are as far as they are from the goal.
    rows, columns, costs = [np.full(len(seeds), cost.size)], [seeds], [again.ravel()[seeds]]
    for m, move in enumerate(MOVES):
        cells = np.argwhere(grid.moves >> np.uint32(m) & 1)
        rows.append(np.ravel_multi_index(cells.T, cost.shape))
        columns.append(np.ravel_multi_index((cells + move).T, cost.shape))
        costs.append(lengths[m] + factors[m] * clearance_cost[tuple(cells.T)])
    graph = coo_array(
        (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=[cost.size + 1] * 2
    )
    expected = dijkstra(graph.tocsr(), indices=cost.size)[:-1].reshape(cost.shape)
    assert np.isfinite(expected).mean() > 0.5
    assert (expected == cost).all()


def test_what_is_not_metres_is_told_apart():
    """A cheapest path is no shorter than the shortest, and no dearer than the shortest is when it is paid for."""
    (grid, goal), prefer = small_town(8.0), Preference(1.0, 1.0, 0.5, 3.0)
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


def test_the_bound_is_kept_and_in_the_open_a_column_is_visited_once():
    grid = ClearanceGrid.build(scene(half=20.0, ceiling=10.0))
    full, _, visits = field(grid, (0.3, 0.2, 3.0))
    reached = np.isfinite(full).any(axis=2).sum()
    assert reached <= visits <= 1.03 * reached
    some, _, _ = field(grid, (0.3, 0.2, 3.0), bound=8.0)
    assert (some[full <= 8.0] == full[full <= 8.0]).all()
    # Beyond the bound only the vertical goes on, in columns that hold something within it.
    beyond = np.isfinite(some) & (some > 8.0)
    assert (some.min(axis=2)[beyond.any(axis=2)] <= 8.0).all()
