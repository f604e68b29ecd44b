"""Mountains and the birch wood: each stands up to a look from close by."""

import numpy as np
import pytest
import shapely
from support.layout_checks import catalogue, each_scene

from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.kit.mountains import Ridge, above, massif, steep
from aerialdojo_gen.scenes.model import Scene

SCENES = ["N_Mountain_0", "N_Mountain_1", "N_Forest_1"]
of_each_scene = each_scene(SCENES)


@of_each_scene
def test_boulders_touch_the_ground(scene_of, name):
    scene = scene_of(name)
    ground = RayCaster(Scene(name, (scene["ground"],), scene.materials, scene.bounds))
    for boulder in (i for i in scene.instances if i.category == "boulder"):
        v = boulder.vertices
        origins = np.column_stack([v[:, :2], np.full(len(v), 60.0)])
        depth, _ = ground.first_hit(origins, np.tile([0.0, 0.0, -1.0], (len(v), 1)))
        above = v[:, 2] - (60.0 - depth)
        assert above.min() < 0.0 < above.max(), boulder.node


def test_the_summit_is_reached_on_foot_and_crowned(scene_of):
    scene = scene_of("N_Mountain_0")
    ground, cross = scene["ground"], scene["summit_cross_000"]
    assert np.ptp(ground.vertices[:, 2]) > 25.0
    assert cross.bounds[0, 2] > 0.8 * ground.vertices[:, 2].max()
    assert "summit_cross" not in catalogue().targets


def test_mountains_rise_to_their_crests_and_show_rock_where_they_are_steep():
    ridge = Ridge(line=((0.0, 10.0, 20.0),), width_m=25.0, hollow=1.0)
    plain = massif((60.0, 60.0), 1.5, 3, [ridge], 0.0, 0.0)
    assert float(plain.z(0.0, 10.0)) == pytest.approx(20.0, abs=1.5)
    assert float(plain.z(-29.0, -29.0)) == pytest.approx(0.0, abs=1e-9)
    benched = massif((60.0, 60.0), 1.5, 3, [ridge], 4.0, 0.0)
    assert steep(plain, 1.2).area < 0.1 * steep(benched, 1.2).area
    top = above(plain, 17.0, 2.0)
    assert shapely.contains_xy(top, 0.0, 10.0)
    assert not shapely.contains_xy(top, 0.0, -10.0)
    assert above(plain, 50.0, 2.0).is_empty
