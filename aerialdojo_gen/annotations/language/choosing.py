"""Choose what a text says: few claims that distinguish an object from its distractors, and now and then one more."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np

from aerialdojo_gen.annotations.claims import Claim, SceneClaims
from aerialdojo_gen.annotations.language.locations import WHERE
from aerialdojo_gen.annotations.language.nouns import Wording, wordings_of
from aerialdojo_gen.annotations.relations import DISTRACTOR_SLACK
from aerialdojo_gen.base.rng import pick
from aerialdojo_gen.scenes.appearances import Appearance

_MAX_PLACES = 3
_SHORT_DETAIL = 10  # words of a detail that is said
# How often an adjective of colour is said, and one of another kind.
_COLOUR = {"terse": 0.75, "vague": 0.0, "normal": 0.85, "detailed": 1.0}
_VALUE = {"terse": 0.3, "vague": 0.0, "normal": 0.5, "detailed": 0.8}
# How often another place and a detail are said that are not needed.
_MORE_PLACES = {"terse": 0.0, "vague": 0.0, "normal": 0.25, "detailed": 0.9}
_MORE_DETAILS = {"terse": 0.0, "vague": 0.0, "normal": 0.45, "detailed": 0.95}
_ONE_OF = {"colour", "material"}
# Of the relations, the most natural first, each is chosen so much more often than the next.
_FALL = 0.8
_PLACE, _SIDE, _USED = 1.2, 0.35, 0.2
_DIRECTION = {"terse": 0.15, "vague": 0.9, "normal": 0.15, "detailed": 0.3}


@dataclass
class Plan:
    """What a text says."""

    level: str
    adjectives: list[Wording] = field(default_factory=list)
    details: list[Wording] = field(default_factory=list)
    places: list[int] = field(default_factory=list)  # Claims of place

    @property
    def indices(self) -> list[int]:
        """The claims that it makes."""
        return [*(wording.index for wording in (*self.adjectives, *self.details)), *self.places]


class About:
    """An object's claims, and which other things each fits."""

    def __init__(
        self, scene: SceneClaims, i: int, claims: Sequence[Claim], appearances: Mapping[str, Appearance],
        shown: Collection[str] | None,
    ) -> None:  # fmt: skip
        self.scene, self.i, self.claims = scene, i, claims
        self.instance = scene.scene.instances[i]
        self.noun = scene.vocabulary.nouns[i].name
        said = [
            w for w in wordings_of(claims, appearances, self.instance.category)
            if w.adjectives or w.tails or w.details
            if w.key != "part" or shown is None or _is_visible(appearances.get(claims[w.index].key), shown)
        ]  # fmt: skip
        self.wordings = {wording.index: wording for wording in said}
        self.adjectives = [w for w in said if w.key != "part" and (w.adjectives or w.tails)]
        self.details = [w for w in said if w.details and _sayable(w)]
        self.places = [k for k, claim in enumerate(claims) if claim.kind in WHERE]
        same = self.instance.category
        self._others = [j for j, it in enumerate(scene.scene.instances) if it.category == same and j != i]
        self._fits = cache(lambda index, j: scene.holds(claims[index], j, DISTRACTOR_SLACK))

    def distractors(self, indices: Collection[int]) -> list[int]:
        """Other things that these claims fit."""
        return self.scene.distractors(self.i, [self.claims[k] for k in indices])

    def fitting(self, index: int, things: Sequence[int]) -> list[int]:
        """Those of some things that a claim fits as well."""
        return [j for j in things if self._fits(index, j)]

    def is_unique(self, index: int) -> bool:
        """Whether a claim is false of every other of the category in the scene, and there are others."""
        return bool(self._others) and not self.fitting(index, self._others)

    def repeats(self, index: int, plan: Plan) -> bool:
        """Whether a claim of place names what one of the plan names, or is a second phrase of place."""
        claim = self.claims[index]
        own = _named(claim)
        for other in (self.claims[k] for k in plan.places):
            if own & _named(other) or (
                claim.kind == other.kind and (claim.kind != "relation" or claim.key == other.key == "between")
            ):
                return True
        return False


def _sayable(wording: Wording) -> bool:
    """Whether a detail is neither long nor a bare number."""
    lengths = [len(detail.split()) for detail in wording.details]
    return min(lengths) > 1 and max(lengths) <= _SHORT_DETAIL


@lru_cache(maxsize=1024)
def _named(claim: Claim) -> frozenset[str]:
    words = [m.noun.split()[-1] for m in claim.things] or claim.key.replace("'s", "").split()
    return frozenset(word.removesuffix("s") for word in words if len(word) > 2)


def _is_visible(appearance: Appearance | None, shown: Collection[str]) -> bool:
    return appearance is None or all(set(part.split("|")) & set(shown) for part in appearance.parts)


def choose(about: About, level: str, used: Collection[int], rng: np.random.Generator) -> Plan | None:
    """Choose what to say; None if the claims that were drawn exclude not all distractors."""
    plan = Plan(level)
    for wording in about.adjectives:
        chance = (_COLOUR if wording.key == "colour" else _VALUE)[level]
        keys = {w.key for w in plan.adjectives}
        # One phrase after the noun is enough, and of "brown wooden" one word.
        redundant = not wording.adjectives and any(not w.adjectives for w in plan.adjectives)
        redundant = redundant or {wording.key, *keys} >= _ONE_OF
        if rng.random() < chance and not redundant:
            plan.adjectives.append(wording)
    ranked = _ranked(about, level, used, rng)
    if ranked:
        plan.places.append(ranked[0])
    left = about.distractors(plan.indices)
    while left:
        places = [k for k in ranked if len(plan.places) < _MAX_PLACES and not about.repeats(k, plan)]
        rest = [k for k in (*places, *about.wordings) if k not in plan.indices]
        best = min(rest, key=lambda k: len(about.fitting(k, left)), default=None)
        if best is None or len(remaining := about.fitting(best, left)) == len(left):
            return None
        left = remaining
        _add(plan, about, best, rng)
    # The first place is needless if others that had to be added are enough.
    if len(plan.places) > 1 and not about.distractors([k for k in plan.indices if k != plan.places[0]]):
        del plan.places[0]
    if rng.random() < _MORE_PLACES[level] and len(plan.places) < _MAX_PLACES:
        plan.places += [k for k in ranked if k not in plan.places and not about.repeats(k, plan)][:1]
    spare = [w for w in about.details if w.index not in plan.indices]
    if rng.random() < _MORE_DETAILS[level] and spare and not plan.details:
        _add(plan, about, pick(spare, rng).index, rng)
    # Of two phrases after the noun, one would not be said.
    tails = sum(not wording.adjectives for wording in plan.adjectives)
    return plan if plan.places and tails <= 1 else None


def _ranked(about: About, level: str, used: Collection[int], rng: np.random.Generator) -> list[int]:
    """Put the claims of place in a random order, the more natural ones rather first."""
    weights = {}
    fall = 1.0
    for k in about.places:
        kind = about.claims[k].kind
        weights[k] = _PLACE if kind == "place" else _DIRECTION[level] if kind == "direction" else fall
        # Compass sides are true of most neighbours, and few people say them.
        if kind == "relation" and about.claims[k].key.endswith(" of"):
            weights[k] *= _SIDE
        fall *= _FALL if kind == "relation" else 1.0
        weights[k] *= _USED if k in used else 1.0
    keys = {k: float(rng.exponential()) / weight for k, weight in weights.items()}
    return sorted(keys, key=lambda k: keys[k])


def _add(plan: Plan, about: About, index: int, rng: np.random.Generator) -> None:
    wording = about.wordings.get(index)
    if wording is None:
        plan.places.append(index)
    elif wording.details and not (wording.adjectives and rng.random() < 0.5):
        plan.details.append(wording)
    else:
        plan.adjectives.append(wording)
