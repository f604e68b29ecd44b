"""Drafts of annotation files: what a person would otherwise write by hand, to be read and owned by one.

Objects are chosen category by category in turn, and described by their attributes, their category's looks and as
many of the facts about their place as it takes to tell them from their rivals. Every draft passes the checks of
`annotate-import`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerialdojo_gen.annotations.ambiguity import Ambiguity
from aerialdojo_gen.annotations.describing import NO_THING, STAGE, Teller, Vocabulary
from aerialdojo_gen.annotations.format import Annotations, Landmark, Object
from aerialdojo_gen.common.advice import command
from aerialdojo_gen.common.rng import rank
from aerialdojo_gen.errors import AnnotationError
from aerialdojo_gen.geometry.frames import compass_direction
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.model import Instance, Scene

_ALOFT_M = 3.0


@dataclass(frozen=True)
class Choice:
    """Which instances may become objects, and how many of a kind.

    Attributes
    ----------
    eligible : callable or None
        ``node -> bool``, e.g. whether anchors exist; None lets all in.
    centre_m : tuple of two float or None
        Middle of the core that objects are taken from; the landmarks' mean where absent.
    within_m : float or None
        Radius of the core; None for the whole scene. How long tasks are hangs on it.
    core_share : float
        Share of the objects that come from the core; the others may stand anywhere.
    aloft_share : float
        Share of the core's objects that is taken from what stands 3 m above z = 0 or higher, as far as there is any:
        roofs and decks against the street make routes that are not straight.
    most_vegetation : int
        Most objects of one category of vegetation.
    most : int
        Most objects of any other category.
    """

    eligible: Callable[[str], bool] | None = None
    centre_m: tuple[float, float] | None = None
    within_m: float | None = None
    core_share: float = 1.0
    aloft_share: float = 0.0
    most_vegetation: int = 3
    most: int = 5


def redraft_annotations(scene: Scene, catalogue: Catalogue, annotations: Annotations, seed: int) -> Annotations:
    """Describe the objects of annotations anew; which they are, their ids and their names stay.

    Parameters
    ----------
    scene : Scene
        The scene.
    catalogue : Catalogue
        Names, kinds and looks of its categories.
    annotations : Annotations
        Of the scene. A name that is not so of the mesh any more, or is another's of its kind, is replaced.
    seed : int
        The same seed gives the same words.

    Returns
    -------
    Annotations
        It passes `check.check_source` where the landmarks do.

    Raises
    ------
    AnnotationError
        A node is gone, or an object cannot be told from others of its kind.
    """
    for node in (*(m.node for m in annotations.landmarks), *(o.node for o in annotations.objects)):
        if node not in scene:
            raise AnnotationError(f"{scene.name}: no node {node!r} in the scene: draft the file anew")
    vocabulary = Vocabulary(scene, catalogue)
    teller = Teller(vocabulary, sorted(annotations.landmarks, key=lambda mark: mark.id), seed)
    index = teller.ambiguity.geometry.index
    objects: list[Object] = []
    for entry in annotations.objects:
        i = index[entry.node]
        own, kind = vocabulary.nouns[i].short, scene[entry.node].category
        # A layout that has changed may have put the yellow one where the green one was.
        others = {n.short for n, it in zip(vocabulary.nouns, scene.instances, strict=True) if it.category == kind}
        sound = entry.name not in others - {own} and teller.sound(i, entry.name)
        name = entry.name if sound else own
        text = teller.describe(i, {other.description for other in objects}, name)
        if text is None:
            raise AnnotationError(
                f"{scene.name}: {entry.node} (object {entry.id}) cannot be told from others of its kind: "
                f"take another object in its place ({command('annotate', scene=scene.name)})"
            )
        objects.append(entry.model_copy(update={"name": name, "category": kind, "description": text}))
    return replace(annotations, objects=tuple(objects))


def draft_annotations(
    scene: Scene,
    catalogue: Catalogue,
    n_landmarks: int,
    n_objects: int,
    seed: int,
    choice: Choice | None = None,
    landmarks: Sequence[str] = (),
) -> Annotations:
    """Draft the annotations of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    catalogue : Catalogue
        Names and kinds of its categories.
    n_landmarks, n_objects : int
        How many of each.
    seed : int
        The same seed gives the same draft.
    choice : Choice or None
        Which instances may become objects.
    landmarks : sequence of str
        Nodes of landmarks that are wanted; the rest is chosen among the catalogue's kind ``landmark``.

    Returns
    -------
    Annotations
        It passes `check.check_source`.

    Raises
    ------
    AnnotationError
        The scene has too few landmarks, or too few things that can be described without ambiguity.
    """
    drafter = _Drafter(scene, catalogue, seed, choice or Choice())
    marks = drafter.landmarks(n_landmarks, landmarks)
    return Annotations(scene.name, marks, drafter.objects(marks, n_objects))


class _Drafter:
    def __init__(self, scene: Scene, catalogue: Catalogue, seed: int, choice: Choice) -> None:
        self._scene, self._seed, self._choice = scene, seed, choice
        self._vocabulary = Vocabulary(scene, catalogue)
        self._kinds, self._nouns = self._vocabulary.kinds, self._vocabulary.nouns

    def landmarks(self, n: int, wanted: Sequence[str]) -> tuple[Landmark, ...]:
        """Choose landmarks: the wanted, then the tallest, then whatever is farthest from the chosen."""
        missing = [node for node in wanted if node not in self._scene]
        if missing:
            raise AnnotationError(f"{self._scene.name}: no node {missing[0]!r} to make a landmark of")
        chosen = [self._scene[node] for node in wanted][:n]
        rest = [i for i in self._scene.instances if self._kinds.get(i.category) == "landmark" and i not in chosen]
        if self._scene.imported:
            rest = self._prominent(4 * n)
        while len(chosen) < n and rest:
            best = max(rest, key=lambda i: (_spread(i, chosen), float(i.bounds[1, 2])))
            chosen.append(best)
            rest.remove(best)
        if len(chosen) < n:
            raise AnnotationError(f"{self._scene.name}: {n} landmarks are wanted, the scene has {len(chosen)}")
        noun = {i.node: noun for i, noun in zip(self._scene.instances, self._nouns, strict=True)}
        plain = [noun[i.node].name for i in chosen]
        names = [noun[i.node].short if plain.count(p) > 1 else p for i, p in zip(chosen, plain, strict=True)]
        if self._scene.imported:
            # Told apart by where they stand, as nothing else is known of them.
            names = [
                self._sided(i, name) if names.count(name) > 1 else name for i, name in zip(chosen, names, strict=True)
            ]
        if len(set(names)) < n:
            raise AnnotationError(f"{self._scene.name}: landmarks share a name: {', '.join(sorted(names))}")
        return tuple(
            Landmark(id=k, name=name, node=i.node) for k, (name, i) in enumerate(zip(names, chosen, strict=True))
        )

    def _prominent(self, n: int) -> list[Instance]:
        """The n tallest things of a mesh of another make."""
        things = [i for i in self._scene.instances if i.category not in NO_THING]
        return sorted(things, key=lambda i: (-float(i.bounds[1, 2]), i.node))[:n]

    def _sided(self, instance: Instance, name: str) -> str:
        x, y = instance.centroid[:2] - self._scene.bounds[:, :2].mean(axis=0)
        return f"{compass_direction(float(x), float(y))} {name}"

    def objects(self, marks: tuple[Landmark, ...], n: int) -> tuple[Object, ...]:
        """Choose and describe objects, a category at a time in turn."""
        teller = Teller(self._vocabulary, marks, self._seed)
        ambiguity = teller.ambiguity
        taken: dict[int, str] = {}
        everywhere = self._queues(ambiguity)
        core = {c: [i for i in queue if self._in_core(i, ambiguity)] for c, queue in everywhere.items()}
        rest = {c: [i for i in queue if i not in core[c]] for c, queue in everywhere.items()}
        aloft = {c: [i for i in queue if self._aloft(i)] for c, queue in core.items()}
        low = {c: [i for i in queue if i not in aloft[c]] for c, queue in core.items()}
        in_core = n if self._choice.within_m is None else round(n * self._choice.core_share)
        phases: tuple[tuple[dict[str, list[int]], int], ...] = (
            (core, in_core),
            (rest, n if in_core < n else in_core),
        )
        if self._choice.aloft_share > 0:
            high = round(in_core * self._choice.aloft_share)
            phases = ((aloft, high), (low, in_core), (aloft, in_core), phases[1])
        for queues, upto in phases:
            while len(taken) < upto:
                before = len(taken)
                # What the core has none of comes first.
                for category, queue in sorted(queues.items(), key=lambda item: self._many(item[0], taken) > 0):
                    if len(taken) < upto and not self._full(category, taken):
                        self._take(queue, teller, taken)
                if len(taken) == before:
                    break
        if len(taken) < n:
            raise AnnotationError(
                f"{self._scene.name}: {n} objects are wanted, {len(taken)} can be chosen and told apart: "
                f"ask for {len(taken)}, and add others by hand (aerialdojo-gen annotate)"
            )
        return tuple(
            Object(
                id=k,
                name=self._nouns[i].short,
                category=self._scene.instances[i].category,
                description=taken[i],
                node=self._scene.instances[i].node,
            )
            for k, i in enumerate(sorted(taken))
        )

    def _many(self, category: str, taken: dict[int, str]) -> int:
        return sum(self._scene.instances[i].category == category for i in taken)

    def _full(self, category: str, taken: dict[int, str]) -> bool:
        most = self._choice.most_vegetation if self._kinds.get(category) == "vegetation" else self._choice.most
        return self._many(category, taken) >= most

    def _queues(self, ambiguity: Ambiguity) -> dict[str, list[int]]:
        """Instances that may become objects, by category; categories in a random but fixed order."""
        queues: dict[str, list[int]] = {}
        for i, instance in enumerate(self._scene.instances):
            if self._may_be_object(i, instance, ambiguity):
                queues.setdefault(instance.category, []).append(i)
        return {c: queues[c] for c in sorted(queues, key=lambda c: (rank(self._seed, STAGE, self._scene.name, c), c))}

    def _may_be_object(self, i: int, instance: Instance, ambiguity: Ambiguity) -> bool:
        choice = self._choice
        if i in ambiguity.landmarks or not self._vocabulary.words[i].target or ambiguity.bearing(i) is None:
            return False
        middle = instance.centroid
        if not (np.all(middle >= self._scene.bounds[0]) and np.all(middle <= self._scene.bounds[1])):
            return False
        return choice.eligible is None or choice.eligible(instance.node)

    def _aloft(self, i: int) -> bool:
        return float(self._scene.instances[i].bounds[0, 2]) >= _ALOFT_M

    def _in_core(self, i: int, ambiguity: Ambiguity) -> bool:
        if self._choice.within_m is None:
            return True
        centre = self._choice.centre_m
        if centre is None:
            x, y = ambiguity.geometry.centres[list(ambiguity.landmarks), :2].mean(axis=0)
            centre = float(x), float(y)
        away = ambiguity.geometry.centres[i, :2] - np.asarray(centre)
        return float(np.hypot(*away)) <= self._choice.within_m

    def _take(self, queue: list[int], teller: Teller, taken: dict[int, str]) -> None:
        """Move one instance from its category's queue to the objects; those that defy description are dropped."""
        instances = self._scene.instances
        while queue:
            alike = [instances[j] for j in taken if instances[j].category == instances[queue[0]].category]
            names = [self._nouns[j].short for j in taken]
            best = max(
                queue,
                key=lambda i: (
                    -names.count(self._nouns[i].short),
                    round(_spread(instances[i], alike), 3),
                    rank(self._seed, STAGE, self._scene.name, instances[i].node),
                ),
            )
            queue.remove(best)
            text = teller.describe(best, set(taken.values())) if teller.sound(best, self._nouns[best].short) else None
            if text is not None:
                taken[best] = text
                return


def _spread(instance: Instance, chosen: Sequence[Instance]) -> float:
    """Distance in the plane to the nearest of the chosen, metres; a kilometre where there is none."""
    gaps = [float(np.hypot(*(instance.centroid[:2] - other.centroid[:2]))) for other in chosen]
    return min(gaps, default=1000.0)
