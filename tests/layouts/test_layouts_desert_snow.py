"""Deserts and snowfields: each stands up to a look from close by."""

from functools import partial

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, each_scene, props_of

from aerialdojo_gen.scenes.kit.huts import MudbrickHouse, mudbrick_houses
from aerialdojo_gen.scenes.kit.layered_rocks import Rock, dunes, layered_rocks, stepped_valley
from aerialdojo_gen.scenes.kit.snow import banks_beside, moguls, profile_slope
from aerialdojo_gen.scenes.terrain import rolling_terrain

blank = partial(blank_site, "N_T_0", seed=3)
SCENES = [f"N_{kind}_{k}" for kind in ("Desert", "Snowfield") for k in (0, 1)]
of_each_scene = each_scene(SCENES)
FLAT = rolling_terrain((60, 60), 1.0, 1, 0.0, 20.0)


@of_each_scene
def test_things_keep_clear_of_rocks_and_houses(scene_of, name):
    scene = scene_of(name)
    hulls = [(i, shapely.MultiPoint(i.vertices[:, :2]).convex_hull) for i in scene.instances if i.category == "hut"]
    for prop in props_of(scene):
        for i, hull in hulls:
            if prop.bounds[0, 2] < i.bounds[1, 2] - 0.5 and prop.bounds[1, 2] > i.bounds[0, 2] + 1.0:
                assert not hull.buffer(-0.3).contains(shapely.Point(prop.centroid[:2])), (prop.node, i.node)


def test_dunes_are_steeper_in_the_lee():
    ground = dunes(blank(80.0), FLAT, cell_m=1.0, height_m=5.0, wavelength_m=24.0, wind_deg=0.0)
    slope = np.diff(ground.heights_m, axis=1)
    assert np.ptp(ground.heights_m) > 4.0
    assert -np.quantile(slope, 0.02) > 1.3 * np.quantile(slope, 0.98)
    assert (slope > 0).mean() > 0.55


def test_a_valley_climbs_from_its_bed():
    bed, steps = [(-30.0, 0.0), (30.0, 0.0)], [(4.0, 6.0, 2.0), (12.0, 16.0, 3.0)]
    ground = stepped_valley(blank(), FLAT, cell_m=1.0, bed=bed, steps=steps, roughness_m=0.3)
    middle, banks, rim = (float(np.mean(ground.z(np.linspace(-25, 25, 50), np.full(50, y)))) for y in (0, 10, 26))
    assert banks - middle == pytest.approx(2.0, abs=0.5)
    assert rim - banks == pytest.approx(3.0, abs=0.5)


def test_snow_is_banked_beside_the_way_and_bumpy_where_asked():
    bank = banks_beside(blank(), FLAT, line=[(-30.0, 0.0), (30.0, 0.0)], width_m=6.0, height_m=1.0)
    assert float(bank.z(0, 4.4)) > 0.8 > 0.2 > float(bank.z(0, 0))
    bumps = moguls(blank(), FLAT, area=shapely.box(-10, -10, 10, 10), height_m=1.0)
    assert np.ptp(bumps.z(np.linspace(-6, 6, 60), np.full(60, 1.1))) > 0.5
    assert float(np.abs(bumps.z(20, 20))) < 1e-9
    tilted = profile_slope(blank(), FLAT, profile=[(-30.0, 0.0), (0.0, 0.0), (30.0, 9.0)])
    assert float(tilted.z(0, -20)) == pytest.approx(0.0, abs=0.2)
    assert 4.0 < float(tilted.z(0, 20)) < 7.0


def test_rocks_and_houses_give_the_heights_of_what_carries_things():
    site = blank()
    rocks = [Rock(shapely.Point(10.0 * k, 0.0).buffer(4.0), f"rock {k}", 3.0 + k) for k in (0, 1)]
    tops = layered_rocks(site, rocks=rocks, bands=["rock"], cap="snow")
    roofs = mudbrick_houses(site, houses=[MudbrickHouse((-15.0, 0.0), "house", 30.0)])
    assert [float(i.bounds[1, 2]) for i in site.instances[:2]] == pytest.approx(tops, abs=1e-5)
    parapet = float(site.instances[2].bounds[1, 2])
    assert parapet - 1.0 < roofs[0] < parapet
