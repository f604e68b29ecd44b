"""Clearance and the Approach: what routes prefer, and what it may cost; how difficult they are."""

import math
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import METRES
from support.handmade import box, instance, scene

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.difficulty import difficulty_of, straight_lines_free
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.planning.preference import clearance_penalty
from aerialdojo_gen.store.schemas import APPROACH

RADIUS = 0.25


def off_heading(r):
    """Angle in space between a route's Approach and its final heading, degrees; 0 without an Approach."""
    if r.actions[-2] != APPROACH:
        return 0.0
    way = r.poses[-1, :3] - r.poses[-2, :3]
    ahead = np.array([math.cos(r.poses[-1, 3]), math.sin(r.poses[-1, 3]), 0.0])
    return math.degrees(math.acos(np.clip(way @ ahead / np.linalg.norm(way), -1.0, 1.0)))


def test_routes_keep_their_distance_and_fly_ahead_for_a_few_hundredths_of_length(planned):
    with_it, without = (
        [r for _, start, r in planned.rows(routes) if planned.planner.grid.distance_m(start[:3]) > 1.0]
        for routes in (planned.routes, planned.shortest)
    )
    assert len(with_it) > 30
    assert {r.outcome for r in with_it + without} == {"SOLVED"}
    far, near = (np.median([r.min_clearance_m for r in routes]) for routes in (with_it, without))
    assert far >= 0.6
    assert near < far - 0.1
    longer = sum(r.length_m for r in with_it) / sum(r.length_m for r in without)
    assert 1.0 <= longer < 1.06
    ahead, anyhow = (np.array([off_heading(r) for r in routes]) for routes in (with_it, without))
    assert (ahead <= 60.0 + 1e-6).mean() >= 0.99
    assert (anyhow > 90.0).mean() > 0.2


def test_a_goal_that_can_be_reached_from_its_front_alone_is_reached_so():
    # A niche that opens to the goal's front: from behind, from above and from the sides there is rock.
    walls = [box((-2, -3, 0), (-0.3, 3, 5)), box((-2, 0.9, 0), (2, 3, 5)), box((-2, -3, 0), (2, -0.9, 5)),
             box((-2, -3, 2.2), (2, 3, 5))]  # fmt: skip
    world = scene(instance("rock", *walls))
    (route,) = Planner(world, PlanConfig(), RADIUS).plan_target((0.0, 0.0, 1.0, 0.0), [(7.0, 4.0, 3.0, 1.0)])
    assert route.outcome == "SOLVED"
    assert off_heading(route) > 90.0


def test_walls_are_not_climbed_flush():
    """A house stands in the way: climbs to its roof keep off the wall, though hugging it is as short."""
    world = scene(instance("house", box((4, -12, 0), (10, 12, 6))), half=14.0, ceiling=12.0)
    starts = [(x, y, 2.0, 0.3) for x in np.linspace(-4.0, -2.0, 5) for y in (-3.0, 0.0, 3.0)]
    hugs, keeps = (
        Planner(world, config, RADIUS).plan_target((12.0, 0.3, 3.0, math.pi), starts)
        for config in (METRES, PlanConfig())
    )
    near, far = (np.array([r.min_clearance_m for r in routes]) for routes in (hugs, keeps))
    assert near.min() < 0.4
    assert far.min() > 0.6
    assert np.median(far) > 0.8
    assert sum(r.length_m for r in keeps) <= sum(r.length_m for r in hugs) + 1.05 * len(starts)


@lru_cache(maxsize=1)
def flat_ground():
    return ClearanceGrid.build(scene(half=10.0, ceiling=6.0)).arrays


plane = st.tuples(*[st.floats(-8, 8)] * 4)


@settings(max_examples=20, deadline=None)
@given(
    plane, st.one_of(st.tuples(*[st.floats(0.26, 0.74)] * 2), st.tuples(*[st.floats(1.5, 5)] * 2)), st.floats(0.1, 10)
)
def test_near_the_ground_the_cost_of_clearance_is_the_integral_and_far_from_it_nothing(xy, z, weight):
    grid, a, b = flat_ground(), (*xy[:2], z[0]), (*xy[2:], z[1])
    there, back = (
        clearance_penalty(*p, *q, 1.0, weight, *grid.origin, grid.cell, grid.field) for p, q in ((a, b), (b, a))
    )
    expected = weight * math.dist(a, b) * (1.0 - sum(z) / 2) if z[0] < 1.0 else 0.0
    assert there == pytest.approx(expected, rel=1e-3, abs=1e-3 if expected else 0.0)
    assert back == pytest.approx(there, rel=1e-6)


def test_difficulty_is_what_geometry_says(planned):
    grid, world, rows = planned.planner.grid, planned.planner.world, planned.rows()
    lengths = np.array([r.length_m for *_, r in rows])
    told = difficulty_of([r.poses for *_, r in rows], lengths, 1.0, RADIUS, grid, world)
    for k, ((goal, start, r), (*_, other)) in enumerate(zip(rows, planned.rows(planned.shortest), strict=True)):
        assert np.linalg.norm(goal[:3] - start[:3]) - 1e-9 <= told.free_length_m[k]
        assert told.free_length_m[k] <= min(r.length_m, other.length_m) + 1e-9
        assert told.plan_detour[k] == pytest.approx(max(1.0, r.length_m / told.free_length_m[k]))
        steps = np.diff(r.poses[:, 2])
        assert told.climb_m[k] == pytest.approx(steps[steps > 0].sum())
        assert told.climb_m[k] >= max(0.0, goal[2] - start[2]) - 1e-9
        assert told.straight_line_free[k] != world.segment_in_collision(start[:3], goal[:3], RADIUS)
    assert 0.1 < told.straight_line_free.mean() < 0.9
    ends = np.random.default_rng(2).uniform([-17, -17, 0.3], [17, 17, 11], (2, 300, 3))
    free = straight_lines_free(*ends, RADIUS, grid, world)
    assert free.tolist() == [not world.segment_in_collision(p, q, RADIUS) for p, q in zip(*ends, strict=True)]
    assert 30 < free.sum() < 270
