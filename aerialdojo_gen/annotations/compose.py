"""Puts a description together from a template and its pieces."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.annotations.phrases import Noun, Words
from aerialdojo_gen.annotations.templates import FULL, MORE, PLAIN

_MOST_IN_ONE = 2
_LONG_PLACE = 5


def compose(
    words: Words, noun: Noun, place: str, facts: list[str], rng: np.random.Generator, used: dict[str, int]
) -> tuple[str, str]:
    """Compose a description of one to three sentences.

    Parameters
    ----------
    words, noun : Words, Noun
        Of the thing described.
    place : str
        E.g. ``"in the car park"``; may be empty.
    facts : list of str
        At least one, e.g. ``"beside a red mailbox"``; those beyond the second get a sentence of their own.
    rng : numpy.random.Generator
        Chooses look, template and joints.
    used : dict of str to int
        How often each template served already in this scene: the least used are chosen from.

    Returns
    -------
    (str, str)
        The description, and the template that it was made from.
    """
    look = words.looks[int(rng.integers(len(words.looks)))] if words.looks else ""
    first, rest = facts[:_MOST_IN_ONE], facts[_MOST_IN_ONE:]
    if place and len(first) == _MOST_IN_ONE:
        first, rest = facts[:1], facts[1:]
    template = _template(noun, look, bool(rest), rng, used)
    closing = any(mark in template for mark in ("{rel}.", "{rel};", "{rel}:"))
    comma = "," if closing and len(place.split()) > _LONG_PLACE else ""
    rel = " ".join([*([place + comma] if place else []), " and ".join(first)])
    fields = {
        "a": noun.a(),
        "bare": noun.bare,
        "the": noun.the(),
        "look": look,
        "verb": words.verb,
        "ing": words.participle,
        "rel": rel,
    }
    text = template.format(**fields, A=_upper(fields["a"]), Rel=_upper(rel))
    if rest:
        more = MORE[int(rng.integers(len(MORE)))]
        text += " " + more.format(verb=words.verb, rel=" and ".join(rest))
    return text, template


def _template(noun: Noun, look: str, more: bool, rng: np.random.Generator, used: dict[str, int]) -> str:
    pool = [
        template
        for template in (FULL if look else PLAIN)
        if not ("with {look}" in template and noun.after)
        and not ("{bare}" in template and noun.group)
        and not (more and template.count(".") > 2)
    ]
    least = min(used.get(template, 0) for template in pool)
    fresh = [template for template in pool if used.get(template, 0) <= least]
    return fresh[int(rng.integers(len(fresh)))]


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
