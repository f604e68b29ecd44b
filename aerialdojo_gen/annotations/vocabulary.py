"""Words and noun phrases of a scene's instances, and what is true of their appearance."""

from __future__ import annotations

from dataclasses import replace

from aerialdojo_gen.annotations.appearance import Surface, repeats, unsupported_colours
from aerialdojo_gen.annotations.phrases import CategoryWords, group_of, noun_of, spoken, words_of
from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.scenes.appearances import Appearance
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.claims import valid_phrases
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Instance, Scene

# Categories of imported meshes that are never objects.
NON_OBJECTS = frozenset({"ground", "clutter", "slab", "terrain"})
# Category of imported nodes without a meaningful name; a person has to set it.
UNKNOWN = "object"


class Vocabulary:
    """Words and noun phrases of a scene's instances."""

    def __init__(self, scene: Scene, catalogue: Catalogue) -> None:
        self.scene = scene
        self.names, self.kinds, self._catalogue = catalogue.names, catalogue.kinds, catalogue
        self._surface = Surface(scene)
        targets = frozenset(catalogue.targets)
        by_category: dict[str, CategoryWords] = {}
        for i in scene.instances:
            if scene.imported and i.category not in NON_OBJECTS:
                # Imported meshes have categories of their own, all of which may be targets.
                self.names[i.category] = spoken(i.category)
                targets |= {i.category}
            if i.category not in by_category:
                name, kind = self.names.get(i.category), self.kinds.get(i.category, "")
                words = words_of(i.category, name, kind, i.category in targets)
                if scene.imported and (words.plural_heads or not words.group):
                    # What is a row of things in the catalogue is one of them here.
                    group = group_of(words.name)
                    words = replace(words, nouns=(), plural_heads=(), collectives=(), group=group)
                by_category[i.category] = words
        self.words = [by_category[i.category] for i in scene.instances]
        shown = (replace(i, attributes={**i.attributes, "colour": self.colour_of(i)}) for i in scene.instances)
        self.nouns = [noun_of(i, w) for i, w in zip(shown, self.words, strict=True)]

    @classmethod
    def of(cls, scene: Scene, catalogue: Catalogue) -> Vocabulary:
        """Return the scene context's vocabulary of a catalogue."""
        return context_of(scene).part("vocabulary", lambda: cls(scene, catalogue), catalogue)

    def colour_of(self, instance: Instance) -> str:
        """An instance's attribute of colour; empty where its surface does not support that."""
        colour = instance.attributes.get("colour", "")
        known = self.scene.imported or not unsupported_colours(colour, instance, self.scene.materials)
        return colour if known else ""

    def appearances_of(self, instance: Instance) -> tuple[Appearance, ...]:
        """Phrases that the catalogue has for an instance's category."""
        return self._catalogue[instance.category].looks if instance.category in self._catalogue else ()

    @cached_method
    def valid_appearances(self, instance: Instance) -> tuple[Appearance, ...]:
        """Phrases of the catalogue that are true of an instance, visible or not."""
        return valid_phrases(self.appearances_of(instance), instance, self.scene.materials)

    @cached_method
    def true_phrases(self, instance: Instance) -> tuple[str, ...]:
        """Phrases that are true of an instance, and visible."""
        return tuple(one.phrase for one in self.valid_appearances(instance) if self._surface.shows(one, instance))

    def unrepeated_phrases(self, instance: Instance) -> tuple[str, ...]:
        """Phrases that are true of an instance, visible, and not repeated by its attributes."""
        return tuple(say for say in self.true_phrases(instance) if not repeats(say, instance))
