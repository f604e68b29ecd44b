"""Match what a person wrote of an object to claims, as far as a small grammar goes.

It knows *things* (nouns of the catalogue and of landmarks), *values* (adjectives of the scene's things, colours),
*relations* (beside, north of, between ... and), the scene's phrases of place and the catalogue's looks. Values before
a thing belong to it; a relation and the things after it make a claim. Other words are counted as unchecked.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, lru_cache

from aerialdojo_gen.annotations.claims import Claim, Kind, Mention, SceneClaims
from aerialdojo_gen.annotations.phrases import LISTS, TABLES, phrases_of_value, plural, spoken
from aerialdojo_gen.annotations.vocabulary import SHADES
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.scenes.model import Instance

_TOKEN = re.compile(r"[a-z0-9']+|[,.;:!?()]")
# Compass corners are one word in the tables; people write two.
_CORNER = re.compile(r"\b(north|south)[- ](east|west)")
_MARK = "look'"
_STOPS = frozenset(".;:!?")
_PLAIN: Mapping[str, Kind] = {"colour": "colour", "size": "size"}  # Attributes with claims of their own kind


def _relations() -> dict[tuple[str, ...], str]:
    table = {phrase: key for key, many in TABLES["relations"].items() for phrase in many.split(", ")}
    forms = ("{} of", "to the {} of", "just {} of", "on the {} side of", "at the {} side of", "on the {}ern side of")
    table |= {form.format(d): f"{d} of" for d in DIRECTIONS for form in forms}
    return {_tokens(phrase): key for phrase, key in table.items()}


def _tokens(text: str) -> tuple[str, ...]:
    return tuple(_TOKEN.findall(_CORNER.sub(r"\1\2", text.lower())))


@lru_cache(maxsize=4096)
def _written(text: str) -> frozenset[str]:
    """Words of a text, whatever their case."""
    return frozenset(re.findall(r"[^\W_]+", text.casefold()))


class Matcher:
    """Matches texts about the instances of one scene."""

    def __init__(self, claims: SceneClaims) -> None:
        self._claims, self._instances = claims, claims.scene.instances
        self.landmark_nodes = claims.landmark_names
        self._categories: dict[str, set[str]] = {}
        for category, name in claims.vocabulary.names.items():
            for form in {name.lower(), spoken(category)}:
                self._categories.setdefault(form, set()).add(category)
        self._phrases: dict[tuple[str, ...], tuple[str, str]] = {}
        for phrase, key in _relations().items():
            self._phrases[phrase] = "relation", key
        for idiom in ("know it by", "tell it by"):
            self._add(idiom, "words", "")  # and not where it stands
        for wording in self._values_of:
            self._add(wording, "value", wording)
        for word in SHADES:
            self._phrases.setdefault((word,), ("value", word))
        for place, wordings in claims.place_wordings().items():
            for wording in (place, *wordings):
                self._add(wording, "place", place)
        nouns = {noun.name.lower() for noun in claims.vocabulary.nouns} | {*self.landmark_nodes}
        for name in sorted({*self._categories, *nouns}):
            for form in (plural(name), name):
                self._add(form, "thing", name)
        self._longest = max(map(len, self._phrases), default=0)

    def _add(self, phrase: str, kind: str, meaning: str) -> None:
        if tokens := _tokens(phrase):
            self._phrases[tokens] = kind, meaning

    @cached_property
    def _values_of(self) -> Mapping[str, set[tuple[str, str]]]:
        """Attributes and their values by how they are said; several may be said alike."""
        values: dict[str, set[tuple[str, str]]] = {}
        for instance in self._instances:
            for key, value in instance.attributes.items():
                if key not in ("place", "group", "called"):
                    for wording in (value, *phrases_of_value(key, value, instance.category)):
                        values.setdefault(wording.removeprefix("+").lower(), set()).add((key, value))
        return values

    def faults(self, i: int, text: str) -> list[str]:
        """What a text says of an instance that is false, in words."""
        node, matched, places = self._instances[i].node, self.read(text, i), self._claims.places
        wrong = [f"it is called {matched.called!r}, and the mesh says {self._name(i)!r}"] if matched.called else []
        return wrong + [
            f"{words!r} is not so of {node}"
            + (f": {places.fault(i, claim.key)}" if claim.kind == "place" and places is not None else "")
            for claim, words in matched.claims.items()
            if not self._claims.holds(claim, i)
        ]

    def true_claims(self, i: int, text: str) -> list[Claim]:
        """The claims of a text that hold of its instance."""
        return [claim for claim in self.read(text, i).claims if self._claims.holds(claim, i)]

    def _name(self, i: int) -> str:
        category = self._instances[i].category
        return self._claims.vocabulary.names.get(category, spoken(category))

    def read(self, text: str, i: int) -> Reading:
        """Match a name or a description of an instance."""
        reading = Reading(self, i)
        text, appearances = self._replace_phrases(text, i)
        tokens, at = _tokens(text), 0
        while at < len(tokens):
            length, kind, meaning = self._match(tokens, at)
            if tokens[at].startswith(_MARK):
                reading.add_phrase(*appearances[int(tokens[at].removeprefix(_MARK))])
            if kind == "thing" and self._match(tokens, at + length)[1] == "thing":
                kind = "part of a name"  # a spruce log pile is no spruce
            reading.take(tokens[at : at + length], kind, meaning)
            at += length
        reading.end_clause()
        return reading

    def _replace_phrases(self, text: str, i: int) -> tuple[str, list[tuple[str, str]]]:
        """Replace the catalogue's phrases about the instance's category by marks; phrases and words by mark."""
        imported, vocabulary = self._claims.scene.imported, self._claims.vocabulary
        marked: list[tuple[str, str]] = []
        for appearance in () if imported else vocabulary.appearances_of(self._instances[i]):
            for wording in appearance.wordings:
                if not _written(wording) <= _written(text):
                    continue
                pattern = r"[\W_]+".join(map(re.escape, re.findall(r"[^\W_]+", wording.lower())))
                mark = f" {_MARK}{len(marked)} "
                left = re.sub(
                    rf"(?<!without )(?<!no )(?<![^\W_]){pattern}(?![^\W_])", mark, text, flags=re.IGNORECASE
                )
                marked += [(appearance.phrase, wording)] if left != text else []
                text = left
        return text, marked

    def _match(self, tokens: tuple[str, ...], at: int) -> tuple[int, str, str]:
        for length in range(min(self._longest, len(tokens) - at), 0, -1):
            if found := self._phrases.get(tokens[at : at + length]):
                return length, *found
        return 1, "", ""

    def values(self, i: int, values: Iterable[str], named: bool) -> Iterator[tuple[Claim, str]]:
        """Claims of the values that a text gives its instance; those not right before its name count only if so."""
        colours = [value for value in values if set(_tokens(value)) & SHADES.keys()] if named else []
        if colours:
            yield Claim("colour", " ".join(colours)), " ".join(colours)
        attributes = self._instances[i].attributes
        for value in values:
            known = sorted(self._values_of.get(value, ())) if value not in colours else []
            claims = [Claim(_PLAIN[k], v) if k in _PLAIN else Claim("attribute", f"{k}={v}") for k, v in known]
            true = [claim for claim in claims if self._claims.holds(claim, i)]
            denied = [claim for claim, (key, _) in zip(claims, known, strict=True) if named and key in attributes]
            yield from ((claim, value) for claim in true or denied[:1])

    def contradicts(self, i: int, called: str) -> bool:
        """Whether a noun is no name of an instance; "garden wall" is none against "stone wall"."""
        instance: Instance = self._instances[i]
        if self._claims.scene.imported or called not in self._categories:
            return False
        own = {*_tokens(self._name(i)), *_tokens(spoken(instance.category))}
        return instance.category not in self._categories[called] and not own & set(_tokens(called))


class Reading:
    """What is understood of a text about one object."""

    def __init__(self, matcher: Matcher, i: int) -> None:
        self.claims: dict[Claim, str] = {}  # With the words that make it
        self.called = ""  # What the text calls its object, if that contradicts the mesh
        self.unchecked: list[str] = []  # Words that say something, and match nothing
        self._matcher, self._i = matcher, i
        self._relation, self._words = "", list[str]()
        self._values, self._adjacent = list[str](), False
        self._things: list[Mention] = []
        self._subject = ""

    def take(self, words: tuple[str, ...], kind: str, meaning: str) -> None:
        """Take one phrase: its words, its kind and its meaning."""
        first = words[0]
        if first in _STOPS or (first in ",()" and not self._things) or (not kind and first in LISTS["verbs"]):
            self.end_clause()
        elif kind == "relation":
            self.end_clause()
            self._relation = meaning
        elif kind == "place":
            self.end_clause()
            self.claims[Claim("place", meaning)] = " ".join(words)
        elif kind == "value":
            self._values.append(meaning)
        elif kind == "thing":
            self._thing(meaning, [*words])
        elif not kind and first.isalpha() and first not in LISTS["empty"] | LISTS["degrees"]:
            self.unchecked.append(first)
        if self._relation:
            self._words += words
        self._adjacent = kind == "value" or (self._adjacent and first in ("and", ","))

    def add_phrase(self, phrase: str, words: str) -> None:
        """Take one of the catalogue's phrases: after a relation it is said of the other thing."""
        if not self._relation:
            self.claims[Claim("part", phrase)] = words

    def _thing(self, name: str, words: list[str]) -> None:
        if self._relation:
            mention = Mention(self._matcher.landmark_nodes.get(name, ""), name, tuple(self._values), unique=False)
            self._things.append(mention)
            if self._relation != "between" or len(self._things) == 2:
                kind: Kind = "direction" if mention.node and self._relation.endswith(" of") else "relation"
                key = self._relation.removesuffix(" of") if kind == "direction" else self._relation
                self.claims[Claim(kind, key, tuple(self._things))] = " ".join([*self._words, *words])
                self._things = []
        elif not self._subject:
            self._subject = name
            self.called = name if self._matcher.contradicts(self._i, name) else ""
            self._resolve_pending(named=self._adjacent)
        self._values = []

    def end_clause(self) -> None:
        """End what a relation or a verb governs."""
        # After "beside a bench with ..." the values belong to the bench, not to the subject.
        if not self._relation:
            self._resolve_pending(named=False)
        self._values, self._relation, self._words, self._things = [], "", [], []

    def _resolve_pending(self, named: bool) -> None:
        for claim, words in self._matcher.values(self._i, self._values, named):
            self.claims.setdefault(claim, words)
