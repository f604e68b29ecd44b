"""What is said of looks is so of the surface, and can be seen: nothing of what ground, water or the name hides."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from support.annotation_scenes import PAINTS, box, street, street_annotations, street_vocabulary
from support.catalogue_faults import MIN_TRUE_PHRASES

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.claims import Claim, SceneClaims
from aerialdojo_gen.annotations.format import format_annotations, parse_annotations
from aerialdojo_gen.annotations.relations import DISTRACTOR_SLACK
from aerialdojo_gen.annotations.vocabulary import Surface, Vocabulary, colour_shares, repeats, unsupported_colours
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.appearances import valid_phrases
from aerialdojo_gen.scenes.model import Material, Part, Scene


def test_colours_are_those_of_the_surface():
    red = box("mailbox_000", (0, 0, 0), (1, 1, 1), colour="red")
    assert colour_shares(red, PAINTS) == pytest.approx({"red": 1.0})
    # A twentieth of the surface is a colour of a part, and not that of the whole.
    small = box("mailbox_000", (0, 0, 0), (0.22, 0.22, 0.22), colour="green").parts[0]
    mixed = dataclasses.replace(red, parts=(*red.parts, small))
    # Stripes are two colours.
    tile = np.repeat(np.array([[[200, 30, 20]], [[250, 250, 250]]], np.uint8), 8, axis=0).repeat(16, axis=1)
    striped = dataclasses.replace(red, parts=tuple(Part(p.vertices, p.faces, p.uv, "stripes") for p in red.parts))
    paints = PAINTS | {"stripes": Material("stripes", (225, 140, 135), tile)}
    for thing, text, wrong in (
        (red, "red", []), (red, "dark green", ["green"]), (red, "red and white", ["white"]),
        (mixed, "green", ["green"]), (mixed, "green handle", []),
        (striped, "red and white", []), (striped, "blue and white", ["blue"]),
    ):  # fmt: skip
        assert unsupported_colours(text, thing, paints) == wrong, text


def test_a_colour_that_the_surface_does_not_have_is_a_fault():
    grey = box("x_0", (30, 32, 0), (5, 2, 2.5)).parts
    things = (dataclasses.replace(i, parts=grey) if i.node == "delivery_van_002" else i for i in street().instances)
    source = parse_annotations(format_annotations(street_annotations()))
    faults = SourceCheck(source, street_vocabulary(dataclasses.replace(street(), instances=tuple(things)))).faults
    assert any("'blue' is not so of delivery_van_002" in fault.message for fault in faults)


WHEELS = "silvery hubcaps"
ROOF = "a long roof down to the tailgate"


def stand(catalogue, category: str, level_m: float, variant: str | None = None, deck_m: float | None = None) -> Scene:
    """One thing on z = 0, and the ground or the water about it at a level; a deck overhead."""
    thing = catalogue.instantiate(category, "thing_000", generator(0, "test", category), variant=variant)
    levels = [level_m - 1] if deck_m is None else [level_m - 1, deck_m]
    ground = [box(f"ground_{k:03d}", (0, 0, z), (60, 60, 1)) for k, z in enumerate(levels)]
    materials = {p.material: catalogue.materials[p.material] for p in thing.parts}
    bounds = np.array([[-30.0, -30.0, -1.0], [30.0, 30.0, 30.0]])
    return Scene("U_Stand_0", (thing, *ground), materials | {"grey": catalogue.materials["concrete"]}, bounds)


def said(catalogue, scene: Scene) -> tuple[str, ...]:
    return Vocabulary(scene, catalogue).unrepeated_phrases(scene.instances[0])


def test_what_is_under_water_is_not_told_and_a_deck_overhead_hides_nothing(catalogue):
    dry, flooded = (said(catalogue, stand(catalogue, "hatchback", level)) for level in (0.0, 0.8))
    assert {WHEELS, ROOF} <= set(dry)
    assert ROOF in flooded
    assert WHEELS not in flooded
    assert said(catalogue, stand(catalogue, "hatchback", 0.0, deck_m=5.0)) == dry


def test_a_hidden_part_is_not_said_of_its_own_thing_and_does_not_tell_another_from_it(catalogue):
    claims = SceneClaims(Vocabulary(stand(catalogue, "hatchback", 0.8), catalogue), [])
    slacks = (1.0, DISTRACTOR_SLACK)
    # Who looks for hubcaps cannot know what is under water: such a thing is like one that shows them.
    for phrase, so in ((WHEELS, [False, True]), (ROOF, [True, True]), ("a spoiler", [False, False])):
        assert [claims.holds(Claim("part", phrase), 0, slack) for slack in slacks] == so, phrase


@pytest.mark.parametrize("category", ["hatchback", "street_lamp", "igloo", "swing_set", "garden_shed"])
def test_more_water_hides_more(catalogue, category):
    shown = [
        {look.phrase for look in catalogue[category].looks if Surface(scene).shows(look, scene.instances[0])}
        for scene in (stand(catalogue, category, level) for level in (0.0, 0.3, 0.6, 0.9, 1.2))
    ]
    assert all(more >= less for more, less in pairwise(shown))
    assert len(shown[-1]) < len(shown[0])
    thing = stand(catalogue, category, 0.0).instances[0]
    true = {look.phrase for look in valid_phrases(catalogue[category].looks, thing, catalogue.materials)}
    assert true <= shown[0]


def test_the_share_that_is_hidden_is_that_of_the_area(catalogue):
    block = box("block_000", (3, 4, -1.0), (2, 2, 4))
    hidden = Surface(stand(catalogue, "hatchback", 0.0)).hidden(block, np.arange(len(block.faces)))
    # The bottom, and of the eight triangles of the sides those whose middles are the lower ones.
    middles = block.vertices[block.faces].mean(axis=1)[:, 2]
    areas = np.where(np.isin(middles, (-1.0, 3.0)), 2.0, 4.0)
    assert hidden == pytest.approx(areas[middles < 0.0].sum() / areas.sum())


@pytest.mark.parametrize(
    ("category", "variant", "twice"),
    [
        ("shipping_container", "white_short_open", "its doors wide open"),
        ("excavator", "orange_parked", "its bucket resting on the ground"),
        ("turnstile", "steel", "no roof"),
    ],
)
def test_a_phrase_that_says_an_attribute_again_is_not_used(catalogue, category, variant, twice):
    scene = stand(catalogue, category, 0.0, variant)
    true = valid_phrases(catalogue[category].looks, scene.instances[0], scene.materials)
    assert twice in {look.phrase for look in true}
    assert twice not in said(catalogue, scene)


def test_of_every_variant_of_which_a_phrase_is_not_used_there_is_something_to_tell(catalogue):
    pairs = [
        (category, variant.name)
        for category in catalogue.targets
        for variant in catalogue[category].variants
        for named in [dataclasses.replace(box("x_0", (0, 0, 0), (1, 1, 1)), attributes=dict(variant.attributes))]
        if any(repeats(look.phrase, named) for look in catalogue[category].looks)
    ]
    assert len(pairs) > 20
    things = tuple(
        catalogue.instantiate(category, f"thing_{k:04d}", generator(0, "test", category), variant=variant)
        for k, (category, variant) in enumerate(pairs)
    )
    materials = {part.material: catalogue.materials[part.material] for i in things for part in i.parts}
    materials["grey"] = catalogue.materials["concrete"]
    ground = box("ground_000", (0, 0, -1), (200, 200, 1))
    scene = Scene("U_All_0", (*things, ground), materials, np.array([[-99.0, -99.0, -1.0], [99.0, 99.0, 99.0]]))
    vocabulary = Vocabulary(scene, catalogue)
    phrases = {thing.node: vocabulary.unrepeated_phrases(thing) for thing in things}
    assert [pairs[k] for k, said in enumerate(phrases.values()) if len(said) < MIN_TRUE_PHRASES] == []
    assert not any(repeats(say, thing) for thing in things for say in phrases[thing.node])
