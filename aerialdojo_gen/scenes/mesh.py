"""Triangle meshes of the shape vocabulary, and how they become textured parts.

A mesh lives in its prop's own frame (x front, y left, z up, metres) until it is placed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.portable import product
from aerialdojo_gen.scenes.kernels import face_areas, larger_faces, textured, volume_terms
from aerialdojo_gen.scenes.model import Part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A triangle below this area (m²) is a sliver that no renderer shows and whose normal is noise.
_MIN_AREA_M2 = 1e-9
_NO_UV = np.empty((0, 3, 2))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, and where the shape knows better than a projection, their texture coordinates."""

    vertices: Floats  # (n, 3) float64; metres
    faces: Ints  # (m, 3) int32; indices into `vertices`, counter-clockwise seen from outside
    corner_uv: Floats | None = None  # (m, 3, 2) float64 or None

    @property
    def volume_m3(self) -> float:
        """Signed volume: positive for a closed mesh whose faces are wound outwards."""
        return float(volume_terms(*_for_kernels(self.vertices, self.faces)).sum() / 6.0)


Parts = list[tuple[str, Mesh]]
"""Meshes with their materials, or with the roles that these have."""


def mesh(vertices: ArrayLike, faces: ArrayLike, corner_uv: Floats | None = None) -> Mesh:
    """Make a mesh of array-likes; faces of fewer than three distinct vertices or of no area are dropped."""
    v = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    f = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1, 3)
    keep, every = larger_faces(v, f, _MIN_AREA_M2)
    if every:
        return Mesh(v, f, corner_uv)
    return Mesh(v, f[keep], None if corner_uv is None else corner_uv[keep])


def outward(m: Mesh) -> Mesh:
    """Turn the faces of a closed mesh outwards, whichever way they were wound."""
    return flipped(m) if m.volume_m3 < 0 else m


def flipped(m: Mesh) -> Mesh:
    """Reverse the winding of every face."""
    return Mesh(m.vertices, m.faces[:, ::-1].copy(), None if m.corner_uv is None else m.corner_uv[:, ::-1].copy())


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes together without welding them; of none, one without a face."""
    if len(meshes) == 1:
        return meshes[0]
    if not meshes:
        return Mesh(np.empty((0, 3)), np.empty((0, 3), np.int32))
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    uv = None
    if any(m.corner_uv is not None for m in meshes):
        uv = np.concatenate(
            [np.full((len(m.faces), 3, 2), np.nan) if m.corner_uv is None else m.corner_uv for m in meshes]
        )
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + np.int32(o) for m, o in zip(meshes, offsets, strict=True)]),
        uv,
    )


def by_material(parts: Iterable[tuple[str, Mesh]]) -> Parts:
    """Put the meshes of each material together, in the order in which they first come; those without a face go."""
    groups: dict[str, list[Mesh]] = {}
    for material, body in parts:
        if len(body.faces):
            groups.setdefault(material, []).append(body)
    return [(material, merge(bodies)) for material, bodies in groups.items()]


def translated(m: Mesh, offset: ArrayLike) -> Mesh:
    """Move a mesh by (x, y, z) metres."""
    return Mesh(m.vertices + np.asarray(offset, dtype=np.float64), m.faces, m.corner_uv)


def repeated(m: Mesh, offsets: Floats) -> Mesh:
    """Put copies of a mesh together, each moved by one of some offsets (k, 3), metres."""
    count = len(offsets)
    starts = (np.arange(count) * len(m.vertices)).astype(np.int32)
    return Mesh(
        (m.vertices + offsets[:, None]).reshape(-1, 3),
        (m.faces + starts[:, None, None]).reshape(-1, 3),
        None if m.corner_uv is None else np.tile(m.corner_uv, (count, 1, 1)),
    )


def stretched(m: Mesh, factors: Floats) -> Mesh:
    """Stretch a mesh about the origin by positive factors (3,) along x, y and z."""
    return m if (factors == 1.0).all() else Mesh(m.vertices * factors, m.faces, m.corner_uv)


def rotation(x_deg: float, y_deg: float, z_deg: float) -> Floats:
    """Make the (3, 3) matrix that turns about x, then y, then z by right-handed angles in degrees."""
    out = None
    for axis, angle in enumerate((x_deg, y_deg, z_deg)):
        if angle:
            turn = _axis_rotation(axis, angle)
            # As a product with one: without negative zeros.
            out = turn + 0.0 if out is None else product(turn, out)
    return np.eye(3) if out is None else out


def rotated(m: Mesh, matrix: Floats) -> Mesh:
    """Apply a rotation matrix (3, 3)."""
    return Mesh(product(m.vertices, matrix.T), m.faces, m.corner_uv)


def posed(m: Mesh, turn: Floats, at: ArrayLike) -> Mesh:
    """Turn a mesh by a matrix (3, 3), then move it by (x, y, z) metres."""
    return translated(rotated(m, turn), at)


def mirrored(m: Mesh, axis: int) -> Mesh:
    """Mirror in the plane where coordinate `axis` is 0, with faces wound outwards again."""
    v = m.vertices.copy()
    v[:, axis] *= -1.0
    return flipped(Mesh(v, m.faces, m.corner_uv))


def to_part(m: Mesh, material: str, tile_m: float) -> Part:
    """Give a mesh its material and box-projected texture coordinates in its own frame, a tile of `tile_m` metres."""
    given = _NO_UV if m.corner_uv is None else np.ascontiguousarray(m.corner_uv, np.float64)
    vertices, faces, uv = textured(*_for_kernels(m.vertices, m.faces), given, float(tile_m))
    return Part(vertices, faces, uv, material)


def areas(v: Floats, f: Ints) -> Floats:
    """Areas of faces (m, 3) over vertices (n, 3): (m,) float64, square metres."""
    return np.asarray(face_areas(*_for_kernels(v, f)))


def _for_kernels(v: Floats, f: Ints) -> tuple[Floats, Ints]:
    return np.ascontiguousarray(v, np.float64), np.ascontiguousarray(f, np.int32)


def _axis_rotation(axis: int, angle_deg: float) -> Floats:
    # Quarter turns are exact, so that what is meant to stand flush stands flush.
    quarter = round(angle_deg / 90.0)
    if angle_deg == quarter * 90.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    else:
        c, s = float(np.cos(np.radians(angle_deg))), float(np.sin(np.radians(angle_deg)))
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out
