import math
from itertools import pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from support.flying import town
from support.handmade import scene

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.geometry.motion import TURN_RAD
from aerialdojo_gen.planning.difficulty import free_lengths_m
from aerialdojo_gen.planning.direct import direct_legs
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.planning.preference import Preference, approach_penalty, clearance_penalty
from aerialdojo_gen.planning.translations import DOWN, UP

RADIUS, APPROACH_M = 0.25, 1.0
PREFER = Preference(1.0, 1.2, 0.5, 3.0)


def legs_from(start, goal, grid, h=0.0, prefer=PREFER):
    """The direct way from a pose to a goal pose: its cost, and (direction, metres) of its legs."""
    directions, metres = np.zeros(3, np.int64), np.zeros(3, np.int64)
    length, extra = direct_legs(
        *start, np.asarray(goal[:3]), goal[3], h, math.inf, RADIUS, APPROACH_M, prefer, grid.arrays,
        directions, metres,
    )  # fmt: skip
    return length + extra, [(int(d), int(m)) for d, m in zip(directions, metres, strict=True) if m]


def corners_of(start, legs):
    points = [np.asarray(start[:3])]
    for direction, metres in legs:
        yaw = start[3] + direction * TURN_RAD
        step = {UP: (0, 0, 1), DOWN: (0, 0, -1)}.get(direction, (math.cos(yaw), math.sin(yaw), 0))
        points.append(points[-1] + np.array(step) * metres)
    return np.array(points)


@pytest.fixture(scope="module")
def built():
    return Planner(town(), None, RADIUS)


@pytest.fixture(scope="module")
def empty():
    config = PlanConfig(clearance_weight=0.0, max_approach_angle_deg=180.0)
    return Planner(scene(half=60.0, ceiling=50.0), config, RADIUS)


def test_direct_ways_are_free_end_at_the_goal_and_cost_what_they_say(built):
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(2000):
        start, goal = (np.array([*rng.uniform([-17, -17, 0.5], [17, 17, 10]), rng.uniform(-3, 3)]) for _ in "sg")
        cost, legs = legs_from(start, goal, built.grid)
        if cost == math.inf:
            continue
        found += 1
        points = np.vstack([corners_of(start, legs), goal[:3]])
        assert not built.world.route_in_collision(points, RADIUS)
        way, a = points[-1] - points[-2], built.grid.arrays
        gap = float(np.linalg.norm(way))
        assert gap <= APPROACH_M
        paid = sum(m for _, m in legs) + gap
        paid += approach_penalty(*way[:2], goal[3], gap, PREFER.ahead_cos, PREFER.approach_penalty)
        paid += sum(
            clearance_penalty(*p, *q, PREFER.clearance, PREFER.weight, *a.origin, a.cell, a.field)
            for p, q in pairwise(points)
        )
        assert cost == pytest.approx(paid, abs=1e-9)
    assert found > 200


def metres(low, high):
    """To the micrometre: a gap of 1e-190 m has a direction for `math.hypot`, and none for the sum of its squares."""
    return st.floats(low, high).map(lambda x: round(x, 6))


@settings(max_examples=20, deadline=None)
@example((1.0, 0.0, 2.0), (0.0, 0.0, 2.0), 0.0, -1.0)  # Backwards onto the goal: what is left has no direction
@example((0.0, -18.03125, 2.0), (15.210938, -10.703125, 2.0), 0.0, 0.0)  # An Approach between two directions
@given(*[st.tuples(metres(-40, 40), metres(-40, 40), metres(2, 40))] * 2, *[st.floats(-3, 3)] * 2)
def test_in_the_open_no_way_along_those_headings_is_cheaper(empty, p, q, yaw, goal_yaw):
    start, goal = (*p, yaw), (*q, goal_yaw)
    prefer = PREFER._replace(weight=0.0)
    cost, legs = legs_from(start, goal, empty.grid, prefer=prefer)
    assert cost < math.inf
    dx, dy, dz = np.subtract(q, p)
    first = math.floor((math.atan2(dy, dx) - yaw) / TURN_RAD)
    one, other = ((math.cos(yaw + k * TURN_RAD), math.sin(yaw + k * TURN_RAD)) for k in (first, first + 1))
    most = math.ceil(math.hypot(dx, dy)) + 2
    near = [(a, b) for a, b in product(range(most), repeat=2) if a + b <= most + 1]
    up = math.copysign(1.0, dz)
    least = math.inf
    for (a, b), c in product(near, range(max(0, int(abs(dz)) - 1), int(abs(dz)) + 3)):
        rest = (dx - a * one[0] - b * other[0], dy - a * one[1] - b * other[1], dz - up * c)
        gap = math.hypot(*rest)
        if gap <= APPROACH_M:
            ahead = approach_penalty(rest[0], rest[1], goal_yaw, gap, prefer.ahead_cos, prefer.approach_penalty)
            least = min(least, a + b + c + gap + ahead)
    assert cost == pytest.approx(least, abs=1e-6)
    assert legs in [list(order) for order in permutations(legs)]


def test_in_the_open_most_routes_take_one_expansion_and_are_as_short_as_may_be(empty):
    rng = np.random.default_rng(8)
    starts = np.column_stack([rng.uniform([-40, -40, 3], [40, 40, 40], (60, 3)), rng.uniform(-3, 3, 60)])
    goal = np.array([3.0, -2.0, 20.0, 0.4])
    routes = empty.plan_target(goal, starts)
    assert [r.outcome for r in routes] == ["SOLVED"] * len(routes)
    assert np.mean([r.expansions == 1 for r in routes]) > 0.8
    least = free_lengths_m(starts, goal[:3], APPROACH_M)
    lengths = np.array([r.length_m for r in routes])
    assert (lengths >= least - 1e-6).all()
    assert (lengths <= least + 1.0).all()
    assert np.mean(lengths / least) < 1.01


def test_a_detour_that_the_cost_to_go_tells_of_spares_the_trial(built):
    start, goal = (-17.0, -17.0, 11.0, 0.0), (17.0, 17.0, 11.0, 0.0)
    assert legs_from(start, goal, built.grid, h=0.0)[0] < math.inf
    assert legs_from(start, goal, built.grid, h=1.1 * math.dist(start[:3], goal[:3]) + 1.0)[0] == math.inf
