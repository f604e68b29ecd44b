"""What a text calls its object, against what the mesh says."""

import json
from dataclasses import replace

import numpy as np
import pytest

from aerialdojo_gen.annotations.check import check_source
from aerialdojo_gen.annotations.format import parse_annotations
from aerialdojo_gen.annotations.head_noun import NounChecker
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Instance, Part

NAMES = {
    "storefront": "storefront", "sedan": "sedan", "garden_wall": "garden wall", "wall": "wall",
    "building": "building", "traffic_light": "traffic light", "tram": "tram",
}  # fmt: skip


def thing(category, **attributes):
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    part = Part(np.zeros((3, 3)), faces, np.zeros((3, 2), dtype=np.float32), "paint")
    return Instance(f"{category}_000", category, "", attributes, (part,))


@pytest.mark.parametrize(
    ("text", "colour", "wrong"),
    [
        ("red sedan", "teal", ["'sedan'", "'red'"]),
        ("A red sedan parked by the storefront.", "teal", ["'sedan'", "'red'"]),
        ("red storefront", "teal", ["'red'"]),
        ("red storefront", "dark red", []),
        ("gray storefront", "grey", []),
        ("green storefront", "teal", []),
        ("teal storefront with a red awning", "teal", []),
        ("storefront beside the red sedan", "teal", []),
        ("crimson storefront", "teal", []),
        ("old shop", "teal", []),
        ("red storefront", "patterned", []),
        ("", "teal", []),
    ],
)
def test_a_name_that_the_mesh_contradicts_is_told(text, colour, wrong):
    found = list(NounChecker(NAMES).contradictions(text, thing("storefront", colour=colour)))
    assert len(found) == len(wrong)
    assert all(word in message for word, message in zip(wrong, found, strict=True))


@pytest.mark.parametrize(
    ("text", "category"),
    [("stone wall", "garden_wall"), ("This traffic light showing red stands along the tram street.", "traffic_light"),
     ("brick building", "building"), ("storefronts", "storefront")],
)  # fmt: skip
def test_what_is_only_put_otherwise_is_no_contradiction(text, category):
    assert list(NounChecker(NAMES).contradictions(text, thing(category))) == []


def test_the_import_refuses_a_red_sedan_that_is_a_wall(project):
    catalogue = load_catalogue(project / "scene_assets")
    scene = build_scene(project / "scene_assets" / "smoke" / "U_Courtyard_0.toml", catalogue)
    names = {category: catalogue[category].name for category in catalogue}
    document = json.loads((project / "annotations" / "smoke" / "U_Courtyard_0.json").read_text())
    entry = next(e for e in document["objects"] if e["category"] == "delivery_van")
    before = len(check_source(parse_annotations(json.dumps(document)), scene, names))
    entry["name"] = "red bench"
    faults = check_source(parse_annotations(json.dumps(document)), scene, names)
    assert (before, [fault.path for fault in faults]) == (0, [f"objects[{document['objects'].index(entry)}].name"])
    assert "it is called 'bench', and the mesh says 'delivery van'" in faults[0].message
    # What an imported mesh says is a guess: the person knows better.
    imported = check_source(parse_annotations(json.dumps(document)), replace(scene, imported=True), names)
    assert not [fault for fault in imported if "it is called 'bench'" in fault.message]
