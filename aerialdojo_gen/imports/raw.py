"""What a mesh file holds, before anything is believed of it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.imports.cutting import Region, cut

GREY = (168, 164, 156)


# Columns of `RawNode.corners`: texture coordinates, v up, and sRGB, 0-255, NaN where a corner has no colour.
CORNER = ("u", "v", "red", "green", "blue")


@dataclass(frozen=True, eq=False)
class RawSurface:
    """A material of a file."""

    name: str = ""  # As in the file
    colour: tuple[int, int, int] = GREY  # sRGB, 0-255; a texture's mean where it has one
    texture: NDArray[np.uint8] | None = None  # (H, W, 3) uint8 or None; sRGB; row 0 is the top (v = 1)
    mask: NDArray[np.bool_] | None = None  # Where the texture is there; None where it is everywhere
    double_sided: bool = False  # Whether it is there from both sides
    unlit: bool = False  # Whether it is to be drawn without light
    jpeg: bytes = b""  # The texture's file, where that is a JPEG and the texture is just what it decodes to
    notes: tuple[str, ...] = ()  # What was lost or changed of it, for the user to read

    @cached_property
    def digest(self) -> str:
        """Of all that is drawn of it, hexadecimal: the same whatever it is called and wherever it stands."""
        sha = hashlib.sha256(repr((self.colour, self.double_sided, self.unlit)).encode())
        for array in (self.texture, self.mask):
            if array is not None:
                sha.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return sha.hexdigest()


@dataclass(frozen=True, eq=False)
class RawNode:
    """A node of a file: its name and its triangles."""

    name: str  # As in the file; empty where it has none
    vertices: NDArray[np.float64]  # In the file's own axes and units; anything may stand in it, NaN too
    faces: NDArray[np.int64]  # (m, 3) int64; indices into `vertices`
    colours: NDArray[np.uint8]  # (m, 3) uint8; sRGB of each face
    surface: NDArray[np.int32] | None = None  # (m,) int32 or None
    corners: NDArray[np.float32] | None = None  # (m, 3, 5) float32 or None
    surfaces: tuple[RawSurface, ...] = ()

    def select_faces(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> RawNode:
        """Return the node with some of its faces alone, in the order given; vertices stay as they are."""
        return RawNode(
            self.name, self.vertices, self.faces[rows], self.colours[rows],
            None if self.surface is None else self.surface[rows],
            None if self.corners is None else self.corners[rows], self.surfaces,
        )  # fmt: skip

    def with_vertices(self, vertices: NDArray[np.float64], faces: NDArray[np.int64] | None = None) -> RawNode:
        """Return the node with other vertices, and where given with other indices into them, face by face."""
        faces = self.faces if faces is None else faces
        return RawNode(self.name, vertices, faces, self.colours, self.surface, self.corners, self.surfaces)


def extract_faces(body: RawNode, rows: NDArray[np.int64] | NDArray[np.bool_]) -> RawNode:
    """Make a node of some faces of another, with the vertices that they need."""
    used, faces = np.unique(body.faces[rows], return_inverse=True)
    return body.select_faces(rows).with_vertices(body.vertices[used], faces.reshape(-1, 3))


def clip_node(body: RawNode, region: Region) -> RawNode:
    """Make a node of what of another lies within a region of the plan; without faces where nothing does."""
    pieces = cut(body.vertices, body.faces, region)
    n = len(pieces.source)
    # What faces have comes from their source; what corners have is mixed by their weights.
    kept = body.select_faces(pieces.source)
    if kept.corners is not None:
        kept = replace(kept, corners=np.einsum("kij,kjc->kic", pieces.weights, kept.corners).astype(np.float32))
    return kept.with_vertices(pieces.corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


def default_colours(n: int) -> NDArray[np.uint8]:
    """Return the colour of faces whose file has none, (n, 3) uint8."""
    return np.tile(np.array(GREY, dtype=np.uint8), (n, 1))


def merge_nodes(name: str, bodies: Sequence[RawNode]) -> RawNode:
    """Make one node of several of a file; the same one whatever their order."""
    bodies = sorted(bodies, key=_digest)
    vertices, faces = soup(bodies)
    colours = np.concatenate([b.colours for b in bodies])
    whole = RawNode(name, vertices, faces.astype(np.int64), colours)
    if all(b.surface is None and b.corners is None for b in bodies):
        return whole
    first: dict[tuple[RawSurface, ...], int] = {}
    for b in bodies:
        first.setdefault(b.surfaces, sum(map(len, first)))
    surface, corners = [], []
    for b in bodies:
        m = len(b.faces)
        own = np.full(m, -1, np.int32) if b.surface is None else b.surface
        surface.append(np.where(own < 0, own, own + first[b.surfaces]).astype(np.int32))
        corners.append(empty_corners(m) if b.corners is None else b.corners)
    surfaces = tuple(s for several in first for s in several)
    return RawNode(name, vertices, whole.faces, colours, np.concatenate(surface), np.concatenate(corners), surfaces)


def empty_corners(n: int) -> NDArray[np.float32]:
    """Return what the corners of n faces carry that have neither texture coordinates nor colours, (n, 3, 5)."""
    out = np.full((n, 3, len(CORNER)), np.nan, dtype=np.float32)
    out[..., :2] = 0.0
    return out


def sort_by_position(bodies: Sequence[RawNode]) -> list[RawNode]:
    """Sort nodes by where they are: a file's nodes come in an order that depends on its reader and writer.

    West before east, then south before north, then low before high, by their lower corners; nodes of one corner by a
    digest of their triangles. Vertices must be finite.
    """
    return sorted(bodies, key=lambda body: (body.vertices.min(axis=0).tolist(), _digest(body)))


def _digest(body: RawNode) -> bytes:
    digest = hashlib.sha256()
    for array in (body.vertices, body.faces, body.colours, body.surface, body.corners):
        if array is not None:
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
