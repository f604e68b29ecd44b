"""Words of the catalogue and sentences of the grammar: clean English that asserts no more than is checked."""

import itertools
import re
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.annotations.language.locations import Location, relation_phrases
from aerialdojo_gen.annotations.language.nouns import Name, NounPhrase, Wording, name_of, noun_phrase, phrase_of
from aerialdojo_gen.annotations.language.sentences import SLOTS, Content, compose, expand, frames
from aerialdojo_gen.annotations.language.writer import LENGTHS
from aerialdojo_gen.annotations.phrases import article, group_of, words_of
from aerialdojo_gen.annotations.vocabulary import SHADES

KINDS = {"terse": ("at", "ref"), "vague": ("at",), "normal": ("at", "ref", "at_with", "at_telling")}
MORE = ("with", "telling", "at", "clause", "near")
ALL = [f for level, kinds in KINDS.items() for kind in kinds for f in frames(level, kind)]
ALL += [f for kind in MORE for f in frames("more", kind)]

NOUNS = ("sedan", "overturned car", "row of wheelie bins", "ice cream cart", "hunting stand", "SUV")
ADJECTIVES = ("red", "orange", "old", "empty", "unloaded")
PLACES = (
    Location(0, "place", "in the car park", "in the car park"),
    Location(1, "relation", "beside", "next to the kiosk", "the kiosk", "next to it", "beside it", True, 2),
    Location(2, "relation", "near", "near an oak", "an oak", "near it", "close by", False, 1),
    Location(3, "relation", "between", "between a van and the hut", "a van and the hut", "between them", lead=1),
    Location(4, "direction", "north", "north of the tower", "the tower", "north of it", "", True, 2),
)
DETAILS = (
    Wording(5, "part", details=("a white roof",), clauses=("it lies on its roof",)),
    Wording(6, "sign", details=("a sign reading “BAKERY”",)),
)


def check(text):
    """Whether a text is clean English as far as rules can tell."""
    assert text == " ".join(text.split()), text
    assert not re.search(r"[{}\[\]|]|\s[,.;:?]|[,.;:][,.;:]|\.\s+[a-z]", text), text
    assert text[0].isupper() or text[0] == "“", text
    for determiner, word in re.findall(r"\b(an?) ([\w-]+)", text.lower()):
        assert determiner == article(word), text
    assert len(text.split()) <= 60, text


def test_no_frame_stands_twice_and_all_slots_are_known():
    for level, kinds in KINDS.items():
        texts = [frame.text for kind in kinds for frame in frames(level, kind)]
        assert len(texts) == len(set(texts))
    assert all(frame.slots <= SLOTS for frame in ALL)


@pytest.mark.parametrize("level", KINDS)
def test_each_kind_of_first_sentence_has_templates_on_both_sides(level):
    for kind in KINDS[level]:
        templates = {frame.template: frame.held_out for frame in frames(level, kind)}
        assert 0.2 <= np.mean(list(templates.values())) <= 0.5


def test_alternatives_nest():
    assert list(expand("[a|b [c|d]] e")) == ["a e", "b c e", "b d e"]
    assert list(expand("[very |]good")) == ["very good", "good"]


def test_a_collective_keeps_its_adjectives_at_its_things():
    phrase = noun_phrase(name_of("stack of fish crates"), ["white", "tall", "five"])
    assert phrase.a == "a tall stack of five white fish crates"
    assert NounPhrase(name_of("overturned car"), own=("red",)).a == "an overturned red car"
    assert NounPhrase(Name("SUV"), tail="full of soil").a == "an SUV full of soil"


def test_a_noun_phrase_says_no_word_twice_and_all_that_can_only_stand_after_it():
    cone = Wording(0, "shape", tails=("clipped into a cone", "shaped like a cone"))
    forms = Wording(1, "state", adjectives=("potted",), tails=("in a pot",))
    for seed in range(20):
        phrase = phrase_of(name_of("clipped evergreen"), [forms, cone], np.random.default_rng(seed))
        assert phrase.a == "a potted clipped evergreen shaped like a cone"
    bales = [Wording(0, "load", adjectives=("five round",)), Wording(1, "part", adjectives=("round",))]
    phrase = phrase_of(name_of("stack of hay bales"), bales, np.random.default_rng(0))
    assert phrase.a == "a stack of five round hay bales"


def test_relations_have_words_whatever_their_conditions():
    words = relation_phrases()
    for table in ("relation", "pronoun"):
        for key, some in words[table].items():
            assert any(not one.conditions for one in some), (table, key)
    for key in words["relation"]:
        assert key in words["pronoun"], key


@given(
    level=st.sampled_from(sorted(LENGTHS)),
    noun=st.sampled_from(NOUNS),
    adjectives=st.lists(st.sampled_from(ADJECTIVES), max_size=2, unique=True),
    tail=st.sampled_from(["", "full of soil"]),
    verb=st.sampled_from([("is parked", "parked"), ("stands", "standing"), ("is", "")]),
    places=st.lists(st.sampled_from(PLACES), min_size=1, max_size=3, unique=True),
    details=st.lists(st.tuples(st.sampled_from(DETAILS), st.booleans()), max_size=2, unique_by=lambda d: d[0].index),
    held_out=st.booleans(),
    seed=st.integers(0, 2**32),
)
def test_texts_say_what_they_are_asked_to(level, noun, adjectives, tail, verb, places, details, held_out, seed):
    phrase = NounPhrase(name_of(noun), own=tuple(adjectives), tail=tail)
    content = Content(level, phrase, verb, places, details)
    rng = np.random.default_rng(seed)
    made = next((m for m in (compose(content, held_out, (), rng) for _ in range(40)) if m is not None), None)
    if made is None:  # what is said after the noun leaves room for no detail
        assert level in ("terse", "vague")
        assert details
        return
    text, frame, held = made
    check(text)
    assert held == held_out
    assert "{" in frame
    assert phrase.name.head.lower() in text.lower()
    for place in places:
        assert (place.thing or place.text) in text or (place.thing or place.text).capitalize() in text
    for wording, _ in details:
        said = [*wording.details, *(clause[2:] for clause in wording.clauses)]
        assert any(words in text for words in said), (text, said)


NUMBERS = dict(
    zip(("two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"), range(2, 11), strict=True)
)
# "Four axles" of eight wheels, "seven pairs" of fourteen skis.
HALVES = ("axles", "pairs", "bogies", "sets")


def nouns(catalogue, category):
    words = words_of(category, catalogue[category].name, catalogue[category].kind)
    wholes = [f"{whole} of {head}" for whole, head in itertools.product(words.collectives, words.plural_heads)]
    return [noun.lower() for noun in (*words.nouns, *wholes)]


def head_of(noun):
    return re.split(r" (?:of|on|in|with|at|for|from|under|that|to|made|and) ", noun)[0]


def test_every_category_has_synonyms_and_none_names_another_category(catalogue):
    by_category = {category: nouns(catalogue, category) for category in catalogue}
    spoken_of = [category for category in catalogue if catalogue[category].kind != "life"]
    assert [category for category in spoken_of if len(by_category[category]) < 2] == []
    names = {category: catalogue[category].name.lower() for category in catalogue}
    # "Wall" would name a garden wall as well.
    named = defaultdict(set)
    for category in catalogue:
        for name in (names[category], *by_category[category]):
            words = name.split()
            for k in range(len(words)):
                named[" ".join(words[k:])].add(category)
    faults = [
        (category, noun, other) for category in catalogue for noun in by_category[category] for other in named[noun]
        if names[category] != names[other]
    ]  # fmt: skip
    assert not faults, "\n".join(map(str, faults))


def test_synonyms_are_singular_unless_a_group_goes_before(catalogue):
    for category in catalogue:
        words = words_of(category, catalogue[category].name, catalogue[category].kind)
        for noun in words.nouns:
            assert bool(group_of(head_of(noun))) == bool(words.group), (category, noun)
        for noun in words.plural_heads:
            assert group_of(head_of(noun)) or head_of(noun).split()[-1] in ("masonry", "straw"), (category, noun)


def test_no_wording_of_a_look_says_a_colour_or_a_number_that_is_not_checked(catalogue):
    faults = []
    for category in catalogue.targets:
        for look in catalogue[category].looks:
            colours = {name for names in look.colour.values() for name in names}
            materials = " ".join(name for names in look.material.values() for name in names)
            counts = {n for least, most in look.count.values() for n in range(least, most + 1)}
            for wording in (*look.wordings, *look.adjectives):
                text = wording.replace("ice cream", "").lower()
                words = re.findall(r"[a-z]+", text)
                said = [w for w in words if w in SHADES and w[:4] not in materials]
                faults += [(category, wording, word) for word in said if not SHADES[word] & colours]
                if re.search(r"metre|times|layers|rows|storeys|high|tiers", text):
                    continue
                found = counts | ({n // 2 for n in counts} if set(words) & set(HALVES) else set())
                numbers = {NUMBERS[w] for w in words if w in NUMBERS} | ({2} if " pair " in text else set())
                faults += [
                    (category, wording, n) for n in numbers - found - {n // 2 for n in found if "each" in text}
                ]
    assert not faults, "\n".join(map(str, faults))
