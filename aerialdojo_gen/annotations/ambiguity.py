"""Check whether a description fits anything but its own object.

Objects are located by their nearest landmark, the compass direction from it, and the claims of the description
(`claims`). The distractors of an object are all instances of its category with the same landmark and direction,
annotated or not: an agent in the scene sees them all. A description is ambiguous if all its claims hold for a
distractor, with the slack `claims.DISTRACTOR_SLACK` on distances and angles.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cached_property

from aerialdojo_gen.annotations.bearings import Bearing, nearest_landmark
from aerialdojo_gen.annotations.parsing import Lexicon, Reading
from aerialdojo_gen.annotations.places import Places, places_of
from aerialdojo_gen.annotations.relations import DISTRACTOR_SLACK, SceneGeometry
from aerialdojo_gen.scenes.model import Scene


def first_sentence(text: str) -> str:
    """Return the first sentence of a text."""
    return re.split(r"(?<=[.!?])\s", text.strip(), maxsplit=1)[0]


class Ambiguity:
    """Checks descriptions for ambiguity in one scene."""

    def __init__(self, geometry: SceneGeometry, lexicon: Lexicon, landmarks: Sequence[int]) -> None:
        self.geometry = geometry
        self.lexicon = lexicon
        self.landmarks = tuple(landmarks)

    @cached_property
    def bearings(self) -> list[Bearing | None]:
        """Nearest landmark and direction of every instance."""
        places = self.geometry.centres[list(self.landmarks)]
        return [nearest_landmark(centre, places) for centre in self.geometry.centres]

    @cached_property
    def _groups(self) -> dict[tuple[str, Bearing | None], list[int]]:
        groups: dict[tuple[str, Bearing | None], list[int]] = {}
        for i, instance in enumerate(self.geometry.scene.instances):
            groups.setdefault((instance.category, self.bearings[i]), []).append(i)
        return groups

    def candidates(self, i: int) -> list[int]:
        """Other instances of the same category, landmark and direction."""
        category = self.geometry.scene.instances[i].category
        return [j for j in self._groups[category, self.bearings[i]] if j != i]

    def distractors(self, i: int, description: str) -> list[int]:
        """Instances that a description of `i` fits as well."""
        candidates = self.candidates(i)
        if not candidates:
            return []
        reading = self.lexicon.read(description, i)
        own = [value for value in reading.values if self.lexicon.has(i, value)]
        return [
            j
            for j in candidates
            if self.lexicon.fits(j, own)
            and not any(self._place_fault(j, place, DISTRACTOR_SLACK) for place in reading.places)
            and all(claim.holds(self.geometry, j, DISTRACTOR_SLACK) for claim in reading.claims)
        ]

    def _place_fault(self, i: int, place: str, slack: float = 1.0) -> str:
        """Return the first condition of a place phrase that an instance violates; empty if there is none."""
        places = self.lexicon.places
        return places.fault(i, place, slack) if places is not None and place in places else ""

    def first_sentence_distractors(self, i: int, name: str, description: str) -> list[int]:
        """Instances that the name and first sentence of a description of `i` fit: a reader may stop there."""
        return self.distractors(i, f"The {name}: {first_sentence(description)}")

    def false_claims(self, i: int, text: str) -> list[str]:
        """What a name or description says that is not so of instance `i`, in words.

        Values are held against the instance only where they stand right before its name: "with a white roof" is
        no claim that the whole is white.
        """
        reading: Reading = self.lexicon.read(text, i)
        instance = self.geometry.scene.instances[i]
        denied = [value for value in reading.named if self.lexicon.denied(i, value)]
        wrong = [f"it is called {value!r}, and the mesh is not" for value in denied]
        wrong += [
            f"{claim.text!r} is not so of {instance.node}"
            for claim in reading.claims
            if not claim.holds(self.geometry, i)
        ]
        for place in reading.places:
            if self.lexicon.places is not None and place not in self.lexicon.places:
                wrong.append(f"{place!r} cannot be checked: it is not bound to any condition; leave it out")
            elif why := self._place_fault(i, place):
                wrong.append(f"{place!r} is not so of {instance.node}: {why}")
        return wrong


def make_ambiguity(
    scene: Scene,
    names: Mapping[str, str],
    landmarks: Mapping[str, str],
    order: Sequence[str],
    geometry: SceneGeometry | None = None,
) -> Ambiguity:
    """Make the ambiguity check of a scene."""
    geometry = geometry or SceneGeometry(scene)
    bound = None if scene.imported else places_of(scene.name)
    places = None if bound is None else Places(geometry, bound)
    lexicon = Lexicon(geometry, names, {name: geometry.index[node] for name, node in landmarks.items()}, places)
    return Ambiguity(geometry, lexicon, [geometry.index[node] for node in order])
