"""Phrases of place: each condition is so or not so of a mesh, and what is not so is a fault."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from support.annotation_scenes import PAINTS, box, street, street_annotations, street_vocabulary

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.format import format_annotations, parse_annotations
from aerialdojo_gen.annotations.places import Places, check_conditions, check_phrases, places_of
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.scenes.model import Instance, Scene

ROOT = Path(__file__).resolve().parents[2]


def _house() -> tuple[Instance, ...]:
    """Three floors on pillars, each 3 m above the other, and a bench on every one of them."""
    slabs = [box("house_000", (0, 0, 3.0 * k + 2.8), (10, 10, 0.2)) for k in range(3)]
    pillar = box("house_000", (0, 4.8, 0), (0.2, 0.2, 9.0))
    parts = tuple(part for thing in (*slabs, pillar) for part in thing.parts)
    benches = [box(f"bench_{k:03d}", (1, 1, 3.0 * k), (1, 0.5, 0.8)) for k in range(4)]
    return (Instance("house_000", "house", "", {}, parts), *benches)


@pytest.fixture(scope="module")
def yard() -> Scene:
    things = (
        box("ground_000", (0, 0, -0.2), (80, 80, 0.2), colour="green"),
        box("ground_001", (30, 0, -0.1), (16, 16, 0.12), colour="grey"),
        *_house(),
        box("mailbox_000", (5.4, 0, 0), (0.6, 0.6, 1.2)),
        box("mailbox_001", (12, 0, 0), (0.6, 0.6, 1.2)),
        box("wall_000", (18, 0, 0), (0.4, 20, 2)),
        box("wall_001", (20.5, -6, 0), (0.4, 2, 2)),
        box("sign_000", (17.7, 5, 1), (0.2, 1, 0.6)),
        box("sedan_000", (28, 0, 0), (4, 2, 1.5)),
        box("sedan_001", (28, 4, 0), (4, 2, 1.5)),
        box("sedan_002", (-30, 4, 0), (4, 2, 1.5)),
    )
    return Scene("U_Yard_0", things, PAINTS, np.array([[-40.0, -40.0, 0.0], [40.0, 40.0, 30.0]]))


CASES = [
    ("under the house", {"under": "house_*"}, {"bench_000", "bench_001", "bench_002"}),
    ("on the house", {"on": "house"}, {"bench_001", "bench_002", "bench_003"}),
    ("on its first floor", {"floor": [1, "house"]}, {"bench_001"}),
    ("on its second floor", {"floor": [2, "house"]}, {"bench_002"}),
    ("on its ground floor", {"floor": [0, "house"]}, {"bench_000"}),
    ("on its roof", {"roof": "house"}, {"bench_003"}),
    ("in the house", {"inside": "house", "z": [-1, 1]}, {"bench_000"}),
    ("beside the house", {"beside": "house", "z": [-1, 1]}, {"bench_000", "mailbox_000"}),
    ("near the house", {"near": "house", "surface": "green", "z": [-1, 1], "east_of": "house"},
     {"bench_000", "mailbox_000", "mailbox_001"}),
    ("in the car park", {"surface": "grey", "among": [1, "sedan", 3]}, {"sedan_000", "sedan_001"}),
    ("on the wall", {"touching": "wall_*", "high": 0.5}, {"sign_000"}),
    ("between house and wall", {"between": ["house", "wall_000"]}, {"mailbox_000", "mailbox_001", "sign_000"}),
    ("in the west", {"part": "west"}, {"sedan_002"}),
    ("over the asphalt", {"over": "grey"}, {"sedan_000", "sedan_001"}),
    ("beside the asphalt", {"by": "grey", "west_of": "sedan_000"}, {"wall_001"}),
]  # fmt: skip


@pytest.mark.parametrize(("phrase", "conditions", "true_of"), CASES, ids=[case[0] for case in CASES])
def test_a_phrase_is_so_of_what_stands_there_and_of_nothing_else(yard, phrase, conditions, true_of):
    geometry = SceneGeometry(yard)
    places = Places(geometry, {phrase: conditions})
    check_conditions(phrase, conditions)
    asked = [n for n in geometry.index if not n.startswith(("ground", "house"))]
    assert {node for node in asked if not places.fault(geometry.index[node], phrase)} == true_of


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        ({}, "at least one condition"),
        ({"besides": "house"}, "unknown condition 'besides'"),
        ({"among": [2, "sedan", 40]}, "is not what it takes"),
        ({"part": "upper left"}, "is not what it takes"),
        ({"floor": ["first", "house"]}, "is not what it takes"),
        ({"z": [4, 2]}, "is not what it takes"),
        ({"also": ["among the sheds"]}, "at least one condition"),
        ({"z": [2, 4], "also": ["among the sheds", "among the sheds"]}, "is not what it takes"),
    ],
)
def test_a_binding_that_is_none_is_refused(conditions, message):
    with pytest.raises(AnnotationError, match=message):
        check_conditions("'in the yard'", conditions)


def test_all_scenes_have_places_and_all_files_are_right():
    scenes = sorted(path.stem for path in (ROOT / "scene_assets" / "scenes").glob("*.toml"))
    assert len(scenes) == 42
    assert all(places_of(scene) for scene in scenes)
    assert places_of("U_Street_0") is None


def test_a_wording_belongs_to_one_phrase_and_may_replace_it(yard):
    said = {"surface": "grey", "say": "out in the Yard", "also": ["amid the cars"]}
    phrases = {"in the yard": said, "by the wall": {"beside": "wall_000"}}
    check_phrases("[U_Yard_0]", phrases)
    assert Places(SceneGeometry(yard), phrases).wordings["in the yard"] == ("out in the Yard", "amid the cars")
    with pytest.raises(AnnotationError, match="'by the wall': 'by the wall' is a wording of 'in the yard' too"):
        check_phrases("[U_Yard_0]", phrases | {"in the yard": said | {"also": ["By the wall"]}})


def _faults(place: str, says: str) -> list[str]:
    things = tuple(
        dataclasses.replace(i, attributes=i.attributes | {"place": place}) if i.node == "delivery_van_002" else i
        for i in street().instances
    )
    house = box("office_block_000", (30, 32, 0), (1, 1, 0.1))
    scene = dataclasses.replace(street(), name="U_Factory_1", instances=(*things, house))
    text = format_annotations(
        street_annotations(delivery_van_002=says, mailbox_001="A red mailbox under the canopy.")
    )
    objects = parse_annotations(text.replace("U_Street_0", "U_Factory_1"))
    found = SourceCheck(objects, street_vocabulary(scene)).faults
    return [fault.message for fault in found if fault.path.startswith("objects[2]")]


def test_a_place_that_is_not_so_is_a_fault_and_one_that_is_not_known_is_left_unchecked():
    assert _faults("beside the office", "The blue delivery van beside the office.") == []
    (wrong,) = _faults("on the roof of the office", "The blue delivery van on the roof of the office.")
    assert "not so of delivery_van_002: roof = 'office_block_000'" in wrong
    assert _faults("in the moonlight", "The blue delivery van in the moonlight.") == []
