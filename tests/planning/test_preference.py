"""Clearance and the Approach: what routes prefer, and what it may cost."""

import math
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import along, distances, solid, town
from support.handmade import box, instance, scene

from aerialdojo_gen.base.config.sections import PlanConfig, SearchAttempt
from aerialdojo_gen.dataset.episode import Reference, fly, spl_fault
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.difficulty import agent_actions, difficulty_of, straight_lines_free
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.planning.preference import clearance_penalty
from aerialdojo_gen.store.schemas import APPROACH

RADIUS = 0.25
# The shortest there is: the control that preferences are seen against.
INDIFFERENT = PlanConfig(
    clearance_weight=0.0,
    max_approach_angle_deg=180.0,
    ladder=(SearchAttempt(weight=1.05, budget=20_000, tolerance_growth_m=0.0),),
)


@lru_cache(maxsize=1)
def planned():
    """Routes of the town with the preferences and without: the planner, and (goal, start, with, without)."""
    prefers, does_not = Planner(town(), PlanConfig(), RADIUS), Planner(town(), INDIFFERENT, RADIUS)
    rng = np.random.default_rng(5)

    def pose():
        while True:
            p = rng.uniform([-17, -17, 0.5], [17, 17, 7])
            if prefers.grid.distance_m(p) > 1.0 and prefers.grid.reachable(p):
                return np.array([*p, rng.uniform(-math.pi, math.pi)])

    rows = []
    for _ in range(4):
        goal, starts = pose(), [pose() for _ in range(25)]
        ways = zip(starts, prefers.plan_target(goal, starts), does_not.plan_target(goal, starts), strict=True)
        rows += [(goal, *way) for way in ways]
    return prefers, rows


def clearances(routes):
    mesh = solid(town())
    return np.array([distances(mesh, along(r.poses[:, :3], 0.25)).min() for r in routes])


def off_heading(r):
    """Angle in space between a route's Approach and its final heading, degrees; 0 without an Approach."""
    if r.actions[-2] != APPROACH:
        return 0.0
    way = r.poses[-1, :3] - r.poses[-2, :3]
    ahead = np.array([math.cos(r.poses[-1, 3]), math.sin(r.poses[-1, 3]), 0.0])
    return math.degrees(math.acos(np.clip(way @ ahead / np.linalg.norm(way), -1.0, 1.0)))


def test_routes_keep_their_distance_for_a_few_hundredths_of_length():
    _, rows = planned()
    with_it, without = [r for *_, r, _ in rows], [r for *_, r in rows]
    assert {r.outcome for r in with_it + without} == {"SOLVED"}
    far, near = clearances(with_it), clearances(without)
    assert np.median(far) >= 0.6
    assert np.median(near) < np.median(far) - 0.1
    longer = sum(r.length_m for r in with_it) / sum(r.length_m for r in without)
    assert 1.0 <= longer < 1.06
    # What is stored is metres, whatever the search counted.
    for r in with_it:
        assert r.length_m == pytest.approx(np.linalg.norm(np.diff(r.poses[:, :3], axis=0), axis=1).sum(), abs=1e-9)


def test_an_approach_flies_ahead():
    _, rows = planned()
    angles = np.array([off_heading(r) for *_, r, _ in rows])
    assert (angles <= 60.0 + 1e-6).mean() >= 0.99
    assert (np.array([off_heading(r) for *_, r in rows]) > 90.0).mean() > 0.2


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
    goal = (12.0, 0.3, 3.0, math.pi)
    hugs = Planner(world, INDIFFERENT, RADIUS).plan_target(goal, starts)
    keeps = Planner(world, PlanConfig(), RADIUS).plan_target(goal, starts)
    near, far = (np.array([r.min_clearance_m for r in routes]) for routes in (hugs, keeps))
    assert near.min() < 0.4
    assert far.min() > 0.6
    assert np.median(far) > 0.8
    assert sum(r.length_m for r in keeps) <= sum(r.length_m for r in hugs) + 1.05 * len(starts)


@settings(max_examples=60, deadline=None)
@given(
    a=st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(0.26, 0.74)),
    b=st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(0.26, 0.74)),
    weight=st.floats(0.1, 10),
)
def test_near_the_ground_the_cost_of_clearance_is_the_integral(a, b, weight):
    grid = flat_ground()
    found = clearance_penalty(*a, *b, 1.0, weight, *grid.origin, grid.cell, grid.field)
    length = math.dist(a, b)
    assert found == pytest.approx(weight * length * (1.0 - (a[2] + b[2]) / 2), rel=1e-3, abs=1e-3)
    assert clearance_penalty(*b, *a, 1.0, weight, *grid.origin, grid.cell, grid.field) == pytest.approx(
        found, rel=1e-6
    )


@lru_cache(maxsize=1)
def flat_ground():
    return ClearanceGrid.build(scene(half=10.0, ceiling=6.0)).arrays


def test_far_from_surfaces_nothing_is_added():
    grid = flat_ground()
    assert clearance_penalty(-8.0, -8.0, 2.0, 8.0, 8.0, 5.0, 1.0, 1.0, *grid.origin, grid.cell, grid.field) == 0.0


def test_what_agents_fly_succeeds_by_the_evaluators_own_replay():
    _, rows = planned()
    space = FlightSpace(town(), RADIUS)
    for goal, start, r, _ in rows:
        actions = agent_actions(r.actions).tolist()
        assert max(actions) < APPROACH
        assert actions[-1] == 0
        assert 0 not in actions[:-1]
        budget = 90 if r.length_m < 30 else 180
        episode = fly(space, Reference(tuple(start), tuple(goal[:3]), budget, r.length_m, actions))
        assert spl_fault(episode, r.length_m, 1.0 + 1e-9) == ""
        assert abs(math.remainder(episode.yaw_rad - goal[3], 2 * math.pi)) <= math.radians(7.5) + 1e-9


def test_difficulty_is_what_geometry_says():
    planner, rows = planned()
    routes = [r for *_, r, _ in rows]
    told = difficulty_of(
        [r.poses for r in routes], np.array([r.length_m for r in routes]), 1.0, RADIUS, planner.grid, planner.world
    )
    mesh = solid(town())
    assert 0.1 < told.straight_line_free.mean() < 0.9
    for k, (goal, start, r, other) in enumerate(rows):
        assert np.linalg.norm(goal[:3] - start[:3]) - 1e-9 <= told.free_length_m[k]
        assert told.free_length_m[k] <= min(r.length_m, other.length_m) + 1e-9
        assert told.plan_detour[k] == pytest.approx(max(1.0, r.length_m / told.free_length_m[k]))
        steps = np.diff(r.poses[:, 2])
        assert told.climb_m[k] == pytest.approx(steps[steps > 0].sum())
        assert told.climb_m[k] >= max(0.0, goal[2] - start[2]) - 1e-9
        nearest = distances(mesh, along(np.array([start[:3], goal[:3]]), 0.02)).min()
        # Between samples a surface can come nearer by half their spacing at most.
        if told.straight_line_free[k]:
            assert nearest >= RADIUS - 1e-9
        else:
            assert nearest <= RADIUS + 0.01


def test_straight_lines_are_what_fcl_says():
    planner, _ = planned()
    rng = np.random.default_rng(2)
    ends = rng.uniform([-17, -17, 0.3], [17, 17, 11], (2, 300, 3))
    free = straight_lines_free(*ends, RADIUS, planner.grid, planner.world)
    expected = [not planner.world.segment_in_collision(p, q, RADIUS) for p, q in zip(*ends, strict=True)]
    assert free.tolist() == expected
    assert 30 < free.sum() < 270
