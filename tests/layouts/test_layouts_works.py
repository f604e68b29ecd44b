"""Factories and construction sites: each stands up to a look from close by, and structure bears what is on it."""

from functools import partial

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, catalogue, distances, each_scene, props_of

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.concrete import Slab, concrete_frame, scaffold
from aerialdojo_gen.scenes.kit.halls import HallRoof, hall
from aerialdojo_gen.scenes.kit.landforms import earth_ramp, level_grid, terraces
from aerialdojo_gen.scenes.kit.steelwork import guard_rails

blank = partial(blank_site, "U_T_0")
SCENES = [f"U_{kind}_{k}" for kind in ("Factory", "ConstructionSite") for k in (0, 1)]
of_each_scene = each_scene(SCENES)


@of_each_scene
def test_things_stand_at_many_heights(scene_of, name):
    scene = scene_of(name)
    targets = set(catalogue().targets)
    heights = np.array([p.bounds[0, 2] for p in props_of(scene) if p.category in targets])
    assert np.percentile(heights, 95) - np.percentile(heights, 5) > 3.5


def test_a_frame_bears_on_every_floor_and_is_open_between():
    site = blank()
    plan = rectangle(-8, -8, 8, 8)
    void = rectangle(-2, -2, 2, 2)
    grid = [-7.0, 0.0, 7.0]
    concrete_frame(site, xs=grid, ys=grid, slabs=[Slab(plan, 3.6, void), Slab(plan, 7.2)])
    scene = site.scene()
    assert distances(scene, [(4.0, 4.0, 5.0), (1.0, 1.5, 5.0)], (0.0, 0.0, -1.0)) == pytest.approx([1.4, 5.0])
    across = distances(scene, [(-20.0, 3.5, 1.8), (-20.0, 3.5, 4.67)], (1.0, 0.0, 0.0))
    assert across[0] > 30.0
    assert across[1] == pytest.approx(12.1, abs=0.3)
    assert not site.is_free(7.0, 7.0, 0.2)
    assert site.is_free(4.0, 4.0, 1.0, z=3.6)


def test_pits_have_benches_and_ramps_lead_down():
    pit = rectangle(-15, -15, 15, 15)
    site = blank()
    flat = level_grid(site, site.terrain, cell_m=1.0)
    ground = terraces(site, flat, area=pit, steps=[(0, 0), (3, -2), (6, -2), (9, -5)])
    assert ground.z(0, 0) == pytest.approx(-5.0)
    assert ground.z(-10.5, 0) == pytest.approx(-2.0, abs=0.1)
    assert ground.z(-20, 0) == 0.0
    ground = earth_ramp(site, ground, start=(-16, 0, 0.0), end=(4, 0, -5.0), width_m=4.0)
    profile = ground.z(np.linspace(-16, 4, 21), np.zeros(21))
    assert profile == pytest.approx(np.linspace(0.0, -5.0, 21), abs=0.15)


def test_halls_are_entered_by_their_gates_alone():
    site = blank()
    gates = {"s": [(8.0, 12.0, 0.0, 4.0)]}
    box = (-10.0, -6.0, 10.0, 6.0)
    hall(site, category="hall", box=box, eaves_m=5.0, wall="brick", roof=HallRoof("gravel"), gates=gates)
    feet = [(0.0, -12.0, 1.8), (-6.0, -12.0, 1.8), (6.0, -12.0, 1.0)]
    distance = distances(site.scene(), feet, (0.0, 1.0, 0.0))
    assert distance[0] > 17.0
    assert (distance[1:] < 6.2).all()
    assert site.is_free(0.0, 0.0, 2.0)
    assert not site.is_free(-6.0, -6.0, 0.2)


def test_scaffolds_take_the_side_left_of_their_line():
    site = blank()
    scaffold(site, line=((0.0, 0.0), (10.0, 0.0)), z=(0.0, 6.0))
    assert not site.is_free(5.0, 0.6, 0.2)
    assert site.is_free(5.0, -0.6, 0.2)
    assert site.instances[-1].bounds[1, 2] == pytest.approx(7.1, abs=0.1)


def test_guard_rails_follow_every_line():
    lines = shapely.MultiLineString([[(0, 0), (6, 0)], [(0, 4), (0, 9)]])
    bodies = dict(guard_rails(lines, 2.0, toe="planks"))
    rail = bodies["marking_yellow"].vertices
    assert bodies["planks"].vertices[:, 2].max() == pytest.approx(2.2)
    assert rail[:, 2].min() == pytest.approx(2.0)
    assert rail[:, 2].max() == pytest.approx(3.1)
    assert rail[:, 0].max() == pytest.approx(6.0, abs=0.1)
    assert rail[:, 1].max() == pytest.approx(9.0, abs=0.1)
    assert "planks" not in dict(guard_rails(lines, 2.0))
