"""Landmarks of a town that has none of the catalogue's: large things, by names that fit nothing else in it."""

import numpy as np
import pytest
from support import maps

from aerialdojo_gen.annotations.landmarks import choose_landmarks
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.imports.places import add_map
from aerialdojo_gen.scenes.catalogue import load_catalogue


@pytest.fixture(scope="module")
def vocabulary(tmp_path_factory):
    folder = tmp_path_factory.mktemp("map")
    outlines = [([*o, o[0]], tags) for o, tags in maps.BUILDINGS.values()]
    extract = maps.write_map(folder / "town.osm.pbf", [*maps.LINES, *outlines])
    town = add_map("Town", extract, folder / "mine", bbox=[maps.box()])[0].scene
    return Vocabulary(town, load_catalogue(home() / "scene_assets"))


@pytest.mark.parametrize("n", [1, 2])
def test_landmarks_are_large_and_their_names_fit_nothing_else(vocabulary, n):
    scene = vocabulary.scene
    roofs = [i for i in scene.instances if i.bounds[0, 2] > 8.0]
    assert roofs, "a roof with something on it, higher than most buildings"
    marks = choose_landmarks(vocabulary, n, at_most=True)
    assert 1 <= len(marks) <= n
    for mark in marks:
        assert np.ptp(scene[mark.node].bounds, axis=0).min() >= 3.0
        words = set(mark.name.split())
        # "A building" would be any of them, an office building, too.
        fits = [i.node for i, noun in zip(scene.instances, vocabulary.nouns, strict=True)
                if words <= {*noun.name.split(), *noun.short.split(), *noun.adjectives}]  # fmt: skip
        assert fits in ([mark.node], [])
