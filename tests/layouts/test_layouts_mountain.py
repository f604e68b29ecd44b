"""Mountains and the birch wood: each stands up to a look from close by."""

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, catalogue, distances, each_scene

from aerialdojo_gen.scenes.kit.mountains import Ridge, high_ground, massif, steep_ground
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.terrain import flat_terrain

SCENES = ["N_Mountain_0", "N_Mountain_1", "N_Forest_1"]
of_each_scene = each_scene(SCENES)


@of_each_scene
def test_boulders_touch_the_ground(scene_of, name):
    scene = scene_of(name)
    ground = Scene(name, (scene["ground"],), scene.materials, scene.bounds)
    for boulder in (i for i in scene.instances if i.category == "boulder"):
        v = boulder.vertices
        depth = distances(ground, np.column_stack([v[:, :2], np.full(len(v), 60.0)]), (0.0, 0.0, -1.0))
        above = v[:, 2] - (60.0 - depth)
        assert above.min() < 0.0 < above.max(), boulder.node


def test_the_summit_is_reached_on_foot_and_crowned(scene_of):
    scene = scene_of("N_Mountain_0")
    ground, cross = scene["ground"], scene["summit_cross_000"]
    assert np.ptp(ground.vertices[:, 2]) > 25.0
    assert cross.bounds[0, 2] > 0.8 * ground.vertices[:, 2].max()
    assert "summit_cross" not in catalogue().targets


def test_mountains_rise_to_their_crests_and_show_rock_where_they_are_steep():
    site = blank_site("N_T_0", seed=3)
    ridge = Ridge([(0.0, 10.0, 20.0)], 25.0, hollow=1.0)
    flat = flat_terrain((60, 60))
    plain = massif(site, flat, ridges=[ridge], cell_m=1.5, bench_m=0.0, rough_m=0.0)
    assert float(plain.z(0.0, 10.0)) == pytest.approx(20.0, abs=1.5)
    assert float(plain.z(-29.0, -29.0)) == pytest.approx(0.0, abs=1e-9)
    site.set_ground(plain)
    faces, top = steep_ground(site, slope=1.2), high_ground(site, above_m=17.0, slope=2.0)
    assert shapely.contains_xy(top, 0.0, 10.0)
    assert not shapely.contains_xy(top, 0.0, -10.0)
    assert high_ground(site, above_m=50.0, slope=2.0).is_empty
    site.set_ground(massif(site, flat, ridges=[ridge], cell_m=1.5, bench_m=4.0, rough_m=0.0))
    assert faces.area < 0.1 * steep_ground(site, slope=1.2).area
