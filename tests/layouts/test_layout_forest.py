"""The forest N_Forest_0 as built from its recipe: what it offers, how things stand, what is open to flight."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from support.layout_checks import touching

from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.model import Instance, Scene

_ELSEWHERE = {"in the wood", "beside a path", "beside the stream"}
_STRUCTURE = {"ground", "wooden_fence", "reed_clump"}
_LIFE = {"person", "dog", "crow"}


@pytest.fixture(scope="module")
def forest(scene_of: Callable[[str], Scene]) -> Scene:
    return scene_of("N_Forest_0")


@pytest.fixture(scope="module")
def things(forest: Scene) -> list[Instance]:
    return [
        i
        for i in forest.instances
        if i.category not in _STRUCTURE | _LIFE and i.attributes.get("place") not in _ELSEWHERE
    ]


@pytest.fixture(scope="module")
def ground(forest: Scene) -> trimesh.Trimesh:
    body = forest["ground"]
    return trimesh.Trimesh(body.vertices, body.faces, process=False)


def _ground_z(ground: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    origins = np.column_stack([points[:, :2], np.full(len(points), 50.0)])
    down = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    places, rays, _ = ground.ray.intersects_location(origins, down, multiple_hits=False)
    z = np.full(len(points), -np.inf)
    z[rays] = places[:, 2]
    return z


def test_what_there_is_to_find_lies_close_together(forest: Scene, things: list[Instance]) -> None:
    at = np.array([i.centroid[:2] for i in things])
    apart = np.linalg.norm(at[:, None] - at[None, :], axis=2)[np.triu_indices(len(at), 1)]
    assert np.linalg.norm(at, axis=1).max() < 27.0
    assert np.median(apart) < 25.0
    assert np.ptp([i.centroid[2] for i in things]) > 10.0


def test_no_two_things_are_told_apart_by_nothing(things: list[Instance]) -> None:
    seen = Counter((i.category, i.variant, i.attributes["place"]) for i in things)
    assert max(seen.values()) == 1


def test_things_stand_on_the_ground(things: list[Instance], ground: trimesh.Trimesh) -> None:
    raised = {"rocking_chair", "cooler_box", "footbridge"}
    for thing in things:
        if thing.category in raised:
            continue
        v = thing.vertices
        feet = v[v[:, 2] < v[:, 2].min() + 0.12]
        gap = feet[:, 2] - _ground_z(ground, feet)
        assert gap.min() < 0.05, f"{thing.node} floats by {gap.min():.2f} m"
        assert gap.max() < 0.35, f"{thing.node} stands on {gap.max():.2f} m of air"
        assert v[:, 2].max() > _ground_z(ground, v)[v[:, 2].argmax()] + 0.3, f"{thing.node} is buried"


def test_things_do_not_run_into_one_another(things: list[Instance]) -> None:
    assert not touching(things)


def test_the_raised_things_stand_on_porch_and_deck(forest: Scene) -> None:
    for node, under, category in (
        ("rocking_chair_000", "log_cabin_000", "rocking_chair"),
        ("cooler_box_000", "fire_tower_000", "cooler_box"),
    ):
        thing, support = forest[node], forest[under]
        assert thing.category == category
        body = trimesh.Trimesh(support.vertices, support.faces, process=False)
        feet = thing.vertices[thing.vertices[:, 2] < thing.vertices[:, 2].min() + 0.02]
        down = np.tile([0.0, 0.0, -1.0], (len(feet), 1))
        places, _, _ = body.ray.intersects_location(feet + np.array([0.0, 0.0, 0.3]), down, multiple_hits=False)
        assert len(places) == len(feet)
        assert np.abs(feet[:, 2].min() - places[:, 2]).max() < 0.06


def test_every_thing_can_be_flown_around_on_some_side(forest: Scene, things: list[Instance]) -> None:
    free = ClearanceGrid.build(forest, radius_m=0.25, margin_m=0.05)
    for thing in things:
        low, high = thing.bounds
        middle = (low + high) / 2
        reach = np.linalg.norm((high - low)[:2]) / 2 + 1.0
        angles = np.arange(16) * np.pi / 8
        ring = [
            (middle[0] + reach * np.cos(a), middle[1] + reach * np.sin(a), z)
            for a in angles
            for z in (middle[2], high[2] - 0.1, high[2] + 0.8)
        ]
        assert sum(free.reachable(p) for p in ring) >= 3, thing.node


def test_the_landmark_rises_over_the_wood_but_not_over_the_ceiling(forest: Scene) -> None:
    tower = forest["fire_tower_000"]
    assert tower.bounds[1, 2] - tower.bounds[0, 2] > 14.0
    assert all(i.bounds[1, 2] < forest.ceiling_m - 1.0 for i in forest.instances)


def test_trees_stay_off_the_clearings(forest: Scene) -> None:
    camp, cabin = (forest[node].centroid for node in ("campfire_000", "log_cabin_000"))
    for tree in forest.instances:
        if tree.category.endswith("_tree") and tree.attributes["place"] == "in the wood":
            v = tree.vertices
            root = v[v[:, 2] < v[:, 2].min() + 0.1].mean(axis=0)
            for spot in (camp, cabin):
                assert np.hypot(*(root - spot)[:2]) > 4.0, tree.node


@pytest.mark.parametrize("seed", [0, 1, 7, 123])
def test_blobs_are_simple_round_areas(seed: int) -> None:
    area = blob(3.0, -2.0, 5.0, seed)
    assert area.is_valid
    assert 0.4 * np.pi * 25 < area.area < 2.2 * np.pi * 25
    assert area.centroid.distance(blob(3.0, -2.0, 5.0, seed, ragged=0.0).centroid) < 1.5
