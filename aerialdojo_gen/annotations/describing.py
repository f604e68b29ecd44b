"""Write descriptions that are true of an instance's mesh and unambiguous in its scene."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from aerialdojo_gen.annotations.ambiguity import Ambiguity, make_ambiguity
from aerialdojo_gen.annotations.compose import compose
from aerialdojo_gen.annotations.facts import Fact, FactFinder
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.phrases import place_of
from aerialdojo_gen.annotations.relations import DISTRACTOR_SLACK
from aerialdojo_gen.annotations.vocabulary import NON_OBJECTS, Vocabulary
from aerialdojo_gen.base.rng import generator

STAGE = "annotate-draft"
_MAX_FACTS = 4
_TRIES = 18
_MAX_WORDS = 60
_MIN_EXTRA_WEIGHT = 0.35


class DescriptionWriter:
    """Writes descriptions of the instances of one scene."""

    def __init__(self, vocabulary: Vocabulary, landmarks: Sequence[Landmark], seed: int) -> None:
        self._vocabulary, self._scene, self._seed = vocabulary, vocabulary.scene, seed
        named: Mapping[str, str] = {m.name: m.node for m in landmarks}
        self.ambiguity: Ambiguity = make_ambiguity(self._scene, vocabulary.names, named, [m.node for m in landmarks])
        index = self.ambiguity.geometry.index
        self._finder = FactFinder(
            self.ambiguity, vocabulary.words, vocabulary.nouns, {index[m.node]: m.name for m in landmarks}
        )
        self._used: dict[str, int] = {}

    def is_true_name(self, i: int, name: str) -> bool:
        """Whether a name says nothing false of instance `i`."""
        return not self._vocabulary.faults(self._scene.instances[i], name) and not self.ambiguity.false_claims(
            i, name
        )

    def describe(self, i: int, others: Collection[str], name: str = "") -> str | None:
        """Describe an instance; None if no true and unambiguous text is found."""
        instance, noun = self._scene.instances[i], self._vocabulary.nouns[i]
        words = replace(self._vocabulary.words[i], looks=self._vocabulary.looks(instance))
        rng = generator(self._seed, STAGE, self._scene.name, instance.node)
        facts, where, name = self._finder.facts(i, rng), self._place(i), name or noun.short
        for attempt in range(_TRIES):
            place = where if attempt < _TRIES // 2 else ""
            usable = [fact for fact in facts if not self._mentions(fact, place)][attempt % 3 :]
            talkative = bool(rng.random() < (0.25 if place else 0.7)) and attempt < _TRIES // 3
            needed, extra = self._choose(i, f"It is {noun.a()} {place}.", usable, talkative)
            if not needed and not (place and attempt >= _TRIES // 3):
                continue
            plain = attempt % 6 >= 4  # a look may contain words that parse as a claim
            phrasing = replace(words, looks=()) if plain else words
            text, template = compose(
                phrasing, noun, place, [f.text for f in needed], [f.text for f in extra], rng, self._used
            )
            if text not in others and self._is_valid(i, name, text):
                self._used[template] = self._used.get(template, 0) + 1
                for look in (look for look in words.looks if look in text):
                    self._used[look] = self._used.get(look, 0) + 1
                return text
        return self._describe_alone(i, name, others) if self._scene.imported else None

    def _describe_alone(self, i: int, name: str, others: Collection[str]) -> str | None:
        """Describe an instance by its noun alone, where that is unambiguous."""
        noun, words = self._vocabulary.nouns[i], self._vocabulary.words[i]
        alone = not any(self._scene.instances[j].category not in NON_OBJECTS for j in self._finder.near(i))
        texts = [f"Look for {noun.a()}, {words.participle} by itself."] if alone else []
        texts.append(f"Look for {noun.a()}.")
        return next((text for text in texts if text not in others and self._is_valid(i, name, text)), None)

    def _is_valid(self, i: int, name: str, text: str) -> bool:
        ambiguity, instance = self.ambiguity, self._scene.instances[i]
        return (
            len(text.split()) <= _MAX_WORDS
            and not ambiguity.false_claims(i, text)
            and not self._vocabulary.faults(instance, text)
            and not ambiguity.distractors(i, text)
            and not ambiguity.first_sentence_distractors(i, name, text)
        )

    def _place(self, i: int) -> str:
        """Return the phrase of place from the layout, if its conditions are known and hold."""
        place, places = place_of(self._scene.instances[i]), self.ambiguity.lexicon.places
        if not place or places is None:
            return place
        bound = place.lower() in places and not places.fault(i, place.lower())
        return place if bound else ""

    def _mentions(self, fact: Fact, place: str) -> bool:
        """Whether the phrase of place already mentions the fact's things."""
        spoken_of = set(place.replace("'s", "").split())
        return any(self._vocabulary.nouns[j].name.split()[-1] in spoken_of for j in fact.things)

    def _choose(self, i: int, base: str, facts: list[Fact], talkative: bool) -> tuple[list[Fact], list[Fact]]:
        """Choose the most natural fact, then those that exclude most distractors, then one optional extra."""
        needed: list[Fact] = []
        extra: list[Fact] = []
        distractors = set(self.ambiguity.distractors(i, base))
        left = list(facts)
        while left and len(needed) + len(extra) < _MAX_FACTS:
            best = left[0]
            if needed and distractors:
                best = max(left, key=lambda fact: len(distractors) - len(self._still_fitting(fact, distractors)))
                if len(self._still_fitting(best, distractors)) == len(distractors):
                    break
            elif needed and not (talkative and not extra and best.weight > _MIN_EXTRA_WEIGHT):
                break
            (needed if not needed or distractors else extra).append(best)
            distractors = self._still_fitting(best, distractors)
            nouns = {self._vocabulary.nouns[j].short for j in best.things}
            left = [f for f in left if not nouns & {self._vocabulary.nouns[j].short for j in f.things}]
        return needed, extra

    def _still_fitting(self, fact: Fact, distractors: set[int]) -> set[int]:
        return {
            j for j in distractors if all(c.holds(self.ambiguity.geometry, j, DISTRACTOR_SLACK) for c in fact.claims)
        }
