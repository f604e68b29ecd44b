"""Forests, mountains, deserts, snowfields, islands and coasts: each stands up to a look from close by."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import partial

import numpy as np
import pytest
import shapely
from support.layout_checks import (
    DAILY,
    blank_site,
    catalogue,
    distances,
    each_scene,
    nightly_unless,
    props_of,
    touching,
)
from support.maps import ground_z

from aerialdojo_gen.scenes.grammar import blob, ragged_outline
from aerialdojo_gen.scenes.kit.quays import pier
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.terrain import rolling_terrain

DOWN = (0.0, 0.0, -1.0)
_ELSEWHERE = {"in the wood", "beside a path", "beside the stream"}
_STRUCTURE = {"ground", "wooden_fence", "reed_clump"}
_LIFE = {"person", "dog", "crow"}


@pytest.fixture(scope="module", params=[nightly_unless("N_Forest_0" in DAILY, "N_Forest_0")])
def forest(request: pytest.FixtureRequest, scene_of: Callable[[str], Scene]) -> Scene:
    return scene_of(request.param)


@pytest.fixture(scope="module")
def things(forest: Scene) -> list[Instance]:
    return [
        i
        for i in forest.instances
        if i.category not in _STRUCTURE | _LIFE and i.attributes.get("place") not in _ELSEWHERE
    ]


def above_ground(scene: Scene, things: Iterable[Instance]) -> Iterator[tuple[Instance, np.ndarray]]:
    """Things, and how far each vertex lies above the ground."""
    things = list(things)
    v = np.concatenate([thing.vertices for thing in things])
    above = v[:, 2] - ground_z(scene, v[:, :2])
    return zip(things, np.split(above, np.cumsum([len(thing.vertices) for thing in things])[:-1]), strict=True)


def test_no_two_things_are_told_apart_by_nothing(things: list[Instance]) -> None:
    assert max(Counter((i.category, i.variant, i.attributes["place"]) for i in things).values()) == 1
    assert not touching(things)


def test_things_stand_on_the_ground(forest: Scene, things: list[Instance]) -> None:
    on_ground = [i for i in things if i.category not in {"rocking_chair", "cooler_box", "footbridge"}]
    for thing, above in above_ground(forest, on_ground):
        z = thing.vertices[:, 2]
        feet = above[z < z.min() + 0.12]
        assert feet.min() < 0.05, f"{thing.node} floats by {feet.min():.2f} m"
        assert feet.max() < 0.35, f"{thing.node} stands on {feet.max():.2f} m of air"
        assert above[z.argmax()] > 0.3, f"{thing.node} is buried"


@pytest.mark.parametrize(
    ("node", "under"), [("rocking_chair_000", "log_cabin_000"), ("cooler_box_000", "fire_tower_000")]
)
def test_the_raised_things_stand_on_porch_and_deck(forest: Scene, node: str, under: str) -> None:
    v = forest[node].vertices
    feet = v[v[:, 2] < v[:, 2].min() + 0.02] + [0.0, 0.0, 0.3]
    alone = Scene(under, (forest[under],), forest.materials, forest.bounds)
    np.testing.assert_allclose(feet[:, 2] - distances(alone, feet, DOWN), v[:, 2].min(), atol=0.06)


@pytest.mark.parametrize("seed", [0, 1, 7, 123])
def test_blobs_are_simple_round_areas(seed: int) -> None:
    area = blob(3.0, -2.0, 5.0, seed)
    assert area.is_valid
    assert 0.4 * np.pi * 25 < area.area < 2.2 * np.pi * 25
    assert area.centroid.distance(blob(3.0, -2.0, 5.0, seed, ragged=0.0).centroid) < 1.5


@each_scene(["N_Mountain_0", "N_Mountain_1", "N_Forest_1"])
def test_boulders_touch_the_ground(scene_of, name):
    scene = scene_of(name)
    for boulder, above in above_ground(scene, (i for i in scene.instances if i.category == "boulder")):
        assert above.min() < 0.0 < above.max(), boulder.node


@each_scene(["N_Mountain_0"])
def test_the_summit_is_reached_on_foot_and_crowned(scene_of, name):
    scene = scene_of(name)
    ground, cross = scene["ground"], scene["summit_cross_000"]
    assert np.ptp(ground.vertices[:, 2]) > 25.0
    assert cross.bounds[0, 2] > 0.8 * ground.vertices[:, 2].max()
    assert "summit_cross" not in catalogue().targets


blank = partial(blank_site, "N_T_0", seed=3)
FLAT = rolling_terrain((60, 60), 1.0, 1, 0.0, 20.0)


@each_scene(f"N_{kind}_{k}" for kind in ("Desert", "Snowfield") for k in (0, 1))
def test_things_keep_clear_of_rocks_and_houses(scene_of, name):
    scene = scene_of(name)
    hulls = [(i, shapely.MultiPoint(i.vertices[:, :2]).convex_hull) for i in scene.instances if i.category == "hut"]
    for prop in props_of(scene):
        for i, hull in hulls:
            if prop.bounds[0, 2] < i.bounds[1, 2] - 0.5 and prop.bounds[1, 2] > i.bounds[0, 2] + 1.0:
                assert not hull.buffer(-0.3).contains(shapely.Point(prop.centroid[:2])), (prop.node, i.node)


@each_scene(f"N_{kind}_{k}" for kind in ("Island", "Coast") for k in (0, 1))
def test_boats_lie_on_the_level_sea(scene_of, name):
    scene = scene_of(name)
    afloat = ("fishing_boat", "rowing_boat", "sailboat", "motor_yacht", "tugboat", "buoy")
    boats = np.array([i.bounds for i in props_of(scene) if i.category in afloat])
    assert len(boats) >= 4
    np.testing.assert_allclose(ground_z(scene, boats.mean(axis=1)[:, :2]), 0.0, atol=0.15)
    assert boats[:, 0, 2].max() < 0.1


def test_coastlines_are_natural_and_always_the_same():
    coarse = shapely.box(-20, -20, 20, 20)
    line = ragged_outline(coarse.exterior, 5, 1.5, 3.0)
    assert line.equals(ragged_outline(coarse.exterior, 5, 1.5, 3.0))
    assert not line.equals(ragged_outline(coarse.exterior, 6, 1.5, 3.0))
    assert line.is_valid
    assert line.area == pytest.approx(1600, rel=0.15)
    assert 0.5 < shapely.hausdorff_distance(line.boundary, coarse.boundary) < 6.0


def test_piers_bear_above_and_are_open_below():
    site = blank()
    pier(site, at=(-15.0, 0.0), yaw_deg=0.0, length_m=30.0, width_m=5.0, z=4.0, bay_m=5.0, rail="iron")
    scene = site.scene()
    down = distances(scene, [(x, 0.4, 9.0) for x in (-12.0, 0.3, 14.0)], DOWN)
    assert 9.0 - down == pytest.approx([4.0] * 3, abs=0.01)
    assert distances(scene, [(-20.0, 1.2, 1.2)], (1.0, 0.0, 0.0))[0] > 30.0
