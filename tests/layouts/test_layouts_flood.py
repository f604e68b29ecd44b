"""Floods: water up to the sills, a broken dyke, and everything on something or afloat."""

import numpy as np
import pytest
from support.layout_checks import (
    clashes,
    floating,
    glb_bytes,
    kinds_of,
    looks_of,
    props_of,
    scene_of,
    walled_in,
)

from aerialdojo_gen.common.paper import paper_counts

SCENES = ["D_Flood_0", "D_Flood_1"]
each_scene = pytest.mark.parametrize("name", SCENES)
_HOUSES = ("house", "flat_house", "barn")


@each_scene
def test_floods_are_as_rich_as_the_paper_asks(name):
    scene = scene_of(name)
    n_landmarks, n_objects = paper_counts()[name]
    assert 30_000 <= scene.n_triangles <= 200_000
    assert kinds_of(scene)["landmark"] >= n_landmarks
    assert len(looks_of(scene)) >= 1.2 * n_objects


@each_scene
def test_things_stand_or_float(name):
    assert not floating(scene_of(name), reach_m=2.4)


@each_scene
def test_things_do_not_stand_in_one_another(name):
    assert not clashes(scene_of(name))
    assert not walled_in(scene_of(name), _HOUSES)


@each_scene
def test_the_water_stands_up_to_the_windows(name):
    houses = [i for i in scene_of(name).instances if i.category in ("house", "flat_house")]
    assert len(houses) >= 3
    for house in houses:
        glass = np.concatenate([p.vertices[:, 2] for p in house.parts if p.material == "window"])
        assert house.bounds[0, 2] < -1.0
        assert -0.3 < glass.min() < 0.3


@each_scene
def test_what_is_half_under_shows_more_than_half(name):
    for prop in props_of(scene_of(name)):
        if prop.attributes.get("place", "").startswith("half under"):
            low, high = prop.bounds[:, 2]
            assert low < -0.5
            assert low + high > 0.0


@each_scene
def test_the_dyke_has_a_gap_at_water_level(name):
    ground = next(i for i in scene_of(name).instances if i.category == "ground")
    crest = ground.vertices[ground.vertices[:, 2] > 2.5]
    gap_x = np.sort(crest[:, 0])
    assert np.diff(gap_x).max() > 5.0
    assert ground.bounds[0, 2] == pytest.approx(0.0, abs=0.05)


def test_bytes_are_the_same_every_time(tmp_path):
    first, second = glb_bytes("D_Flood_1", tmp_path)
    assert first == second


def test_the_two_floods_differ():
    first, second = (scene_of(name) for name in SCENES)
    assert not np.array_equal(first.bounds, second.bounds)
    assert len(looks_of(first) ^ looks_of(second)) > 0.3 * len(looks_of(first) | looks_of(second))
