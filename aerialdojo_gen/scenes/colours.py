"""Colours of a surface, sampled evenly over its area, and their everyday names."""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Material, Part

_SAMPLES = 4096
# A second colour is named from this share of the surface, and of the first colour's share.
_SECOND, _OF_FIRST = 0.2, 0.35
_NEUTRAL, _AS_MUCH = ("white", "grey", "black"), 1.5


def shown_colours(
    parts: Sequence[Part], materials: Mapping[str, Material], n: int = _SAMPLES
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Sample about n surface colours of parts by area: colours (k, 3) uint8 sRGB and weights (k,)."""
    found: list[NDArray[np.uint8]] = []
    weights: list[NDArray[np.float64]] = []
    sizes = [areas(part.vertices, part.faces) for part in parts]
    whole = sum(float(size.sum()) for size in sizes)
    for part, size in zip(parts, sizes, strict=True):
        own, material = float(size.sum()), materials[part.material]
        if own <= 0.0:
            continue
        if part.colours is None and material.texture is None:
            found.append(np.array([material.colour], dtype=np.uint8))
            weights.append(np.array([own]))
            continue
        colours = _sampled(part, material, size, max(16, round(n * own / whole)))
        found.append(colours)
        weights.append(np.full(len(colours), own / max(len(colours), 1)))
    if not found:
        return np.zeros((0, 3), dtype=np.uint8), np.zeros(0)
    weight = np.concatenate(weights)
    return np.concatenate(found), weight / max(float(weight.sum()), 1e-300)


def _sampled(part: Part, material: Material, size: NDArray[np.float64], n: int) -> NDArray[np.uint8]:
    """Colours at n places evenly over the area of a part, fewer where its texture has holes: (k, 3)."""
    k = np.arange(n)
    reach = np.cumsum(size)
    face = part.faces[np.minimum(np.searchsorted(reach, (k + 0.5) / n * reach[-1]), len(size) - 1)]
    # Quasi-random points: multiples of the plastic number fill the unit square evenly.
    a, b = (0.5 + k / 1.324717957244746) % 1.0, (0.5 + k / 1.7548776662466927) % 1.0
    a, b = np.where(a + b > 1.0, 1.0 - a, a), np.where(a + b > 1.0, 1.0 - b, b)
    share = np.stack([1.0 - a - b, a, b], axis=1)
    if part.colours is not None:
        return np.rint(np.einsum("nk,nkc->nc", share, part.colours[face].astype(np.float64))).astype(np.uint8)
    assert material.texture is not None
    uv = np.einsum("nk,nkc->nc", share, part.uv[face].astype(np.float64))
    row, column = texel(uv, material.texture.shape[0], material.texture.shape[1])
    if material.mask is None:
        return np.asarray(material.texture[row, column])
    return np.asarray(material.texture[row, column][material.mask[row, column]])


def texel(uv: NDArray[np.float64], rows: int, columns: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the texels (row, column), (n,) each, at texture coordinates (n, 2), v up; textures repeat."""
    column = np.floor(uv[:, 0] % 1.0 * columns).astype(np.int64) % columns
    row = np.floor(-uv[:, 1] % 1.0 * rows).astype(np.int64) % rows
    return row, column


def colour_words(colours: NDArray[np.uint8], weights: NDArray[np.float64]) -> str:
    """Name the colour of a surface, or the two that it has most of, e.g. ``"blue and white"``."""
    shares = named_shares(colours, weights)
    ranked = sorted(shares, key=lambda word: (-shares[word], word))
    if not ranked:
        return ""
    first, second = ranked[0], ranked[1] if len(ranked) > 1 else ""
    # Neutral colours come second if both are about equal: "blue and white".
    if first in _NEUTRAL and second not in _NEUTRAL and second and shares[first] < _AS_MUCH * shares[second]:
        first, second = second, first
    both = second and min(shares[first], shares[second]) >= max(
        _SECOND, _OF_FIRST * max(shares[first], shares[second])
    )
    return f"{first} and {second}" if both else first


def named_shares(colours: NDArray[np.uint8], weights: NDArray[np.float64]) -> dict[str, float]:
    """Sum weights (k,) by colour name of colours (k, 3)."""
    reduced = colours.astype(np.int64) // 4 * 4 + 2 if len(colours) > 256 else colours.astype(np.int64)
    found, index = np.unique(reduced, axis=0, return_inverse=True)
    summed = np.bincount(index.reshape(-1), weights=weights, minlength=len(found))
    shares: dict[str, float] = {}
    for rgb, weight in zip(found, summed.tolist(), strict=True):
        word = colour_name(rgb)
        shares[word] = shares.get(word, 0.0) + weight
    return shares


# Upper ends of the hues, degrees.
_HUES = (
    (15, "red"),
    (42, "orange"),
    (68, "yellow"),
    (165, "green"),
    (195, "turquoise"),
    (255, "blue"),
    (290, "purple"),
    (335, "pink"),
    (361, "red"),
)
# Every word that a colour can have.
COLOURS = (
    "white", "black", "grey", "brown", "beige", "red", "orange", "yellow", "green", "turquoise", "blue", "purple",
    "pink",
)  # fmt: skip


def colour_name(rgb: ArrayLike) -> str:
    """Name an sRGB colour by one of about a dozen everyday words, e.g. ``"brown"``."""
    red, green, blue = (float(c) / 255.0 for c in np.asarray(rgb, dtype=np.float64))
    hue, light, saturation = colorsys.rgb_to_hls(red, green, blue)
    if light > 0.9:
        return "white"
    if light < 0.12:
        return "black"
    if saturation < 0.16:
        return "grey" if light < 0.82 else "white"
    word = next(name for end, name in _HUES if hue * 360 < end)
    if word in ("red", "orange", "yellow") and light < 0.42 and saturation < 0.75:
        return "brown"
    if word in ("orange", "yellow") and light > 0.68:
        return "beige"
    return word
