"""What a text says of a thing, held against the mesh, and whether it fits another thing as well."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from support.annotation_scenes import GOOD, PAINTS, box, street, street_annotations, street_vocabulary

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.claims import Claim, Mention, SceneClaims
from aerialdojo_gen.annotations.format import Landmark, format_annotations, parse_annotations
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.appearances import valid_phrases
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.model import Material, Scene

TOWER = Landmark(id=0, name="clock tower", node="clock_tower_000")
YELLOW_MAILBOX = Mention("", "mailbox", ("yellow",), False)


class _Street:
    """The street's claims, with more things, and what texts about it are matched to."""

    def __init__(self, *more):
        scene = dataclasses.replace(street(), instances=(*street().instances, *more))
        self.claims = SceneClaims(street_vocabulary(scene), [TOWER])
        self.matcher, self.index = Matcher(self.claims), self.claims.geometry.index

    def faults(self, node, text):
        return self.matcher.faults(self.index[node], text)

    def fits(self, node, text):
        i = self.index[node]
        others = self.claims.distractors(i, self.matcher.true_claims(i, text))
        return {self.claims.scene.instances[j].node for j in others}


@pytest.fixture(scope="module")
def on_street():
    return _Street()


@pytest.mark.parametrize("node", sorted(GOOD))
def test_good_descriptions_are_true_and_fit_nothing_else(on_street, node):
    assert on_street.faults(node, GOOD[node]) == []
    assert on_street.fits(node, GOOD[node]) == set()


@pytest.mark.parametrize(
    ("text", "fits"),
    [
        ("A delivery van.", {"delivery_van_001", "delivery_van_002"}),
        ("A red delivery van in the yard, north-east of here.", {"delivery_van_001"}),
        ("A delivery van with big wheels. It is red.", {"delivery_van_001"}),
        ("A delivery van beside a yellow mailbox.", set()),
        ("A delivery van with a mailbox to be seen somewhere.", {"delivery_van_001", "delivery_van_002"}),
        ("A delivery van that stands south of a yellow mailbox.", set()),
        ("A delivery van northeast of the clock tower.", {"delivery_van_001", "delivery_van_002"}),
    ],
)
def test_planted_ambiguities_are_found(on_street, text, fits):
    assert on_street.fits("delivery_van_000", text) == fits


def test_a_rival_that_is_almost_as_near_counts():
    # 3.4 m from the second van: too far to be said "beside", near enough to be taken for it.
    wider = _Street(box("mailbox_002", (40, 40 - 1 - 3.4 - 0.3, 0), (0.6, 0.6, 1.2), colour="yellow"))
    text = GOOD["delivery_van_000"]
    assert wider.fits("delivery_van_000", text) == {"delivery_van_001"}
    assert wider.faults("delivery_van_001", text) != []


@pytest.mark.parametrize(
    ("node", "text"),
    [
        ("delivery_van_000", "A blue delivery van in the yard."),
        ("delivery_van_000", "A red delivery van beside a bench."),
        ("delivery_van_000", "A red delivery van beside a red mailbox."),
        ("delivery_van_000", "A red delivery van on the north side of a mailbox."),
        ("delivery_van_000", "A red delivery van under the canopy."),
        ("delivery_van_000", "A red delivery van to the east of the clock tower."),
        ("mailbox_001", "A red mailbox on the canopy."),
        ("mailbox_001", "A red bench under the canopy."),
        ("delivery_van_001", "A red delivery van between the bench and the clock tower."),
    ],
)
def test_untruths_are_found(on_street, node, text):
    assert len(on_street.faults(node, text)) == 1


def test_words_belong_to_their_thing_and_what_matches_nothing_is_counted(on_street):
    i = on_street.index["delivery_van_000"]
    matched = on_street.matcher.read("In the yard, next to a yellow mailbox, stands a cheerful red delivery van.", i)
    assert set(matched.claims) == {
        Claim("place", "in the yard"), Claim("colour", "red"), Claim("relation", "beside", (YELLOW_MAILBOX,)),
    }  # fmt: skip
    assert matched.unchecked == ["cheerful"]
    assert on_street.claims.fitting(YELLOW_MAILBOX) == {on_street.index["mailbox_000"]}


def test_a_phrase_of_the_catalogue_must_be_so_of_the_instance(catalogue):
    sign = catalogue.instantiate("stop_sign", "stop_sign_000", generator(0, "test", "looks"), position=(-60, 0, 0))
    looks = catalogue["stop_sign"].looks
    materials = {part.material: catalogue.materials[part.material] for part in sign.parts}
    true = valid_phrases(looks, sign, materials)
    scene = dataclasses.replace(
        street(), instances=(*street().instances, sign), materials=street().materials | materials
    )
    matcher = Matcher(SceneClaims(street_vocabulary(scene), []))
    i = len(scene.instances) - 1
    assert true
    for look in looks:
        for wording in look.wordings:
            found = matcher.faults(i, f"A stop sign with {wording.upper()}.")
            assert (found == []) == (look in true), wording
            assert list(matcher.read(f"A stop sign with {wording}.", i).claims) == [Claim("part", look.phrase)]


@pytest.mark.parametrize(
    ("gap_m", "word", "so"),
    [
        (0.2, "leaning against", True), (1.0, "leaning against", False),
        (4.0, "at", True), (6.0, "at", False), (6.0, "near", True),
    ],
)  # fmt: skip
def test_relations_are_read_as_strictly_as_they_are_meant(gap_m, word, so):
    bench = box("bench_001", (-60 + 1 + gap_m + 0.5, 0, 0), (1, 1, 1), colour="green")
    pair = _Street(bench, box("mailbox_002", (-60, 0, 0), (2, 2, 2), colour="red"))
    assert (pair.faults("bench_001", f"A green bench {word} the red mailbox.") == []) is so


def _faults(**texts: str) -> list[str]:
    source = parse_annotations(format_annotations(street_annotations(**texts)))
    return [fault.message for fault in SourceCheck(source, street_vocabulary()).faults]


def test_twins_are_told_apart_in_the_first_sentence_of_few():
    assert _faults() == []
    late = "A red delivery van. It is parked in the yard between the bench and the street lamp."
    (message,) = _faults(delivery_van_001=late)
    assert "its start fits delivery_van_000 as well" in message
    (message,) = _faults(delivery_van_001="A red delivery van.")
    assert "it fits delivery_van_000 as well" in message
    long = "The blue delivery van " + "very " * 60 + "much so."
    assert any("has more than 60 words" in message for message in _faults(delivery_van_002=long))


_PAINTS = PAINTS | {"teal": Material("teal", (0, 128, 128)), "dark red": Material("dark red", (140, 20, 20))}


@pytest.mark.parametrize(
    ("text", "category", "colour", "wrong"),
    [
        ("red sedan", "storefront", "teal", ["'sedan'", "'red'"]),
        ("A red sedan. It has wide windows.", "storefront", "teal", ["'sedan'", "'red'"]),
        ("red shop front", "storefront", "teal", ["'red'"]),
        ("red shop front", "storefront", "dark red", []),
        ("gray shop front", "storefront", "grey", []),
        ("green shop front", "storefront", "teal", []),
        ("teal shop front with a red something", "storefront", "teal", []),
        ("crimson shop front", "storefront", "teal", []),
        ("", "storefront", "teal", []),
        # What is only put otherwise is no contradiction.
        ("old shop", "storefront", "teal", []),
        ("stone wall", "garden_wall", "grey", []),
        ("This traffic light showing red stands along the tram street.", "traffic_light", "grey", []),
        ("brick building", "building", "grey", []),
        ("shop fronts", "storefront", "grey", []),
    ],
)
def test_a_name_that_the_mesh_contradicts_is_told(catalogue, text, category, colour, wrong):
    thing = box(f"{category}_000", (0, 0, 0), (1, 1, 1), colour=colour)
    scene = Scene("U_Street_0", (thing,), _PAINTS, np.array([[-9.0, -9.0, 0.0], [9.0, 9.0, 9.0]]))
    found = Matcher(SceneClaims(Vocabulary(scene, catalogue), [])).faults(0, text)
    assert len(found) == len(wrong)
    assert all(word in message for word, message in zip(wrong, found, strict=True))


def test_the_import_refuses_a_van_that_is_called_a_bench(project, catalogue):
    scene = build_scene(project / "scene_assets" / "smoke" / "U_Courtyard_0.toml", catalogue)
    document = json.loads((project / "annotations" / "smoke" / "U_Courtyard_0.json").read_text())

    def faults(imported=False):
        words = Vocabulary(dataclasses.replace(scene, imported=imported), catalogue)
        return SourceCheck(parse_annotations(json.dumps(document)), words).faults

    assert faults() == []
    k, entry = next((k, e) for k, e in enumerate(document["objects"]) if e["category"] == "delivery_van")
    entry["name"] = "red bench"
    (fault,) = faults()
    assert fault.path == f"objects[{k}].name"
    assert "it is called 'bench', and the mesh says 'delivery van'" in fault.message
    # What an imported mesh says is a guess: the person knows better.
    assert not [fault for fault in faults(imported=True) if "it is called 'bench'" in fault.message]
