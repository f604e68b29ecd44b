"""Bridges and rail corridors: each stands up to a look from close by."""

from functools import partial

import numpy as np
import pytest
from shapely.geometry import Polygon
from support.layout_checks import blank_site, distances, each_scene, props_of

from aerialdojo_gen.scenes.grammar import s_curve
from aerialdojo_gen.scenes.kit.bridges import arcade, bridge_deck, bridge_parapets
from aerialdojo_gen.scenes.kit.rail import RAIL_M, ballast, tracks
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.shapes_extruded import upright

blank = partial(blank_site, "I_T_0")
ROLLING = ("locomotive", "steam_locomotive", "passenger_carriage", "freight_wagon", "tank_wagon", "handcar")


@each_scene(["I_RailCorridor_0", "I_RailCorridor_1"])
def test_wheels_stand_on_rails(scene_of, name):
    scene = scene_of(name)
    tracks = tuple(i for i in scene.instances if i.category == "track")
    rails = Scene(name, tracks, scene.materials, scene.bounds)
    stock = [i for i in props_of(scene) if i.category in ROLLING]
    assert len(stock) >= 6
    for car in stock:
        low = car.vertices[car.vertices[:, 2] < RAIL_M + 0.02]
        on = np.abs(distances(rails, low + np.array([0.0, 0.0, 0.3]), (0.0, 0.0, -1.0)) - 0.3) < 0.05
        assert on.mean() > 0.3, car.node


@each_scene(["I_Bridge_0", "I_Bridge_1"])
def test_one_can_fly_under_the_bridge_and_not_through_its_road(scene_of, name):
    scene = scene_of(name)
    x = np.linspace(-12.0, 12.0, 13)
    assert (distances(scene, [(u, 0.3, 0.5) for u in x], (0.0, 0.0, -1.0)) < 0.6).all()
    # From one side to the other, well below the deck and above the water.
    across = distances(scene, [(u, -7.0, -6.0) for u in x], (0.0, 1.0, 0.0))
    assert (across > 14.0).sum() >= 5


def test_tracks_carry_rails_at_their_height():
    site = blank()
    path = [(-20.0, -3.0), *s_curve((-8.0, -3.0), (12.0, 4.0))]
    ballast(site, lines=[path])
    tracks(site, lines=[path])
    laid = site.instances[-1]
    assert laid.bounds[1, 2] == pytest.approx(RAIL_M)
    rails = laid.vertices[laid.vertices[:, 2] > RAIL_M - 0.01]
    line = np.array(path)
    gaps = [float(np.min(np.hypot(*(line - v[:2]).T))) for v in rails[:: max(len(rails) // 10, 1)]]
    assert min(gaps) > 0.5
    assert site.ground_z(-15.0, -3.0) == pytest.approx(0.35)


def test_s_curves_join_parallel_tracks():
    path = s_curve((0.0, 1.0), (20.0, 6.0))
    assert path[0] == (0.0, 1.0)
    assert path[-1] == pytest.approx((20.0, 6.0))
    assert abs(path[1][1] - 1.0) < 0.2
    assert abs(path[-2][1] - 6.0) < 0.2


def test_arcades_open_where_their_arches_are():
    wall = arcade(-10.0, 10.0, 0.0, 8.0, [(0.0, 3.0, 3.0)], 2.0)
    solid = 20.0 * 8.0 - (6.0 * 3.0 + np.pi * 9.0 / 2)
    a, b, c = (wall.vertices[wall.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(2.0 * solid, rel=0.02)


def test_upright_faces_stand_where_they_are_drawn():
    body = upright([Polygon([(0, 0), (2, 0), (2, 1), (0, 1)])], 0.5, y_m=3.0)
    assert body.vertices.min(axis=0) == pytest.approx((0.0, 2.75, 0.0))
    assert body.vertices.max(axis=0) == pytest.approx((2.0, 3.25, 1.0))


def test_parapets_are_open_at_their_gaps():
    ends = {"x0": -10.0, "x1": 10.0, "half_m": 4.5}
    whole = bridge_parapets(**ends, frame="iron")
    gapped = bridge_parapets(**ends, frame="iron", gaps=[(-2.0, 2.0, 1)])
    assert sum(len(m.faces) for _, m in gapped) != sum(len(m.faces) for _, m in whole)
    site = blank()
    site.add("deck", "bridge_deck", [*bridge_deck(**ends, road_m=3.0), *gapped])
    far = distances(site.scene(), [(0.0, 0.0, 0.7), (5.0, 0.0, 0.7)], (0.0, 1.0, 0.0))
    assert far[0] > 10.0
    assert far[1] < 4.6
