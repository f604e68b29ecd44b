"""What a mesh file holds, before anything is believed of it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.soup import soup

GREY = (168, 164, 156)


@dataclass(frozen=True, eq=False)
class RawNode:
    """A node of a file: its name and its triangles.

    Attributes
    ----------
    name : str
        As in the file; empty where it has none.
    vertices : (n, 3) float64
        In the file's own axes and units; anything may stand in it, NaN too.
    faces : (m, 3) int64
        Indices into `vertices`.
    colours : (m, 3) uint8
        sRGB of each face.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8]


def plain(n: int) -> NDArray[np.uint8]:
    """Return the colour of faces whose file has none, (n, 3) uint8."""
    return np.tile(np.array(GREY, dtype=np.uint8), (n, 1))


def joined(name: str, bodies: Sequence[RawNode]) -> RawNode:
    """Make one node of several; the same one whatever their order."""
    bodies = sorted(bodies, key=_digest)
    vertices, faces = soup(bodies)
    return RawNode(name, vertices, faces.astype(np.int64), np.concatenate([b.colours for b in bodies]))


def in_place_order(bodies: Sequence[RawNode]) -> list[RawNode]:
    """Sort nodes by where they are: a file's nodes come in an order that depends on its reader and writer.

    West before east, then south before north, then low before high, by their lower corners; nodes of one corner by a
    digest of their triangles. Vertices must be finite.
    """
    return sorted(bodies, key=lambda body: (body.vertices.min(axis=0).tolist(), _digest(body)))


def _digest(body: RawNode) -> bytes:
    digest = hashlib.sha256()
    for array in (body.vertices, body.faces, body.colours):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
