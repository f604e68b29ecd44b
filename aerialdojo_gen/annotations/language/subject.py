"""An object's own words: which adjectives and details its claims give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.claims import Claim
from aerialdojo_gen.annotations.language.nouns import OF_THE_WHOLE, Name, NounPhrase
from aerialdojo_gen.annotations.phrases import LETTERED, phrase_value
from aerialdojo_gen.scenes.looks import Look

_ORDER = ("size", "state", "pattern", "shape", "colour", "material")


@dataclass(frozen=True)
class Wording:
    """A claim about an object's looks, and the ways to say it."""

    index: int  # Of the claim
    key: str  # The attribute's, or "part"
    adjectives: tuple[str, ...] = ()
    tails: tuple[str, ...] = ()  # After the noun: "full of soil"
    details: tuple[str, ...] = ()  # After "with" or "it has"
    clauses: tuple[str, ...] = ()  # "it lies on its roof"


def wordings_of(claims: Sequence[Claim], looks: Mapping[str, Look], last_word: str) -> list[Wording]:
    """Word the claims of looks; `last_word` is that of the object's name."""
    found = []
    for index, claim in enumerate(claims):
        if claim.kind == "part":
            look = looks.get(claim.key)
            also = (look.also, look.adjectives, look.clauses) if look is not None else ((), (), ())
            found.append(Wording(index, "part", also[1], (), (claim.key, *also[0]), also[2]))
        elif claim.kind in ("colour", "size", "attribute"):
            key, _, value = claim.key.rpartition("=")
            found.append(_value(index, key or claim.kind, value, last_word))
    return found


def _value(index: int, key: str, value: str, last_word: str) -> Wording:
    phrase = phrase_value(key, value)
    if phrase.startswith("+"):
        return Wording(index, key, (phrase[1:],))
    if phrase.startswith("with a sign reading") and last_word in LETTERED:
        word = phrase.removeprefix("with a sign reading ")
        return Wording(index, key, tails=(f"reading {word}", f"that says {word}", f"saying {word}"))
    if phrase.startswith("with "):
        return Wording(index, key, details=(phrase.removeprefix("with "),))
    return Wording(index, key, tails=(phrase,))


def phrase_of(name: Name, said: Sequence[Wording], rng: np.random.Generator) -> NounPhrase:
    """Make the noun phrase that says these adjectives and tails, in English order."""
    known = set(name.text.split())
    ordered = sorted(said, key=lambda w: _ORDER.index(w.key) if w.key in _ORDER else 1)
    whole: list[str] = []
    own: list[str] = []
    for wording in ordered:
        if wording.adjectives:
            word = wording.adjectives[int(rng.integers(len(wording.adjectives)))]
            if word not in known:
                (whole if name.group and wording.key in OF_THE_WHOLE else own).append(word)
    tails = [w.tails[int(rng.integers(len(w.tails)))] for w in ordered if w.tails and not w.adjectives]
    return NounPhrase(name, tuple(whole), tuple(own), tails[0] if tails else "")
