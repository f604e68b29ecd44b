"""Triangle meshes of the shape vocabulary, and how they become textured parts.

A mesh lives in its prop's own frame (x front, y left, z up, metres) until it is placed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.portable import cross, dot, norm, product
from aerialdojo_gen.scenes.model import Part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A triangle below this area (m²) is a sliver that no renderer shows and whose normal is noise.
_MIN_AREA_M2 = 1e-9
# Faces flatter than this (cosine of the slope) take their texture straight from above, so that a
# gently rolling surface shows no jump of the pattern between its triangles.
_FLAT_COSINE = 0.96


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, and where the shape knows better than a projection, their texture coordinates."""

    vertices: Floats  # (n, 3) float64; metres
    faces: Ints  # (m, 3) int32; indices into `vertices`, counter-clockwise seen from outside
    corner_uv: Floats | None = None  # (m, 3, 2) float64 or None

    @property
    def volume_m3(self) -> float:
        """Signed volume: positive for a closed mesh whose faces are wound outwards."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(dot(a, cross(b, c)).sum() / 6.0)


def mesh(vertices: ArrayLike, faces: ArrayLike, corner_uv: Floats | None = None) -> Mesh:
    """Make a mesh of array-likes; faces of fewer than three distinct vertices or of no area are dropped."""
    v = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    f = np.asarray(faces, dtype=np.int32).reshape(-1, 3)
    keep = areas(v, f) > _MIN_AREA_M2
    if keep.all():
        return Mesh(v, f, corner_uv)
    return Mesh(v, f[keep], None if corner_uv is None else corner_uv[keep])


def outward(m: Mesh) -> Mesh:
    """Turn the faces of a closed mesh outwards, whichever way they were wound."""
    return flipped(m) if m.volume_m3 < 0 else m


def flipped(m: Mesh) -> Mesh:
    """Reverse the winding of every face."""
    return Mesh(m.vertices, m.faces[:, ::-1].copy(), None if m.corner_uv is None else m.corner_uv[:, ::-1].copy())


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes together without welding them."""
    if len(meshes) == 1:
        return meshes[0]
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    uv = None
    if any(m.corner_uv is not None for m in meshes):
        uv = np.concatenate([_uv_or_nan(m) for m in meshes])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + np.int32(o) for m, o in zip(meshes, offsets, strict=True)]),
        uv,
    )


def translated(m: Mesh, offset: ArrayLike) -> Mesh:
    """Move a mesh by (x, y, z) metres."""
    return replace(m, vertices=m.vertices + np.asarray(offset, dtype=np.float64))


def stretched(m: Mesh, factors: Floats) -> Mesh:
    """Stretch a mesh about the origin by positive factors (3,) along x, y and z."""
    return m if (factors == 1.0).all() else replace(m, vertices=m.vertices * factors)


def rotation(x_deg: float, y_deg: float, z_deg: float) -> Floats:
    """Make the (3, 3) matrix that turns about x, then y, then z by right-handed angles in degrees."""
    out = np.eye(3)
    for axis, angle in enumerate((x_deg, y_deg, z_deg)):
        if angle:
            out = product(_axis_rotation(axis, angle), out)
    return out


def rotated(m: Mesh, matrix: Floats) -> Mesh:
    """Apply a rotation matrix (3, 3)."""
    return replace(m, vertices=product(m.vertices, matrix.T))


def posed(m: Mesh, turn: Floats, at: ArrayLike) -> Mesh:
    """Turn a mesh by a matrix (3, 3), then move it by (x, y, z) metres."""
    return translated(rotated(m, turn), at)


def mirrored(m: Mesh, axis: int) -> Mesh:
    """Mirror in the plane where coordinate `axis` is 0, with faces wound outwards again."""
    v = m.vertices.copy()
    v[:, axis] *= -1.0
    return flipped(replace(m, vertices=v))


def to_part(m: Mesh, material: str, tile_m: float) -> Part:
    """Give a mesh its material and box-projected texture coordinates in its own frame, a tile of `tile_m` metres."""
    uv_m = _projected_uv(m)
    if m.corner_uv is not None:
        given = ~np.isnan(m.corner_uv)
        uv_m = np.where(given, m.corner_uv, uv_m)
    corners = m.faces.reshape(-1)
    uv = (uv_m.reshape(-1, 2) / tile_m).astype(np.float32)
    key = np.column_stack([corners.astype(np.int64), np.rint(uv * 4096.0).astype(np.int64)])
    order = np.lexsort(key.T[::-1])
    new = np.empty(len(key), dtype=bool)
    new[:1] = True
    new[1:] = np.any(key[order[1:]] != key[order[:-1]], axis=1)
    index = np.empty(len(key), dtype=np.int32)
    index[order] = np.cumsum(new) - 1
    first = order[new]
    return Part(m.vertices[corners[first]], index.reshape(-1, 3), uv[first], material)


def _uv_or_nan(m: Mesh) -> Floats:
    return np.full((len(m.faces), 3, 2), np.nan) if m.corner_uv is None else m.corner_uv


def areas(v: Floats, f: Ints) -> Floats:
    """Areas of faces (m, 3) over vertices (n, 3): (m,) float64, square metres."""
    return np.asarray(_areas(np.ascontiguousarray(v, np.float64), np.ascontiguousarray(f, np.int32)))


@njit(cache=True)
def _areas(v: Floats, f: Ints) -> Floats:
    # By numpy's order of additions, in one call: meshes are many and small.
    out = np.empty(len(f))
    for n in range(len(f)):
        a, b, c = f[n, 0], f[n, 1], f[n, 2]
        ux, uy, uz = v[b, 0] - v[a, 0], v[b, 1] - v[a, 1], v[b, 2] - v[a, 2]
        wx, wy, wz = v[c, 0] - v[a, 0], v[c, 1] - v[a, 1], v[c, 2] - v[a, 2]
        x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        out[n] = np.sqrt(x * x + y * y + z * z) / 2.0
    return out


def _projected_uv(m: Mesh) -> Floats:
    corners = m.vertices[m.faces]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(norm(normals)[:, None], 1e-300)
    flat = np.abs(normals[:, 2]) > _FLAT_COSINE
    along = np.column_stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))])
    along /= np.maximum(norm(along)[:, None], 1e-12)
    along[flat] = (1.0, 0.0, 0.0)
    up = cross(normals, along)
    up[flat] = (0.0, 1.0, 0.0)
    return np.stack([dot(corners, along[:, None]), dot(corners, up[:, None])], axis=2)


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
