"""Sizes: what the catalogue builds is as large as the real things, `scene_assets/sizes.toml`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue
from aerialdojo_gen.scenes.designs import PLAIN, DesignSets
from aerialdojo_gen.scenes.materials import read_toml
from aerialdojo_gen.scenes.prop import Category, Variant, parse_category

ASSETS = Path(__file__).resolve().parents[2] / "scene_assets"
SLACK = 1.05
Ranges = Sequence[Sequence[float]]


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue(ASSETS)


@pytest.fixture(scope="module")
def sizes() -> Mapping[str, Ranges]:
    return read_toml(ASSETS / "sizes.toml")


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


def extents_m(catalogue: Catalogue, category: str) -> dict[tuple[str, str], tuple[float, float]]:
    """Longest horizontal extent and height of every shape, by variant and design."""
    out = {}
    for variant in shapes_of(catalogue[category]):
        for design in catalogue[category].designs:
            thing = catalogue.instantiate(
                category, "thing", generator(0, "test"), variant=variant.name, design=design.name
            )
            x, y, z = np.ptp(thing.bounds, axis=0)
            out[variant.name, design.name] = (max(x, y), z)
    return out


def outliers(extents: Mapping[tuple[str, str], Sequence[float]], ranges: Ranges) -> list[tuple[str, str]]:
    """Variants and designs of which an extent is out of its range."""
    return [
        name
        for name, found in extents.items()
        if not all(low / SLACK <= size <= high * SLACK for size, (low, high) in zip(found, ranges, strict=True))
    ]


def test_every_category_has_a_size(catalogue, sizes):
    assert set(sizes) == set(catalogue)
    for category, ranges in sizes.items():
        assert len(ranges) == 2, category
        assert all(0 < low < high for low, high in ranges), category


@pytest.mark.slow
def test_things_are_as_large_as_real_ones(catalogue, sizes):
    wrong = {category: outliers(extents_m(catalogue, category), sizes[category]) for category in catalogue}
    assert not {category: names for category, names in wrong.items() if names}


def test_a_thing_of_a_wrong_size_is_found(catalogue, sizes):
    extents = extents_m(catalogue, "sedan")
    for factors in ([0.7, 1.0], [1.4, 1.0], [1.0, 0.7], [1.0, 1.4]):
        assert outliers({name: np.multiply(one, factors) for name, one in extents.items()}, sizes["sedan"])
    assert not outliers(extents, sizes["sedan"])


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
    sets: DesignSets = dict.fromkeys(("free", "fixed"), (PLAIN,))
    with pytest.raises(AssetError, match=r"\[crate\]: scale must be a number from 0.1 to 10"):
        parse_category(Path("props.toml"), "crate", body, catalogue.materials, sets)
