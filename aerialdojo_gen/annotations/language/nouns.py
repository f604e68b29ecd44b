"""Noun phrases, and which adjectives and details an object's claims give.

Synonyms that a scene leaves unambiguous, collectives, the order of adjectives, articles.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from aerialdojo_gen.annotations.claims import Claim
from aerialdojo_gen.annotations.phrases import LISTS, CategoryWords, group_of, phrases_of_value, with_article
from aerialdojo_gen.base.rng import pick
from aerialdojo_gen.scenes.appearances import Appearance
from aerialdojo_gen.scenes.colours import COLOURS

_USUAL = 0.35  # How often the catalogue's own name is used where there are others
# Small words, which may be said again; so may colours.
_SMALL = re.compile(r"an?|the|and|or|of|on|in|at|to|by|for|from|with|without|over|under|its?|them|no|up|out|off")
_ORDER = ("size", "state", "pattern", "shape", "colour", "material")


@dataclass(frozen=True)
class Name:
    """A noun without adjectives."""

    head: str  # "sedan"; "wheelie bins" of a collective
    group: str = ""  # "row" of a collective
    lead: str = ""  # "overturned", which other adjectives follow

    @property
    def text(self) -> str:
        """The noun in full: "row of wheelie bins"."""
        return " ".join(filter(None, (self.lead, self.group and f"{self.group} of", self.head)))


@dataclass(frozen=True)
class NounPhrase:
    """A noun with adjectives."""

    name: Name
    whole: tuple[str, ...] = ()  # Adjectives of the whole, and of the head
    own: tuple[str, ...] = ()
    tail: str = ""  # "full of soil"

    @cached_property
    def bare(self) -> str:
        """Without article."""
        own = " ".join([*self.own, self.name.head])
        middle = f"{self.name.group} of {own}" if self.name.group else own
        return " ".join(filter(None, (self.name.lead, *self.whole, middle, self.tail)))

    @property
    def a(self) -> str:
        """With the indefinite article."""
        return with_article(self.bare)

    @property
    def the(self) -> str:
        """With the definite article."""
        return f"the {self.bare}"


def noun_phrase(name: Name, adjectives: Sequence[str], tail: str = "") -> NounPhrase:
    """Put adjectives in their places: those of the whole before the collective, numbers before the others."""
    whole = tuple(word for word in adjectives if name.group and word in LISTS["of_the_whole"])
    own = sorted(
        (word for word in adjectives if word not in whole), key=lambda word: word.split()[0] not in LISTS["numbers"]
    )
    return NounPhrase(name, whole, tuple(own), tail)


@cache
def name_of(text: str) -> Name:
    """Split a noun into its collective and its head."""
    group, of, head = text.partition(" of ")
    if of and group in LISTS["collectives"]:
        return Name(head, group)
    first, _, rest = text.partition(" ")
    return Name(rest, lead=first) if rest and first in LISTS["leading"] else Name(text)


class Names:
    """The nouns that texts of a scene may use, by category."""

    def __init__(self, words: Mapping[str, CategoryWords], landmarks: Sequence[str]) -> None:
        self._words = words
        users: defaultdict[str, set[str]] = defaultdict(set)
        for category, own in words.items():
            for noun in (own.name, *own.nouns):
                users[noun].add(category)
        for name in landmarks:
            users[name].add(name)
        # "Bench" may mean a picnic bench, too.
        ends: defaultdict[str, set[str]] = defaultdict(set)
        for noun, categories in users.items():
            parts = noun.split()
            for k in range(len(parts)):
                ends[" ".join(parts[k:])] |= categories
        self._free = {noun for noun in users if len(ends[noun]) == 1}

    def choose(self, category: str, name: str, rng: np.random.Generator, alone: bool = True) -> Name:
        """Choose a noun for a thing of a category that is called `name`; `alone` where no adjective goes with it."""
        words = self._words[category]
        usual = _grouped(words, name)
        if name != words.name:
            return usual  # An imported thing has a name of its own
        free = [
            noun for noun in words.nouns if noun in self._free and (alone or noun.split()[0] not in LISTS["sizes"])
        ]
        others = [_grouped(words, noun) for noun in free]
        if words.collectives:
            others += [Name(head, group) for head in words.plural_heads for group in words.collectives]
        if not others or rng.random() < _USUAL:
            return usual
        return pick(others, rng)


def _grouped(words: CategoryWords, noun: str) -> Name:
    name = name_of(noun)
    # Where the usual name is a plural, its synonyms are, or mass nouns: "a clump of bracken".
    if name.group or not words.group or not (group_of(noun) or group_of(words.name)):
        return name
    return Name(noun, words.group.removeprefix("a ").removeprefix("an ").removesuffix(" of"))


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
