"""What is kept of a goal's cost-to-go is the same to the bit, within the room that there is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from support.flying import free_poses

from aerialdojo_gen.planning.connectivity import QUANTUM_M
from aerialdojo_gen.planning.field_cache import FieldCache

FIELDS = arrays.arrays(
    np.float32,
    arrays.array_shapes(min_dims=3, max_dims=3, max_side=6),
    elements=st.one_of(st.just(np.inf), st.integers(0, 2**24 - 1).map(lambda n: n * QUANTUM_M)),
)


@given(FIELDS, st.booleans())
def test_a_field_comes_back_bit_for_bit(field, plain):
    kept = FieldCache(1.0 if plain else 0.0, 1.0)
    scratch = field.copy()
    kept.store(b"goal", scratch)
    scratch.fill(3.0)
    found = kept.find(b"goal", scratch)
    assert found.dtype == np.float32
    assert np.array_equal(found.view(np.int32), field.view(np.int32))
    assert (found is scratch) is not plain
    assert kept.find(b"another", scratch) is None


def test_no_more_is_kept_than_there_is_room_for():
    rough = np.random.default_rng(1).integers(0, 2**24, (100, 100, 6)).astype(np.float32) * np.float32(QUANTUM_M)
    kept = FieldCache(0.5, 0.3)  # two as they are, one compressed
    for k in range(5):
        kept.store(bytes([k]), rough)
    there = [kept.find(bytes([k]), np.empty_like(rough)) is not None for k in range(5)]
    assert there == [True, True, True, False, False]


@pytest.mark.parametrize("room", [(0.0, 0.0), (0.0, 50.0), (1000.0, 0.0)])
def test_routes_are_the_same_however_fields_are_kept(planned, room):
    planner = planned.planner
    goal, *others, level = free_poses(planner.grid, np.random.default_rng(5), 16)
    # A goal of the same place that faces elsewhere is another goal, and so is one above it.
    moved = np.array([[0, 0, 0, 0], [0, 0, 0, 3.0], [0, 0, 0.5, 0]])
    goals, starts = [level, *(goal + moved)], np.array(others)
    assert not planner.grid.in_collision(goals[-1][:3])
    expected = [planner.plan_target(goal, starts) for goal in goals]
    with planner.keeping_fields(*room):
        foreseen = [planner.estimate_routes(goal, starts) for goal in goals]
        routes = [planner.plan_target(goal, starts) for goal in goals]
    assert sum(route.outcome == "SOLVED" for route in expected[0]) > 6
    for before, after, told in zip(expected, routes, foreseen, strict=True):
        for a, b, c in zip(before, after, told, strict=True):
            assert (a.outcome, a.length_m, a.expansions) == (b.outcome, b.length_m, b.expansions)
            assert a.poses.tobytes() == b.poses.tobytes()
            assert c.outcome in ("NOT_NEEDED", a.outcome)
