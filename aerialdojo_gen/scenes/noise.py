"""Tileable noise and drawing aids for textures; every array wraps around at its borders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from aerialdojo_gen.rng import generator

Floats = NDArray[np.float64]


def value_noise(size: int, cells: int, rng: np.random.Generator, cells_y: int | None = None) -> Floats:
    """Make smooth noise of `cells` lumps along x, (size, size) float64 in about -1 to 1, tileable."""
    rows = cells if cells_y is None else cells_y
    lattice = rng.uniform(-1.0, 1.0, size=(rows, cells))
    x = np.arange(size) * cells / size
    y = np.arange(size) * rows / size
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    ty, tx = _smooth(y - i)[:, None], _smooth(x - j)[None, :]
    a, b = lattice[np.ix_(i, j)], lattice[np.ix_(i, (j + 1) % cells)]
    c, d = lattice[np.ix_((i + 1) % rows, j)], lattice[np.ix_((i + 1) % rows, (j + 1) % cells)]
    return np.asarray((a * (1 - tx) + b * tx) * (1 - ty) + (c * (1 - tx) + d * tx) * ty)


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
    axis = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(axis, axis)
    distance, owner = _nearest_two(points, np.column_stack([x.ravel(), y.ravel()]))
    first, second = distance.T.reshape(2, size, size)
    return first, second, owner[:, 0].reshape(size, size)


def texture_rng(name: str) -> np.random.Generator:
    """Give the generator of a texture: the pattern depends on its name alone, not on its colour."""
    return generator(0, "texture", name)


def shade(colour: Floats, value: Floats) -> Floats:
    """Multiply a colour (3,) or an image (H, W, 3) by a brightness (H, W)."""
    return np.asarray(np.broadcast_to(colour, (*value.shape, 3)) * value[..., None])


def _nearest_two(points: Floats, queries: Floats) -> tuple[Floats, NDArray[np.int64]]:
    distance, index = cKDTree(points, boxsize=np.ones(2)).query(queries, k=2)
    return np.asarray(distance, dtype=np.float64), np.asarray(index, dtype=np.int64)


def _smooth(t: Floats) -> Floats:
    return t * t * (3.0 - 2.0 * t)
