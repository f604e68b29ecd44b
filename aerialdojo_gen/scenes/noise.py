"""Tileable noise and drawing aids for textures; every array wraps around at its borders."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.rng import generator

Floats = NDArray[np.float64]
Texture = Callable[[Floats, np.random.Generator], Floats]
"""Draws a texture in a colour; its pattern depends on the generator alone."""


def value_noise(size: int, cells: int, rng: np.random.Generator, cells_y: int | None = None) -> Floats:
    """Make smooth noise of `cells` lumps along x, (size, size) float64 in about -1 to 1, tileable."""
    rows = cells if cells_y is None else cells_y
    lattice = rng.uniform(-1.0, 1.0, size=(rows, cells))
    x = np.arange(size) * cells / size
    y = np.arange(size) * rows / size
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    ty, tx = _smooth(y - i)[:, None], _smooth(x - j)[None, :]
    # Along x once a row of the lattice, not once a row of the picture.
    rows_mixed = lattice[:, j] * (1 - tx) + lattice[:, (j + 1) % cells] * tx
    return np.asarray(rows_mixed[i] * (1 - ty) + rows_mixed[(i + 1) % rows] * ty)


def fractal(size: int, cells: int, octaves: int, rng: np.random.Generator, gain: float = 0.5) -> Floats:
    """Sum octaves of `value_noise`, scaled to a standard deviation of 1 about 0."""
    total = np.zeros((size, size))
    for k in range(octaves):
        total += gain**k * value_noise(size, min(cells * 2**k, size), rng)
    total -= total.mean()
    return np.asarray(total / total.std())


def cells(size: int, count: int, rng: np.random.Generator) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Make a Worley pattern: distances to the nearest and second nearest of `count` points, and which is nearest.

    Distances are in tiles, (size, size) float64.
    """
    points = rng.uniform(0.0, 1.0, size=(count, 2))
    return _cells(size, points.tobytes())


# A pattern is the same in all colours of its texture.
@lru_cache(maxsize=16)
def _cells(size: int, points: bytes) -> tuple[Floats, Floats, NDArray[np.int64]]:
    axis = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(axis, axis)
    # Few textures need it, and it takes as long to load as all else that a catalogue needs.
    from scipy.spatial import cKDTree

    tree = cKDTree(np.frombuffer(points).reshape(-1, 2), boxsize=np.ones(2))
    distance, index = tree.query(np.column_stack([x.ravel(), y.ravel()]), k=2)
    owner = np.asarray(index, dtype=np.int64)
    first, second = np.asarray(distance, dtype=np.float64).T.reshape(2, size, size)
    found = first, second, owner[:, 0].reshape(size, size)
    for array in found:
        array.flags.writeable = False
    return found


@lru_cache(maxsize=8)
def leaf_pattern(
    name: str, size: int, count: int, length_px: tuple[float, float], tones: int
) -> tuple[Floats, NDArray[np.int64]]:
    """Strew leaves over a tile: brightness (size, size) of the top leaf, and its tone (-1 where there is none)."""
    rng = texture_rng(name)
    light = np.ones((size, size))
    tone = np.full((size, size), -1, dtype=np.int64)
    reach = int(np.ceil(length_px[1] / 2)) + 1
    dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    window = np.arange(-reach, reach + 1)
    for x, y, turn, length, slim, own in rng.uniform(
        (0, 0, 0, length_px[0], 0.35, 0.85), (size, size, 2 * np.pi, length_px[1], 0.6, 1.12), size=(count, 6)
    ):
        u = (dx * np.cos(turn) + dy * np.sin(turn)) / (length / 2)
        v = (-dx * np.sin(turn) + dy * np.cos(turn)) / (length / 2 * slim)
        rim = u**2 + np.abs(v) * (1.0 + 0.4 * np.abs(u))
        i, j = np.nonzero(rim < 1.0)
        rows, columns = (int(y) + window)[i] % size, (int(x) + window)[j] % size
        light[rows, columns] = own * (1.08 - 0.3 * rim[i, j] + np.where(np.abs(v[i, j]) < 0.18, 0.08, 0.0))
        tone[rows, columns] = int(rng.integers(tones))
    return light, tone


def leaves(image: Floats, name: str, count: int, length_px: tuple[float, float], tones: Floats) -> Floats:
    """Lay the leaves of `leaf_pattern` over an image, each in one of the tones (n, 3)."""
    light, tone = leaf_pattern(name, len(image), count, length_px, len(tones))
    return np.where((tone >= 0)[..., None], tones[tone] * light[..., None], image)


def balanced(image: Floats, colour: Floats) -> Floats:
    """Scale an image so that its mean is the colour, also when seen from afar."""
    return np.asarray(image * (colour / np.maximum(image.mean(axis=(0, 1)), 1.0)))


def texture_rng(name: str) -> np.random.Generator:
    """Give the generator of a texture: the pattern depends on its name alone, not on its colour."""
    return generator(0, "texture", name)


def shade(colour: Floats, value: Floats) -> Floats:
    """Multiply a colour (3,) or an image (H, W, 3) by a brightness (H, W)."""
    return np.asarray(np.broadcast_to(colour, (*value.shape, 3)) * value[..., None])


def _smooth(t: Floats) -> Floats:
    return t * t * (3.0 - 2.0 * t)
