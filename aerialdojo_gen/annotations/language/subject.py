"""An object's own words: which adjectives and details its claims give."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.claims import Claim
from aerialdojo_gen.annotations.language.nouns import Name, NounPhrase, noun_phrase
from aerialdojo_gen.annotations.phrases import phrases_of_value
from aerialdojo_gen.base.rng import pick
from aerialdojo_gen.scenes.appearances import Appearance
from aerialdojo_gen.scenes.colours import COLOURS

# Small words, which may be said again; so may colours.
_SMALL = re.compile(r"an?|the|and|or|of|on|in|at|to|by|for|from|with|without|over|under|its?|them|no|up|out|off")
_ORDER = ("size", "state", "pattern", "shape", "colour", "material")


@dataclass(frozen=True)
class Wording:
    """A claim about an object's appearance, and the ways to say it."""

    index: int  # Of the claim
    key: str  # The attribute's, or "part"
    adjectives: tuple[str, ...] = ()
    tails: tuple[str, ...] = ()  # After the noun: "full of soil"
    details: tuple[str, ...] = ()  # After "with" or "it has"
    clauses: tuple[str, ...] = ()  # "it lies on its roof"


def wordings_of(claims: Sequence[Claim], appearances: Mapping[str, Appearance], category: str) -> list[Wording]:
    """Word the claims about the appearance of an instance of a category."""
    found = []
    for index, claim in enumerate(claims):
        if claim.kind == "part":
            own = appearances.get(claim.key)
            said = (own.details, own.adjectives, own.clauses) if own is not None else ((claim.key,), (), ())
            found.append(Wording(index, "part", said[1], (), said[0], said[2]))
        elif claim.kind in ("colour", "size", "attribute"):
            key, _, value = claim.key.rpartition("=")
            key = key or claim.kind
            phrases = phrases_of_value(key, value, category)
            details = tuple(p.removeprefix("with ") for p in phrases if p.startswith("with "))
            # "Drums, one of them toppled, by the gate": no sentence here has room for that.
            tails = tuple(p for p in phrases if not p.startswith(("+", "with ", "one ")))
            found.append(Wording(index, key, tuple(p[1:] for p in phrases if p.startswith("+")), tails, details))
    return found


def phrase_of(name: Name, said: Sequence[Wording], rng: np.random.Generator) -> NounPhrase | None:
    """Make the noun phrase that says these adjectives and tails, in English order; None if it says a word twice."""
    known = set(name.text.split())
    ordered = sorted(said, key=lambda w: _ORDER.index(w.key) if w.key in _ORDER else 1)
    adjectives: list[str] = []
    tail = ""
    # One phrase fits after the noun: that of what has no adjective goes first.
    for wording in sorted(ordered, key=lambda w: bool(w.adjectives)):
        after = fresh(wording.tails, name.text) or (() if wording.adjectives else wording.tails)
        options = [*wording.adjectives, *(() if tail else after)]
        chosen = pick(options, rng) if options else ""
        if chosen in wording.tails:
            tail = chosen
            continue
        words = chosen.split()
        # "Light wooden" before "wooden pallets".
        adjectives.append(" ".join(words[:-1] if words and words[-1] in known else words))
    # "Five round" says "round" as well.
    kept = [a for a in adjectives if a and not any(set(a.split()) < set(b.split()) for b in adjectives)]
    return None if _repeats_word(kept, name.text) else noun_phrase(name, kept, tail)


def _repeats_word(adjectives: Sequence[str], noun: str) -> bool:
    """Whether a word or a part of a compound is said twice: "striped blue-striped", "A-shaped A-board"."""
    words = [*(word for text in adjectives for word in text.split()), *(w for w in noun.split() if "-" in w)]
    parts = [part for word in words for part in word.split("-") if part != "and"]
    return len(set(parts)) < len(parts)


def fresh(phrases: Sequence[str], said: str) -> tuple[str, ...]:
    """Return those of some phrases that say no word of a text again, small words and colours apart."""
    known = {word.removesuffix("s") for word in said.split() if word not in COLOURS and not _SMALL.fullmatch(word)}
    return tuple(phrase for phrase in phrases if not known & {word.removesuffix("s") for word in phrase.split()})
