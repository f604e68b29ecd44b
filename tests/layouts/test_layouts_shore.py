"""Islands and coasts: the sea is level, boats float, piers can be flown under, and things stand as they should."""

from functools import partial

import numpy as np
import pytest
import shapely
from support import layout_checks as look
from support.layout_checks import blank_site

from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.expressions import eased
from aerialdojo_gen.scenes.kit.ground_cover import steep_area
from aerialdojo_gen.scenes.kit.landforms import ground_by_formula, inland_m
from aerialdojo_gen.scenes.kit.natural_ground import ragged_outline
from aerialdojo_gen.scenes.kit.quays import groynes, pier, sea_wall
from aerialdojo_gen.scenes.kit.structures import flights

blank = partial(blank_site, "N_T_0")
SCENES = [f"N_{kind}_{k}" for kind in ("Island", "Coast") for k in (0, 1)]
BOATS = ("fishing_boat", "rowing_boat", "sailboat", "motor_yacht", "tugboat", "buoy")
of_each_scene = look.each_scene(SCENES)


@of_each_scene
def test_boats_lie_on_the_level_sea(scene_of, name):
    scene = scene_of(name)
    boats = [i for i in look.props_of(scene) if i.category in BOATS]
    ground = look.Scene(name, (scene["ground"],), scene.materials, scene.bounds)
    assert len(boats) >= 4
    above = [(*boat.bounds.mean(axis=0)[:2], 60.0) for boat in boats]
    np.testing.assert_allclose(look.distances(ground, above, (0.0, 0.0, -1.0)), 60.0, atol=0.15)
    assert max(boat.bounds[0, 2] for boat in boats) < 0.1


def test_coastlines_are_natural_and_always_the_same():
    coarse = shapely.box(-20, -20, 20, 20)
    line = ragged_outline(coarse.exterior, 5, 1.5, 3.0)
    assert line.equals(ragged_outline(coarse.exterior, 5, 1.5, 3.0))
    assert not line.equals(ragged_outline(coarse.exterior, 6, 1.5, 3.0))
    assert line.is_valid
    assert line.area == pytest.approx(1600, rel=0.15)
    assert 0.5 < shapely.hausdorff_distance(line.boundary, coarse.boundary) < 6.0


def test_inland_is_positive_on_the_land_and_negative_at_sea():
    land = shapely.box(-10, -10, 10, 10)
    away = inland_m(land, np.array([0.0, 9.0, 13.0]), np.zeros(3))
    assert away == pytest.approx([10.0, 1.0, -3.0])
    assert eased(np.array([-1.0, 0.5, 3.0]), 0.0, 1.0) == pytest.approx([0.0, 0.5, 1.0])


def test_steep_ground_is_found():
    site = blank()
    terrain = ground_by_formula(
        site, site.terrain, cell_m=2.0, height=lambda arrays: np.where(arrays["x"] > 0.0, 8.0, 0.0)
    )
    steep = steep_area(terrain, 40.0)
    assert steep.contains(shapely.Point(1.0, 0.0))
    assert not steep.intersects(shapely.box(6.0, -20.0, 25.0, 20.0))


def test_piers_bear_above_and_are_open_below():
    site = blank()
    pier(site, at=(-15.0, 0.0), yaw_deg=0.0, length_m=30.0, width_m=5.0, z=4.0, bay_m=5.0, rail="iron")
    scene = site.scene()
    down = look.distances(scene, [(x, 0.4, 9.0) for x in (-12.0, 0.3, 14.0)], (0.0, 0.0, -1.0))
    assert 9.0 - down == pytest.approx([4.0] * 3, abs=0.01)
    assert look.distances(scene, [(-20.0, 1.2, 1.2)], (1.0, 0.0, 0.0))[0] > 30.0


def test_walls_groynes_and_steps_bar_the_way():
    site = blank()
    sea_wall(site, box=(-10.0, 4.0, 10.0, 5.5), z=(0.0, 3.0))
    groynes(site, lines=[[(0.0, -12.0), (0.0, 2.0)]], height_m=1.8)
    flights(site, feet=[(6.0, -4.0)], yaw_deg=90.0, width_m=2.0, run_m=7.0, on=0.0, to_m=3.0)
    cast = RayCaster(site.scene())
    origins = np.array([[-5.0, -3.0, 1.5], [-3.0, -5.0, 1.2], [6.0, -1.0, 8.0]])
    ways = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    distance, _ = cast.first_hit(origins, ways)
    assert distance[0] == pytest.approx(7.0, abs=0.6)
    assert distance[1] == pytest.approx(3.0, abs=0.2)
    assert 5.5 < distance[2] < 7.5
    assert not site.is_free(-5.0, 4.8, 0.3)
    assert not site.is_free(6.0, 0.0, 0.3)
