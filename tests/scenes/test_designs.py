"""Designs: things of one category differ, round parts stay round, and held-out designs stand where they should."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue
from aerialdojo_gen.scenes.designs import of_side, parse_designs
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.plans.build import build_plan, build_tables

ASSETS = Path(__file__).resolve().parents[2] / "scene_assets"
# Made to a standard, joined to what stands beside them, or varied by their own builder.
FEW_DESIGNS = 30


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue(ASSETS)


def made(catalogue: Catalogue, category: str, design: str) -> Instance:
    variant = catalogue[category].variants[0].name
    return catalogue.instantiate(category, "thing", generator(0, "test"), variant=variant, design=design)


def test_designs_of_a_category_are_different_shapes(catalogue):
    few = []
    for category in catalogue.targets:
        designs = catalogue[category].designs
        shapes = {made(catalogue, category, design.name).shape for design in designs}
        assert len(shapes) == len(designs), category
        few += [category] if len([d for d in designs if not d.held_out]) < 4 or len(designs) < 6 else []
    assert len(few) < FEW_DESIGNS, few


def test_no_design_changes_a_thing_beyond_use(catalogue):
    """Its extents stay within a third, its triangles are closed, and it stands where the first design stands."""
    for category in catalogue.targets:
        plain, *others = [made(catalogue, category, design.name) for design in catalogue[category].designs]
        sizes = np.ptp(plain.bounds, axis=0)
        for other in others:
            ratio = np.ptp(other.bounds, axis=0) / sizes
            assert ((ratio > 0.66) & (ratio < 1.4)).all(), (category, ratio)
            # What hangs above its origin, or reaches below it, does so in proportion.
            low, own = plain.bounds[0, 2], other.bounds[0, 2]
            assert abs(own - low) <= 0.25 * abs(low) + 0.02, (category, low, own)


@pytest.mark.parametrize(("category", "part", "axes"), [
    ("sedan", "tyre", (0, 2)), ("delivery_van", "tyre", (0, 2)), ("bicycle", "tyre", (0, 2)),
    ("fire_hydrant", "body", (0, 1)), ("stop_sign", "back", (1, 2)),
])  # fmt: skip
def test_what_is_round_stays_round(catalogue, category, part, axes):
    """Wheels, bodies and discs keep their proportions in their own plane, and wheels stand on the ground."""
    round_m = {}
    for design in catalogue[category].designs:
        thing = made(catalogue, category, design.name)
        assert thing.copies_of(part), (category, part)
        faces = thing.copies_of(part)[0]
        extents = np.ptp(thing.vertices[thing.faces[faces]].reshape(-1, 3), axis=0)[list(axes)]
        round_m[design.name] = extents[0] / extents[1]
        assert part != "tyre" or abs(thing.bounds[0, 2]) < 0.02
    assert np.allclose(list(round_m.values()), round_m["plain"], rtol=1e-4), round_m


def test_vehicles_in_bays_differ_beside_their_designs_and_stand_on_round_wheels(catalogue):
    bays = {"make": "parking_rows", "rows": [[0, 0, 90, 24]], "occupancy": 1.0, "vehicles": {"sedan": 1.0}}
    plan = {"plan": 1, "seed": 3, "size_m": [80, 40], "ceiling_m": 12, "sky": "#a9c6e8"}
    height = np.ptp(made(catalogue, "sedan", "plain").bounds[:, 2])
    for differ, different in ((0.0, range(1, 11)), (0.06, [24])):
        cars = [
            thing
            for thing in build_tables("U_Test_0", plan | {"site": [bays | {"differ": differ}]}, catalogue).instances
            if thing.category == "sedan"
        ]
        assert len(cars) == 24
        assert len({car.shape for car in cars}) in different
        for car in cars:
            tyre = car.vertices[car.faces[car.copies_of("tyre")[0]]].reshape(-1, 3)
            assert abs(car.bounds[0, 2]) < 0.02
            # Its radius is the same ahead and upwards: along x and y the car's yaw mixes it with the tyre's width.
            around = np.linalg.norm(np.ptp(tyre, axis=0)[:2])
            assert np.ptp(tyre[:, 2]) < around < 1.3 * np.ptp(tyre[:, 2])
            assert abs(np.ptp(car.bounds[:, 2]) / height - 1.0) < 0.25


def test_out_of_distribution_scenes_have_held_out_designs(catalogue):
    shapes: dict[str, dict[str, set[str]]] = {"0": defaultdict(set), "1": defaultdict(set)}
    for name in ("U_Alley_0", "U_Alley_1"):
        for thing in build_plan(ASSETS / "scenes" / f"{name}.toml", catalogue).instances:
            if thing.category in catalogue.targets:
                designs = catalogue[thing.category].designs
                assert thing.held_out == (name.endswith("_1") and len(designs) > 1)
                shapes[name[-1]][thing.category].add(thing.shape)
    several = [c for c in shapes["0"] if c in shapes["1"] and len(catalogue[c].designs) > 1]
    assert several
    assert not any(shapes["0"][c] & shapes["1"][c] for c in several)
    assert any(len(found) > 1 for found in shapes["0"].values())


def test_a_side_without_designs_takes_the_first(catalogue):
    designs = catalogue["sedan"].designs
    assert {d.held_out for d in of_side(designs, "train")} == {False}
    assert {d.held_out for d in of_side(designs, "held_out")} == {True}
    assert of_side(designs, "plain") == designs[:1] == of_side(designs[:1], "held_out")


@pytest.mark.parametrize(("raw", "named"), [
    ([], "array of tables"),
    ([{"name": "plain", "held_out": True}], "first design"),
    ([{"name": "plain"}, {"name": "plain"}], "one name"),
    ([{"name": "plain", "stretch": [1, 1]}], "three factors"),
    ([{"name": "plain", "stretch": [1, 1, 9]}], "three factors"),
    ([{"name": "plain", "without": ["roof"]}], "'roof'"),
    ([{"name": "plain", "params": {"high": 2}}], "'high'"),
    ([{"name": "plain", "stretches": [1, 1, 1]}], "'stretches'"),
])  # fmt: skip
def test_what_is_wrong_with_a_design_is_named(raw, named):
    with pytest.raises(AssetError, match=named):
        parse_designs(raw, {"height": (1, 2)}, {"door"}, "props.toml: [booth]")
