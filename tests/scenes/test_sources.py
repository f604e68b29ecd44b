"""The sources of the 42 scenes together: the paper's scenes, counts and categories, each of them used."""

import json
import tomllib
from collections import Counter

import pytest
from support.layout_checks import ASSETS

from aerialdojo_gen.base.paper_figures import inventory


@pytest.fixture(scope="module")
def annotations():
    return {
        path.stem: json.loads(path.read_text(encoding="utf-8"))
        for path in (ASSETS.parent / "annotations").glob("*.json")
    }


def test_every_scene_of_the_paper_has_a_recipe_and_annotations(annotations):
    recipes = {path.stem for path in (ASSETS / "scenes").glob("*.toml")}
    assert recipes == set(inventory()) == set(annotations)


def test_landmarks_and_objects_are_as_many_as_the_papers(annotations):
    found = {name: (len(body["landmarks"]), len(body["objects"])) for name, body in annotations.items()}
    assert found == {name: (row.landmarks, row.objects) for name, row in inventory().items()}
    assert tuple(map(sum, zip(*found.values(), strict=True))) == (109, 2099)


def test_there_are_254_categories_and_each_is_looked_for(annotations, catalogue):
    used = Counter(entry["category"] for body in annotations.values() for entry in body["objects"])
    assert len(catalogue.targets) == 254
    assert set(used) == set(catalogue.targets)


def test_categories_are_told_apart_by_name(catalogue):
    names = Counter(catalogue[category].name for category in catalogue.targets)
    assert [name for name, n in names.items() if n > 1] == []


def test_the_two_instances_of_a_type_differ_in_more_than_the_seed():
    folder = ASSETS / "scenes"
    for name in inventory():
        if name.endswith("_0"):
            one, two = (tomllib.loads((folder / f"{stem}.toml").read_text()) for stem in (name, f"{name[:-1]}1"))
            for keys in (("size_m",), ("palette", "sky"), ("parameters", "site")):
                assert [one.get(key) for key in keys] != [two.get(key) for key in keys], name
