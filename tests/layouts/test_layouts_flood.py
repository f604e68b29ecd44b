"""Floods: water up to the sills, a broken dyke, and everything on something or afloat."""

import numpy as np
import pytest
from support.layout_checks import each_scene, props_of

SCENES = ["D_Flood_0", "D_Flood_1"]
of_each_scene = each_scene(SCENES)


@of_each_scene
def test_the_water_stands_up_to_the_windows(scene_of, name):
    houses = [i for i in scene_of(name).instances if i.category in ("house", "flat_house")]
    assert len(houses) >= 3
    for house in houses:
        glass = np.concatenate([p.vertices[:, 2] for p in house.parts if p.material == "window"])
        assert house.bounds[0, 2] < -1.0
        assert -0.3 < glass.min() < 0.3


@of_each_scene
def test_what_is_half_under_shows_more_than_half(scene_of, name):
    for prop in props_of(scene_of(name)):
        if prop.attributes.get("place", "").startswith("half under"):
            low, high = prop.bounds[:, 2]
            assert low < -0.5
            assert low + high > 0.0


@of_each_scene
def test_the_dyke_has_a_gap_at_water_level(scene_of, name):
    ground = next(i for i in scene_of(name).instances if i.category == "ground")
    crest = ground.vertices[ground.vertices[:, 2] > 2.5]
    gap_x = np.sort(crest[:, 0])
    assert np.diff(gap_x).max() > 5.0
    assert ground.bounds[0, 2] == pytest.approx(0.0, abs=0.05)
