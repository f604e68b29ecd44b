"""Nothing is said of what the ground or the water hides, and nothing that the name has said already."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from support.annotation_scenes import box

from aerialdojo_gen.annotations.appearance import repeats
from aerialdojo_gen.annotations.ground import Surface
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.claims import MIN_TRUE_PHRASES, valid_phrases
from aerialdojo_gen.scenes.model import Scene

WHEELS = "silvery hubcaps"
ROOF = "a long roof down to the tailgate"


def stand(catalogue, category: str, level_m: float, variant: str | None = None, deck_m: float | None = None) -> Scene:
    """One thing on z = 0, and the ground or the water about it at a level."""
    thing = catalogue.instantiate(category, "thing_000", generator(0, "test", category), variant=variant)
    ground = dataclasses.replace(box("ground_000", (0, 0, level_m - 1), (60, 60, 1)), category="ground")
    deck = (
        ()
        if deck_m is None
        else (dataclasses.replace(box("ground_001", (0, 0, deck_m), (60, 60, 1)), category="ground"),)
    )
    names = {part.material for i in (thing, ground, *deck) for part in i.parts}
    materials = {name: catalogue.materials["concrete" if name == "grey" else name] for name in names}
    bounds = np.array([[-30.0, -30.0, -1.0], [30.0, 30.0, 30.0]])
    return Scene("U_Stand_0", (thing, ground, *deck), materials, bounds)


def said(catalogue, scene: Scene) -> tuple[str, ...]:
    return Vocabulary(scene, catalogue).unrepeated_phrases(scene.instances[0])


def test_what_is_under_water_is_not_told(catalogue):
    dry, flooded = (stand(catalogue, "hatchback", level) for level in (0.0, 0.8))
    assert {WHEELS, ROOF} <= set(said(catalogue, dry))
    assert ROOF in said(catalogue, flooded)
    assert WHEELS not in said(catalogue, flooded)


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
    scene = stand(catalogue, "hatchback", 0.0)
    block = box("block_000", (3, 4, -1.0), (2, 2, 4))
    hidden = Surface(scene).hidden(block, np.arange(len(block.faces)))
    # The bottom, and of the eight triangles of the sides those whose middles are the lower ones.
    middles = block.vertices[block.faces].mean(axis=1)[:, 2]
    areas = np.where(np.isin(middles, (-1.0, 3.0)), 2.0, 4.0)
    assert hidden == pytest.approx(areas[middles < 0.0].sum() / areas.sum())


def test_a_deck_overhead_hides_nothing(catalogue):
    scene = stand(catalogue, "hatchback", 0.0, deck_m=5.0)
    assert said(catalogue, scene) == said(catalogue, stand(catalogue, "hatchback", 0.0))


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
    assert twice in {
        look.phrase for look in valid_phrases(catalogue[category].looks, scene.instances[0], scene.materials)
    }
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
    ground = dataclasses.replace(box("ground_000", (0, 0, -1), (200, 200, 1)), category="ground")
    materials = {part.material: catalogue.materials[part.material] for i in things for part in i.parts}
    materials["grey"] = catalogue.materials["concrete"]
    scene = Scene("U_All_0", (*things, ground), materials, np.array([[-99.0, -99.0, -1.0], [99.0, 99.0, 99.0]]))
    vocabulary = Vocabulary(scene, catalogue)
    phrases = {thing.node: vocabulary.unrepeated_phrases(thing) for thing in things}
    assert [pairs[k] for k, said in enumerate(phrases.values()) if len(said) < MIN_TRUE_PHRASES] == []
    assert not any(repeats(say, thing) for thing in things for say in phrases[thing.node])
