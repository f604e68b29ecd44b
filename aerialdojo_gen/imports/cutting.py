"""Clip triangles to a convex region of the plan; closed bodies stay closed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from aerialdojo_gen.imports.raw import RawNode

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIDES = 64
_GRID_M = 1e-6


@dataclass(frozen=True)
class Region:
    """A convex region of the plan."""

    corners: tuple[tuple[float, float], ...]  # tuple of (x, y); metres, counter-clockwise
    option: str  # As the user typed it: ``"--crop 10 20 100"``

    @classmethod
    def circle(cls, x: float, y: float, radius: float) -> Region:
        """Make a 64-sided polygon inscribed in a circle; metres."""
        angles = [2 * math.pi * k / _SIDES for k in range(_SIDES)]
        corners = tuple((x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles)
        return cls(corners, f"--crop {x:g} {y:g} {radius:g}")

    @classmethod
    def box(cls, x0: float, y0: float, x1: float, y1: float) -> Region:
        """Make a rectangle of two opposite corners, metres."""
        (x0, x1), (y0, y1) = sorted((x0, x1)), sorted((y0, y1))
        return cls(((x0, y0), (x1, y0), (x1, y1), (x0, y1)), f"--box {x0:g} {y0:g} {x1:g} {y1:g}")

    @property
    def low(self) -> Floats:
        """Lower corner of its bounding rectangle, (2,) float64."""
        return np.min(self.corners, axis=0)

    @property
    def high(self) -> Floats:
        """Upper corner of its bounding rectangle, (2,) float64."""
        return np.max(self.corners, axis=0)

    @property
    def planes(self) -> list[tuple[Floats, float]]:
        """Sides as (outward normal, offset): a point p is inside if normal · p <= offset for all."""
        sides = list(pairwise((*self.corners, self.corners[0])))
        normals = [np.array([y1 - y0, x0 - x1]) / math.hypot(x1 - x0, y1 - y0) for (x0, y0), (x1, y1) in sides]
        return [(normal, float(normal @ start)) for normal, (start, _) in zip(normals, sides, strict=True)]


class Pieces(NamedTuple):
    """Clipped triangles."""

    corners: Floats  # (k, 3, 3) float64; metres
    source: Ints  # (k,) int64; index of the original triangle; for caps, of a triangle at the cut's rim
    weights: Floats  # Barycentric weights of each corner in its source triangle, for interpolation


def cut(vertices: Floats, faces: Ints, region: Region) -> Pieces:
    """Clip triangles to a convex region; closed bodies are closed again along the border."""
    corners = vertices[faces]
    body, closed = connected_bodies(faces, len(vertices))
    pieces = Pieces(corners, np.arange(len(faces)), np.broadcast_to(np.eye(3), (len(faces), 3, 3)))
    # Closed bodies must reach the planes whole: the clipped rims show where to add caps.
    low, high = np.full((len(closed), 2), np.inf), np.full((len(closed), 2), -np.inf)
    np.minimum.at(low, body, corners[:, :, :2].min(axis=1))
    np.maximum.at(high, body, corners[:, :, :2].max(axis=1))
    own = closed[body][:, None]
    low = np.where(own, low[body], corners[:, :, :2].min(axis=1))
    high = np.where(own, high[body], corners[:, :, :2].max(axis=1))
    touched = np.asarray((low <= region.high).all(axis=1) & (high >= region.low).all(axis=1))
    pieces = _select(pieces, touched)
    for normal, offset in region.planes:
        pieces = _clip_by_plane(pieces, body, closed, normal, offset)
    return pieces


def clip_node(body: RawNode, region: Region) -> RawNode:
    """Clip a node to a region of the plan; may have no faces."""
    pieces = cut(body.vertices, body.faces, region)
    n = len(pieces.source)
    # Face attributes come from the source; corner attributes are interpolated.
    kept = body.select_faces(pieces.source)
    if kept.corners is not None:
        kept = replace(kept, corners=np.einsum("kij,kjc->kic", pieces.weights, kept.corners).astype(np.float32))
    return kept.with_vertices(pieces.corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


def _select(pieces: Pieces, rows: NDArray[np.bool_] | Ints) -> Pieces:
    return Pieces(pieces.corners[rows], pieces.source[rows], pieces.weights[rows])


def _concatenate(parts: Sequence[Pieces]) -> Pieces:
    corners, source, weights = zip(*parts, strict=True)
    return Pieces(np.concatenate(corners), np.concatenate(source), np.concatenate(weights))


def _clip_by_plane(pieces: Pieces, body: Ints, closed: NDArray[np.bool_], normal: Floats, offset: float) -> Pieces:
    """Keep the inner side of a vertical plane, and cap closed bodies."""
    away = pieces.corners[:, :, :2] @ normal - offset
    # Points in the plane are inside, so that a surface is cut the same however it is triangulated.
    outside = away > 0.0
    n = outside.sum(axis=1)
    inner = n == 0
    if inner.all():
        return pieces
    keep, one, two = _select(pieces, inner), np.flatnonzero(n == 1), np.flatnonzero(n == 2)
    # Rotate the odd corner to the front, so that both cases share the code.
    first = np.concatenate([np.argmax(outside[one], axis=1), np.argmin(outside[two], axis=1)])
    rows = np.concatenate([one, two])
    turn = (first[:, None] + np.arange(3)) % 3
    at = np.arange(len(rows))[:, None]
    split = _select(pieces, rows)
    # Corners and their weights are interpolated alike.
    c = np.concatenate([split.corners, split.weights], axis=2)[at, turn]
    d, i, k = away[rows][at, turn], np.arange(len(rows)), len(one)
    border = np.empty((len(rows), 2, 6))
    for j in (0, 1):
        # Interpolate from the inner corner outwards, so that both triangles of an edge give identical points.
        ends = np.concatenate([np.full(k, j + 1), np.zeros(len(two), np.int64)])
        beyond = np.concatenate([np.zeros(k, np.int64), np.full(len(two), j + 1)])
        share = (d[i, ends] / (d[i, ends] - d[i, beyond]))[:, None]
        border[:, j] = c[i, ends] + share * (c[i, beyond] - c[i, ends])
    source = split.source
    made = np.concatenate([
        np.stack([border[:k, 0], c[:k, 1], c[:k, 2]], 1), np.stack([border[:k, 0], c[:k, 2], border[:k, 1]], 1),
        np.stack([c[k:, 0], border[k:, 0], border[k:, 1]], 1),
    ])  # fmt: skip
    clipped = Pieces(made[..., :3], np.concatenate([source[:k], source[:k], source[k:]]), made[..., 3:])
    kept = _concatenate([keep, clipped])
    kept = _select(kept, np.argsort(kept.source, kind="stable"))
    return _concatenate([kept, *_caps(border[..., :3], source, body, closed, normal, offset)])


def _caps(
    segments: Floats, source: Ints, body: Ints, closed: NDArray[np.bool_], normal: Floats, offset: float
) -> list[Pieces]:
    """Cap triangles in a plane for closed bodies with the rims `segments`, (n, 2, 3)."""
    out = []
    along = np.array([-normal[1], normal[0]])
    origin = normal * offset
    whole = np.flatnonzero(closed[body[source]])
    for k in np.unique(body[source[whole]]):
        rows = whole[body[source[whole]] == k]
        flat = np.stack([(segments[rows][:, :, :2] - origin) @ along, segments[rows][:, :, 2]], axis=-1)
        spot = _merge_close_points(flat.reshape(-1, 2))
        _, first = np.unique(spot, return_index=True)
        grid = np.round(flat.reshape(-1, 2)[first] / _GRID_M)[spot].reshape(-1, 2, 2)
        lines = shapely.linestrings(grid * _GRID_M)
        lines = lines[shapely.length(lines) > 0]
        if not len(lines):
            continue
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(_polygons_inside(lines)))
        if not len(triangles):
            continue
        uz = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
        a, b, c = uz[:, 0], uz[:, 1], uz[:, 2]
        turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]) < 0
        uz[turned] = uz[turned][:, ::-1]
        corners = np.empty((len(uz), 3, 3))
        corners[:, :, :2] = origin + uz[:, :, :1] * along
        corners[:, :, 2] = uz[:, :, 1]
        # Use the exact rim points, so that there are no gaps.
        ends = dict(zip(map(tuple, grid.reshape(-1, 2).tolist()), segments[rows].reshape(-1, 3), strict=True))
        keys = np.round(uz / _GRID_M).reshape(-1, 2).tolist()
        exact = [ends.get((u, z), at) for (u, z), at in zip(keys, corners.reshape(-1, 3), strict=True)]
        corners = np.array(exact).reshape(-1, 3, 3)
        one = np.zeros((len(uz), 3, 3))
        one[:, :, 0] = 1.0
        out.append(Pieces(corners, np.full(len(uz), source[rows].min()), one))
    return out


def _merge_close_points(ends: Floats) -> Ints:
    """Label points, (n, 2): points closer than the grid share a label, even if rounding separates them."""
    pairs = cKDTree(ends).query_pairs(_GRID_M, output_type="ndarray")
    near = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(len(ends), len(ends)))
    return connected_components(near, directed=False)[1].astype(np.int64)


def _polygons_inside(lines: NDArray[np.object_]) -> NDArray[np.object_]:
    """Polygons within closed outlines, without holes, by the even-odd rule."""
    faces = shapely.get_parts(shapely.polygonize([shapely.union_all(lines)]))
    inner = shapely.get_coordinates(shapely.point_on_surface(faces))
    ends = shapely.get_coordinates(lines).reshape(-1, 2, 2)
    a, b = ends[:, 0], ends[:, 1]
    odd = np.zeros(len(faces), dtype=np.bool_)
    for k, (u, z) in enumerate(inner):
        spans = (a[:, 1] > z) != (b[:, 1] > z)
        rise = b[spans, 1] - a[spans, 1]
        at = a[spans, 0] + (z - a[spans, 1]) / rise * (b[spans, 0] - a[spans, 0])
        odd[k] = int((at > u).sum()) % 2 == 1
    return np.asarray(faces[odd])


def connected_bodies(faces: Ints, n: int) -> tuple[Ints, NDArray[np.bool_]]:
    """Edge-connected bodies of faces (m, 3): label of each face, and which bodies are closed."""
    if not len(faces):
        return np.zeros(0, np.int64), np.zeros(0, np.bool_)
    own = np.sort(faces, axis=1)
    first, same, _ = unique_rows(*own.T)
    own = own[first]
    m = len(own)
    edges = np.concatenate([own[:, [0, 1]], own[:, [1, 2]], own[:, [0, 2]]])
    key = edges[:, 0] * n + edges[:, 1]
    order = np.argsort(key, kind="stable")
    owner, key = (np.tile(np.arange(m), 3))[order], key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    count = np.diff(first, append=len(key))
    next_of = np.flatnonzero(np.repeat((count == 2) | (count == 3), count)[1:] & (key[1:] == key[:-1]))
    graph = coo_array((np.ones(len(next_of), np.int8), (owner[next_of], owner[next_of + 1])), shape=(m, m))
    k, label = connected_components(graph, directed=False)
    of = label[owner]
    pair, _, times = unique_rows(of, key)
    closed = np.ones(k, dtype=np.bool_)
    closed[of[pair[times != 2]]] = False
    return label[same].astype(np.int64), closed


def unique_rows(*columns: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Unique rows of number columns, like `numpy.unique(axis=0)` but several times faster."""
    order = np.lexsort(columns[::-1])
    new = np.zeros(len(order), dtype=np.bool_)
    new[:1] = True
    for column in columns:
        ordered = column[order]
        new[1:] |= ordered[1:] != ordered[:-1]
    same = np.empty(len(order), dtype=np.int64)
    same[order] = np.cumsum(new) - 1
    begins = np.flatnonzero(new)
    return order[begins], same, np.diff(begins, append=len(order))
