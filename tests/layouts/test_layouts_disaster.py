"""Earthquakes, explosions and floods: broken structure holds together, and everything is on something or afloat."""

from functools import partial

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, clashes, each_scene, floating

from aerialdojo_gen.scenes.grammar import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.rubble import slab_pile, strew_things
from aerialdojo_gen.scenes.kit.ruins import put_up
from aerialdojo_gen.scenes.kit.wreckage import Bite, Style, Wreck, broken_edge, torn_floor, torn_wall
from aerialdojo_gen.scenes.placement import Placement

blank = partial(blank_site, "D_T_0")
BITE = Bite(0.0, -4.0, 2.0, 4.0, seed=3)


def test_bites_start_at_their_foot_and_widen():
    bite = Bite(1.0, 2.0, 2.0, 5.0, 1.0, 11.0, seed=4)
    assert bite.area(0.9).is_empty
    assert bite.area(1.0).area < bite.area(6.0).area < bite.area(20.0).area
    assert bite.area(20.0).area == pytest.approx(bite.area(20.5).area)


def test_walls_lose_what_a_bite_takes_and_no_more():
    rng = np.random.default_rng(1)
    face = rectangle(0.0, 0.0, 20.0, 9.0)
    whole = torn_wall((-10.0, -4.0), (10.0, -4.0), face, (), rng, thickness_m=0.3)
    torn = torn_wall((-10.0, -4.0), (10.0, -4.0), face, (BITE,), rng, thickness_m=0.3)
    assert whole.volume_m3 == pytest.approx(20.0 * 9.0 * 0.3)
    assert 0.3 * whole.volume_m3 < torn.volume_m3 < 0.85 * whole.volume_m3
    upper = torn.vertices[torn.vertices[:, 2] > 6.0]
    assert np.abs(upper[:, 0]).min() > 1.0
    assert torn_wall((0.0, 0.0), (1.0, 0.0), rectangle(0, 1, 1, 3), (Bite(0.5, 0.0, 9.0, 9.0),), rng).volume_m3 == 0.0


def test_floors_end_where_bars_stick_out():
    plan = rectangle(-10.0, -5.0, 10.0, 5.0)
    floor = torn_floor(plan, 3.0, (BITE,))
    assert floor.volume_m3 == pytest.approx(0.25 * plan.difference(BITE.area(3.0)).area, rel=1e-6)
    edge = broken_edge(plan, 3.0, (BITE,))
    assert edge
    for at, yaw in edge:
        assert shapely.Point(at).distance(BITE.area(3.0).boundary) < 0.05
        ahead = shapely.Point(at[0] + 0.4 * np.cos(np.radians(yaw)), at[1] + 0.4 * np.sin(np.radians(yaw)))
        assert BITE.area(3.0).contains(ahead)


def test_a_leaning_building_tips_over_its_front():
    site = blank()
    straight = put_up(site, Wreck(Frame(-15.0, 0.0), 12.0, 8.0, 4, Style()), 0.0)
    leaning = put_up(site, Wreck(Frame(15.0, 0.0), 12.0, 8.0, 4, Style(), lean_deg=8.0), 0.0)
    assert leaning.bounds[0, 1] < straight.bounds[0, 1] - 1.0
    assert leaning.bounds[1, 2] > straight.bounds[1, 2]


def test_a_floor_bears_nothing_where_it_is_gone():
    site = blank()
    wreck = Wreck(Frame(0.0, 0.0, 90.0), 16.0, 10.0, 3, Style(), (Bite(0.0, -5.0, 3.0, 6.0, seed=5),))
    put_up(site, wreck, 0.0)
    assert wreck.bears(6.0, 3.0, 2)
    assert not wreck.bears(0.0, -4.0, 2)


def test_things_are_strewn_where_there_is_room():
    site = blank()
    site.place(Placement("bench", 0.0, 0.0))
    placed = strew_things(site, "on the square", rectangle(-8, -8, 8, 8), ["bench", "stretcher", "bench"], "t")
    assert [i.category for i in placed] == ["bench", "stretcher", "bench"]
    assert not clashes(site.scene())


def test_the_top_of_a_pile_is_level_and_free():
    site = blank()
    z = slab_pile(site, (0.0, 0.0), 30.0, (14.0, 9.0), 4, "t")
    assert site.is_free(1.0, 0.0, 0.5, z=z)
    assert not site.is_free(1.0, 0.0, 0.5, z=z - 1.0)
    site.place(Placement("bench", 1.0, 0.0, z=z))
    assert not floating(site.scene())


of_each_scene = each_scene(["D_Flood_0", "D_Flood_1"])


@of_each_scene
def test_the_water_stands_up_to_the_windows(scene_of, name):
    houses = [i for i in scene_of(name).instances if i.category in ("house", "flat_house")]
    assert len(houses) >= 3
    for house in houses:
        glass = np.concatenate([p.vertices[:, 2] for p in house.parts if p.material == "window"])
        assert house.bounds[0, 2] < -1.0
        assert -0.3 < glass.min() < 0.3


@of_each_scene
def test_the_dyke_has_a_gap_at_water_level(scene_of, name):
    ground = next(i for i in scene_of(name).instances if i.category == "ground")
    crest = ground.vertices[ground.vertices[:, 2] > 2.5]
    gap_x = np.sort(crest[:, 0])
    assert np.diff(gap_x).max() > 5.0
    assert ground.bounds[0, 2] == pytest.approx(0.0, abs=0.05)
