"""Content of a mesh file before validation."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.soup import soup

GREY = (168, 164, 156)


# Columns of `RawNode.corners`: texture coordinates, v up, and sRGB, 0-255, NaN where a corner has no colour.
CORNER = ("u", "v", "red", "green", "blue")


@dataclass(frozen=True, eq=False)
class RawSurface:
    """A material of a file."""

    name: str = ""  # As in the file
    colour: tuple[int, int, int] = GREY  # sRGB, 0-255; a texture's mean where it has one
    texture: NDArray[np.uint8] | None = None  # (H, W, 3) uint8 or None; sRGB; row 0 is the top (v = 1)
    mask: NDArray[np.bool_] | None = None  # Opaque pixels; None if all are
    double_sided: bool = False  # Whether both sides are drawn
    unlit: bool = False  # Whether it is drawn without lighting
    jpeg: bytes = b""  # The texture's file, if it is a JPEG that decodes to exactly the texture
    notes: tuple[str, ...] = ()  # Losses and changes, for the user

    @cached_property
    def digest(self) -> str:
        """Digest of everything that is drawn, hexadecimal, independent of names."""
        sha = hashlib.sha256(repr((self.colour, self.double_sided, self.unlit)).encode())
        for array in (self.texture, self.mask):
            if array is not None:
                sha.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return sha.hexdigest()


@dataclass(frozen=True, eq=False)
class RawNode:
    """A node of a file: name and triangles."""

    name: str  # As in the file; empty where it has none
    vertices: NDArray[np.float64]  # In the file's axes and units; may contain NaN
    faces: NDArray[np.int64]  # (m, 3) int64; indices into `vertices`
    colours: NDArray[np.uint8]  # (m, 3) uint8; sRGB of each face
    surface: NDArray[np.int32] | None = None  # (m,) int32 or None
    corners: NDArray[np.float32] | None = None  # (m, 3, 5) float32 or None
    surfaces: tuple[RawSurface, ...] = ()

    @property
    def normals(self) -> NDArray[np.float64]:
        """Normal of each face, (m, 3), as long as twice its area."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    def select_faces(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> RawNode:
        """Return the node with a subset of its faces; vertices stay."""
        return replace(
            self, faces=self.faces[rows], colours=self.colours[rows],
            surface=None if self.surface is None else self.surface[rows],
            corners=None if self.corners is None else self.corners[rows],
        )  # fmt: skip

    def with_vertices(self, vertices: NDArray[np.float64], faces: NDArray[np.int64] | None = None) -> RawNode:
        """Return the node with other vertices, and optionally other indices."""
        return replace(self, vertices=vertices, faces=self.faces if faces is None else faces)


def bounds_of(bodies: Sequence[RawNode]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner of bodies, (3,) each; all are finite."""
    points = np.concatenate([b.vertices for b in bodies])
    return points.min(axis=0), points.max(axis=0)


def extract_faces(body: RawNode, rows: NDArray[np.int64] | NDArray[np.bool_]) -> RawNode:
    """Extract faces as a node with only the vertices they need."""
    used, faces = np.unique(body.faces[rows], return_inverse=True)
    return body.select_faces(rows).with_vertices(body.vertices[used], faces.reshape(-1, 3))


def default_colours(n: int) -> NDArray[np.uint8]:
    """Return the default face colours, (n, 3) uint8."""
    return np.tile(np.array(GREY, dtype=np.uint8), (n, 1))


def merge_nodes(name: str, bodies: Sequence[RawNode]) -> RawNode:
    """Merge nodes into one, independent of their order."""
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
    """Return corners without texture coordinates and colours, (n, 3, 5)."""
    out = np.full((n, 3, len(CORNER)), np.nan, dtype=np.float32)
    out[..., :2] = 0.0
    return out


def sort_by_position(bodies: Sequence[RawNode]) -> list[RawNode]:
    """Sort nodes by their lower corners, then by a digest: their order in a file is its writer's. All are finite."""
    return sorted(bodies, key=lambda body: (body.vertices.min(axis=0).tolist(), _digest(body)))


def _digest(body: RawNode) -> bytes:
    digest = hashlib.sha256()
    for array in (body.vertices, body.faces, body.colours, body.surface, body.corners):
        if array is not None:
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
