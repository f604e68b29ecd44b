"""Claims about where an object is, in words: relations, phrases of place, directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.claims import Claim, Mention, SceneClaims
from aerialdojo_gen.annotations.language.nouns import Names, noun_phrase
from aerialdojo_gen.annotations.language.relation_phrases import relation_phrases
from aerialdojo_gen.annotations.phrases import group_of
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.rng import pick

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


class LocationPhrases:
    """Words for the claims of place in one scene."""

    def __init__(self, claims: SceneClaims, names: Names) -> None:
        self._claims, self._names = claims, names
        self._landmarks = {claims.scene.instances[k].node for k in claims.landmarks}

    def of(self, i: int, index: int, claim: Claim, level: str, rng: np.random.Generator) -> Location:
        """Word a claim of instance `i`, for a text of a level."""
        if claim.kind == "place":
            text = pick(self._place(claim.key), rng)
            return Location(index, "place", claim.key, text)
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

    def _place(self, phrase: str) -> Sequence[str]:
        places = self._claims.places
        return places.wordings(phrase.lower()) if places is not None and phrase.lower() in places else (phrase,)

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
