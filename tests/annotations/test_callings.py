"""What a text calls its object, against what the mesh says."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.annotation_scenes import PAINTS, box

from aerialdojo_gen.annotations.check import check_source
from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.format import parse_annotations
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.model import Material, Scene

_PAINTS = PAINTS | {"teal": Material("teal", (0, 128, 128)), "dark red": Material("dark red", (140, 20, 20))}


@pytest.fixture(scope="module")
def faults_of(catalogue):
    """What is false of a text about the only thing of a scene."""

    def faults(text, category, colour):
        thing = box(f"{category}_000", (0, 0, 0), (1, 1, 1), colour=colour)
        scene = Scene("U_Street_0", (thing,), _PAINTS, np.array([[-9.0, -9.0, 0.0], [9.0, 9.0, 9.0]]))
        return Matcher(SceneClaims(Vocabulary(scene, catalogue), [])).faults(0, text)

    return faults


@pytest.mark.parametrize(
    ("text", "colour", "wrong"),
    [
        ("red sedan", "teal", ["'sedan'", "'red'"]),
        ("A red sedan. It has wide windows.", "teal", ["'sedan'", "'red'"]),
        ("red shop front", "teal", ["'red'"]),
        ("red shop front", "dark red", []),
        ("gray shop front", "grey", []),
        ("green shop front", "teal", []),
        ("teal shop front with a red something", "teal", []),
        ("crimson shop front", "teal", []),
        ("old shop", "teal", []),
        ("", "teal", []),
    ],
)
def test_a_name_that_the_mesh_contradicts_is_told(faults_of, text, colour, wrong):
    found = faults_of(text, "storefront", colour)
    assert len(found) == len(wrong)
    assert all(word in message for word, message in zip(wrong, found, strict=True))


@pytest.mark.parametrize(
    ("text", "category"),
    [("stone wall", "garden_wall"), ("This traffic light showing red stands along the tram street.", "traffic_light"),
     ("brick building", "building"), ("shop fronts", "storefront")],
)  # fmt: skip
def test_what_is_only_put_otherwise_is_no_contradiction(faults_of, text, category):
    assert faults_of(text, category, "grey") == []


def test_the_import_refuses_a_red_sedan_that_is_a_wall(project, catalogue):
    scene = build_scene(project / "scene_assets" / "smoke" / "U_Courtyard_0.toml", catalogue)
    document = json.loads((project / "annotations" / "smoke" / "U_Courtyard_0.json").read_text())
    entry = next(e for e in document["objects"] if e["category"] == "delivery_van")
    before = len(check_source(parse_annotations(json.dumps(document)), Vocabulary(scene, catalogue)).faults)
    entry["name"] = "red bench"
    faults = check_source(parse_annotations(json.dumps(document)), Vocabulary(scene, catalogue)).faults
    assert (before, [fault.path for fault in faults]) == (0, [f"objects[{document['objects'].index(entry)}].name"])
    assert "it is called 'bench', and the mesh says 'delivery van'" in faults[0].message
    # What an imported mesh says is a guess: the person knows better.
    words = Vocabulary(replace(scene, imported=True), catalogue)
    imported = check_source(parse_annotations(json.dumps(document)), words)
    assert not [fault for fault in imported.faults if "it is called 'bench'" in fault.message]
