"""Products and functions of floats whose last bit does not depend on the processor.

NumPy leaves products of matrices and lengths of vectors to OpenBLAS, and exp, powers and arctan2 of arrays to vector
code: both take other instructions on other processors, and these round otherwise. Here sums have a fixed order, and
functions are those of the C library, as in `math`; `np.sin`, `np.cos` and `np.hypot` are these too. The C library has
one variant for processors with FMA, which is in all since 2013, and one for older ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats

UP = np.array([0.0, 0.0, 1.0])


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar products of the few components along the last axis; the other axes are broadcast."""
    total = a[..., 0] * b[..., 0]
    for k in range(1, a.shape[-1]):
        total = total + a[..., k] * b[..., k]
    return np.asarray(total)


def norm(v: Floats) -> Floats:
    """Lengths of vectors along the last axis."""
    return np.asarray(np.sqrt(dot(v, v)))


def unit(v: Floats) -> Floats:
    """Vectors along the last axis, each divided by its length."""
    return v / norm(v)[..., None]


def distances_along(line: Floats) -> Floats:
    """Distance along a line of n points, (n, 2) or (n, 3), at each of them: (n,), the first 0."""
    return np.concatenate([[0.0], np.cumsum(norm(np.diff(line, axis=0)))])


def cross(a: Floats, b: Floats) -> Floats:
    """Vector products along the last axis."""
    # np.cross spends ten times the arithmetic on checking axes, and meshes are many and small.
    x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out = np.empty((*x.shape, 3))
    out[..., 0] = x
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def product(a: Floats, b: Floats) -> Floats:
    """Matrix product of (..., k) and (k, m)."""
    rows = np.ascontiguousarray(a, np.float64).reshape(-1, a.shape[-1])
    out = _product(rows, np.ascontiguousarray(b, np.float64))
    return np.asarray(out.reshape(*a.shape[:-1], b.shape[1]))


def exp(x: ArrayLike) -> Floats:
    """Exponentials of numbers, of any shape."""
    values = np.asarray(x, np.float64)
    return np.asarray(_exp(values.ravel()).reshape(values.shape))


def power(base: ArrayLike, exponent: ArrayLike) -> Floats:
    """Numbers to the power of others; shapes are broadcast."""
    x, y = np.broadcast_arrays(np.asarray(base, np.float64), np.asarray(exponent, np.float64))
    return np.asarray(_power(x.ravel(), y.ravel()).reshape(x.shape))


def atan2(y: ArrayLike, x: ArrayLike) -> Floats:
    """Angles of the directions (x, y), radians in [-π, π]; shapes are broadcast."""
    up, along = np.broadcast_arrays(np.asarray(y, np.float64), np.asarray(x, np.float64))
    return np.asarray(_atan2(up.ravel(), along.ravel()).reshape(up.shape))


@njit(cache=True)
def _product(a: Floats, b: Floats) -> Floats:
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            for k in range(a.shape[1]):
                out[i, j] += a[i, k] * b[k, j]
    return out


@njit(cache=True)
def _exp(x: Floats) -> Floats:
    return np.exp(x)


@njit(cache=True)
def _power(x: Floats, y: Floats) -> Floats:
    return np.power(x, y)


@njit(cache=True)
def _atan2(y: Floats, x: Floats) -> Floats:
    return np.arctan2(y, x)
