"""Describes the objects of an annotation file anew."""

from __future__ import annotations

from dataclasses import replace

from aerialdojo_gen.annotations.describing import DescriptionWriter, Vocabulary
from aerialdojo_gen.annotations.format import Annotations, Object
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.model import Scene


def redraft_annotations(scene: Scene, catalogue: Catalogue, annotations: Annotations, seed: int) -> Annotations:
    """Describe the objects of annotations anew; which they are, their ids and their names stay."""
    for node in (*(m.node for m in annotations.landmarks), *(o.node for o in annotations.objects)):
        if node not in scene:
            raise AnnotationError(f"{scene.name}: no node {node!r} in the scene: draft the file anew")
    vocabulary = Vocabulary(scene, catalogue)
    teller = DescriptionWriter(vocabulary, sorted(annotations.landmarks, key=lambda mark: mark.id), seed)
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
