"""Islands and coasts: the sea is level, boats float, piers can be flown under, and things stand as they should."""

import numpy as np
import pytest
import shapely
from support import layout_checks as look

from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.layouts.natural.parts.quays import flight, groyne, pier, retaining_wall
from aerialdojo_gen.scenes.layouts.natural.parts.shore import inland_m, ragged, rise, shaped, steep_area
from aerialdojo_gen.scenes.recipe import Recipe
from aerialdojo_gen.scenes.site import Site

SCENES = [f"N_{kind}_{k}" for kind in ("Island", "Coast") for k in (0, 1)]
BOATS = ("fishing_boat", "rowing_boat", "sailboat", "motor_yacht", "tugboat", "buoy")
of_each_scene = look.each_scene(SCENES)


@of_each_scene
def test_boats_lie_on_the_level_sea(scene_of, name):
    scene = scene_of(name)
    boats = [i for i in look.props_of(scene) if i.category in BOATS]
    ground = look.Scene(name, (scene["ground"],), scene.materials, scene.bounds)
    cast = RayCaster(ground)
    assert len(boats) >= 4
    for boat in boats:
        middle = boat.bounds.mean(axis=0)
        distance, _ = cast.first_hit(np.array([[middle[0], middle[1], 60.0]]), np.array([[0.0, 0.0, -1.0]]))
        assert abs(60.0 - float(distance[0])) < 0.15, boat.node
        assert boat.bounds[0, 2] < 0.1


def blank() -> Site:
    return Site("N_T_0", Recipe(layout="none", size_m=(60, 60), ceiling_m=20), look.catalogue())


def test_coastlines_are_natural_and_always_the_same():
    coarse = [(-20, -20), (20, -20), (20, 20), (-20, 20)]
    line = ragged(coarse, 5, 1.5)
    assert line.equals(ragged(coarse, 5, 1.5))
    assert not line.equals(ragged(coarse, 6, 1.5))
    assert line.is_valid
    assert line.area == pytest.approx(1600, rel=0.15)
    assert 0.5 < shapely.hausdorff_distance(line.boundary, shapely.Polygon(coarse).boundary) < 6.0


def test_inland_is_positive_on_the_land_and_negative_at_sea():
    land = shapely.box(-10, -10, 10, 10)
    away = inland_m(land, np.array([0.0, 9.0, 13.0]), np.zeros(3))
    assert away == pytest.approx([10.0, 1.0, -3.0])
    assert rise(np.array([-1.0, 0.5, 3.0]), 0.0, 1.0) == pytest.approx([0.0, 0.5, 1.0])


def test_steep_ground_is_found():
    terrain = shaped(blank(), 2.0, 20.0, lambda x, _y, _n: np.where(x > 0.0, 8.0, 0.0))
    steep = steep_area(terrain, 40.0)
    assert steep.contains(shapely.Point(1.0, 0.0))
    assert not steep.intersects(shapely.box(6.0, -20.0, 25.0, 20.0))


def test_piers_bear_above_and_are_open_below():
    site = blank()
    pier(site, Frame(-15.0, 0.0, 0.0), 30.0, 5.0, 4.0, bay_m=5.0)
    cast = RayCaster(site.scene())
    down, along = np.array([[0.0, 0.0, -1.0]]), np.array([[1.0, 0.0, 0.0]])
    for x in (-12.0, 0.3, 14.0):
        distance, _ = cast.first_hit(np.array([[x, 0.4, 9.0]]), down)
        assert 9.0 - float(distance[0]) == pytest.approx(4.0, abs=0.01)
    distance, _ = cast.first_hit(np.array([[-20.0, 1.2, 1.2]]), along)
    assert float(distance[0]) > 30.0


def test_walls_groynes_and_steps_bar_the_way():
    site = blank()
    retaining_wall(site, -10.0, 10.0, 4.0, 5.5, 0.0, 3.0)
    groyne(site, [(0.0, -12.0), (0.0, 2.0)], 1.8)
    flight(site, (6.0, -4.0), 90.0, 2.0, 0.0, 3.0, 7.0)
    cast = RayCaster(site.scene())
    origins = np.array([[-5.0, -3.0, 1.5], [-3.0, -5.0, 1.2], [6.0, -1.0, 8.0]])
    ways = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    distance, _ = cast.first_hit(origins, ways)
    assert distance[0] == pytest.approx(7.0, abs=0.6)
    assert distance[1] == pytest.approx(3.0, abs=0.2)
    assert 5.5 < distance[2] < 7.5
    assert not site.is_free(-5.0, 4.8, 0.3)
    assert not site.is_free(6.0, 0.0, 0.3)
