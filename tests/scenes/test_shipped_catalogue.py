"""The catalogue that ships, its shapes built once, and the sources of the 42 scenes.

Things are as large as the real ones (`scene_assets/sizes.toml`), their designs differ, round parts stay round, and
held-out designs stand where they should.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from support.catalogue_faults import catalogue_faults
from support.layout_checks import ASSETS

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.paper_figures import inventory
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.materials import read_toml
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.plans.build import build_tables
from aerialdojo_gen.scenes.prop import (
    Category,
    Variant,
    of_side,
    parse_category,
    parse_designs,
    parse_entry,
    words_of,
)

SLACK = 1.05
# Made to a standard, joined to what stands beside them, or varied by their own builder.
FEW_DESIGNS = 30
URBAN = {"vehicles", "street", "retail", "park", "signs", "shopfronts", "landmarks_urban"}
HUNG = {"shop_sign", "wall_banner", "wall_clock", "storefront", "dock_door"}


def shapes_of(prop: Category) -> Iterator[Variant]:
    """Variants, one of those that differ in nothing but their surfaces."""
    written = any("{" in part.get("text", "") for part in prop.parts)
    built = set()
    for variant in prop.variants:
        shape = (variant.without, *sorted(variant.params.items()))
        key = (shape, tuple(variant.attributes.items()) if written else ())
        if key not in built:
            built.add(key)
            yield variant


def made(catalogue: Catalogue, category: str, variant: str, design: str) -> Instance:
    rng = generator(0, "check", category, variant)
    return catalogue.instantiate(category, "thing", rng, variant=variant, design=design)


def faults_of(catalogue: Catalogue, category: str, ranges: Sequence[Sequence[float]]) -> Iterator[str]:
    """What is wrong with the shapes of a category; its longest horizontal extent and height have ranges, metres."""
    prop, ((least, most), (lowest, highest)) = catalogue[category], ranges
    urban = Path(prop.source.partition(":")[0]).stem in URBAN
    designs = [design.name for design in prop.designs]
    things = {(v.name, d): made(catalogue, category, v.name, d) for v in shapes_of(prop) for d in designs}
    for (variant, design), thing in things.items():
        (x, y, z), low, faces = np.ptp(thing.bounds, axis=0), thing.bounds[0, 2], len(thing.faces)
        if not (least / SLACK <= max(x, y) <= most * SLACK and lowest / SLACK <= z <= highest * SLACK):
            yield f"{variant} {design} is {x:.2f} by {y:.2f} by {z:.2f} m large"
        if areas(thing.vertices, thing.faces).min() <= 0:
            yield f"{variant} {design} has a face without an area"
        # A stack of pallets is made of boards.
        if design == designs[0] and not (12 if urban else 1) <= faces <= (3000 if urban else 6000):
            yield f"{variant} has {faces} triangles"
        if design == designs[0] and (low < -2.5 or (urban and not -0.05 <= low < 0.5 and category not in HUNG)):
            yield f"{variant} begins {low:.2f} m above the ground"
    if prop.target:
        plain, *others = [things[prop.variants[0].name, design] for design in designs]
        if len({thing.shape for thing in (plain, *others)}) < len(designs):
            yield "two designs have one shape"
        # Extents stay within a third, or a half with parts of its own; it stands where the first design stands.
        least, most = (0.48, 1.5) if any(words_of(part, "design") for part in prop.parts) else (0.66, 1.4)
        for design, other in zip(designs[1:], others, strict=True):
            ratio = np.ptp(other.bounds, axis=0) / np.ptp(plain.bounds, axis=0)
            if not ((ratio > least) & (ratio < most)).all():
                yield f"{design} is {ratio.round(2).tolist()} times as large as {designs[0]}"
            # What hangs above its origin, or reaches below it, does so in proportion.
            low, own = plain.bounds[0, 2], other.bounds[0, 2]
            if abs(own - low) > 0.25 * abs(low) + 0.02:
                yield f"{design} begins at {own:.2f} m, {designs[0]} at {low:.2f} m"
        yield from catalogue_faults(catalogue, [category], every=False, things=things)


@pytest.mark.slow
@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_shapes_are_as_large_as_real_ones_stand_differ_and_are_what_the_catalogue_says(catalogue, every):
    """Every shape of the day's eighth of the categories, or of all."""
    sizes, day = read_toml(ASSETS / "sizes.toml"), int(os.environ["SAMPLE_SEED"])
    assert set(sizes) == set(catalogue)
    chosen = catalogue if every else sorted(catalogue)[day % 8 :: 8]
    assert [f"{name}: {fault}" for name in chosen for fault in faults_of(catalogue, name, sizes[name])] == []


@pytest.mark.nightly
def test_all_that_the_catalogue_says_of_targets_is_so_of_every_design_of_every_variant(catalogue):
    assert catalogue_faults(catalogue) == []


def test_urban_things_have_looks_that_differ(catalogue):
    urban = [c for c in catalogue if Path(catalogue[c].source.partition(":")[0]).stem in URBAN]
    assert len(urban) > 80
    for category in urban:
        looks = [tuple(sorted(variant.attributes.items())) for variant in catalogue[category].variants]
        assert all(looks), category
        assert len(set(looks)) == len(looks), category


def test_targets_have_several_designs_and_held_out_ones_structure_of_their_own(catalogue):
    """Of a category with parts by design, each held-out one has, or lacks, what no training one does."""
    few, checked = [], 0
    for category in catalogue.targets:
        prop = catalogue[category]
        held_out = [design.name for design in prop.designs if design.held_out]
        few += [category] if len(prop.designs) < 6 or len(prop.designs) - len(held_out) < 4 else []
        if not any(words_of(part, "design") for part in prop.parts):
            continue
        checked += 1
        built = {
            design.name: frozenset(
                k
                for k, part in enumerate(prop.parts)
                if not design.without.intersection(words_of(part, "tag"))
                and (not words_of(part, "design") or design.name in words_of(part, "design"))
            )
            for design in prop.designs
        }
        training = [built[design.name] for design in prop.designs if not design.held_out]
        assert len(set(training)) >= 6, (category, len(set(training)))
        assert len(held_out) >= 2, category
        for name in held_out:
            own = built[name] - frozenset().union(*training)
            lacks = frozenset.intersection(*training) - built[name]
            assert own or lacks, (category, name)
    assert checked >= 245
    assert len(few) < FEW_DESIGNS, few


def test_every_surface_can_be_drawn(catalogue):
    for name in catalogue.materials.names:
        surface = catalogue.materials[name]
        assert surface.texture is None or surface.texture.shape[2] == 3
        assert 0 <= min(surface.colour) <= max(surface.colour) <= 255


def test_the_scale_of_a_category_multiplies_all_extents(catalogue):
    fox = catalogue["fox"]
    assert fox.scale < 1.0
    made = catalogue.instantiate("fox", "fox", generator(0, "test"), scale=1.0 / fox.scale)
    own = catalogue.instantiate("fox", "fox", generator(0, "test"))
    np.testing.assert_allclose(np.ptp(own.bounds, axis=0), np.ptp(made.bounds, axis=0) * fox.scale, rtol=1e-5)
    assert own.shape != made.shape


@pytest.mark.parametrize("scale", [0, 0.09, 10.5, -1, True, "2", float("nan")])
def test_a_scale_beyond_use_is_named(catalogue, scale):
    body = {"name": "box", "scale": scale, "parts": [{"shape": "box", "size": [1, 1, 1], "role": "wood"}]}
    with pytest.raises(AssetError, match=r"\[crate\]: scale = "):
        parse_category(parse_entry(Path("props.toml"), "crate", body), catalogue.materials, {})


@pytest.mark.parametrize(("category", "part", "axes"), [
    ("sedan", "tyre", (0, 2)), ("delivery_van", "tyre", (0, 2)), ("bicycle", "tyre", (0, 2)),
    ("fire_hydrant", "body", (0, 1)), ("stop_sign", "back", (1, 2)),
])  # fmt: skip
def test_what_is_round_stays_round(catalogue, category, part, axes):
    """Wheels, bodies and discs keep their proportions in their own plane, and wheels stand on the ground."""
    round_m = {}
    for design in catalogue[category].designs:
        thing = made(catalogue, category, catalogue[category].variants[0].name, design.name)
        assert thing.copies_of(part), (category, part)
        faces = thing.copies_of(part)[0]
        extents = np.ptp(thing.vertices[thing.faces[faces]].reshape(-1, 3), axis=0)[list(axes)]
        round_m[design.name] = extents[0] / extents[1]
        assert part != "tyre" or abs(thing.bounds[0, 2]) < 0.02
    assert np.allclose(list(round_m.values()), round_m["plain"], rtol=1e-4), round_m


def test_vehicles_in_bays_differ_beside_their_designs_and_stand_on_round_wheels(catalogue):
    bays = {"make": "parking_rows", "rows": [[0, 0, 90, 24]], "occupancy": 1.0, "vehicles": {"sedan": 1.0}}
    plan = {"plan": 1, "seed": 3, "size_m": [80, 40], "ceiling_m": 12, "sky": "#a9c6e8"}
    height = np.ptp(made(catalogue, "sedan", catalogue["sedan"].variants[0].name, "plain").bounds[:, 2])
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
    sides = {(path.stem[-1], read_toml(path).get("designs", "train")) for path in (ASSETS / "scenes").glob("*.toml")}
    assert sides == {("0", "train"), ("1", "held_out")}
    kinds = ("mailbox", "fire_hydrant", "litter_bin")
    yard = {"plan": 1, "size_m": [40, 40], "ceiling_m": 12, "site": [
        {"place": [{"what": kind, "at": [-15, 5 * k], "count": 6, "step": [5, 0]} for k, kind in enumerate(kinds)]},
    ]}  # fmt: skip
    shapes: dict[str, dict[str, set[str]]] = {"train": defaultdict(set), "held_out": defaultdict(set)}
    for side, found in shapes.items():
        for thing in build_tables("U_Yard_0", yard | {"designs": side}, catalogue).instances[1:]:
            assert thing.held_out == (side == "held_out")
            found[thing.category].add(thing.shape)
    assert all(not shapes["train"][kind] & shapes["held_out"][kind] for kind in kinds)
    assert any(len(several) > 1 for several in shapes["train"].values())


def test_a_side_without_designs_takes_the_first(catalogue):
    designs = catalogue["sedan"].designs
    assert {d.held_out for d in of_side(designs, "train")} == {False}
    assert {d.held_out for d in of_side(designs, "held_out")} == {True}
    assert of_side(designs, "plain") == designs[:1] == of_side(designs[:1], "held_out")


@pytest.mark.parametrize(("raw", "named"), [
    ([], "array of tables"),
    ([{"name": "plain", "held_out": True}], "first design"),
    ([{"name": "plain"}, {"name": "plain"}], "one name"),
    ([{"name": "plain", "stretch": [1, 1, 9]}], r"stretch\.2 = 9: Input should be less than or equal to 2"),
    ([{"name": "plain", "without": ["roof"]}], "'roof'"),
    ([{"name": "plain", "params": {"high": 2}}], "'high'"),
    ([{"name": "plain", "stretches": [1, 1, 1]}], "'stretches'"),
])  # fmt: skip
def test_what_is_wrong_with_a_design_is_named(raw, named):
    with pytest.raises(AssetError, match=named):
        parse_designs(raw, {"height": (1, 2)}, {"door"}, "props.toml: [booth]")


def test_the_scenes_have_the_papers_landmarks_and_objects_and_all_254_categories_are_looked_for(catalogue):
    annotations = {
        path.stem: json.loads(path.read_text(encoding="utf-8"))
        for path in (ASSETS.parent / "annotations").glob("*.json")
    }
    assert {path.stem for path in (ASSETS / "scenes").glob("*.toml")} == set(inventory())
    found = {name: (len(body["landmarks"]), len(body["objects"])) for name, body in annotations.items()}
    assert found == {name: (row.landmarks, row.objects) for name, row in inventory().items()}
    assert tuple(map(sum, zip(*found.values(), strict=True))) == (109, 2099)
    assert len(catalogue.targets) == 254
    assert {entry["category"] for body in annotations.values() for entry in body["objects"]} == set(catalogue.targets)
    names = Counter(catalogue[category].name for category in catalogue.targets)
    assert [name for name, n in names.items() if n > 1] == []


def test_the_two_instances_of_a_type_differ_in_more_than_the_seed():
    folder = ASSETS / "scenes"
    for name in inventory():
        if name.endswith("_0"):
            one, two = (tomllib.loads((folder / f"{stem}.toml").read_text()) for stem in (name, f"{name[:-1]}1"))
            for keys in (("size_m",), ("palette", "sky"), ("parameters", "site")):
                assert [one.get(key) for key in keys] != [two.get(key) for key in keys], name
