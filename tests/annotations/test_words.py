"""Words of the catalogue's categories: synonyms and looks, and that they assert no more than is checked."""

import itertools
import re
from collections import defaultdict

from aerialdojo_gen.annotations.appearance import SHADES
from aerialdojo_gen.annotations.phrases import group_of, words_of

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
