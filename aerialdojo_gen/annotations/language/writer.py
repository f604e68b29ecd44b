"""Write the paraphrases of a scene's objects."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerialdojo_gen.annotations.claims import Claim, SceneClaims
from aerialdojo_gen.annotations.language.choosing import About, Plan, choose
from aerialdojo_gen.annotations.language.locations import LocationPhrases
from aerialdojo_gen.annotations.language.nouns import Names, fresh, phrase_of
from aerialdojo_gen.annotations.language.sentences import Content, compose
from aerialdojo_gen.base.rng import generator

# Words of a text, by level.
LENGTHS = {"terse": (4, 9), "vague": (4, 13), "normal": (7, 30), "detailed": (16, 60)}
_CYCLE = ("normal", "terse", "detailed", "vague", "normal")
# Held-out texts of every five.
_HELD_OUT = 2
_TRIES = 30
_USUAL_VERB = 0.6


@dataclass(frozen=True)
class Text:
    """A paraphrase."""

    level: str
    text: str
    claims: tuple[int, ...]  # Indices of the claims that it makes
    frame: str  # Its sentences with slots
    held_out: bool  # Whether it is for test tasks


class Writer:
    """Writes the texts of one scene."""

    def __init__(self, claims: SceneClaims, landmarks: Sequence[str], seed: int, stage: str) -> None:
        self._claims, self._seed, self._stage = claims, seed, stage
        vocabulary, instances = claims.vocabulary, claims.scene.instances
        words = {it.category: own for it, own in zip(instances, vocabulary.words, strict=True)}
        self._names = Names(words, landmarks)
        self._locations = LocationPhrases(claims, self._names)
        self._said: set[str] = set()
        self._openings: set[str] = set()

    def texts(self, i: int, claims: Sequence[Claim], shown: Collection[str] | None, n: int) -> list[Text]:
        """Write up to `n` texts of instance `i`, none twice; fewer if its claims do not distinguish it.

        `shown` are the parts that its pictures show, None if that is unknown.
        """
        instance = self._claims.scene.instances[i]
        rng = generator(self._seed, self._stage, self._claims.scene.name, instance.node)
        appearances = {one.phrase: one for one in self._claims.vocabulary.appearances_of(instance)}
        about = About(self._claims, i, claims, appearances, shown)
        found: list[Text] = []
        for level, held_out in _orders(n, rng):
            text = self._write(about, level, held_out, found, rng)
            if text is not None:
                found.append(text)
                self._said.add(text.text)
                self._openings.add(_opening(text.text))
        return found

    def _write(
        self, about: About, level: str, held_out: bool, others: Sequence[Text], rng: np.random.Generator
    ) -> Text | None:
        used = {index for text in others for index in text.claims}
        starts = {" ".join(text.text.split()[:2]) for text in others}
        for attempt in range(_TRIES):
            # What cannot be said in few words is said in more.
            own = level if attempt < _TRIES // 2 else "normal" if attempt < 3 * _TRIES // 4 else "detailed"
            plan = choose(about, own, used, rng)
            if plan is None:
                continue
            content = self._content(about, plan, rng)
            composed = None if content is None else compose(content, held_out, starts, rng)
            if composed is None:
                continue
            text, frame, held = composed
            least, most = LENGTHS[own]
            if attempt < _TRIES // 2 and _opening(text) in self._openings:
                continue
            if text not in self._said and least <= len(text.split()) <= most:
                return Text(own, text, tuple(sorted(plan.indices)), frame, held)
        return None

    def _content(self, about: About, plan: Plan, rng: np.random.Generator) -> Content | None:
        """Choose words for what a text says; None if a detail would only say again what the noun phrase does."""
        name = self._names.choose(about.instance.category, about.noun, rng, alone=not plan.adjectives)
        # "Flies its flag" and "opens" go with few places.
        own = self._claims.vocabulary.words[about.i].verbs
        verbs = [v for v in own if v[0].startswith("is ") or not (" " in v[0] or v[0] == "opens")] or [("is", "")]
        other = len(verbs) > 1 and rng.random() > _USUAL_VERB
        verb = verbs[int(rng.integers(1, len(verbs))) if other else 0]
        phrase = phrase_of(name, plan.adjectives, rng)
        if phrase is None:
            return None
        said = phrase.bare
        details = [
            (replace(w, details=fresh(w.details, said), clauses=fresh(w.clauses, said)), about.is_unique(w.index))
            for w in plan.details
        ]
        if not all(wording.details for wording, _ in details):
            return None
        return Content(
            plan.level,
            phrase,
            # A hunting stand does not stand.
            ("is", "") if verb[0].removesuffix("s") in name.text.split() else verb,
            [self._locations.of(about.i, k, about.claims[k], plan.level, rng) for k in plan.places],
            details,
        )


def _opening(text: str) -> str:
    return " ".join(text.lower().split()[:4])


def _orders(n: int, rng: np.random.Generator) -> Iterator[tuple[str, bool]]:
    """Yield the levels of an object's texts, and which of them are held out."""
    least = 1 if n > 1 else 0
    held = set(rng.permutation(n)[: max(least, n * _HELD_OUT // len(_CYCLE))].tolist())
    yield from ((_CYCLE[k % len(_CYCLE)], k in held) for k in range(n))
