"""Find true spatial relations of an instance, for drafts to choose from."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.ambiguity import Ambiguity
from aerialdojo_gen.annotations.bearings import lies_towards
from aerialdojo_gen.annotations.compose import RELATIONS
from aerialdojo_gen.annotations.parsing import Claim
from aerialdojo_gen.annotations.phrases import Noun, Words
from aerialdojo_gen.geometry.frames import compass_direction

# Stricter than the check, so that drafted texts stay true after small changes of the scene.
_TIGHT = 0.9
_REACH_M = 9.0
_MAX_THINGS = 10
_MIN_SIZE_M = 0.3


@dataclass(frozen=True)
class Fact:
    """A spatial relation of an instance to others, in words."""

    text: str  # ``"beside a red mailbox"``
    claims: tuple[Claim, ...]  # As parsed by the check
    weight: float  # How natural the phrase is; higher first
    things: frozenset[int]  # Indices of the instances that it mentions


class FactFinder:
    """Finds spatial relations of the instances of one scene."""

    def __init__(
        self, ambiguity: Ambiguity, words: list[Words], nouns: list[Noun], landmarks: dict[int, str]
    ) -> None:
        self._ambiguity = ambiguity
        self._geometry = ambiguity.geometry
        self._words = words
        self._nouns = nouns
        self._landmarks = landmarks
        self._count = Counter(w.name for w in words)
        self._short = Counter(n.short for n in nouns)

    def facts(self, i: int, rng: np.random.Generator) -> list[Fact]:
        """List facts about instance `i`, the most natural first."""
        things = [j for j in self._geometry.neighbours(i, _REACH_M) if self._may_refer(i, j)]
        gaps = {j: self._geometry.gap_m(i, j) for j in things}
        things.sort(key=lambda j: (-self._salience(j) / (1.5 + gaps[j]), j))
        found: list[Fact] = []
        for j in things[:_MAX_THINGS]:
            found += self._pair_facts(i, j, rng)
        for a, j in enumerate(things[:6]):
            for k in things[a + 1 : 6]:
                texts = self._reference_to(i, j), self._reference_to(i, k)
                if self._geometry.scene.imported and 0.0 in (gaps[j], gaps[k]):
                    continue
                if texts[0] != texts[1] and self._geometry.between(i, j, k, _TIGHT):
                    weight = 1.2 * min(self._weight(i, j), self._weight(i, k))
                    found += self._verified(i, "between {} and {}".format(*texts), weight, (j, k))
        keyed = [(-fact.weight * float(rng.uniform(0.8, 1.25)), k, fact) for k, fact in enumerate(found)]
        return [fact for _, _, fact in sorted(keyed, key=lambda item: item[:2])]

    def near(self, i: int) -> list[int]:
        """List the instances within reach of instance `i`."""
        return self._geometry.neighbours(i, _REACH_M)

    def _may_refer(self, i: int, j: int) -> bool:
        size = self._geometry.boxes[j, 1] - self._geometry.boxes[j, 0]
        return self._words[j].reference and float(size.max()) >= _MIN_SIZE_M and j != i

    def _salience(self, j: int) -> float:
        size = float((self._geometry.boxes[j, 1] - self._geometry.boxes[j, 0]).max())
        rarity = 1.0 / self._count[self._words[j].name] ** 0.5 + 1.0 / self._short[self._nouns[j].short] ** 0.5
        return (2.0 if j in self._landmarks else 1.0) * rarity * min(size, 4.0) ** 0.4

    def _weight(self, i: int, j: int) -> float:
        same = self._words[i].name == self._words[j].name
        return self._salience(j) / (1.5 + self._geometry.gap_m(i, j)) * (0.5 if same else 1.0)

    def _pair_facts(self, i: int, j: int, rng: np.random.Generator) -> list[Fact]:
        geometry, weight, thing = self._geometry, self._weight(i, j), self._reference_to(i, j)
        found: list[Fact] = []
        touching = geometry.support(i) == j or j in geometry.covers(i)
        imported = geometry.scene.imported
        if imported and not touching and geometry.gap_m(i, j) == 0.0:
            return []  # one intersects the other or is a part of it: no relation applies
        if geometry.support(i) == j and (not imported or geometry.rests_on(i, j)):
            found += self._verified(i, self._phrase("on", rng).format(thing), 3.0 * weight, (j,))
        if j in geometry.covers(i) and not (imported and geometry.support(j) == i):
            found += self._verified(i, self._phrase("under", rng).format(thing), 2.0 * weight, (j,))
        if not touching and geometry.beside(i, j, _TIGHT):
            found += self._verified(i, self._phrase("beside", rng).format(thing), 1.5 * weight, (j,))
        elif not touching and geometry.near(i, j, _TIGHT) and geometry.level_gap_m(i, j) > 0.0:
            found += self._verified(i, self._phrase("near", rng).format(thing), 0.8 * weight, (j,))
        bearing = geometry.bearing_rad(i, j)
        if bearing is not None and not touching and geometry.level_gap_m(i, j) > 0.0:
            direction = compass_direction(float(np.cos(bearing)), float(np.sin(bearing)))
            offset = geometry.centres[i] - geometry.centres[j]
            if geometry.side(i, j, direction, _TIGHT) and lies_towards(offset, direction, 17.5):
                text = self._phrase("side", rng).format(thing, d=direction)
                found += self._verified(i, text, weight, (j,))
        return found

    def _verified(self, i: int, text: str, weight: float, things: tuple[int, ...]) -> list[Fact]:
        # Names may contain words that parse differently: keep only facts that parse as intended.
        reading = self._ambiguity.lexicon.read(f"it stands {text}", i)
        claims = reading.claims
        meant = len(claims) == 1 and all(j in members for j, members in zip(things, claims[0].things, strict=False))
        if not meant or reading.values or not claims[0].holds(self._geometry, i, _TIGHT):
            return []
        return [Fact(text, tuple(claims), weight, frozenset(things))]

    def _phrase(self, relation: str, rng: np.random.Generator) -> str:
        forms = RELATIONS[relation]
        return forms[int(rng.integers(len(forms)))]

    def _reference_to(self, i: int, j: int) -> str:
        if j in self._landmarks:
            return f"the {self._landmarks[j]}"
        noun = self._nouns[j]
        if self._count[noun.name] == 1:
            return f"the {noun.name}"
        if self._short[noun.short] == 1 and not noun.group:
            return noun.the(short=True)
        if self._words[i].name == noun.name and not noun.group:
            same = self._nouns[i].short == noun.short
            return f"another {noun.short}" if same else noun.a(short=True)
        return noun.a(short=True)
