"""Noun phrases: synonyms that a scene leaves unambiguous, collectives, the order of adjectives, articles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from aerialdojo_gen.annotations.phrases import CategoryWords, article, group_of
from aerialdojo_gen.annotations.words import LISTS
from aerialdojo_gen.base.rng import pick

_USUAL = 0.35  # How often the catalogue's own name is used where there are others


@dataclass(frozen=True)
class Name:
    """A noun without adjectives."""

    head: str  # "sedan"; "wheelie bins" of a collective
    group: str = ""  # "row" of a collective
    lead: str = ""  # "overturned", which other adjectives follow

    @property
    def text(self) -> str:
        """The noun in full: "row of wheelie bins"."""
        return " ".join(
            [*([self.lead] if self.lead else []), *([f"{self.group} of"] if self.group else []), self.head]
        )


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
        return " ".join(part for part in (self.name.lead, *self.whole, middle, self.tail) if part)

    @property
    def a(self) -> str:
        """With the indefinite article."""
        return f"{article(self.bare)} {self.bare}"

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
