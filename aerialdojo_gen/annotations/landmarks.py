"""Choose landmarks for drafts: far apart, prominent, each with a unique name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.vocabulary import NON_OBJECTS, UNKNOWN, Vocabulary
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.scenes.model import Instance, Scene

# Margins by which the tallest is called tallest, and the northernmost northernmost.
_TALLER = 1.1
_FARTHER_M = 1.0
_LARGE_M = 3.0
_SIDES = (("northernmost", 1, 1.0), ("southernmost", 1, -1.0), ("easternmost", 0, 1.0), ("westernmost", 0, -1.0))


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


def reaches_into(scene: Scene, instance: Instance) -> bool:
    """Whether a landmark's middle lies over the site and some of it below the ceiling, as a high mast's does."""
    (x0, y0, z0), (x1, y1, z1) = scene.bounds.tolist()
    x, y, _ = instance.centroid.tolist()
    bottom, top = instance.bounds[:, 2].tolist()
    return x0 <= x <= x1 and y0 <= y <= y1 and bottom <= z1 and top >= z0


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
