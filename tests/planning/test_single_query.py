"""Single queries: the routes of the whole cost-to-go, found by a part of it."""

import math
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import free_poses, town
from support.handmade import box, instance, scene

from aerialdojo_gen.base.config.sections import PlanConfig, SearchAttempt
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.cost_to_go import Area, cost_at, expand, expand_cost, make_memory, seed_goal
from aerialdojo_gen.planning.planner import Planner, plan
from aerialdojo_gen.planning.preference import Preference, clearance_cost_field
from aerialdojo_gen.planning.query_field import _clear, make_path_arrays, short_path_cost

RADIUS = 0.25
PREFER = Preference(1.0, 1.2, 0.4, 3.0)


class Alone(Planner):
    """A planner that does not expand the whole cost-to-go."""

    def plan_target(self, goal, starts):
        raise AssertionError("the whole cost-to-go is asked for")


def same(one, other):
    assert one.outcome == other.outcome
    assert one.poses.tobytes() == other.poses.tobytes()
    assert one.actions.tobytes() == other.actions.tobytes()
    told = ("length_m", "expansions", "min_clearance_m", "cost_to_go_m", "attempts")
    assert [getattr(one, name) for name in told] == [getattr(other, name) for name in told]


@pytest.mark.parametrize("config", [PlanConfig(), PlanConfig(action_cost_m=0.5)])
def test_in_the_town_the_routes_are_those_of_the_whole_cost_to_go(config):
    """Also where actions cost half a metre: edges are taken that are much dearer than the grid's path."""
    whole, alone = Planner(town(), config, RADIUS), Alone(town(), config, RADIUS)
    rng = np.random.default_rng(4)
    for goal in free_poses(whole.grid, rng, 3):
        starts = free_poses(whole.grid, rng, 12)
        for start, route in zip(starts, whole.plan_target(goal, starts), strict=True):
            assert route.outcome == "SOLVED"
            same(alone.plan_one(goal, start), route)
    same(plan(town(), start, goal, config=config), route)


@st.composite
def worlds(draw):
    """A low or a high hall, less than a cell's block of vector lanes or some of them, with blocks and walls in it."""
    half, ceiling = draw(st.sampled_from([4.3, 9.0])), draw(st.sampled_from([1.7, 4.1, 9.0]))
    blocks = []
    for n in range(draw(st.integers(0, 7))):
        x, y = (draw(st.floats(-half, half)) for _ in range(2))
        w, d, h = (draw(st.floats(0.1, most)) for most in (half, half, ceiling))
        z = draw(st.sampled_from([0.0, 0.0, ceiling - h]))
        blocks.append(instance(f"block_{n}", box((x - w / 2, y - d / 2, z - 0.1), (x + w / 2, y + d / 2, z + h))))
    return scene(*blocks, half=half, ceiling=ceiling)


CONFIGS = [
    PlanConfig(),
    PlanConfig(clearance_weight=0.0, max_approach_angle_deg=180.0),
    PlanConfig(max_length_m=9.0, min_detour_ratio=1.05),
    PlanConfig(cell_m=0.8, ladder=(SearchAttempt(weight=1.4, budget=2_000),)),
    PlanConfig(ladder=(SearchAttempt(weight=0.97, budget=20_000, tolerance_growth_m=0.0),)),
]


@given(worlds(), st.sampled_from(CONFIGS), st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_in_any_world_what_becomes_of_a_query_is_the_same(world, config, seed):
    planner, rng = Planner(world, config, RADIUS), np.random.default_rng(seed)
    low, high = planner.grid.arrays.lower, planner.grid.arrays.upper
    # Anywhere: in solids and in sealed rooms too.
    ends = [np.array([*rng.uniform(low, high), rng.uniform(-math.pi, math.pi)]) for _ in range(6)]
    for goal, start in zip(ends[:3], ends[3:], strict=True):
        one = planner.plan_one(goal, start)
        (target,) = planner.plan_target(goal, [start])
        same(one, target)
        # And again, for the memory of a query has to be clean after it.
        same(planner.plan_one(goal, start), target)


@lru_cache(maxsize=1)
def ground():
    grid = ClearanceGrid.build(town())
    goal = next(p for p in np.array([[0.1, 0.2, 1.4], [4.0, 4.0, 1.4]]) if grid.reachable(p))
    clearance_cost = clearance_cost_field(grid.arrays.field, PREFER)
    whole = np.full(grid.moves.shape, np.inf, np.float32)
    seeds = seed_goal(*goal, 0.0, 1.0, grid.radius_m, grid.arrays, grid.moves, whole, PREFER)
    seeded = whole.ravel()[seeds]
    expand_cost(seeds, 100.0, 200.0, grid.arrays, grid.moves, whole, clearance_cost)
    return grid, goal, clearance_cost, whole, seeds, seeded


@pytest.mark.parametrize(("weight", "beyond"), [(1.0, 0.0), (1.05, 4.0), (1.6, 6.0)])
def test_within_reach_costs_are_those_of_the_whole_field_to_the_bit(weight, beyond):
    grid, goal, clearance_cost, whole, seeds, seeded = ground()
    cells, cost, memory = grid.arrays, np.full(whole.shape, np.inf, np.float32), make_memory(whole.shape)
    centres = [cells.origin[a] + (np.arange(n) + 0.5) * cells.cell for a, n in enumerate(whole.shape)]
    x, y, z = np.meshgrid(*centres, indexing="ij")
    for start in np.array([(14.0, -11.0, 2.0), (-13.2, 9.1, 6.5), (-4.0, -15.0, 0.9)]):
        reach = weight * cost_at(*start, cells, whole) + beyond
        away = np.hypot(x - start[0], y - start[1]) + abs(z - start[2])
        within = away + weight * whole.astype(float) <= reach - 1e-6
        assert within.sum() > 100
        for _ in range(2):
            cost.reshape(-1)[seeds] = seeded
            area = Area(start, goal, 1.0, weight, reach, 100.0, math.inf)
            n, _ = expand(seeds, area, cells, grid.moves, cost, clearance_cost, memory)
            assert (cost[within] == whole[within]).all()
            # Nothing is cheaper than it is, and most of the field is left alone.
            assert (cost >= whole).all()
            assert np.isfinite(cost).mean() < 0.7 * np.isfinite(whole).mean()
            _clear(n, seeds, cost, memory)
            assert np.isinf(cost).all()
            assert not memory.last.any()
            assert not memory.waiting.any()


def test_a_short_grid_path_is_little_longer_than_the_shortest():
    grid, _, clearance_cost, whole, seeds, seeded = ground()
    cost, arrays, ratios = np.full(whole.shape, np.inf, np.float32), make_path_arrays(), []

    def found(place, bound):
        cost.reshape(-1)[seeds] = seeded
        path = short_path_cost(seeds, *place, bound, grid.arrays, grid.moves, clearance_cost, cost, arrays)
        assert np.isinf(cost).all()
        assert (arrays.heads == -1).all()
        return path

    for place in np.random.default_rng(1).uniform([-17, -17, 0.5], [17, 17, 11], (70, 3)):
        if grid.reachable(place):
            path = found(place, 100.0)
            ratios.append(path / cost_at(*place, grid.arrays, whole))
            assert found(place, path / 1.2) == np.inf
    # Between cells the cost-to-go is interpolated, the path's is of one of them.
    assert len(ratios) > 50
    assert min(ratios) > 0.97
    assert max(ratios) < 1.1
    assert np.median(ratios) < 1.02
