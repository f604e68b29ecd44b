"""Earthquakes, explosions and floods: broken structure holds together, and everything is on something or afloat."""

from functools import partial

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon
from support.layout_checks import blank_site, clashes, each_scene, floating, props_of

from aerialdojo_gen.scenes.grammar import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.landforms import level_area
from aerialdojo_gen.scenes.kit.rubble import crater, fault, heap, rises, slab_pile, strew_things
from aerialdojo_gen.scenes.kit.ruins import Shored, broken_arcade, damaged_building, put_up, raking_shores
from aerialdojo_gen.scenes.kit.wreckage import Bite, Style, Wreck, broken_edge, torn_floor, torn_wall
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.terrain import rolling_terrain

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


def test_an_arcade_stands_on_its_posts_and_shores_reach_a_leaning_front():
    site = blank()
    posts = [(x, y) for x in (-3.0, 3.0) for y in (-8.0, 0.0, 8.0)]
    roof = broken_arcade(
        site, node="arcade", plan=rectangle(-3.5, -9.0, 3.5, 9.0), at=(0.0, 0.0), height_m=4.0, hole=Bite(3, 8, 2, 3),
        posts=posts, material="stone", stubs=[(3.0, 5.0, 1.0)],
    )  # fmt: skip
    base = damaged_building(
        site, node="house", at=(15.0, 0.0), yaw_deg=90.0, size_m=(12.0, 8.0), storeys=3, style=Style(), lean_deg=6.0,
        sunk_m=0.5,
    )  # fmt: skip
    raking_shores(site, node="shores", fronts=[Shored((15.0, 0.0), 8.0, [-3.0, 0.0, 3.0], 90.0, leans=True)])
    arcade, _, shores = site.instances
    assert roof == pytest.approx(site.ground_z(0.0, 0.0) + 4.0)
    assert base == pytest.approx(site.ground_z(15.0, 0.0) - 0.5)
    assert arcade.bounds[1, 2] == pytest.approx(roof)
    assert shores.bounds[0, 0] > 15.0
    assert shores.bounds[1, 2] == pytest.approx(site.ground_z(15.0, 0.0) + 5.4, abs=0.2)
    assert not site.is_free(3.0, 5.0, 0.2)
    assert not floating(site.scene())


def test_a_terrace_is_levelled_above_a_point_of_the_old_ground():
    site = blank()
    ground = rises(site, rolling_terrain((60.0, 60.0), 1.0, 1, 0.0, 20.0), [(-30.0, 30.0, 6.0)], "y")
    high = float(ground.z(0.0, 10.0)) + 0.7
    areas = [rectangle(-10, 5, -4, 12), rectangle(4, 5, 10, 12)]
    level = level_area(site, ground, area=areas, above=(0.0, 10.0, 0.7), blend_m=2.0)
    assert level.z([-7.0, 7.0], [8.0, 8.0]) == pytest.approx(high)


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


def test_the_ground_sinks_right_of_a_fault():
    ground = fault(blank(), rolling_terrain((40, 40), 1.0, 1, 0.0, 20.0), [(-30.0, 0.0), (30.0, 0.0)], 1.5, 1.0)
    assert float(ground.z(3.0, 5.0)) == pytest.approx(0.0)
    assert float(ground.z(3.0, -5.0)) == pytest.approx(-1.5)


def test_craters_have_a_bowl_and_a_rim():
    ground = crater(blank(), rolling_terrain((60, 60), 1.0, 1, 0.0, 20.0), (0.0, 0.0), 6.0, 3.0, 1.0)
    assert float(ground.z(0.0, 0.0)) == pytest.approx(-3.0)
    ring = [float(ground.z(r, 0.0)) for r in np.arange(0.0, 20.0, 0.5)]
    assert max(ring) > 0.6
    assert ring[-1] == pytest.approx(0.0)


def test_heaps_rise_inside_their_area_only():
    area = Polygon([(-5, -5), (5, -5), (5, 5), (-5, 5)])
    ground = heap(blank(), rolling_terrain((40, 40), 1.0, 1, 0.0, 20.0), area, 2.0, 3)
    assert float(ground.z(0.0, 0.0)) > 1.0
    assert float(ground.z(8.0, 0.0)) == pytest.approx(0.0)


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
