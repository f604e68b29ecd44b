"""What a mesh file holds, before anything is believed of it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.imports.cutting import Region, cut

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

    def some(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> RawNode:
        """Return the node with some of its faces alone, in the order given; vertices stay as they are."""
        return RawNode(self.name, self.vertices, self.faces[rows], self.colours[rows])

    def placed(self, vertices: NDArray[np.float64], faces: NDArray[np.int64] | None = None) -> RawNode:
        """Return the node with other vertices, and where given with other indices into them, face by face."""
        return RawNode(self.name, vertices, self.faces if faces is None else faces, self.colours)


def some_of(body: RawNode, rows: NDArray[np.int64] | NDArray[np.bool_]) -> RawNode:
    """Make a node of some faces of another, with the vertices that they need."""
    used, faces = np.unique(body.faces[rows], return_inverse=True)
    return body.some(rows).placed(body.vertices[used], faces.reshape(-1, 3))


def cut_to(body: RawNode, region: Region) -> RawNode:
    """Make a node of what of another lies within a region of the plan; without faces where nothing does."""
    pieces = cut(body.vertices, body.faces, region)
    n = len(pieces.source)
    # What faces have comes from their source; what corners have is mixed by `pieces.weights`.
    return body.some(pieces.source).placed(pieces.corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


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
