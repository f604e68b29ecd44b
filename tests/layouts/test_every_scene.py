"""What every scene of the paper keeps to, whatever its layout: what it holds, and how it stands up to a near look."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.layout_checks import (
    ASSETS,
    DAILY,
    ELSEWHERE,
    built_elsewhere,
    catalogue,
    clashes,
    distances,
    each_scene,
    floating,
    kinds_of,
    looks_of,
    nightly_unless,
    props_of,
    touching,
    walled_in,
)  # fmt: skip

from aerialdojo_gen.base.paper_figures import paper_counts
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.scenes import checks
from aerialdojo_gen.scenes.checks import SITTER
from aerialdojo_gen.scenes.horizon.build import MAX_TRIANGLES
from aerialdojo_gen.scenes.kit.rail import RAIL_M
from aerialdojo_gen.scenes.model import Scene

SCENES = sorted(path.stem for path in (ASSETS / "scenes").glob("*.toml"))
TYPES = sorted({name.rpartition("_")[0] for name in SCENES})
# SHA-256 of the meshes of the release, by scene.
RELEASED = {
    Path(name).stem: digest
    for digest, name in map(str.split, (ASSETS.parent / "tests/golden/release.sha256").read_text().splitlines())
    if name.startswith("meshes/")
}
# How deep in what bears it a prop's foot may be, metres: boulders lie half in the ground, trees root in slopes, what
# a flood has moved stands in the water.
REACH_M = {
    "D_Earthquake": 1.5, "D_Explosion": 1.2, "D_Flood": 2.4, "I_Bridge": 1.5, "I_RailCorridor": 1.5, "N_Desert": 1.4,
    "N_Forest": 2.2, "N_Mountain": 2.2, "N_Snowfield": 1.4, "U_Park": 1.3, "U_Stadium": 1.3,
}  # fmt: skip
# They hang on walls; a kiosk's own stilts reach through the pier's deck; chair and box stand on porch and lookout.
HUNG = {
    "cooler_box", "dock_door", "pier_kiosk", "rocking_chair", "shop_sign", "storefront", "wall_banner", "wall_clock",
}  # fmt: skip
# They are props and bear others.
BEARERS = {"freighter", "shipping_container"}
# They bear or span what stands in their outline; trees grow out of hedges, fences run on along what they enclose.
SPANNING = {"container_crane", "fire_tower", "freighter", "gantry_crane", "hedge_block", "log_cabin", "wooden_fence"}
# Structure that is closed: nobody looks for a thing in it.
CLOSED = {
    "bathing_house", "barn", "boat_shed", "boathouse", "brick_stack", "burst_tank", "cafe", "canteen", "coal_bunker",
    "container_stack", "depot_shed", "ferry_terminal", "flat_house", "flats", "hotel", "house", "hut", "ice_ridge",
    "mudbrick_house", "office_block", "pier_pavilion", "port_office", "power_house", "retaining_wall", "rock",
    "ruin_wall", "sea_wall", "station_building", "station_house", "substation", "thatched_hut", "ticket_office",
    "toll_house", "toll_office", "town_block", "town_house", "turbine_hall", "warehouse", "workshop", "yard_wall",
}  # fmt: skip
# How much of the smaller of two outlines may lie in the other's: planters stand close to shop windows.
SHARE = {"D_Flood": 0.2, "I_Bridge": 0.05, "I_RailCorridor": 0.05, "U_Alley": 0.2, "U_ParkingLot": 0.2}

# Environment in which OpenBLAS and NumPy take the instructions of the oldest x86-64 processors that they know.
OLD_PROCESSOR = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}


def type_of(name: str) -> str:
    return name.rpartition("_")[0]


@pytest.fixture(scope="module", params=[nightly_unless(name in DAILY, name) for name in SCENES])
def scene(request: pytest.FixtureRequest, scene_of: Callable[[str], Scene]) -> Scene:
    return scene_of(request.param)


def read_annotations(name: str) -> dict[str, Any]:
    return json.loads((ASSETS.parent / "annotations" / f"{name}.json").read_text(encoding="utf-8"))


def test_it_has_the_bytes_of_the_release(scene: Scene, mesh_of: Callable[[str], Path]) -> None:
    """Which other processes built on another day; a change that is meant to change it renews the golden file."""
    assert hashlib.sha256(mesh_of(scene.name).read_bytes()).hexdigest() == RELEASED[scene.name]


# A change of powers is first seen in N_Mountain_0, of how parts are turned or joined in U_Mall_0.
@pytest.mark.scenes
@pytest.mark.parametrize("name", [nightly_unless(name == ELSEWHERE, name) for name in ("N_Mountain_0", "U_Mall_0")])
def test_it_has_these_bytes_on_another_processor_too(tmp_path: Path, name: str) -> None:
    assert hashlib.sha256(built_elsewhere(name, tmp_path, OLD_PROCESSOR)).hexdigest() == RELEASED[name]


def test_it_holds_what_the_paper_the_recipe_and_the_annotations_ask_for(scene: Scene) -> None:
    n_landmarks, n_objects = paper_counts()[scene.name]
    assert kinds_of(scene)["landmark"] >= n_landmarks
    assert len(looks_of(scene)) >= n_objects
    there = Counter(i.category for i in scene.instances)
    wanted = Counter(tomllib.loads((ASSETS / "scenes" / f"{scene.name}.toml").read_text()).get("inventory", {}))
    assert wanted <= there
    annotated = read_annotations(scene.name)
    assert {thing["node"] for thing in annotated["landmarks"] if "node" in thing} <= {i.node for i in scene.instances}
    for thing in annotated["objects"]:
        assert scene[thing["node"]].category == thing["category"]


def test_its_names_are_unique(scene: Scene) -> None:
    nodes = Counter(i.node for i in scene.instances)
    assert [node for node, n in nodes.items() if n > 1 or not re.fullmatch(r"[a-z][a-z0-9_]*", node)] == []
    assert [i.node for i in scene.instances if i.category == "ground"] == ["ground"]


def test_it_keeps_to_its_bounds_and_its_budget(scene: Scene) -> None:
    low, high = scene.bounds
    # What is looked for can be flown around; towers rise above the ceiling, and crowns hang over the edge.
    targets = [scene[thing["node"]] for thing in read_annotations(scene.name)["objects"]]
    assert [t.node for t in targets if (t.centroid < low - [0.0, 0.0, 2.0]).any() or (t.centroid > high).any()] == []
    assert [i.node for i in scene.instances if ((i.bounds[1] < low) | (i.bounds[0] > high)).any()] == []
    assert 30_000 <= scene.n_triangles <= checks.MAX_TRIANGLES
    # Of air over the lowest ground there is more where there are hills.
    relief_m = float(np.ptp(scene["ground"].vertices[:, 2]))
    assert 12.0 <= scene.ceiling_m <= 30.0 + relief_m


def test_the_land_goes_on_to_the_horizon(scene: Scene) -> None:
    """From anywhere in the flight volume, below the horizon there is no sky; and what lies beyond is cheap."""
    beyond = [part for instance in scene.backdrop for part in instance.parts]
    assert 0 < sum(len(part.faces) for part in beyond) <= MAX_TRIANGLES
    assert "horizon" not in scene
    caster = TriangleRayCaster(*soup([*(part for i in scene.instances for part in i.parts), *beyond]))
    draws = generator(0, "horizon", scene.name)
    down = draws.normal(size=(4000, 3)) * [1.0, 1.0, 0.2]
    down[:, 2] = -np.abs(down[:, 2]) - 1e-4
    eyes = draws.uniform(scene.bounds[0], scene.bounds[1], (4000, 3))
    ground = TriangleRayCaster(scene["ground"].vertices, scene["ground"].faces)
    above = ground.first_hit(eyes, np.tile([0.0, 0.0, -1.0], (4000, 1)))[1] >= 0
    assert above.mean() > 0.3
    # A ray in a million slips between two triangles.
    assert (caster.first_hit(eyes[above], down[above])[1] < 0).sum() <= 1


def test_its_props_stand_on_something(scene: Scene) -> None:
    reach_m = REACH_M.get(type_of(scene.name), 0.9)
    # On steep slopes some lean out: the next test looks at every one.
    hung = HUNG | {"boulder"} if type_of(scene.name) in ("N_Forest", "N_Mountain") else HUNG
    assert floating(scene, hung, reach_m, BEARERS) == []


@each_scene(["N_Mountain_0", "N_Mountain_1", "N_Forest_1"])
def test_boulders_touch_the_ground(scene_of, name):
    scene = scene_of(name)
    ground = Scene(name, (scene["ground"],), scene.materials, scene.bounds)
    for boulder in (i for i in scene.instances if i.category == "boulder"):
        high = boulder.vertices * [1.0, 1.0, 0.0] + [0.0, 0.0, 500.0]
        above = boulder.vertices[:, 2] - (500.0 - distances(ground, high, (0.0, 0.0, -1.0)))
        assert above.min() < 0.0 < above.max(), boulder.node


def test_its_props_do_not_stand_in_one_another(scene: Scene) -> None:
    assert clashes(scene, SHARE.get(type_of(scene.name), 0.1), SPANNING) == []


def test_its_props_are_not_walled_in(scene: Scene) -> None:
    assert walled_in(scene, CLOSED) == []


@pytest.mark.parametrize("kind", [nightly_unless({f"{kind}_0", f"{kind}_1"} <= DAILY, kind) for kind in TYPES])
def test_the_two_scenes_of_a_type_differ(scene_of: Callable[[str], Scene], kind: str) -> None:
    first, second = (scene_of(f"{kind}_{k}") for k in (0, 1))
    assert not np.array_equal(first.bounds, second.bounds)
    things = [{(i.category, i.variant) for i in props_of(s)} for s in (first, second)]
    assert len(things[0] ^ things[1]) > 0.3 * len(things[0] | things[1])
    structure = [
        {tuple(np.round(i.bounds.ravel(), 1)) for i in s.instances if i.category not in catalogue()}
        for s in (first, second)
    ]
    assert len(structure[0] & structure[1]) <= 1


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


@each_scene(["U_Stadium_0"])
def test_one_flies_from_the_pitch_through_a_portal_and_out_of_the_ground(scene_of, name):
    # Under the upper rows and through the outer wall; beside the portal the front wall bars the way.
    xs = (-12.0, 0.0, 12.0)
    eyes = [*((x + 1.1, -10.9, 2.0) for x in xs), *((x + 1.9, -10.9, 0.9) for x in xs)]
    through, beside = distances(scene_of(name), eyes, (0.0, -1.0, 0.0)).reshape(2, 3)
    assert (through > 9.0).all()
    assert (beside < 1.5).all()


@pytest.fixture(scope="module", params=[nightly_unless("U_Mall_0" in DAILY, "U_Mall_0")])
def mall(request: pytest.FixtureRequest, scene_of: Callable[[str], Scene]) -> Scene:
    return scene_of(request.param)


@pytest.fixture(scope="module")
def mall_world(mall: Scene) -> CollisionWorld:
    return CollisionWorld(mall)


def test_every_prop_says_where_it_stands(mall: Scene) -> None:
    for i in props_of(mall):
        assert i.attributes.get("place", "").strip() or catalogue()[i.category].kind == "life", i.node


def test_props_do_not_stand_in_each_other(mall: Scene) -> None:
    pairs = touching(i for i in props_of(mall) if catalogue()[i.category].kind != "building" and i.category != SITTER)
    # Hedges run on from block to block, and trees grow out of them.
    assert [p for p in sorted(pairs) if not any("hedge" in n for n in p)] == []


@pytest.mark.parametrize(
    ("p", "q", "free"),
    [
        ((-10.5, 15.0, 3.2), (-10.5, 60.0, 3.2), True),
        ((-29.0, 17.7, 4.3), (8.0, 17.7, 4.3), True),
        ((-33.65, 3.0, 3.9), (-33.65, 14.0, 3.9), True),
        ((-11.0, -20.0, 3.3), (-11.0, -1.5, 3.3), True),
        ((-59.6, 0.0, 4.4), (-59.6, 40.0, 4.4), True),
        ((47.0, 18.6, 2.4), (90.0, 18.6, 2.4), True),
        ((51.0, 37.0, 6.3), (90.0, 37.0, 6.3), True),
        ((57.0, -30.0, 2.9), (57.0, -12.0, 2.9), True),
        ((38.0, -14.0, 7.0), (38.0, 50.0, 7.0), True),
        ((-20.0, 10.0, 2.0), (-20.0, 55.0, 2.0), False),
        ((0.0, 30.0, 12.0), (0.0, 30.0, 3.0), False),
        ((65.0, 30.0, 2.0), (65.0, 30.0, 9.0), False),
    ],
    ids=[
        "passage", "north arcade", "west arcade", "gate", "west canopy", "deck", "middle floor", "terrace", "drive",
        "hall", "roof", "slab",
    ],
)  # fmt: skip
def test_a_drone_can_fly_through_passages_but_not_through_walls_and_floors(mall_world, p, q, free):
    assert mall_world.segment_in_collision(np.array(p), np.array(q), 0.25) is not free
