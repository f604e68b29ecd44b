"""Check what a text says of its object's appearance against the mesh: the catalogue's phrases, and colours."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.annotations.words import LISTS, TABLES
from aerialdojo_gen.scenes.colours import colour_name, shown_colours
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Instance, Material

# Colour words and the results of `colour_name` that each may stand for.
SHADES: Mapping[str, frozenset[str]] = {word: frozenset(names.split()) for word, names in TABLES["shades"].items()}
# Minimum share of the surface: for a colour named alone, and for one of several or of a part.
_ALONE, _AMONG = 0.1, 0.03


def colour_shares(instance: Instance, materials: Mapping[str, Material]) -> dict[str, float]:
    """Return the share of an instance's surface by colour name."""
    shares: dict[str, float] = {}
    whole = 0.0
    if any(materials[part.material].atlas for part in instance.parts):
        # Only the part of an atlas texture that the instance shows counts, not the whole image.
        return _pixel_shares(*shown_colours(instance.parts, materials))
    for part in instance.parts:
        area = float(areas(part.vertices, part.faces).sum())
        whole += area
        for name, share in _material_shares(materials[part.material]).items():
            shares[name] = shares.get(name, 0.0) + area * share
    return {name: area / whole for name, area in shares.items()} if whole > 0.0 else {}


def _pixel_shares(colours: NDArray[np.uint8], weights: NDArray[np.float64]) -> dict[str, float]:
    found, index = np.unique(colours // 8 * 8 + 4, axis=0, return_inverse=True)
    shares: dict[str, float] = {}
    for rgb, weight in zip(found, np.bincount(index.reshape(-1), weights=weights, minlength=len(found)), strict=True):
        for name in _colour_names(rgb):
            shares[name] = shares.get(name, 0.0) + float(weight)
    return shares


@lru_cache(maxsize=1024)
def _material_shares(material: Material) -> dict[str, float]:
    """Return a material's share by colour name: stripes count as two colours, not as their mean."""
    pixels = np.array([material.colour])
    if material.texture is not None:
        step = max(1, material.texture.shape[0] // 16)
        pixels = np.concatenate([material.texture[::step, ::step].reshape(-1, 3), np.tile(pixels, (64, 1))])
    found, counts = np.unique(pixels // 8 * 8 + 4 if len(pixels) > 1 else pixels, axis=0, return_counts=True)
    shares: dict[str, float] = {}
    for rgb, count in zip(found, counts, strict=True):
        for name in _colour_names(rgb):
            shares[name] = shares.get(name, 0.0) + float(count) / len(pixels)
    return shares


def _colour_names(rgb: NDArray[np.integer]) -> set[str]:
    names = {colour_name(rgb)}
    middle = (float(rgb.max()) + float(rgb.min())) / 2.0
    if names == {"grey"} and float(np.ptp(rgb)) >= 0.2 * middle:
        # Dark saturated colours are classified as grey, but people see the hue.
        names.add(colour_name(np.clip(middle + 3.0 * (rgb - middle), 0, 255)))
    return names


def colour_words(text: str) -> list[str]:
    """List the colour words of a text, in order."""
    return [word for word in re.findall(r"[a-z]+", text.lower()) if word in SHADES]


def unsupported_colours(text: str, instance: Instance, materials: Mapping[str, Material]) -> list[str]:
    """List the colours of a text that the instance's surface does not have."""
    words = colour_words(text)
    shares = colour_shares(instance, materials)
    alone = [word for word in re.findall(r"[a-z]+", text.lower()) if word not in LISTS["degrees"]] == words[:1]
    least = _ALONE if alone else _AMONG
    return [word for word in words if sum(shares.get(name, 0.0) for name in SHADES[word]) < least]


# Attributes that do not name a part.
_NOT_PARTS = frozenset({"colour", "size", "material", "place"})
_STEM = 4
_STOP_WORDS = frozenset({"a", "an", "the", "of", "on", "in", "its", "it", "and", "with", "without", "around", "full"})


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
