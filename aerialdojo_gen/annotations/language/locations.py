"""Claims about where an object is, in words: relations, phrases of place, directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.claims import Claim, Mention, SceneClaims
from aerialdojo_gen.annotations.language.grammar import wordings
from aerialdojo_gen.annotations.language.nouns import Name, Names, NounPhrase
from aerialdojo_gen.annotations.phrases import group_of
from aerialdojo_gen.base.constants import DIRECTIONS

WHERE = frozenset({"place", "relation", "direction"})
_SHORT = 5


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

    @property
    def short(self) -> bool:
        """Whether another phrase may follow without a comma."""
        return len(self.text.split()) <= _SHORT


class LocationWords:
    """Words for the claims of place in one scene."""

    def __init__(self, claims: SceneClaims, names: Names) -> None:
        self._claims, self._names = claims, names
        self._landmarks = {claims.scene.instances[k].node for k in claims.landmarks}

    def of(self, i: int, index: int, claim: Claim, level: str, rng: np.random.Generator) -> Location:
        """Word a claim of instance `i`, for a text of a level."""
        if claim.kind == "place":
            text = _one(self._place(claim.key), rng)
            return Location(index, "place", claim.key, text)
        things = [self._thing(i, mention, rng) for mention in claim.things]
        direction = claim.key.removesuffix(" of")
        key = "direction" if claim.kind == "direction" else "side" if direction in DIRECTIONS else claim.key
        table = wordings()
        many = len(things) > 1 or (things[0].startswith("the ") and _is_plural(claim.things[0].noun))
        pronoun = _one(table["pronoun"].get(key, table["pronoun"]["side"]), rng)
        if many and key != "between":
            pronoun = pronoun.replace(" its ", " their ") if " its " in pronoun else _with_them(pronoun)
        text = _one(table.get(level, {}).get(key) or table["relation"][key], rng)
        turned = table["turned"].get(key, ())
        return Location(
            index, claim.kind, claim.key, text.format(*things, d=direction), thing=" and ".join(things),
            pronoun=pronoun.format(d=direction), turned=_one(turned, rng) if turned else "",
            unique=all(mention.unique for mention in claim.things), lead=len(text.partition("{}")[0].split()),
        )  # fmt: skip

    def _place(self, phrase: str) -> Sequence[str]:
        places = self._claims.places
        return places.wordings(phrase.lower()) if places is not None and phrase.lower() in places else (phrase,)

    def _thing(self, i: int, mention: Mention, rng: np.random.Generator) -> str:
        if mention.node in self._landmarks:
            return f"the {mention.noun}"
        instances = self._claims.scene.instances
        k = self._claims.geometry.index[mention.node]
        name: Name = self._names.choose(instances[k].category, mention.noun, rng)
        said = tuple(word for word in mention.said if word not in name.text.split())
        phrase = NounPhrase(name, own=said)
        if mention.unique:
            return phrase.the
        alike = instances[k].category == instances[i].category
        return f"another {phrase.bare}" if alike and not said else phrase.a


def _is_plural(noun: str) -> bool:
    return bool(group_of(noun)) and " of " not in noun


def _with_them(pronoun: str) -> str:
    return pronoun.removesuffix(" it") + " them" if pronoun.endswith(" it") else pronoun


def _one(options: Sequence[str], rng: np.random.Generator) -> str:
    return options[int(rng.integers(len(options)))]
