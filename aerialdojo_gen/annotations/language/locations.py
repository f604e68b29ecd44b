"""Claims about where an object is, in words: relations by ``relations.toml``, phrases of place, directions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from aerialdojo_gen.annotations.claims import Claim, Mention, SceneClaims
from aerialdojo_gen.annotations.language.nouns import Names, noun_phrase
from aerialdojo_gen.annotations.phrases import group_of
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.rng import pick
from aerialdojo_gen.base.safe_parse import read_toml

WHERE = frozenset({"place", "relation", "direction"})
_LEVEL_M = 1.0
STRUCTURE = "structure"  # the kind of what is not in the catalogue


@dataclass(frozen=True)
class RelationPhrase:
    """One wording: {} is the thing, {d} the direction."""

    say: str
    conditions: Mapping[str, Any] = field(default_factory=dict)

    def holds(self, claims: SceneClaims, i: int, j: int) -> bool:
        """Whether it is true of instance `i` and the thing `j`, of which its relation is."""
        return all(_HOLDS[name](claims, i, j, value) for name, value in self.conditions.items())


def _size(claims: SceneClaims, j: int) -> Any:
    return np.ptp(claims.geometry.boxes[j], axis=0)


_HOLDS: Mapping[str, Callable[[SceneClaims, int, int, Any], bool]] = {
    "gap_m": lambda c, i, j, ends: bool(ends[0] <= c.geometry.gap_m(i, j) <= ends[1]),
    "tall_m": lambda c, _, j, least: bool(_size(c, j)[2] >= least),
    "long_m": lambda c, _, j, least: bool(_size(c, j)[:2].max() >= least),
    "level": lambda c, i, j, _: bool(abs(c.geometry.boxes[i, 0, 2] - c.geometry.boxes[j, 0, 2]) <= _LEVEL_M),
    "kinds": lambda c, _, j, kinds: c.vocabulary.kinds.get(c.scene.instances[j].category, STRUCTURE) in kinds,
    "like": lambda c, _, j, like: any(fnmatchcase(c.scene.instances[j].category, one) for one in like.split("|")),
    "smaller": lambda c, i, j, _: bool((_size(c, i) <= _size(c, j)).all()),
}


@cache
def relation_phrases() -> Mapping[str, Mapping[str, tuple[RelationPhrase, ...]]]:
    """Read the wordings, by table and the claim's key."""
    path = Path(__file__).with_name("relations.toml")
    tables = read_toml(path, AnnotationError)
    return {
        name: {
            key: tuple(_words(e, f"{path.name}: [{name}] {key}") for e in entries) for key, entries in table.items()
        }
        for name, table in tables.items()
    }


def _words(entry: Any, where: str) -> RelationPhrase:
    if isinstance(entry, str):
        return RelationPhrase(entry)
    conditions = {name: value for name, value in entry.items() if name != "say"}
    for name in conditions:
        if name not in _HOLDS:
            raise AnnotationError(f"{where}: unknown condition {name!r}{nearest(name, tuple(_HOLDS))}")
    return RelationPhrase(entry["say"], conditions)


@dataclass(frozen=True)
class Location:
    """One claim of place in words."""

    index: int  # Of the claim
    kind: str  # Of the claim
    key: str
    text: str  # "next to the kiosk"
    thing: str = ""  # "the kiosk"; empty for phrases of place
    pronoun: str = ""  # "next to it"
    turned: str = ""  # "next to it", of the thing by the object; empty where that is not said
    unique: bool = False  # Whether the scene has one such thing
    lead: int = 0  # Words before the thing


class LocationPhrases:
    """Words for the claims of place in one scene."""

    def __init__(self, claims: SceneClaims, names: Names) -> None:
        self._claims, self._names = claims, names
        self._landmarks = {claims.scene.instances[k].node for k in claims.landmarks}

    def of(self, i: int, index: int, claim: Claim, level: str, rng: np.random.Generator) -> Location:
        """Word a claim of instance `i`, for a text of a level."""
        if claim.kind == "place":
            places = self._claims.places
            said = (claim.key,) if places is None else places.wordings.get(claim.key.lower(), (claim.key,))
            return Location(index, "place", claim.key, pick(said, rng))
        things = [self._thing(i, mention, rng) for mention in claim.things]
        direction = claim.key.removesuffix(" of")
        key = "direction" if claim.kind == "direction" else "side" if direction in DIRECTIONS else claim.key
        index_of = self._claims.geometry.index
        nodes = [index_of[mention.node] for mention in claim.things]
        text = self._words(level if level in relation_phrases() else "relation", key, i, nodes, rng)
        pronoun = self._words("pronoun", key, i, nodes, rng)
        if len(things) == 1 and things[0].startswith("the ") and " of " not in (noun := claim.things[0].noun):
            pronoun = _of_many(pronoun) if group_of(noun) else pronoun
        return Location(
            index, claim.kind, claim.key, text.format(*things, d=direction), thing=" and ".join(things),
            pronoun=pronoun.format(d=direction), turned=self._words("turned", key, i, nodes, rng),
            unique=all(mention.unique for mention in claim.things), lead=len(text.partition("{}")[0].split()),
        )  # fmt: skip

    def _words(self, table: str, key: str, i: int, nodes: Sequence[int], rng: np.random.Generator) -> str:
        """Choose a wording whose conditions hold; empty if the table has none for the key."""
        phrases = relation_phrases()
        words = phrases[table].get(key) or (phrases["relation"][key] if table == "vague" else ())
        for k in rng.permutation(len(words)).tolist():
            if all(words[k].holds(self._claims, i, j) for j in nodes):
                return words[k].say
        return ""

    def _thing(self, i: int, mention: Mention, rng: np.random.Generator) -> str:
        if mention.node in self._landmarks:
            return f"the {mention.noun}"
        instances = self._claims.scene.instances
        k = self._claims.geometry.index[mention.node]
        name = self._names.choose(instances[k].category, mention.noun, rng, alone=not mention.said)
        said = tuple(word for word in mention.said if word not in name.text.split())
        phrase = noun_phrase(name, said)
        if mention.unique:
            return phrase.the
        alike = instances[k].category == instances[i].category
        return f"another {phrase.bare}" if alike and not said else phrase.a


def _of_many(pronoun: str) -> str:
    pronoun = pronoun.removesuffix(" it") + " them" if pronoun.endswith(" it") else pronoun
    return f" {pronoun}".replace(" its ", " their ").strip()
