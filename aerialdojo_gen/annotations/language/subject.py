"""An object's own words: which adjectives and details its claims give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.claims import Claim
from aerialdojo_gen.annotations.language.nouns import OF_THE_WHOLE, Name, NounPhrase
from aerialdojo_gen.annotations.phrases import phrases_of_value
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


def wordings_of(claims: Sequence[Claim], looks: Mapping[str, Look], category: str) -> list[Wording]:
    """Word the claims of the looks of a thing of a category."""
    found = []
    for index, claim in enumerate(claims):
        if claim.kind == "part":
            look = looks.get(claim.key)
            also = (look.also, look.adjectives, look.clauses) if look is not None else ((), (), ())
            found.append(Wording(index, "part", also[1], (), (claim.key, *also[0]), also[2]))
        elif claim.kind in ("colour", "size", "attribute"):
            key, _, value = claim.key.rpartition("=")
            key = key or claim.kind
            phrases = phrases_of_value(key, value, category)
            details = tuple(p.removeprefix("with ") for p in phrases if p.startswith("with "))
            # "Drums, one of them toppled, by the gate": no sentence here has room for that.
            tails = tuple(p for p in phrases if not p.startswith(("+", "with ", "one ")))
            found.append(Wording(index, key, tuple(p[1:] for p in phrases if p.startswith("+")), tails, details))
    return found


def phrase_of(name: Name, said: Sequence[Wording], rng: np.random.Generator) -> NounPhrase:
    """Make the noun phrase that says these adjectives and tails, in English order."""
    known = set(name.text.split())
    ordered = sorted(said, key=lambda w: _ORDER.index(w.key) if w.key in _ORDER else 1)
    whole: list[str] = []
    own: list[str] = []
    for wording in ordered:
        if wording.adjectives:
            words = wording.adjectives[int(rng.integers(len(wording.adjectives)))].split()
            # "Light wooden" before "wooden pallets".
            if word := " ".join(words[:-1] if words[-1] in known else words):
                (whole if name.group and wording.key in OF_THE_WHOLE else own).append(word)
    tails = [w.tails[int(rng.integers(len(w.tails)))] for w in ordered if w.tails and not w.adjectives]
    return NounPhrase(name, tuple(whole), tuple(own), tails[0] if tails else "")
