"""What is said of looks, colours and twins is held against the mesh."""

from __future__ import annotations

import dataclasses

import pytest
from support.annotation_scenes import PAINTS, box, street, street_annotations, street_vocabulary

from aerialdojo_gen.annotations.appearance import colour_shares, unsupported_colours
from aerialdojo_gen.annotations.check import check_source
from aerialdojo_gen.annotations.claims import Claim, SceneClaims
from aerialdojo_gen.annotations.format import format_annotations, parse_annotations
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.phrases import noun_of, words_of
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.claims import valid_phrases
from aerialdojo_gen.scenes.model import Material, Part, Scene


def _faults(scene: Scene | None = None, **texts: str) -> list[str]:
    source = parse_annotations(format_annotations(street_annotations(**texts)))
    return [fault.message for fault in check_source(source, street_vocabulary(scene)).faults]


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


def test_what_matches_nothing_is_counted(catalogue):
    matcher = Matcher(SceneClaims(street_vocabulary(), []))
    matched = matcher.read("A cheerful red delivery van beside a yellow mailbox, humming.", 2)
    assert matched.unchecked == ["cheerful", "humming"]
    assert {claim.key for claim in matched.claims} == {"red", "beside"}


def test_colours_are_those_of_the_surface():
    red = box("mailbox_000", (0, 0, 0), (1, 1, 1), colour="red")
    assert colour_shares(red, PAINTS) == pytest.approx({"red": 1.0})
    assert unsupported_colours("red", red, PAINTS) == []
    assert unsupported_colours("dark green", red, PAINTS) == ["green"]
    assert unsupported_colours("red and white", red, PAINTS) == ["white"]
    # A twentieth of the surface is a colour of a part, and not that of the whole.
    small = box("mailbox_000", (0, 0, 0), (0.22, 0.22, 0.22), colour="green").parts[0]
    mixed = dataclasses.replace(red, parts=(*red.parts, small))
    assert unsupported_colours("green", mixed, PAINTS) == ["green"]
    assert unsupported_colours("green handle", mixed, PAINTS) == []


def test_stripes_are_two_colours():
    thing = box("mailbox_000", (0, 0, 0), (1, 1, 1), colour="red")
    from numpy import uint8, zeros

    tile = zeros((16, 16, 3), dtype=uint8)
    tile[:8], tile[8:] = (200, 30, 20), (250, 250, 250)
    awning = Material("stripes", (225, 140, 135), tile)
    striped = dataclasses.replace(thing, parts=tuple(Part(p.vertices, p.faces, p.uv, "stripes") for p in thing.parts))
    assert unsupported_colours("red and white", striped, {"stripes": awning}) == []
    assert unsupported_colours("blue and white", striped, {"stripes": awning}) == ["blue"]


def test_a_colour_that_the_surface_does_not_have_is_a_fault():
    scene = street()
    grey = tuple(
        dataclasses.replace(i, parts=box("x_0", (30, 32, 0), (5, 2, 2.5)).parts)
        if i.node == "delivery_van_002"
        else i
        for i in scene.instances
    )
    assert any(
        "'blue' is not so of delivery_van_002" in message
        for message in _faults(dataclasses.replace(scene, instances=grey))
    )


def test_twins_are_told_apart_in_the_first_sentence():
    assert _faults() == []
    late = "A red delivery van. It is parked in the yard between the bench and the street lamp."
    (message,) = _faults(delivery_van_001=late)
    assert "its start fits delivery_van_000 as well" in message
    (message,) = _faults(delivery_van_001="A red delivery van.")
    assert "it fits delivery_van_000 as well" in message


def test_a_description_is_short():
    long = "The blue delivery van " + "very " * 60 + "much so."
    assert any("has more than 60 words" in message for message in _faults(delivery_van_002=long))


@pytest.mark.parametrize(
    ("gap_m", "word", "so"),
    [
        (0.2, "leaning against", True),
        (1.0, "leaning against", False),
        (4.0, "at", True),
        (6.0, "at", False),
        (6.0, "near", True),
    ],
)
def test_relations_are_read_as_strictly_as_they_are_meant(gap_m, word, so):
    bench = box("bench_001", (-60 + 1 + gap_m + 0.5, 0, 0), (1, 1, 1), colour="green")
    wall = box("mailbox_002", (-60, 0, 0), (2, 2, 2), colour="red")
    geometry = SceneGeometry(dataclasses.replace(street(), instances=(*street().instances, bench, wall)))
    matcher = Matcher(SceneClaims(street_vocabulary(geometry.scene), [], geometry))
    i = geometry.index["bench_001"]
    assert (matcher.faults(i, f"A green bench {word} the red mailbox.") == []) is so


def test_in_front_and_behind_ask_for_the_front_that_a_thing_has(catalogue):
    sign = catalogue.instantiate("stop_sign", "stop_sign_000", generator(0, "test", "front"), yaw_deg=0.0)
    (front,) = sign.anatomy.fronts_rad
    assert front == pytest.approx(0.0)
    before, after = (box(f"bench_{k:03d}", (x, 0, 0), (1, 1, 1)) for k, x in enumerate((2.5, -2.5)))
    geometry = SceneGeometry(dataclasses.replace(street(), instances=(sign, before, after)))
    assert geometry.front(1, 0)
    assert geometry.behind(2, 0)
    assert not geometry.front(2, 0)
    assert not geometry.behind(1, 0)


@pytest.mark.parametrize(
    ("equipment", "said"),
    [
        ("bands of film around it", "with bands of film around it"),
        ("loose bricks on top", "with loose bricks on top"),
        ("cone on top", "with a cone on top"),
        ("blue tarpaulin over one end", "with a blue tarpaulin over one end"),
        ("orange banner", "with an orange banner"),
        ("a spade and a rake leaning on it", "with a spade and a rake leaning on it"),
        ("two arms", "with two arms"),
    ],
)
def test_equipment_has_the_article_that_its_head_noun_asks_for(equipment, said):
    box_ = box("box_000", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    thing = dataclasses.replace(box_, category="brick_pallet", attributes={"equipment": equipment})
    assert said in noun_of(thing, words_of("brick_pallet", None, "object")).bare
