import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from aerialdojo_gen.geometry.motion import TURN_RAD
from aerialdojo_gen.planning.difficulty import free_lengths_m

# Displacements of every size: shorter than an Approach, about as long, and as long as a route.
metres = st.one_of(st.floats(-2.0, 2.0), st.floats(-100.0, 100.0))
way = st.tuples(metres, metres, metres)
yaw = st.floats(-math.pi, math.pi)


def gauge(h, yaw):
    """Fewest metres along headings for level displacements (n, 2): by the two headings next to each."""
    angle = np.arctan2(h[:, 1], h[:, 0]) - yaw
    first = np.floor(angle / TURN_RAD) * TURN_RAD
    size, rest = np.hypot(h[:, 0], h[:, 1]), angle - first
    return size * (np.sin(rest) + np.sin(TURN_RAD - rest)) / np.sin(TURN_RAD)


def with_approach(d, yaw, a):
    rest = d - a
    return gauge(rest[:, :2], yaw) + np.abs(rest[:, 2]) + np.linalg.norm(a, axis=1)


def one(d, yaw, longest=1.0):
    return float(free_lengths_m([[0.0, 0.0, 0.0, yaw]], [d], longest)[0])


def brute(d, yaw, longest):
    """The best Approach that descents from many places find; the way itself and its parts are among them."""

    def inside(a):
        return a * np.minimum(1.0, longest / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-300))

    def left(a):
        return with_approach(d[None], yaw, inside(a)[None])[0]

    n = 600
    z = 1 - 2 * (np.arange(n) + 0.5) / n
    angle = np.arange(n) * math.pi * (3 - math.sqrt(5))
    unit = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    parts = d * [(1, 1, 1), (1, 1, 0), (0, 0, 1), (0, 0, 0)]
    tries = inside(np.concatenate([parts, *(longest * share * unit for share in (0.25, 0.5, 0.75, 1.0))]))
    found = with_approach(np.broadcast_to(d, tries.shape), yaw, tries)
    best = tries[np.argsort(found)[:24:8]]
    # A descent may stall at an edge: begin it again where it ended, with the steps that it takes anew.
    options = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 2000}
    for _ in range(3):
        best = [minimize(left, a, method="Nelder-Mead", options=options).x for a in best]
    return min(float(found.min()), *map(left, best))


@settings(max_examples=8, deadline=None)
@example((10.0, 0.0, 0.0), 0.0, 1.0)  # straight ahead
@example((0.0, 0.0, -7.0), 0.0, 1.0)  # straight down
@example((0.3, 0.4, 0.5), 0.0, 1.0)  # an Approach alone
@example((10.0, 0.0, 10.0), 0.0, 1.0)  # a heading and a climb: the Approach takes a diagonal of both
@example((0.5, 0.0, 10.0), 0.0, 1.0)
@given(way, yaw, st.sampled_from([1.0, 0.4, 2.5]))
def test_it_is_the_least_that_any_approach_leaves_to_fly(d, yaw, longest):
    least = brute(np.array(d), yaw, longest)
    assert least - 1e-4 <= one(d, yaw, longest) <= least + 1e-9


@settings(max_examples=80, deadline=None)
@given(data=st.data(), yaw=yaw)
def test_no_route_on_the_lattice_is_shorter(data, yaw):
    moves = data.draw(st.lists(st.tuples(st.integers(0, 25), st.sampled_from([1.0, 2.0, 3.0, 5.0])), max_size=12))
    approach = np.array(data.draw(st.tuples(*[st.floats(-1.0, 1.0)] * 3)))
    approach /= max(1.0, float(np.linalg.norm(approach)))
    place = approach.copy()
    for k, step in moves:
        angle = yaw + k * TURN_RAD
        place += step * np.array([math.cos(angle), math.sin(angle), 0] if k < 24 else [0, 0, 1 - 2 * (k - 24)])
    flown = sum(step for _, step in moves) + float(np.linalg.norm(approach))
    free = one(place, yaw)
    assert np.linalg.norm(place) - 1e-9 <= free <= flown + 1e-9


def test_many_are_as_each_alone_and_without_an_approach_nearly_straight():
    rng = np.random.default_rng(1)
    d = rng.uniform(-30, 30, (100, 3))
    starts = np.column_stack([rng.uniform(-50, 50, (100, 3)), rng.uniform(-math.pi, math.pi, 100)])
    free, rigid = (free_lengths_m(starts, starts[:, :3] + d, longest) for longest in (1.0, 1e-9))
    assert free == pytest.approx([one(d[k], starts[k, 3]) for k in range(100)])
    flat, lift = np.hypot(d[:, 0], d[:, 1]), np.abs(d[:, 2])
    # At most 0.9 % longer than straight: half way between two headings.
    assert (rigid >= flat + lift - 1e-6).all()
    assert (rigid <= flat / math.cos(TURN_RAD / 2) + lift + 1e-6).all()
