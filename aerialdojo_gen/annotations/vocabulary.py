"""Words and noun phrases of a scene's instances, and what is true of their appearance.

Colours, phrases of the catalogue, and what the ground hides are measured on the mesh.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from aerialdojo_gen.annotations.phrases import LISTS, TABLES, CategoryWords, group_of, noun_of, spoken, words_of
from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.scenes.appearances import Appearance, valid_phrases
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.colours import colour_name, shown_colours
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Instance, Material, Scene

Floats = NDArray[np.float64]

# Colour words and the results of `colour_name` that each may stand for.
SHADES: Mapping[str, frozenset[str]] = {word: frozenset(names.split()) for word, names in TABLES["shades"].items()}
# Minimum share of the surface: for a colour named alone, and for one of several or of a part.
_ALONE, _AMONG = 0.1, 0.03
# Attributes that do not name a part.
_NOT_PARTS = frozenset({"colour", "size", "material", "place"})
_STEM = 4
_STOP_WORDS = frozenset({"a", "an", "the", "of", "on", "in", "its", "it", "and", "with", "without", "around", "full"})
# Categories of imported meshes that are never objects.
NON_OBJECTS = frozenset({"ground", "clutter", "slab", "terrain"})
# Category of imported nodes without a meaningful name; a person has to set it.
UNKNOWN = "object"
GROUND = ("ground", "terrain", "river")
# A body that stands on the ground touches it.
_TOUCH_M = 0.01
_MAX_HIDDEN = 0.5


def colour_shares(instance: Instance, materials: Mapping[str, Material]) -> dict[str, float]:
    """Return the share of an instance's surface by colour name."""
    if any(materials[part.material].atlas for part in instance.parts):
        # Only the part of an atlas texture that the instance shows counts, not the whole image.
        colours, weights = shown_colours(instance.parts, materials)
        return _shares_by_name(colours // 8 * 8 + 4, weights)
    shares: dict[str, float] = {}
    whole = 0.0
    for part in instance.parts:
        area = float(areas(part.vertices, part.faces).sum())
        whole += area
        for name, share in _material_shares(materials[part.material]).items():
            shares[name] = shares.get(name, 0.0) + area * share
    return {name: area / whole for name, area in shares.items()} if whole > 0.0 else {}


@lru_cache(maxsize=1024)
def _material_shares(material: Material) -> dict[str, float]:
    """Return a material's share by colour name: stripes count as two colours, not as their mean."""
    pixels = np.array([material.colour])
    if material.texture is not None:
        step = max(1, material.texture.shape[0] // 16)
        pixels = np.concatenate([material.texture[::step, ::step].reshape(-1, 3), np.tile(pixels, (64, 1))])
        pixels = pixels // 8 * 8 + 4
    return _shares_by_name(pixels, np.ones(len(pixels)), len(pixels))


def _shares_by_name(
    colours: NDArray[np.integer], weights: NDArray[np.float64], whole: float = 1.0
) -> dict[str, float]:
    found, index = np.unique(colours, axis=0, return_inverse=True)
    shares: dict[str, float] = {}
    for rgb, weight in zip(found, np.bincount(index.reshape(-1), weights, len(found)), strict=True):
        for name in _colour_names(rgb):
            shares[name] = shares.get(name, 0.0) + float(weight) / whole
    return shares


def _colour_names(rgb: NDArray[np.integer]) -> set[str]:
    names = {colour_name(rgb)}
    middle = (float(rgb.max()) + float(rgb.min())) / 2.0
    if names == {"grey"} and float(np.ptp(rgb)) >= 0.2 * middle:
        # Dark saturated colours are classified as grey, but people see the hue.
        names.add(colour_name(np.clip(middle + 3.0 * (rgb - middle), 0, 255)))
    return names


def unsupported_colours(text: str, instance: Instance, materials: Mapping[str, Material]) -> list[str]:
    """List the colours of a text that the instance's surface does not have."""
    words = re.findall(r"[a-z]+", text.lower())
    colours = [word for word in words if word in SHADES]
    shares = colour_shares(instance, materials)
    least = _ALONE if [word for word in words if word not in LISTS["degrees"]] == colours[:1] else _AMONG
    return [word for word in colours if sum(shares.get(name, 0.0) for name in SHADES[word]) < least]


def repeats(say: str, instance: Instance) -> bool:
    """Whether a phrase repeats an attribute of its instance."""
    stems = _stems(say)
    for key, value in instance.attributes.items():
        own = _stems(value)
        lacking = value.startswith("without ") and say.startswith("no ")
        if key not in _NOT_PARTS and len(own) >= (1 if lacking else 2) and own <= stems:
            return True
    return False


def _stems(text: str) -> set[str]:
    return {word[:_STEM] for word in re.findall(r"[^\W_]+", text.lower()) if word not in _STOP_WORDS}


class Surface:
    """The upper surface of a scene's ground and water."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._last: tuple[Instance, NDArray[np.bool_], Floats] | None = None

    @cached_property
    def _triangles(self) -> tuple[shapely.STRtree, Floats]:
        return ground_triangles(self._scene, "*")

    def hidden(self, instance: Instance, faces: NDArray[np.int64]) -> float:
        """Share, 0 to 1, of the area of `faces` (indices into the instance's faces) that lies below the surface."""
        under, areas = self._under(instance)
        return float(areas[faces][under[faces]].sum() / max(areas[faces].sum(), 1e-12))

    def _under(self, instance: Instance) -> tuple[NDArray[np.bool_], Floats]:
        """Return which face centres lie below the surface, and the faces' areas."""
        if self._last is None or self._last[0] is not instance:
            corners = instance.vertices[instance.faces]
            a, b, c = np.moveaxis(corners, 1, 0)
            middles = corners.mean(axis=1)
            tree, ground = self._triangles
            points, over = tree.query(shapely.points(middles[:, :2]), predicate="intersects")
            heights = _heights(ground[over], middles[points, :2])
            below = (heights > middles[points, 2] + _TOUCH_M) & (heights < instance.bounds[1, 2])
            under = np.zeros(len(middles), bool)
            under[points[below]] = True
            self._last = instance, under, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
        return self._last[1:]

    def shows(self, appearance: Appearance, instance: Instance) -> bool:
        """Whether at least half of each part that a phrase mentions, and of each counted copy, is visible."""
        pieces = [faces for name in appearance.count for faces in instance.copies_of(name)]
        pieces += [faces for name in appearance.parts if len(faces := instance.faces_of(name))]
        return all(self.hidden(instance, faces) <= _MAX_HIDDEN for faces in pieces)


def ground_triangles(scene: Scene, pattern: str) -> tuple[shapely.STRtree, Floats]:
    """Ground triangles of materials that match, from above as a tree, and their corners, (n, 3, 3)."""
    found = [
        part.vertices[part.faces]
        for thing in scene.instances
        if thing.category in GROUND
        for part in thing.parts
        if any(fnmatchcase(part.material, one) for one in pattern.split("|"))
    ]
    corners = np.concatenate(found) if found else np.zeros((0, 3, 3))
    shapes = shapely.polygons(corners[:, :, :2])
    solid = shapely.area(shapes) > 1e-6
    return shapely.STRtree(shapes[solid]), corners[solid]


def _heights(triangles: Floats, points: Floats) -> Floats:
    """Height of each triangle's plane, (n, 3, 3), over a point of the plane, (n, 2)."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    away = points - triangles[:, 0, :2]
    return np.asarray(triangles[:, 0, 2] - (normals[:, :2] * away).sum(axis=1) / normals[:, 2])


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
