"""Things on slopes: the gap between feet and ground, before and after, over drawn planes and bumps."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.contact import CONTACT_M, _feet, _gaps, rest_on_ground
from aerialdojo_gen.scenes.model import Instance

LEANING, UPRIGHT = (
    ("pickup_truck", "fire_engine", "bench", "picnic_table", "gas_cylinder_cage"),
    ("guard_booth", "phone_booth", "flagpole"),
)


def thing(catalogue: Catalogue, category: str, yaw_deg: float) -> Instance:
    return catalogue.instantiate(category, "thing", generator(0, "contact"), (3.0, -2.0, 0.0), yaw_deg)


def slope(east: float, north: float):
    return lambda x, y: east * (np.asarray(x) - 3.0) + north * (np.asarray(y) + 2.0)


@settings(max_examples=40)
@given(st.sampled_from(LEANING), st.floats(0, 360), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_what_leans_follows_a_slope(catalogue, category, yaw_deg, east, north) -> None:
    before, ground = thing(catalogue, category, yaw_deg), slope(east, north)
    after, plinth = rest_on_ground(before, catalogue[category].kind, ground)
    gaps = _gaps(after, _feet(before), ground)
    assert plinth is None
    assert gaps.max() <= CONTACT_M
    assert gaps.min() >= -0.25, "its uphill side is not buried"
    # It turned as a whole: no length changed but by rounding.
    lengths = [np.linalg.norm(np.diff(i.vertices, axis=0), axis=1) for i in (before, after)]
    np.testing.assert_allclose(*lengths, atol=1e-4)


@settings(max_examples=30)
@given(st.sampled_from(UPRIGHT), st.floats(0, 360), st.floats(0.02, 0.6))
def test_what_stands_upright_has_no_air_below(catalogue, category, yaw_deg, east) -> None:
    before, ground = thing(catalogue, category, yaw_deg), slope(east, 0.0)
    after, plinth = rest_on_ground(before, catalogue[category].kind, ground)
    moved = after.vertices - before.vertices
    np.testing.assert_allclose(moved, np.tile(moved[0], (len(moved), 1)), atol=1e-4)
    if plinth is None:
        assert _gaps(after, _feet(before), ground).max() <= CONTACT_M
    else:
        block = trimesh.Trimesh(plinth.vertices, plinth.faces)
        assert block.is_watertight
        assert block.bounds[1, 2] == pytest.approx(after.bounds[0, 2], abs=0.02)
        corners = block.vertices[block.vertices[:, 2] < block.bounds[0, 2] + 1e-6]
        assert (corners[:, 2] < ground(corners[:, 0], corners[:, 1])).all(), "it reaches into the ground"


def test_what_stands_on_something_else_stays(catalogue) -> None:
    before = thing(catalogue, "bench", 0.0)
    assert rest_on_ground(before, "prop", lambda x, y: slope(0.1, 0.0)(x, y) - 2.0) == (before, None)
    assert rest_on_ground(before, "prop", slope(0.0, 0.0)) == (before, None)
