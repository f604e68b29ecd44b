"""Drafted annotations: they pass the checks, say what a person would say, and are the same each time."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import pytest
from support.annotation_scenes import PAINTS, box, street

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.draft import AnnotationDrafter, DraftOptions, choose_landmarks
from aerialdojo_gen.annotations.format import Annotations, format_annotations, parse_annotations
from aerialdojo_gen.annotations.language.writer import Writer
from aerialdojo_gen.annotations.phrases import article, noun_of, words_of
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.model import Instance, Scene

ROOT = Path(__file__).resolve().parents[2]


def draft_annotations(scene, catalogue, n_landmarks, n_objects, seed, options=None):
    vocabulary = Vocabulary(scene, catalogue)
    landmarks = choose_landmarks(vocabulary, n_landmarks)
    drafter = AnnotationDrafter(vocabulary, landmarks, dataclasses.replace(options or DraftOptions(), seed=seed))
    return Annotations(scene.name, landmarks, drafter.objects(n_objects))


@pytest.fixture(scope="module")
def plaza(catalogue) -> Scene:
    """Real props: a clock tower and rows of street things round it, many of them alike."""
    rng = generator(0, "test", "plaza")
    categories = ("bench", "mailbox", "litter_bin", "fire_hydrant", "sedan", "delivery_van", "bicycle", "boulder")
    instances = [
        box("ground_000", (0, 0, -0.1), (100, 100, 0.1)),
        catalogue.instantiate("clock_tower", "clock_tower_000", rng),
    ]
    for k in range(48):
        category = categories[int(rng.integers(len(categories)))]
        spot = (-30.0 + 8.0 * (k % 8) + float(rng.uniform(0, 2)), -21.0 + 9.0 * (k // 8), 0.0)
        instances.append(catalogue.instantiate(category, f"{category}_{k:03d}", rng, spot, 15.0 * k))
    materials = PAINTS | {p.material: catalogue.materials[p.material] for i in instances[1:] for p in i.parts}
    return Scene("U_Plaza_0", tuple(instances), materials, street().bounds)


@pytest.mark.parametrize(("up", "chosen"), [(0.0, True), (60.0, False)])
def test_a_landmark_rises_through_the_ceiling_but_stands_below_it(plaza, catalogue, up, chosen):
    mast = catalogue.instantiate("radio_mast", "radio_mast_000", generator(0, "test", "mast"), (40.0, 40.0, up))
    materials = plaza.materials | {p.material: catalogue.materials[p.material] for p in mast.parts}
    bounds = plaza.bounds.copy()
    bounds[1, 2] = mast.centroid[2] - up - 1.0
    scene = dataclasses.replace(plaza, instances=(*plaza.instances, mast), materials=materials, bounds=bounds)
    landmarks = choose_landmarks(Vocabulary(scene, catalogue), 2, at_most=True)
    assert {mark.name for mark in landmarks} == ({"radio mast", "clock tower"} if chosen else {"clock tower"})
    source = parse_annotations(format_annotations(Annotations(scene.name, landmarks, ())))
    assert SourceCheck(source, Vocabulary(scene, catalogue)).faults == []


def test_drafts_pass_the_checks_and_are_the_same_each_time(plaza, catalogue):
    draft = draft_annotations(plaza, catalogue, 1, 20, seed=3)
    text = format_annotations(draft)
    assert text == format_annotations(draft_annotations(plaza, catalogue, 1, 20, seed=3))
    assert text != format_annotations(draft_annotations(plaza, catalogue, 1, 20, seed=4))
    assert SourceCheck(parse_annotations(text), Vocabulary(plaza, catalogue), (1, 20)).faults == []


def test_drafts_are_varied_english(plaza, catalogue):
    draft = draft_annotations(plaza, catalogue, 1, 20, seed=3)
    claims = SceneClaims(Vocabulary(plaza, catalogue), draft.landmarks)
    writer = Writer(claims, [mark.name for mark in draft.landmarks], 3, "test")
    numbers = [claims.geometry.index[entry.node] for entry in draft.objects]
    texts = [text.text for i in numbers for text in writer.texts(i, claims.of(i), (), 1)]
    assert len(texts) == len(numbers)
    # The boulders are scenery: nobody is sent to look for one of many alike.
    assert {entry.category for entry in draft.objects} == {i.category for i in plaza.instances} & set(
        catalogue.targets
    )
    assert len(set(texts)) == len(texts)
    assert len({" ".join(text.split()[:2]) for text in texts}) > 8
    for text in texts:
        assert re.fullmatch(r"[A-Z][^_{}\d]*[.]", text), text
        assert "  " not in text
        assert not re.search(r"\ba [aeio]|\ban [^aeiouASh]|\b(\w+) \1\b", text), text


def test_choice_limits_objects(plaza, catalogue):
    allowed = {i.node for i in plaza.instances if i.category in ("bench", "sedan", "mailbox", "bicycle")}
    options = DraftOptions(
        reject=lambda node: "" if node in allowed else "not allowed", centre_m=(0.0, 0.0), core_radius_m=25.0
    )
    draft = draft_annotations(plaza, catalogue, 1, 8, 0, options)
    for entry in draft.objects:
        assert entry.node in allowed
        x, y, _ = plaza[entry.node].centroid
        assert x * x + y * y <= 25.0**2


def test_too_few_things_is_an_error(plaza, catalogue):
    assert len(draft_annotations(plaza, catalogue, 1, 500, 0).objects) < 500
    with pytest.raises(AnnotationError, match="2 landmarks requested"):
        draft_annotations(plaza, catalogue, 2, 5, 0)


def test_things_that_cannot_be_told_apart_are_not_drafted(catalogue):
    rng = generator(0, "test", "twins")
    tower = catalogue.instantiate("clock_tower", "clock_tower_000", rng)
    twins = [
        catalogue.instantiate("mailbox", f"mailbox_{k:03d}", rng, (30.0, 30.0 + 30.0 * k, 0.0), variant="red")
        for k in range(2)
    ]
    materials = {p.material: catalogue.materials[p.material] for i in (tower, *twins) for p in i.parts}
    scene = dataclasses.replace(street(), name="U_Twins_0", instances=(tower, *twins), materials=materials)
    assert draft_annotations(scene, catalogue, 1, 1, 0).objects == ()


def _thing(catalogue, category: str, **attributes: str) -> str:
    part = street().instances[0].parts
    words = words_of(category, catalogue[category].name, catalogue[category].kind)
    return noun_of(Instance("x_000", category, "", attributes, part), words).bare


@pytest.mark.parametrize(
    ("category", "attributes", "said"),
    [
        ("delivery_van", {"colour": "red", "pattern": "white stripe"}, "red delivery van with a white stripe"),
        ("hatchback", {"colour": "orange", "pattern": "black roof"}, "orange hatchback with a black roof"),
        ("suv", {"colour": ""}, "SUV"),
        ("bush", {"pattern": "red berries"}, "bush with red berries"),
        ("forklift", {"colour": "red", "state": "forks raised"}, "red forklift with raised forks"),
        ("a_board", {"colour": "green", "sign": "menu"}, "green pavement sign reading “MENU”"),
        ("traffic_light", {"state": "showing red"}, "traffic light showing red"),
        ("wildflowers", {"colour": "purple"}, "purple wildflowers"),
        ("deer", {"state": "with antlers", "place": "at the pond"}, "deer with antlers"),
        ("kiosk", {"colour": "teal", "sign": "news"}, "teal kiosk with a sign reading “NEWS”"),
        # The article that the head noun asks for.
        *(
            ("brick_pallet", {"equipment": what}, f"pallet of bricks with {article}{what}")
            for article, what in (
                ("", "bands of film around it"), ("", "loose bricks on top"), ("a ", "cone on top"), ("", "two arms"),
                ("a ", "blue tarpaulin over one end"), ("an ", "orange banner"),
                ("", "a spade and a rake leaning on it"),
            )
        ),
    ],
)  # fmt: skip
def test_noun_phrases(catalogue, category, attributes, said):
    assert _thing(catalogue, category, **attributes) == said


def test_wordings_of_a_category_are_of_values_that_it_has(catalogue):
    path = ROOT / "aerialdojo_gen" / "annotations" / "phrases" / "values.toml"
    tables = {name: t for name, t in tomllib.loads(path.read_text("utf-8"))["values"].items() if isinstance(t, dict)}
    for category, table in tables.items():
        values = {item for variant in catalogue[category].variants for item in variant.attributes.items()}
        for entry, said in table.items():
            key, _, value = entry.partition("=")
            assert any(key == k and value in (v, "*") for k, v in values), (category, entry)
            assert isinstance(said, str) or 0 < len(said) == len(set(said)), (category, entry)


def test_articles():
    assert [article(w) for w in ("unicycle", "umbrella", "oak", "SUV", "one-armed lamp", "red oak")] == [
        "a", "an", "an", "an", "a", "a",
    ]  # fmt: skip
