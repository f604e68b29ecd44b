"""Stadiums and amusement parks: each stands up to a look from close by."""

from collections import Counter

import layout_checks
import numpy as np
import pytest
import shapely
from layout_checks import catalogue, clashes, floating, glb_bytes, kinds_of, looks_of, props_of, scene_of

from aerialdojo_gen.common.paper import paper_counts
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.layouts.urban.stadium.stand_shells import platform
from aerialdojo_gen.layouts.urban.stadium.stands import Tier, gangways, passage, tier_parts
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.model import Scene

SCENES = ["U_Stadium_0", "U_Stadium_1", "U_Park_0", "U_Park_1"]
each_scene = pytest.mark.parametrize("name", SCENES)


@each_scene
def test_scenes_are_as_rich_as_the_paper_asks(name):
    scene = scene_of(name)
    n_landmarks, n_objects = paper_counts()[name]
    assert 30_000 <= scene.n_triangles <= 200_000
    assert kinds_of(scene)["landmark"] >= n_landmarks
    assert len(looks_of(scene)) >= 1.2 * n_objects
    assert 12 <= scene.ceiling_m <= 30


@each_scene
def test_props_stand_on_something_and_not_in_one_another(name):
    scene = scene_of(name)
    assert not floating(scene, reach_m=1.3)
    assert not clashes(scene, share=0.1)


@each_scene
def test_props_stand_within_the_site(name):
    scene = scene_of(name)
    low, high = scene.bounds[:, :2]
    outside = [p.node for p in props_of(scene) if (p.bounds[0, :2] < low).any() or (p.bounds[1, :2] > high).any()]
    assert not outside


@pytest.mark.parametrize("kind", ["Stadium", "Park"])
def test_the_two_scenes_of_a_type_differ(kind):
    first, second = (scene_of(f"U_{kind}_{k}") for k in (0, 1))
    assert not np.array_equal(first.bounds, second.bounds)
    structure = [
        {tuple(np.round(i.bounds.ravel(), 1)) for i in s.instances if i.category not in catalogue()}
        for s in (first, second)
    ]
    assert not structure[0] & structure[1]
    things = [{(i.category, i.variant) for i in props_of(s)} for s in (first, second)]
    assert len(things[0] ^ things[1]) > 0.3 * len(things[0] | things[1])


@pytest.mark.parametrize("name", ["U_Stadium_1", "U_Park_0"])
def test_bytes_are_the_same_every_time(name, tmp_path):
    first, second = glb_bytes(name, tmp_path)
    assert first == second


def test_their_themes_are_shown_whole():
    shown = Counter(p.category for name in SCENES for p in props_of(scene_of(name)))
    assets = layout_checks.ASSETS / "props"
    for theme in ("stadium", "amusement", "park"):
        lines = (assets / f"{theme}.toml").read_text(encoding="utf-8").splitlines()
        categories = [
            line[1:-1] for line in lines if line.startswith("[") and line.endswith("]") and "[[" not in line
        ]
        assert categories
        assert not [c for c in categories if not shown[c]]


def ray(scene: Scene, origin: tuple[float, float, float], towards: tuple[float, float, float]) -> float:
    distance, _ = RayCaster(scene).first_hit(np.array([origin]), np.array([towards]))
    return float(distance[0])


@pytest.mark.parametrize("x", [-12.0, 0.0, 12.0])
def test_one_flies_from_the_pitch_through_a_portal_and_out_of_the_ground(x):
    scene = scene_of("U_Stadium_0")
    # Under the upper rows and through the outer wall; beside the portal the front wall bars the way.
    assert ray(scene, (x + 1.1, -10.9, 2.0), (0.0, -1.0, 0.0)) > 9.0
    assert ray(scene, (x + 1.9, -10.9, 0.9), (0.0, -1.0, 0.0)) < 1.5


def one_tier(**options) -> Tier:
    return Tier(rectangle(-10, -6, 10, 6), 4.0, 8, 1.0, **options)


def test_tiers_rise_a_row_at_a_time():
    tier = one_tier()
    assert [tier.level_m(k) for k in (0, 7)] == pytest.approx([1.0, 1.0 + 7 * 0.42])
    bands = [tier.band(k) for k in range(8)]
    assert shapely.unary_union(bands).area == pytest.approx(tier.plan.area, rel=1e-6)
    assert all(bands[k].intersection(bands[k + 1]).area < 1e-6 for k in range(7))


def test_gangways_lead_straight_out_from_the_front_edge():
    tier = one_tier()
    for foot in gangways(tier, 6.0):
        way = passage(foot, 1.2, tier.rows * tier.tread_m)
        assert way.intersection(tier.edge(0)).area < 1.0
        assert way.difference(tier.edge(0)).difference(tier.plan).area < 0.6


def test_seats_keep_off_gangways_portals_and_what_is_to_stay_clear():
    portal = passage(gangways(one_tier(), 6.0)[0], 3.0, 9.0)
    clear = rectangle(4, 10, 9, 14)
    tier = one_tier(portals=(portal,), clear=(clear,))
    feet = gangways(tier, 6.0)
    parts = dict(tier_parts(tier, feet, concrete="concrete", step="steps", seat=lambda x, y, row: "seat"))
    seats = parts["seat"].vertices
    assert len(seats) > 16 * 200
    low = seats[seats[:, 2] < tier.head_m]
    assert not shapely.contains_xy(portal, low[:, 0], low[:, 1]).any()
    assert not shapely.contains_xy(clear.buffer(-0.3), seats[:, 0], seats[:, 1]).any()
    for foot in feet:
        way = passage(foot, 1.1, tier.rows * tier.tread_m)
        assert not shapely.contains_xy(way, seats[:, 0], seats[:, 1]).any()


def test_platforms_are_level_and_end_at_their_height():
    parts = dict(platform(rectangle(0, 0, 3, 2), 0.5, 2.0, floor="floor", rim="rim"))
    assert parts["floor"].vertices[:, 2].min() == 0.5
    assert parts["floor"].vertices[:, 2].max() == 2.0
    assert parts["rim"].vertices[:, 2].max() == pytest.approx(2.12)
