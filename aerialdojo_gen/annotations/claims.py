"""What can be said of an object: structured claims, each with its own check on the mesh.

Texts are made from claims and never read back. A claim is true of an instance if `SceneClaims.holds` it with slack 1.
A distractor is held to `DISTRACTOR_SLACK`, with the benefit of every doubt: a relation holds of it if it stands so
to any thing that the mention's words fit.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, StrictBool, StrictStr, TypeAdapter

from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.phrases import TABLES
from aerialdojo_gen.annotations.places import Places, places_of
from aerialdojo_gen.annotations.relations import (
    AGAINST_M,
    AT_M,
    BORDER_DEG,
    DISTRACTOR_SLACK,
    Bearing,
    SceneGeometry,
    lies_towards,
    nearest_landmark,
)
from aerialdojo_gen.annotations.vocabulary import SHADES, Vocabulary, unsupported_colours
from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.geometry.frames import compass_direction
from aerialdojo_gen.scenes.model import Instance

Kind = Literal["colour", "size", "attribute", "part", "place", "relation", "direction"]
# Attributes that are no adjectives: claims of a kind of their own, or words of the noun.
_NO_VALUES = frozenset({"colour", "size", "place", "called", "group"})
_ONE_COLOUR = [frozenset(words.split()) for words in TABLES["one_colour"].values()]
_SPELT = {"wooden": "wood", "gray": "grey", "golden": "gold"}
# Stricter than the check, so that claims stay true after small changes of the scene.
_TIGHT = 0.9
_REACH_M, _FAR_M = 9.0, 15.0
_MAX_THINGS, _MAX_BETWEEN, _MIN_SIZE_M = 14, 8, 0.3


@dataclass(frozen=True)
class Mention:
    """A thing that a claim names."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    node: StrictStr
    noun: StrictStr  # Its category's name, or the landmark's
    said: tuple[StrictStr, ...]  # Adjectives that the text must say with it ("red")
    unique: StrictBool  # Whether the scene has one such thing: "the", else "a"


@dataclass(frozen=True)
class Claim:
    """One thing that is said of an object."""

    kind: Kind
    key: StrictStr  # "red", "state=open top", a look's phrase, "beside", "north of", a phrase of place, "northeast"
    things: tuple[Mention, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON, as stored with its object."""
        things = [{"node": m.node, "noun": m.noun, "said": list(m.said), "unique": m.unique} for m in self.things]
        return {"kind": self.kind, "key": self.key, **({"things": things} if things else {})}


_CLAIMS = TypeAdapter(list[Claim])


def claims_from_json(text: str) -> list[Claim]:
    """Read a JSON list of `Claim.to_json`; ValueError or `BeyondBounds` where it is malformed."""
    return _CLAIMS.validate_python(loads_json(text))


class SceneClaims:
    """The claims about the instances of one scene."""

    def __init__(self, vocabulary: Vocabulary, landmarks: Sequence[Landmark]) -> None:
        self.vocabulary, self.scene = vocabulary, vocabulary.scene
        self.geometry = SceneGeometry.of(self.scene)
        bound = None if self.scene.imported else places_of(self.scene.name)
        self.places = None if bound is None else Places(self.geometry, bound)
        self.landmarks = tuple(self.geometry.index[mark.node] for mark in landmarks)
        self._landmark_names = {
            self.geometry.index[m.node]: m.name for m in sorted(landmarks, key=lambda m: m.id, reverse=True)
        }
        self._nouns = vocabulary.nouns
        self._by_noun: dict[str, list[int]] = {}
        for j, noun in enumerate(self._nouns):
            self._by_noun.setdefault(f" {noun.name.lower()}", []).append(j)
        self._count = Counter(noun.name for noun in self._nouns)
        self._short = Counter(noun.short for noun in self._nouns)

    @cached_property
    def bearings(self) -> list[Bearing | None]:
        """Nearest landmark and direction of every instance."""
        places = self.geometry.centres[list(self.landmarks)]
        return [nearest_landmark(centre, places) for centre in self.geometry.centres]

    @cached_property
    def _groups(self) -> dict[tuple[str, Bearing | None], list[int]]:
        groups: dict[tuple[str, Bearing | None], list[int]] = {}
        for i, instance in enumerate(self.scene.instances):
            groups.setdefault((instance.category, self.bearings[i]), []).append(i)
        return groups

    def candidates(self, i: int) -> list[int]:
        """Other instances of the same category, landmark and direction."""
        return [j for j in self._groups[self.scene.instances[i].category, self.bearings[i]] if j != i]

    def distractors(self, i: int, claims: Sequence[Claim]) -> list[int]:
        """Instances that claims of `i` fit as well: only other claims distinguish them from it."""
        return [j for j in self.candidates(i) if all(self.holds(claim, j, DISTRACTOR_SLACK) for claim in claims)]

    def listed(self, instances: Sequence[int]) -> str:
        """Name the first of some instances by their nodes."""
        return ", ".join(self.scene.instances[j].node for j in instances[:3]) + ("..." if len(instances) > 3 else "")

    @cached_method
    def of(self, i: int) -> tuple[Claim, ...]:
        """All true claims of an instance, by kind, the most natural first."""
        instance = self.scene.instances[i]
        found = [*self._values(instance)]
        found += [Claim("part", say) for say in self.vocabulary.unrepeated_phrases(instance)]
        place = Claim("place", instance.attributes.get("place", ""))
        found += [place] if place.key and self.holds(place, i) else []
        found += self._relations(i)
        bearing = self.bearings[i]
        if bearing is not None and bearing.clear:
            found.append(Claim("direction", bearing.direction, (self._mention_of(self.landmarks[bearing.landmark]),)))
        return tuple(found)

    def holds(self, claim: Claim, j: int, slack: float = 1.0) -> bool:
        """Whether a claim is true of an instance; see `relations` for `slack`."""
        return _HOLDS[claim.kind](self, claim, j, slack)

    @property
    def landmark_names(self) -> dict[str, str]:
        """Nodes of the landmarks by their names in lower case."""
        return {name.lower(): self.scene.instances[j].node for j, name in self._landmark_names.items()}

    def place_wordings(self) -> dict[str, tuple[str, ...]]:
        """Phrases of place, in lower case, and how else they are said; in a scene without a table its things' own."""
        if self.places is not None:
            return self.places.wordings
        found = (instance.attributes.get("place", "").lower() for instance in self.scene.instances)
        return {phrase: () for phrase in found if phrase}

    def _values(self, instance: Instance) -> Iterator[Claim]:
        attributes = instance.attributes
        if colour := self.vocabulary.colour_of(instance):
            yield Claim("colour", colour)
        if attributes.get("size"):
            yield Claim("size", attributes["size"])
        for key, value in attributes.items():
            if value and key not in _NO_VALUES:
                yield Claim("attribute", f"{key}={value}")

    def _relations(self, i: int) -> list[Claim]:
        sizes = (self.geometry.boxes[:, 1] - self.geometry.boxes[:, 0]).max(axis=1)
        close = self.geometry.neighbours(i, _REACH_M)
        things = [j for j in close if self.vocabulary.words[j].reference and sizes[j] >= _MIN_SIZE_M]
        weights = {j: self._weight(i, j) for j in things}
        things.sort(key=lambda j: (-weights[j], j))
        found: list[tuple[float, Claim]] = []
        for j in things[:_MAX_THINGS]:
            mention = (self._mention_of(j),)
            found += [(factor * weights[j], Claim("relation", key, mention)) for key, factor in self._pairs(i, j)]
        for a, j in enumerate(things[:_MAX_BETWEEN]):
            for k in things[a + 1 : _MAX_BETWEEN]:
                first, second = self._mention_of(j), self._mention_of(k)
                if self.scene.imported and 0.0 in (self.geometry.gap_m(i, j), self.geometry.gap_m(i, k)):
                    continue
                if (first.noun, first.said) != (second.noun, second.said) and self.geometry.between(i, j, k, _TIGHT):
                    claim = Claim("relation", "between", (first, second))
                    found.append((1.2 * min(weights[j], weights[k]), claim))
        return [claim for _, claim in sorted(found, key=lambda item: -item[0])]

    def _pairs(self, i: int, j: int) -> Iterator[tuple[str, float]]:
        """Relations of an instance to another one, and how natural each is."""
        g, imported = self.geometry, self.scene.imported
        resting, covered = g.support(i) == j, j in g.covers(i)
        if resting and (not imported or g.rests_on(i, j)):
            yield "on", 3.0
        if covered and not (imported and g.support(j) == i):
            yield "under", 2.0
        if resting or covered or (imported and g.gap_m(i, j) == 0.0):
            return
        if g.beside(i, j, _TIGHT):
            yield "beside", 1.5
        elif g.near(i, j, _TIGHT) and g.level_gap_m(i, j) > 0.0:
            yield "near", 0.8
        anatomy = self.scene.instances[j].anatomy
        if anatomy is not None and anatomy.fronts_rad:
            if g.front(i, j, _TIGHT):
                yield "front", 1.2
            elif len(anatomy.fronts_rad) == 1 and g.behind(i, j, _TIGHT):
                yield "behind", 1.1
        bearing = g.bearing_rad(i, j)
        if bearing is not None and g.level_gap_m(i, j) > 0.0:
            direction = compass_direction(float(np.cos(bearing)), float(np.sin(bearing)))
            # From the middle of a long thing and from its nearest point it is the same direction, or none is said.
            offset = g.centres[i] - g.centres[j]
            if g.side(i, j, direction, _TIGHT) and lies_towards(offset, direction, 22.5 - BORDER_DEG):
                yield f"{direction} of", 1.0

    def _weight(self, i: int, j: int) -> float:
        noun, size = self._nouns[j], float((self.geometry.boxes[j, 1] - self.geometry.boxes[j, 0]).max())
        rarity = 1.0 / self._count[noun.name] ** 0.5 + 1.0 / self._short[noun.short] ** 0.5
        salience = (2.0 if j in self._landmark_names else 1.0) * rarity * min(size, 4.0) ** 0.4
        same = self._nouns[i].name == noun.name
        return salience / (1.5 + self.geometry.gap_m(i, j)) * (0.5 if same else 1.0)

    @cached_method
    def _mention_of(self, j: int) -> Mention:
        """Name a thing by as few words as are unique in the scene, else by its short noun phrase."""
        node, noun = self.scene.instances[j].node, self._nouns[j]
        if j in self._landmark_names:
            return Mention(node, self._landmark_names[j], (), True)
        plain = Mention(node, noun.name, (), True)
        if len(self.fitting(plain)) == 1:
            return plain
        full = Mention(node, noun.name, noun.adjectives, True)
        return full if len(self.fitting(full)) == 1 else Mention(node, noun.name, noun.adjectives, False)

    @cached_method
    def fitting(self, mention: Mention) -> frozenset[int]:
        """Instances that a mention's words fit, with every doubt: an unknown colour may be the one that is said."""
        return frozenset(j for j in self._named(mention.noun) if all(self._may_be(j, a) for a in mention.said))

    def _named(self, noun: str) -> list[int]:
        """Landmarks and instances of a name; a picnic bench is a bench, too."""
        ending = f" {noun.lower()}"
        marks = [j for j, name in self._landmark_names.items() if f" {name.lower()}" == ending]
        things = (j for name, same in self._by_noun.items() if name.endswith(ending) for j in same if j not in marks)
        return [*marks, *sorted(things)]

    @cached_property
    def _keys_of(self) -> Mapping[str, frozenset[str]]:
        """Attributes by the adjectives that stand for their values."""
        keys: dict[str, set[str]] = {}
        for instance, noun in zip(self.scene.instances, self._nouns, strict=True):
            for adjective in noun.adjectives:
                own = (key for key, value in instance.attributes.items() if _words(value) & _words(adjective))
                keys.setdefault(adjective, set()).update(own)
        return {adjective: frozenset(found) for adjective, found in keys.items()}

    def _may_be(self, j: int, adjective: str) -> bool:
        """Whether an instance may be called by an adjective."""
        attributes = self.scene.instances[j].attributes
        if any(_covers(own, adjective) for own in (*self._nouns[j].adjectives, *attributes.values())):
            return True
        # What is said of no attribute of it is not denied, either.
        return not self._keys_of.get(adjective, frozenset()) & attributes.keys()

    def _colour_holds(self, claim: Claim, j: int, slack: float) -> bool:
        instance = self.scene.instances[j]
        own = instance.attributes.get("colour", "")
        if slack > 1.0:
            return not own or _covers(own, claim.key)
        if self.scene.imported:
            return not own or _is_shade(own, claim.key)
        shown = not unsupported_colours(claim.key, instance, self.scene.materials)
        return shown and (not own or _is_shade(own, claim.key))

    def _value_holds(self, claim: Claim, j: int, slack: float) -> bool:
        key, _, value = claim.key.rpartition("=")
        own = self.scene.instances[j].attributes.get(key or "size", "")
        return _words(value) <= _words(own) if own else slack > 1.0

    def _part_holds(self, claim: Claim, j: int, slack: float) -> bool:
        instance = self.scene.instances[j]
        if slack <= 1.0:
            return claim.key in self.vocabulary.true_phrases(instance)
        return any(one.phrase == claim.key for one in self.vocabulary.valid_appearances(instance))

    def _place_holds(self, claim: Claim, j: int, slack: float) -> bool:
        place = claim.key.lower()
        if self.places is None:
            return self.scene.instances[j].attributes.get("place", "").lower() == place
        return place in self.places.wordings and not self.places.fault(j, place, slack)

    def _direction_holds(self, claim: Claim, j: int, slack: float) -> bool:
        marks = [self.geometry.index.get(m.node, -1) for m in claim.things]
        return (
            len(marks) == 1
            and marks[0] in self.landmarks
            and claim.key in DIRECTIONS
            and lies_towards(self.geometry.centres[j] - self.geometry.centres[marks[0]], claim.key, 22.5 * slack)
        )

    def is_true(self, claim: Claim, i: int) -> bool:
        """Whether a claim is true of an instance and of the very things that it names."""
        if claim.kind != "relation":
            return self.holds(claim, i)
        named = all(self.geometry.index.get(m.node, -1) in self.fitting(m) for m in claim.things)
        return named and self._related(claim, i, [[self.geometry.index[m.node]] for m in claim.things], 1.0)

    def _relation_holds(self, claim: Claim, j: int, slack: float) -> bool:
        close = set(self.geometry.neighbours(j, _FAR_M * slack))
        return self._related(claim, j, [sorted((self.fitting(m) & close) - {j}) for m in claim.things], slack)

    def _related(self, claim: Claim, j: int, sets: Sequence[Sequence[int]], slack: float) -> bool:
        """Whether a relation holds of an instance to any of some things each."""
        if claim.key == "between":
            return len(sets) == 2 and any(self.geometry.between(j, a, b, slack) for a in sets[0] for b in sets[1])
        if len(sets) != 1:
            return False
        direction = claim.key.removesuffix(" of")
        if direction in DIRECTIONS:
            return any(self._is_side(j, k, direction, slack) for k in sets[0])
        test = _RELATIONS.get(claim.key)
        return test is not None and any(test(self.geometry, j, k, slack) for k in sets[0])

    def _is_side(self, j: int, k: int, direction: str, slack: float) -> bool:
        """Whether an instance is in that direction of another: of a landmark from its centroid, as the goal says."""
        towards = lies_towards(self.geometry.centres[j] - self.geometry.centres[k], direction, 22.5 * slack)
        seen = self.geometry.side(j, k, direction, slack)
        if slack > 1.0:
            return seen or (towards and self.geometry.near(j, k, slack))
        return seen and (towards or k not in self.landmarks)


@lru_cache(maxsize=4096)
def _words(text: str) -> frozenset[str]:
    return frozenset(_SPELT.get(word, word) for word in re.findall(r"[^\W_]+", text.lower()))


@lru_cache(maxsize=4096)
def _covers(own: str, said: str) -> bool:
    """Whether a value may be called by another one: dark green is green, and silver is grey."""
    mine = _words(own)
    return all(
        word in mine or any(word in colours and mine & colours for colours in _ONE_COLOUR) for word in _words(said)
    )


def _is_shade(own: str, said: str) -> bool:
    """Whether each colour of a text may be a name of one that the thing has: red may be said of orange."""
    mine = [SHADES[word] for word in _words(own) if word in SHADES]
    return not mine or all(any(SHADES[word] & one for one in mine) for word in _words(said) if word in SHADES)


_Test = Callable[[SceneGeometry, int, int, float], bool]
_RELATIONS: Mapping[str, _Test] = {
    "beside": SceneGeometry.beside, "against": partial(SceneGeometry.near, most_m=AGAINST_M),
    "at": partial(SceneGeometry.near, most_m=AT_M),
    "near": SceneGeometry.near, "front": SceneGeometry.front, "behind": SceneGeometry.behind, "on": SceneGeometry.on,
    "under": SceneGeometry.under, "above": SceneGeometry.above,
}  # fmt: skip
_HOLDS: Mapping[str, Callable[[SceneClaims, Claim, int, float], bool]] = {
    "colour": SceneClaims._colour_holds, "size": SceneClaims._value_holds, "attribute": SceneClaims._value_holds,
    "part": SceneClaims._part_holds, "place": SceneClaims._place_holds, "relation": SceneClaims._relation_holds,
    "direction": SceneClaims._direction_holds,
}  # fmt: skip
