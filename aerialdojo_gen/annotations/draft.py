"""Draft annotation files for a person to review.

Landmarks are far apart, prominent, and each has a unique name. Objects are chosen category by category in turn, as
far as claims exclude their distractors; the stage `describe` writes their texts. Every draft passes the checks of
`annotate-import`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.annotations.check import is_inside, reaches_into
from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.format import Landmark, Object
from aerialdojo_gen.annotations.language.writer import Writer
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.vocabulary import NON_OBJECTS, UNKNOWN, Vocabulary
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.scenes.model import Instance

STAGE = "annotate-draft"
_ELEVATED_M = 3.0
MAX_PER_CATEGORY = 5
SCENERY = "of ground, slabs or scraps"
_SHOWN = 3
_INDISTINGUISHABLE = "indistinguishable from others of their category"
_NO_DIRECTION = "at a landmark's position, or outside the bounds"
# Margins by which the tallest is called tallest, and the northernmost northernmost.
_TALLER = 1.1
_FARTHER_M = 1.0
_LARGE_M = 3.0
_SIDES = (("northernmost", 1, 1.0), ("southernmost", 1, -1.0), ("easternmost", 0, 1.0), ("westernmost", 0, -1.0))


@dataclass(frozen=True)
class DraftOptions:
    """Which instances may become landmarks and objects, and how many per category."""

    landmarks: tuple[str, ...] = ()  # Nodes to use as landmarks
    n_landmarks: int | None = None  # Default: the paper's, else 1 or 2
    n_objects: int | str | None = None  # "auto" for up to 20; default: the paper's, else that
    seed: int = 0
    reject: Callable[[str], str] | None = None
    centre_m: tuple[float, float] | None = None
    core_radius_m: float | None = None  # Radius of the core area, which limits the length of tasks; None: whole scene
    core_share: float = 1.0  # Share of the objects from the core area
    elevated_share: float = 0.0
    max_vegetation: int = 3  # Maximum objects per vegetation category
    max_per_category: int | None = None  # Maximum objects per other category; default 5


def choose_landmarks(
    vocabulary: Vocabulary, n: int, requested: Sequence[str] = (), at_most: bool = False
) -> tuple[Landmark, ...]:
    """Choose landmarks: the requested ones, then the tallest, then whichever is farthest from those chosen."""
    scene = vocabulary.scene
    missing = [node for node in requested if node not in scene]
    if missing:
        raise AnnotationError(f"{scene.name}: no node {missing[0]!r} to make a landmark of")
    chosen = [scene[node] for node in dict.fromkeys(requested)][:n]
    own: dict[str, str] = {}
    names = _UniqueNames(vocabulary)
    inside = [i for i in scene.instances if reaches_into(scene, i)]
    if scene.imported:
        nameless = [i.node for i in chosen if not names.of(i)]
        if nameless:
            raise AnnotationError(
                f"{scene.name}: the landmark {nameless[0]!r} is indistinguishable from others of its "
                "category: choose another node"
            )
        prominent = [i for i in _prominent(inside) if i not in chosen]
        rest = [i for i in prominent[: 8 * n] if names.of(i)]
        if len(chosen) + len(rest) < n:
            # Few names: the extreme one in each direction has a unique name, however low it is.
            rest = [i for i in prominent if names.of(i)][:n]
    else:
        rest = [i for i in inside if vocabulary.kinds.get(i.category) == "landmark" and i not in chosen]
        if len(chosen) + len(rest) < n and at_most:
            # Mapped towns often have no landmark of the catalogue: use the tallest buildings, that is what is large
            # itself, not only high up on a roof.
            large = [i for i in _prominent(inside) if np.ptp(i.bounds, axis=0).min() >= _LARGE_M][: 8 * n]
            own = {i.node: names.of(i) for i in large if i not in (*chosen, *rest) and names.of(i)}
            rest += [i for i in large if i.node in own]
    while len(chosen) < n and rest:
        best = max(rest, key=lambda i: (spread_m(i, chosen), float(i.bounds[1, 2])))
        chosen.append(best)
        rest.remove(best)
        if at_most and not scene.imported:
            # A landmark's name must be unique: keep only one of identical statues.
            rest = [i for i in rest if names.nouns[i.node].short != names.nouns[best.node].short]
    if len(chosen) < n and not (at_most and chosen):
        raise AnnotationError(
            f"{scene.name}: {n} landmark{'s' if n > 1 else ''} requested, the scene has {len(chosen)}"
        )
    plain = [names.nouns[i.node].name for i in chosen]
    landmark_names = [
        names.of(i) if scene.imported else own.get(i.node) or (names.nouns[i.node].short if plain.count(p) > 1 else p)
        for i, p in zip(chosen, plain, strict=True)
    ]
    if len(set(landmark_names)) < len(landmark_names):
        raise AnnotationError(f"{scene.name}: landmarks share a name: {', '.join(sorted(landmark_names))}")
    return tuple(
        Landmark(id=k, name=name, node=i.node) for k, (name, i) in enumerate(zip(landmark_names, chosen, strict=True))
    )


def spread_m(instance: Instance, chosen: Sequence[Instance]) -> float:
    """Distance in the plane to the nearest chosen instance, metres; 1000 if none is chosen."""
    gaps = [float(np.hypot(*(instance.centroid[:2] - other.centroid[:2]))) for other in chosen]
    return min(gaps, default=1000.0)


def _prominent(instances: Sequence[Instance]) -> list[Instance]:
    """Those of some instances that are things, highest first, those without a name last."""
    things = [i for i in instances if i.category not in NON_OBJECTS]
    return sorted(things, key=lambda i: (i.category == UNKNOWN, -float(i.bounds[1, 2]), i.node))


class _UniqueNames:
    """Unique names for the things of an imported mesh."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.nouns = dict(zip((i.node for i in vocabulary.scene.instances), vocabulary.nouns, strict=True))
        self._alike: dict[str, list[Instance]] = {}
        for instance, noun in zip(vocabulary.scene.instances, vocabulary.nouns, strict=True):
            self._alike.setdefault(noun.name, []).append(instance)

    def of(self, instance: Instance) -> str:
        """Return a unique name; empty if there is none."""
        noun = self.nouns[instance.node]
        others = [other for other in self._alike[noun.name] if other is not instance]
        # An office building is also a building.
        kinds = (name for name in self._alike if name.endswith(f" {noun.name}"))
        others += [other for name in kinds for other in self._alike[name]]
        if not others:
            return noun.name
        if not any(set(noun.adjectives) <= set(self.nouns[other.node].adjectives) for other in others):
            return noun.short
        rises = [float(np.ptp(other.bounds[:, 2])) for other in others]
        if float(np.ptp(instance.bounds[:, 2])) > _TALLER * max(rises):
            return f"tallest {noun.name}"
        for word, axis, sign in _SIDES:
            farthest = max(sign * float(other.centroid[axis]) for other in others)
            if sign * float(instance.centroid[axis]) > farthest + _FARTHER_M:
                return f"{word} {noun.name}"
        return ""


class AnnotationDrafter:
    """Chooses the objects of a scene."""

    def __init__(self, vocabulary: Vocabulary, landmarks: tuple[Landmark, ...], options: DraftOptions) -> None:
        self._vocabulary, self._scene, self._seed, self._options = vocabulary, vocabulary.scene, options.seed, options
        self._kinds, self._nouns = vocabulary.kinds, vocabulary.nouns
        self.landmarks = landmarks
        self.rejections: Counter[str] = Counter()
        self.confusions: list[tuple[str, Sequence[str]]] = []
        self._claims = SceneClaims(vocabulary, landmarks)
        self._matcher = Matcher(self._claims)
        self._writer = Writer(self._claims, [mark.name for mark in landmarks], options.seed, STAGE)
        candidates = [k for k, w in enumerate(vocabulary.words) if w.target and k not in self._claims.landmarks]
        inside = (k for k in candidates if is_inside(self._scene, self._scene.instances[k].centroid))
        self.things = tuple(k for k in inside if self._claims.bearings[k] is not None)
        scenery = sum(not w.target for w in vocabulary.words) if self._scene.imported else 0
        self.rejections.update({_NO_DIRECTION: len(candidates) - len(self.things), SCENERY: scenery})

    def capacity(self) -> int:
        """Upper bound on the number of objects, by the limits per category."""
        kinds = Counter(self._scene.instances[k].category for k in self.things)
        return sum(min(n, self._limit(kind)) for kind, n in kinds.items())

    def rejection_summary(self) -> str:
        """Return why instances were rejected: ``"; not taken: 7 ..., 2 ..."``; empty if none were."""
        confused = "; ".join(
            f"{node} with {others[0]}{f' and {len(others) - 1:,} more' if len(others) > 1 else ''}"
            for node, others in [pair for pair in self.confusions if pair[1]][:_SHOWN]
        )
        examples = {_INDISTINGUISHABLE: f" ({confused})"} if confused else {}
        text = ", ".join(f"{n:,} {why}{examples.get(why, '')}" for why, n in self.rejections.most_common() if n)
        return f"; not taken: {text}" if text else ""

    def objects(self, n: int, on_chosen: Callable[[], object] = lambda: None) -> tuple[Object, ...]:
        """Choose up to `n` objects, round-robin over categories; calls `on_chosen` for each."""
        taken: list[int] = []
        everywhere = self._queues()
        core, rest = _parted(everywhere, self._in_core)
        elevated, low = _parted(core, lambda i: float(self._scene.instances[i].bounds[0, 2]) >= _ELEVATED_M)
        in_core = n if self._options.core_radius_m is None else round(n * self._options.core_share)
        phases: tuple[tuple[dict[str, list[int]], int], ...] = (
            (core, in_core),
            (rest, n if in_core < n else in_core),
        )
        if self._options.elevated_share > 0:
            high = round(in_core * self._options.elevated_share)
            phases = ((elevated, high), (low, in_core), (elevated, in_core), phases[1])
        for queues, upto in phases:
            while len(taken) < upto:
                before = len(taken)
                # Categories that the core lacks come first.
                for category, queue in sorted(queues.items(), key=lambda item: self._count(item[0], taken) > 0):
                    open_slot = len(taken) < upto and self._count(category, taken) < self._limit(category)
                    if open_slot and self._take_next(queue, taken):
                        on_chosen()
                if len(taken) == before:
                    break
        return tuple(
            Object(
                id=k,
                name=self._nouns[i].short,
                category=self._scene.instances[i].category,
                node=self._scene.instances[i].node,
            )
            for k, i in enumerate(sorted(taken))
        )

    def _count(self, category: str, taken: list[int]) -> int:
        return sum(self._scene.instances[i].category == category for i in taken)

    def _limit(self, category: str) -> int:
        vegetation = self._kinds.get(category) == "vegetation"
        return self._options.max_vegetation if vegetation else self._options.max_per_category or MAX_PER_CATEGORY

    def _queues(self) -> dict[str, list[int]]:
        """Candidates by category; categories in a random but fixed order."""
        queues: dict[str, list[int]] = {}
        for i in self.things:
            queues.setdefault(self._scene.instances[i].category, []).append(i)
        return {c: queues[c] for c in sorted(queues, key=lambda c: (rank(self._seed, STAGE, self._scene.name, c), c))}

    def _in_core(self, i: int) -> bool:
        if self._options.core_radius_m is None:
            return True
        centre = self._options.centre_m
        if centre is None:
            x, y = self._claims.geometry.centres[list(self._claims.landmarks), :2].mean(axis=0)
            centre = float(x), float(y)
        away = self._claims.geometry.centres[i, :2] - np.asarray(centre)
        return float(np.hypot(*away)) <= self._options.core_radius_m

    def _take_next(self, queue: list[int], taken: list[int]) -> bool:
        """Move one instance from a category's queue to the objects, dropping invalid ones; False if none is left."""
        instances = self._scene.instances
        while queue:
            alike = [instances[j] for j in taken if instances[j].category == instances[queue[0]].category]
            names = [self._nouns[j].short for j in taken]
            best = max(
                queue,
                key=lambda i: (
                    -names.count(self._nouns[i].short),
                    round(spread_m(instances[i], alike), 3),
                    rank(self._seed, STAGE, self._scene.name, instances[i].node),
                ),
            )
            queue.remove(best)
            why = self._reject(best, instances[best])
            if why:
                self.rejections[why] += 1
            else:
                taken.append(best)
                return True
        return False

    def _reject(self, i: int, instance: Instance) -> str:
        """Return why an instance cannot be an object; empty if it can."""
        why = self._options.reject(instance.node) if self._options.reject else ""
        if why:
            return why
        name, claims = self._nouns[i].short, self._claims.of(i)
        # Without a phrase about parts, which its pictures may not show.
        if not self._matcher.faults(i, name) and self._writer.texts(i, claims, (), 1):
            return ""
        others = self._claims.distractors(i, claims) or self._claims.candidates(i)
        self.confusions.append((instance.node, [self._scene.instances[j].node for j in others]))
        return _INDISTINGUISHABLE


def _parted(
    queues: dict[str, list[int]], test: Callable[[int], bool]
) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    """Part queues into those of what passes a test, and those of the rest."""
    passing = {c: [i for i in queue if test(i)] for c, queue in queues.items()}
    return passing, {c: [i for i in queue if i not in passing[c]] for c, queue in queues.items()}
