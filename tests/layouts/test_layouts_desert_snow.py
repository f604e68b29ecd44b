"""Deserts and snowfields: each stands up to a look from close by."""

import numpy as np
import pytest
import shapely
from support.layout_checks import catalogue, each_scene, props_of

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.layouts.natural.desert.sands import dunes, wash
from aerialdojo_gen.scenes.layouts.natural.parts.groups import Group, level_ground, plan_groups, set_out
from aerialdojo_gen.scenes.layouts.natural.parts.strata import Rock, put_up
from aerialdojo_gen.scenes.layouts.natural.snowfield.winter import banked, moguls, slope_ground
from aerialdojo_gen.scenes.recipe import Recipe
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import rolling_terrain

SCENES = [f"N_{kind}_{k}" for kind in ("Desert", "Snowfield") for k in (0, 1)]
of_each_scene = each_scene(SCENES)


def blank(size: float = 60.0) -> Site:
    return Site("N_T_0", Recipe(layout="none", size_m=(size, size), ceiling_m=20), catalogue())


@of_each_scene
def test_things_keep_clear_of_rocks_and_houses(scene_of, name):
    scene = scene_of(name)
    hulls = [(i, shapely.MultiPoint(i.vertices[:, :2]).convex_hull) for i in scene.instances if i.category == "hut"]
    for prop in props_of(scene):
        for i, hull in hulls:
            if prop.bounds[0, 2] < i.bounds[1, 2] - 0.5 and prop.bounds[1, 2] > i.bounds[0, 2] + 1.0:
                assert not hull.buffer(-0.3).contains(shapely.Point(prop.centroid[:2])), (prop.node, i.node)


def test_dunes_are_steeper_in_the_lee():
    ground = dunes((80, 80), 1.0, 3, 5.0, 24.0, 0.0)
    slope = np.diff(ground.heights_m, axis=1)
    assert np.ptp(ground.heights_m) > 4.0
    assert -np.quantile(slope, 0.02) > 1.3 * np.quantile(slope, 0.98)
    assert (slope > 0).mean() > 0.55


def test_a_wash_climbs_from_its_bed():
    ground = wash((60, 60), 1.0, 3, [(-30, 0), (30, 0)], [(4, 6, 2.0), (12, 16, 3.0)], 0.3)
    middle, banks, rim = (float(np.mean(ground.z(np.linspace(-25, 25, 50), np.full(50, y)))) for y in (0, 10, 26))
    assert banks - middle == pytest.approx(2.0, abs=0.5)
    assert rim - banks == pytest.approx(3.0, abs=0.5)


def test_snow_is_banked_beside_the_way_and_bumpy_where_asked():
    flat = rolling_terrain((60, 60), 1.0, 1, 0.0, 20.0)
    path = [(-30.0, 0.0), (30.0, 0.0)]
    bank = banked(flat, path, 6.0, 1.0)
    assert float(bank.z(0, 4.4)) > 0.8 > 0.2 > float(bank.z(0, 0))
    bumps = moguls(flat, shapely.box(-10, -10, 10, 10), 1.0, 4.4)
    assert np.ptp(bumps.z(np.linspace(-6, 6, 60), np.full(60, 1.1))) > 0.5
    assert float(np.abs(bumps.z(20, 20))) < 1e-9
    tilted = slope_ground(flat, [(-30, 0), (0, 0), (30, 9)], 0.0)
    assert float(tilted.z(0, -20)) == pytest.approx(0.0, abs=0.2)
    assert 4.0 < float(tilted.z(0, 20)) < 7.0


def test_groups_keep_their_distance_and_stand_on_their_decks():
    site = blank()
    rock = Rock(name="mesa", at=(10.0, 0.0), radius_m=7.0, height_m=4.0)
    camp = Group(
        name="camp", at=(-12, 0), radius_m=9, level=True, things=("tent", "tent blue", "campfire @ 0 0", "deer")
    )
    top = Group(name="top", at=(10, 0), radius_m=6, on="mesa", place="up there", things=("stone_cairn grey",))
    area = rock.area(site.recipe.seed)
    planned = plan_groups(site, [camp, top], [area], {"mesa": rock.top(site.recipe.seed)}, lambda _x, _y: 0.0)
    site.set_ground(level_ground(rolling_terrain((60, 60), 1.5, 4, 3.0, 20.0), planned))
    deck = put_up(site, rock, ("rock",))
    placed = set_out(site, planned, {"mesa": deck})
    assert len(placed) == 5
    for a, b in ((a, b) for a in planned for b in planned if a is not b and a.group is b.group):
        assert a.outline.distance(b.outline) >= camp.gap_m - 1e-6
    cairn = next(i for i in placed if i.category == "stone_cairn")
    assert cairn.bounds[0, 2] == pytest.approx(deck.z_m, abs=0.25)
    assert cairn.attributes["place"] == "up there"
    fire = next(p for p in planned if p.category == "campfire")
    assert (fire.x, fire.y) == (-12, 0)


def test_impossible_groups_say_so():
    site = blank()
    crowd = Group(name="crowd", at=(0, 0), radius_m=2, things=("log_cabin", "log_cabin"))
    with pytest.raises(AssetError, match="has no room for 'log_cabin'"):
        plan_groups(site, [crowd], [], {}, lambda _x, _y: 0.0)
    with pytest.raises(AssetError, match="which is no deck"):
        plan_groups(site, [Group(name="a", at=(0, 0), things=(), on="attic")], [], {}, lambda _x, _y: 0.0)
    with pytest.raises(AssetError, match="is no thing"):
        plan_groups(site, [Group(name="a", at=(0, 0), things=("two words here",))], [], {}, lambda _x, _y: 0.0)
