"""Compose a description from a sentence template and its parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerialdojo_gen.annotations.phrases import Noun, Words

# Templates with a look; those with "with {look}" are not for nouns that end in "with ...".
# The first sentence must identify the object by itself.
FULL = (
    "{A} with {look}, {ing} {rel}.",
    "{A} {ing} {rel}. It has {look}.",
    "This {bare} {verb} {rel}. It has {look}.",
    "Look for {a} {ing} {rel}; it has {look}.",
    "{A} that {verb} {rel} and has {look}.",
    "{Rel} {stands} {a} with {look}.",
    "{Rel} {stands} {a}. You can tell it by {look}.",
    "The {bare} {verb} {rel}. You will know it by {look}.",
    "Find the {bare} {rel}: it has {look}.",
    "It is {a} with {look}, and it {verb} {rel}.",
    "Search for {a} {rel}. It has {look}.",
    "{Rel} you will see {a} with {look}.",
    "{Rel} you will find {a}; it has {look}.",
    "The target is {a} {ing} {rel}. It has {look}.",
    "Your target is {a}, {ing} {rel}. It has {look}.",
    "{A} {verb} {rel}. You will notice {look}.",
    "Go to the {bare} {rel}, the one with {look}.",
)
# For objects without a true look.
PLAIN = (
    "{A} {ing} {rel}.",
    "This {bare} {verb} {rel}.",
    "{Rel} {stands} {a}.",
    "Look for {a} {ing} {rel}.",
    "You will find {a} {rel}.",
    "The {bare} {verb} {rel}.",
    "It is {a}, {ing} {rel}.",
)
# For an additional fact.
MORE = ("It is also {rel}.",)
RELATIONS = {
    "beside": ("beside {}", "next to {}", "right beside {}", "right next to {}"),
    "near": ("near {}", "close to {}", "not far from {}", "a few steps from {}"),
    "on": ("on {}", "on top of {}"),
    "under": ("under {}", "beneath {}", "underneath {}"),
    "side": ("just {d} of {}", "to the {d} of {}", "on the {d} side of {}"),
    "between": ("between {}",),
}


_LONG_PLACE = 5


def compose(
    words: Words,
    noun: Noun,
    place: str,
    needed: list[str],
    extra: list[str],
    rng: np.random.Generator,
    used: dict[str, int],
) -> tuple[str, str]:
    """Compose a description of one to three sentences; returns it and its template."""
    if place and needed and place.split()[0] == needed[0].split()[0] == "beside":
        needed = [needed[0].replace("beside", "next to", 1), *needed[1:]]
    look = _least_used(words.looks, rng, used) if words.looks else ""
    comma = "," if place and needed and (len(place.split()) > _LONG_PLACE or len(needed) > 1) else ""
    template = _template(noun, look, bool(comma), bool(extra), rng, used)
    rel = " ".join([*([place + comma] if place else []), *([_join(needed)] if needed else [])])
    fields = {
        "a": noun.a(),
        "bare": noun.bare,
        "the": noun.the(),
        "look": look,
        "verb": words.verb,
        "stands": "stands" if words.verb.startswith("is ") else words.verb,
        "ing": words.participle,
        "rel": rel,
    }
    text = template.format(**fields, A=_upper(fields["a"]), Rel=_upper(rel))
    if extra:
        more = MORE[int(rng.integers(len(MORE)))]
        text += " " + more.format(verb=words.verb, rel=_join(extra))
    return text, template


def _join(texts: list[str]) -> str:
    return " and ".join([*([", ".join(texts[:-1])] if texts[1:] else []), texts[-1]])


def _template(
    noun: Noun, look: str, has_comma: bool, more: bool, rng: np.random.Generator, used: dict[str, int]
) -> str:
    pool = [
        template
        for template in (FULL if look else PLAIN)
        if not ("with {look}" in template and noun.after)
        and not ("{bare}" in template and noun.group)
        and not (has_comma and "{rel} and " in template)
        and not (more and template.count(".") > 2)
    ]
    return _least_used(pool, rng, used)


def _least_used(pool: Sequence[str], rng: np.random.Generator, used: dict[str, int]) -> str:
    least = min(used.get(text, 0) for text in pool)
    fresh = [text for text in pool if used.get(text, 0) <= least]
    return fresh[int(rng.integers(len(fresh)))]


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
