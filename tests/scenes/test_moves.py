"""Where things stand: levelled places, moved props, turned scenes, the gap between feet and sloping ground."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.layout_checks import ASSETS, catalogue

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.placement import CONTACT_M, DRAWN, Placement, _feet, _gaps, rest_on_ground
from aerialdojo_gen.scenes.recipe import SceneHead
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import rolling_terrain

YARD = ASSETS / "smoke" / "U_Courtyard_0.toml"


@cache
def yard() -> Scene:
    return build_scene(YARD, catalogue())


def built(tmp_path, extra):
    recipe = tmp_path / YARD.name
    recipe.write_text(YARD.read_text() + extra)
    return build_scene(recipe, catalogue())


def test_a_move_moves_one_prop_that_is_placed_and_nothing_else(tmp_path):
    before = yard()
    node = next(i.node for i in before.instances if i.anatomy is not None)
    after = built(tmp_path, f'\n[moves]\n{node} = {{ by_m = [0.5, -0.25], up_m = 0.5, place = "elsewhere" }}\n')
    assert [i.node for i in after.instances] == [i.node for i in before.instances]
    for old, new in zip(before.instances, after.instances, strict=True):
        by = np.array([0.5, -0.25, 0.5]) if old.node == node else np.zeros(3)
        np.testing.assert_allclose(new.vertices - old.vertices, np.broadcast_to(by, old.vertices.shape), atol=1e-4)
        assert new.variant == old.variant
        assert new.attributes == (old.attributes | {"place": "elsewhere"} if old.node == node else old.attributes)
    with pytest.raises(AssetError, match=f"moves: no prop '{node}0' is placed: did you mean '{node}'"):
        built(tmp_path, f"\n[moves]\n{node}0 = {{ by_m = [1.0, 0.0] }}\n")


def test_a_moved_prop_stays_on_the_ground():
    site = Site(
        "N_T_0",
        SceneHead.model_validate({"size_m": (60, 60), "ceiling_m": 20, "moves": {"bench_000": {"by_m": (6.0, 3.0)}}}),
        catalogue(),
    )
    site.set_ground(rolling_terrain((60, 60), 1.0, 3, 4.0, 20.0))
    unmoved = site.place(Placement("bench", 1.0, 2.0, variant=DRAWN))
    moved = site.instances[-1]
    fall = site.ground_z(7.0, 5.0) - site.ground_z(1.0, 2.0)
    assert abs(fall) > 0.1
    np.testing.assert_allclose(moved.centroid - unmoved.centroid, (6.0, 3.0, fall), atol=1e-4)
    # All that is placed later finds the room that it would have had.
    assert site.is_free(7.0, 5.0, 1.0)
    assert not site.is_free(1.0, 2.0, 0.5)


def test_a_levelled_place_is_level_and_the_ground_beyond_it_as_before():
    own = rolling_terrain((60, 60), 1.0, 3, 4.0, 20.0)
    levels = {"level": [{"at": (5.0, -4.0), "radius_m": 2.0}]}
    recipe = SceneHead.model_validate({"size_m": (60, 60), "ceiling_m": 20} | levels)
    site = Site("N_T_0", recipe, catalogue())
    site.set_ground(own)
    turns = np.linspace(0.0, 2.0 * np.pi, 24)
    for radius, level in ((2.0, True), (7.5, False)):
        x, y = 5.0 + radius * np.cos(turns), -4.0 + radius * np.sin(turns)
        if level:
            assert np.ptp(own.z(x, y)) > 0.3
            assert np.ptp(site.terrain.z(x, y)) < 1e-9
        else:
            np.testing.assert_array_equal(site.terrain.z(x, y), own.z(x, y))


@pytest.mark.parametrize("turn_deg", [90, 180, 270])
def test_a_turned_plan_is_the_same_scene_turned(tmp_path, turn_deg):
    """Every vertex, front and bound is turned exactly, the land beyond too; the sun stays where it is."""
    before = yard()
    recipe = tmp_path / YARD.name
    recipe.write_text(YARD.read_text().replace("ceiling_m", f"turn_deg = {turn_deg}\nceiling_m", 1))
    after = build_scene(recipe, catalogue())
    c, s = {90: (0, 1), 180: (-1, 0), 270: (0, -1)}[turn_deg]
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert after.sun == before.sun
    corners = before.bounds @ turn.T
    np.testing.assert_array_equal(after.bounds, [corners.min(axis=0), corners.max(axis=0)])
    pairs = zip((*before.instances, *before.backdrop), (*after.instances, *after.backdrop), strict=True)
    fronts = 0
    for old, new in pairs:
        assert (old.node, old.shape, old.attributes) == (new.node, new.shape, new.attributes)
        np.testing.assert_array_equal(new.vertices, old.vertices @ turn.T)
        np.testing.assert_array_equal(new.faces, old.faces)
        if old.anatomy is not None:
            fronts += len(old.anatomy.fronts_rad)
            angles = np.array(
                [(old.anatomy.yaw_rad, *old.anatomy.fronts_rad), (new.anatomy.yaw_rad, *new.anatomy.fronts_rad)]
            )
            np.testing.assert_allclose(np.exp(1j * angles[1]), np.exp(1j * (angles[0] + np.radians(turn_deg))))
            assert (np.abs(angles) <= np.pi).all()
    assert fronts
    assert not np.array_equal(before.bounds, after.bounds) or turn_deg == 180


def test_a_real_place_keeps_its_north():
    head = {"size_m": (60, 60), "ceiling_m": 20, "turn_deg": 90, "origin": {"lon_deg": 7.0, "lat_deg": 50.0}}
    with pytest.raises(ValueError, match="a real place"):
        SceneHead.model_validate(head)


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
