"""Harbours: quays over the water, ships afloat beside them, and everything on something."""

from functools import cache

import numpy as np
import pytest
import shapely
from layout_checks import (
    catalogue,
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
from aerialdojo_gen.layouts.infrastructure.harbor.quays import HIGH_M, LONG_M, QUAY_M, container_block, quay
from aerialdojo_gen.scenes.footprints import footprint
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.recipe import Recipe
from aerialdojo_gen.scenes.site import Site

SCENES = ["I_Harbor_0", "I_Harbor_1"]
each_scene = pytest.mark.parametrize("name", SCENES)
_AFLOAT = {"freighter", "fishing_boat", "tugboat", "sailboat", "motor_yacht", "rowing_boat", "buoy"}
_HALLS = ("warehouse", "boat_shed", "port_office", "ferry_terminal", "house", "container_stack")


@cache
def land(name: str) -> shapely.Geometry:
    """What of the ground lies above the water."""
    ground = next(i for i in scene_of(name).instances if i.category == "ground")
    corners = ground.vertices[ground.faces]
    level = (np.ptp(corners[:, :, 2], axis=1) < 1e-6) & (corners[:, 0, 2] > 1.0)
    return shapely.union_all(shapely.make_valid(shapely.polygons(corners[level][:, :, :2])), grid_size=0.01)


@each_scene
def test_harbours_are_as_rich_as_the_paper_asks(name):
    scene = scene_of(name)
    n_landmarks, n_objects = paper_counts()[name]
    assert 30_000 <= scene.n_triangles <= 200_000
    assert kinds_of(scene)["landmark"] >= n_landmarks
    assert len(looks_of(scene)) >= 1.1 * n_objects


@each_scene
def test_things_stand_or_float(name):
    assert not floating(scene_of(name), bearers=("freighter",))


@each_scene
def test_things_do_not_stand_in_one_another(name):
    assert not clashes(scene_of(name), bearers=("freighter", "container_crane"))
    assert not walled_in(scene_of(name), _HALLS)


@each_scene
def test_boats_float_clear_of_the_quays(name):
    boats = [i for i in props_of(scene_of(name)) if i.category in _AFLOAT]
    assert len(boats) >= 10
    for boat in boats:
        assert boat.bounds[0, 2] < 0.05
        hull = footprint(boat, 0.0)
        assert hull.intersection(land(name)).area < 0.02 * hull.area, boat.node


def test_the_port_has_every_category_of_harbours_and_vehicles():
    known = catalogue()
    themes = [k for k in known.targets if known[k].kind in ("prop", "vehicle")]
    there = {i.category for i in props_of(scene_of("I_Harbor_0"))}
    wanted = set(_AFLOAT) | {
        "shipping_container", "mooring_bollard", "reach_stacker", "straddle_carrier", "lifebuoy_stand", "fish_crates",
        "harbour_crane", "fuel_pump", "anchor_monument", "navigation_beacon", "sedan", "hatchback", "suv",
        "pickup_truck", "delivery_van", "box_truck", "city_bus", "motorcycle", "scooter", "bicycle", "food_truck",
        "forklift", "golf_cart",
    }  # fmt: skip
    assert wanted <= set(themes)
    assert wanted <= there


def test_containers_are_stacked_in_tiers():
    site = Site("I_T_0", Recipe(layout="none", size_m=(60, 60), ceiling_m=20), catalogue())
    quay(site, rectangle(-30, -30, 30, 30))
    plan = container_block(site, -20.0, -5.0, [[3, 1], [0, 2]])
    stack = site.instances[-1]
    assert stack.bounds[1, 2] == pytest.approx(QUAY_M + 3 * HIGH_M, abs=0.1)
    assert plan.bounds[2] - plan.bounds[0] == pytest.approx(2 * LONG_M + 0.5)
    assert not site.is_free(-10.0, -3.0, 0.3)
    assert site.is_free(-10.0, 6.0, 0.3)


def test_bytes_are_the_same_every_time(tmp_path):
    first, second = glb_bytes("I_Harbor_1", tmp_path)
    assert first == second


def test_the_two_harbours_differ():
    first, second = (scene_of(name) for name in SCENES)
    assert not np.array_equal(first.bounds, second.bounds)
    assert len(looks_of(first) ^ looks_of(second)) > 0.3 * len(looks_of(first) | looks_of(second))
