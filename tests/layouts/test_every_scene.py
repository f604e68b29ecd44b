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
    floating,
    kinds_of,
    looks_of,
    nightly_unless,
    props_of,
    walled_in,
)  # fmt: skip

from aerialdojo_gen.base.paper_figures import paper_counts
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes import checks
from aerialdojo_gen.scenes.horizon.build import MAX_TRIANGLES
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


def test_its_names_are_unique_and_its_triangles_sound(scene: Scene) -> None:
    nodes = Counter(i.node for i in scene.instances)
    assert [node for node, n in nodes.items() if n > 1 or not re.fullmatch(r"[a-z][a-z0-9_]*", node)] == []
    assert [i.node for i in scene.instances if i.category == "ground"] == ["ground"]
    for instance in scene.instances:
        assert instance.parts
        for part in instance.parts:
            assert part.material in scene.materials
            assert np.isfinite(part.vertices).all()
            assert len(part.faces)
            assert len(part.uv) == len(part.vertices)
            assert part.faces.min() >= 0
            assert part.faces.max() < len(part.vertices)


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
    # On steep slopes some lean out: test_layouts_nature looks at every one.
    hung = HUNG | {"boulder"} if type_of(scene.name) in ("N_Forest", "N_Mountain") else HUNG
    assert floating(scene, hung, reach_m, BEARERS) == []


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
