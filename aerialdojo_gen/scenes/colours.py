"""Colours of a surface, sampled evenly over its area, and their everyday names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.geometry.portable import dot, norm
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Material, Part

_SAMPLES = 4096
# A second colour is named from this share of the surface, and of the first colour's share.
_SECOND, _OF_FIRST = 0.2, 0.35
# Two colours of a surface are this far apart in CIELAB.
_APART = 25.0
_NEUTRAL, _AS_MUCH = ("white", "grey", "black"), 1.5


def shown_colours(
    parts: Sequence[Part], materials: Mapping[str, Material]
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Sample some thousand surface colours of parts by area: colours (k, 3) uint8 sRGB and weights (k,)."""
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
        colours = _sampled(part, material, size, max(16, round(_SAMPLES * own / whole)))
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
        return np.rint(dot(share[:, None], np.moveaxis(part.colours[face], 1, 2))).astype(np.uint8)
    assert material.texture is not None
    uv = dot(share[:, None], np.moveaxis(part.uv[face], 1, 2))
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
    means: dict[str, NDArray[np.float64]] = {}
    shares: dict[str, float] = {}
    for rgb, weight in _distinct(colours, weights):
        word = colour_name(rgb)
        shares[word] = shares.get(word, 0.0) + weight
        means[word] = means.get(word, np.zeros(3)) + weight * rgb
    by_share = sorted(shares, key=lambda word: (-shares[word], word))
    if not by_share:
        return ""
    # Shades of one colour, as of a wall in light and shade, are none of two.
    at = {word: _lab((mean / max(shares[word], 1e-300))[None])[0] for word, mean in means.items()}
    others = [word for word in by_share[1:] if norm(at[word] - at[by_share[0]]) >= _APART]
    first, second = by_share[0], others[0] if others else ""
    # Neutral colours come second if both are about equal: "blue and white".
    if first in _NEUTRAL and second not in _NEUTRAL and second and shares[first] < _AS_MUCH * shares[second]:
        first, second = second, first
    both = second and min(shares[first], shares[second]) >= max(
        _SECOND, _OF_FIRST * max(shares[first], shares[second])
    )
    return f"{first} and {second}" if both else first


def _distinct(colours: NDArray[np.uint8], weights: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.int64], float]]:
    """Yield the different colours of colours (k, 3), and the sums of their weights (k,)."""
    reduced = colours.astype(np.int64) // 4 * 4 + 2 if len(colours) > 256 else colours.astype(np.int64)
    found, index = np.unique(reduced, axis=0, return_inverse=True)
    yield from zip(found, np.bincount(index.reshape(-1), weights=weights, minlength=len(found)).tolist(), strict=True)


# Every word that a colour can have.
COLOURS = (
    "white", "black", "grey", "brown", "beige", "red", "orange", "yellow", "green", "turquoise", "blue", "purple",
    "pink",
)  # fmt: skip
_SURVEY = Path(__file__).with_name("colour_names.toml")


def colour_name(rgb: ArrayLike) -> str:
    """Name an sRGB colour by the basic term that people use for it, e.g. ``"brown"``."""
    red, green, blue = np.asarray(rgb).tolist()
    return _nearest_term(red, green, blue)


@lru_cache(1 << 16)
def _nearest_term(red: float, green: float, blue: float) -> str:
    terms, places = _survey()
    return terms[int(np.argmin(norm(places - _lab(np.array([[red, green, blue]])))))]


@cache
def _survey() -> tuple[list[str], NDArray[np.float64]]:
    """Return the terms of the survey's colours, and their places in CIELAB, (k, 3)."""
    rows = [(term, bytes.fromhex(code)) for term, codes in read_toml(_SURVEY).items() for code in codes.split()]
    return [term for term, _ in rows], _lab(np.array([list(code) for _, code in rows]))


# Linear sRGB to XYZ over that of the white point D65.
_XYZ = np.array([[0.4339, 0.3762, 0.1899], [0.2126, 0.7152, 0.0722], [0.0177, 0.1095, 0.8728]])


def _lab(rgb: NDArray[Any]) -> NDArray[np.float64]:
    """Convert sRGB colours (k, 3) of 0 to 255 to CIELAB."""
    v = np.asarray(rgb, dtype=np.float64) / 255.0
    linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    xyz = dot(linear[:, None], _XYZ)
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)
