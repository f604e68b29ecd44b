import numpy as np
import pytest
from flying import town
from handmade import box, instance, scene
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.connectivity import MOVE_LENGTHS, MOVES
from aerialdojo_gen.planning.cost_to_go import cost_at, expand_cost, seed_goal


def field(grid, goal, bound=200.0):
    cost = np.full(grid.moves.shape, np.inf, np.float32)
    seeds = seed_goal(*goal, 1.0, grid.radius_m, grid.arrays, grid.moves, cost)
    final = expand_cost(seeds, np.empty((0, 3)), bound, 0.0, grid.arrays, grid.moves, cost)
    return cost, seeds, final


def test_it_is_dijkstras_on_the_same_graph():
    """The level ring and the canonical ordering against scipy's heap over every passable move."""
    grid = ClearanceGrid.build(town(half=12.0, ceiling=8.0, n=16))
    goal = next(p for p in [(0.1, 0.2, 1.4), (4, 4, 1.4), (-7, 2, 3.4)] if grid.reachable(p))
    cost, seeds, _ = field(grid, goal)
    shape = grid.moves.shape
    n = grid.moves.size
    i, j, k = np.indices(shape).reshape(3, -1)
    rows, columns, lengths = [], [], []
    for m, (dx, dy, dz) in enumerate(MOVES):
        has = ((grid.moves.ravel() >> np.uint32(m)) & 1).astype(bool)
        rows.append(np.flatnonzero(has))
        columns.append(np.ravel_multi_index((i[has] + dx, j[has] + dy, k[has] + dz), shape))
        lengths.append(np.full(has.sum(), MOVE_LENGTHS[m] * grid.arrays.cell))
    again = np.full(shape, np.inf, np.float32)
    seed_goal(*goal, 1.0, grid.radius_m, grid.arrays, grid.moves, again)
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
    # Move lengths are rounded to 2^-12 m, and a path has a few hundred of them.
    assert np.abs(expected[finite] - cost[finite]).max() < 0.02


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
    some, _, final = field(grid, (0.0, 0.0, 3.0), bound=8.0)
    assert 8.0 <= final <= 9.0
    assert (some[full <= final] == full[full <= final]).all()
    assert some[np.isfinite(some)].max() < final + 2.0


def test_it_ends_soon_after_the_last_start_is_reached():
    grid = ClearanceGrid.build(scene(half=20.0, ceiling=10.0))
    cost = np.full(grid.moves.shape, np.inf, np.float32)
    seeds = seed_goal(0.0, 0.0, 3.0, 1.0, grid.radius_m, grid.arrays, grid.moves, cost)
    final = expand_cost(seeds, np.array([[5.0, 0, 3], [0, 9.0, 3]]), 100.0, 2.0, grid.arrays, grid.moves, cost)
    assert cost_at(0.0, 9.0, 3.0, grid.arrays, cost) == pytest.approx(9.0, abs=0.1)
    assert 10.5 < final < 12.5
