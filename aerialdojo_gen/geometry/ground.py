"""Ground that is an open sheet: what of a scene it is, what lies below it, and what closes it at its rim.

Imported terrain (a survey's heightfield, a photogrammetric model) is mostly a sheet without an underside: surfaces
alone do not keep a body out of the earth, for it can go round the rim, or through a hole, and be below it without a
touch. What lies below a sheet cannot be read from its winding either, which imports often have wrong. It is decided
here, once for all who ask: a point is below ground where a plumb line meets ground above it and none below it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.geometry.arrays import Flags, Floats, Ints
from aerialdojo_gen.geometry.columns import ColumnIndex, Plan, lowest_of, shares_of
from aerialdojo_gen.geometry.soup import SceneLike

# Columns that decide what is ground are this far apart.
_COLUMN_M = 0.5
# A body with a smaller area in plan is never terrain.
_LEAST_AREA_M2 = 4.0
# A sheet has one layer, but for overhangs; walls with a floor and a roof have two or more.
_SINGLE_LAYER = 2 / 3
# Things stand with their feet in the ground, and so lie lower in their columns.
_LOWEST = 1 / 2
# Steeper than 60 degrees all over is a wall, unless it makes up most of the scene.
_LEVEL = 1 / 2
# Roofs without walls over a scene without any ground would pass for sheets: together they are not its larger part.
_COVER = 1 / 2
_WELD_M = 1e-3
# What ends this far below the flight volume is not in it: the level ground that add-scene lays under everything.
_BELOW_M = 1e-3
_PIECE_M = 0.5
_OUTSIDE_M = 0.02


@dataclass(frozen=True, eq=False)
class Ground:
    """The sheets of a scene that are its ground."""

    triangles: Floats  # (n, 9) float64; metres, world frame; each once, whatever its winding
    rim: Floats  # (m, 9) float64; edges that one triangle alone has: their two ends, and that triangle's third corner
    bare: Floats  # (k, 2) float64
    nodes: frozenset[str] = frozenset()  # The things that triangles of it belong to

    @classmethod
    def of(cls, scene: SceneLike, radius_m: float | None = None) -> Ground | None:
        """Find a scene's ground by form alone: open, level, mostly one layer, lowest bodies; None for a solid."""
        low, high = np.asarray(scene.bounds, np.float64)
        plan = Plan.over(low[:2], high[:2], _COLUMN_M)
        inside = [i for i in scene.instances if _reaches(i.bounds, low, high)]
        if not inside:
            return None
        labelled = any(i.surface for i in inside)
        if labelled and not any(i.surface == "ground" for i in inside):
            return None
        own = [i.vertices[i.faces] for i in inside]
        lowest = lowest_of(np.concatenate(own).reshape(-1, 9), plan)
        empty = np.isnan(lowest)
        # Four in a square: a body does not fit through a slit between two surfaces.
        bare = plan.places(empty[:-1, :-1] & empty[1:, :-1] & empty[:-1, 1:] & empty[1:, 1:])
        if radius_m is not None and not _within(bare, low, high, radius_m):
            return None
        large = [
            k
            for k, i in enumerate(inside)
            if np.prod(np.ptp(i.bounds[:, :2], axis=0)) >= _LEAST_AREA_M2 and i.surface in ("", "ground")
        ]
        if not large:
            return None
        faces, corners, rows = _welded(np.concatenate([own[k] for k in large]))
        owner = np.repeat(large, [len(own[k]) for k in large])[rows]
        body = _bodies(faces, len(corners))
        order = np.argsort(body, kind="stable")
        faces, body, owner = faces[order], body[order], owner[order]
        triangles = corners[faces].reshape(-1, 9)
        n = int(body[-1]) + 1 if len(body) else 0
        # What has a rim is open.
        is_ground = np.bincount(np.tile(body, 3), _edges(faces)[1], n) > 0
        if not labelled:
            covered, single, bottom = shares_of(triangles, body, n, lowest, plan)
            up, area = _areas(triangles)
            level = np.bincount(body, up, n) >= _LEVEL * np.bincount(body, area, n)
            all_columns = int(np.isfinite(lowest).sum())
            is_ground &= covered * plan.step_m**2 >= _LEAST_AREA_M2
            is_ground &= (single >= _SINGLE_LAYER * covered) & (bottom >= _LOWEST * covered)
            is_ground &= level | (covered >= _COVER * all_columns)
        chosen = is_ground[body]
        sheet = triangles[chosen]
        if not len(sheet):
            return None
        if not labelled and np.isfinite(lowest_of(sheet, plan)).sum() < _COVER * all_columns:
            return None
        names = frozenset(inside[k].node for k in np.unique(owner[chosen]))
        return cls(sheet, _rim(faces[chosen], corners), bare, names)

    @cached_property
    def _columns(self) -> ColumnIndex:
        return ColumnIndex.of(self.triangles)

    def lowest_m(self, xy: ArrayLike) -> Floats:
        """Height of the lowest ground at points in plan, (n, 2) float; (n,) float64, metres, NaN where is none."""
        return self._columns.lowest_m(np.asarray(xy, np.float64).reshape(-1, 2))

    def below(self, points: ArrayLike) -> Flags:
        """Whether points (n, 3), world metres, lie below ground: a plumb line meets ground above and none below."""
        p = np.asarray(points, np.float64).reshape(-1, 3)
        # A comparison with NaN is False: where there is no ground nothing lies below it.
        return np.asarray(p[:, 2] < self.lowest_m(p[:, :2]))

    def curtain(self, low: Floats, high: Floats, radius_m: float) -> Floats:
        """Walls (n, 9) straight down from the ground's rim, which close its underside to a body of `radius_m`."""
        if not _within(self.bare, low, high, radius_m):
            return np.empty((0, 9))
        inner_low, inner_high = low[:2] + radius_m, high[:2] - radius_m
        a, b, inwards = _pieces(self.rim, _PIECE_M)
        middle = (a + b) / 2
        near = ((np.minimum(a, b)[:, :2] < inner_high) & (np.maximum(a, b)[:, :2] > inner_low)).all(axis=1)
        near &= np.maximum(a, b)[:, 2] > low[2]
        a, b, inwards, middle = a[near], b[near], inwards[near], middle[near]
        below, floor, _ = self._columns.layers(middle)
        # The floor of the flight volume is gone through, so that no edge of the curtain lies in it.
        floor = np.where(below > 0, floor, low[2] - radius_m)
        outside = middle.copy()
        outside[:, :2] -= _OUTSIDE_M * inwards
        _, _, away = self._columns.layers(outside)
        lowest = self.lowest_m(outside[:, :2])
        # What lies higher beyond the rim has a rim of its own.
        continues = (np.abs(away) <= 2 * radius_m) | (lowest > middle[:, 2])
        hangs = (below % 2 == 0) & ~continues
        a, b, floor = a[hangs], b[hangs], floor[hangs]
        c, d = a.copy(), b.copy()
        c[:, 2], d[:, 2] = np.minimum(a[:, 2], floor), np.minimum(b[:, 2], floor)
        return np.concatenate([np.concatenate([a, b, c], axis=1), np.concatenate([b, d, c], axis=1)])


def _within(places: Floats, low: Floats, high: Floats, radius_m: float) -> bool:
    """Whether a body's centre can be over any of some places, (n, 2)."""
    return bool(((places > low[:2] + radius_m) & (places < high[:2] - radius_m)).all(axis=1).any())


def _reaches(bounds: Floats, low: Floats, high: Floats) -> bool:
    return bool(
        bounds[1, 2] >= low[2] - _BELOW_M and (bounds[0, :2] < high[:2]).all() and (bounds[1, :2] > low[:2]).all()
    )


def _welded(triangles: Floats) -> tuple[Ints, Floats, Ints]:
    """Give triangles (n, 3, 3) common corners: faces (m, 3), no doubles or slivers, corners (k, 3), rows (m,)."""
    points = triangles.reshape(-1, 3)
    cells = np.round((points - points.min(axis=0)) / _WELD_M).astype(np.int64)
    same = _numbered(*cells.T)
    _, first = np.unique(same, return_index=True)
    faces = same.reshape(-1, 3)
    rows = np.flatnonzero((faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0]))
    # An open surface of an import is there twice, once from each side.
    _, once = np.unique(_numbered(*np.sort(faces[rows], axis=1).T), return_index=True)
    rows = rows[np.sort(once)]
    return faces[rows], points[first], rows


def _numbered(*columns: Ints) -> Ints:
    """Number rows of integers, (n,) each: equal rows alike, from 0 without gaps."""
    number = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        # Numbers instead of values, so that no product overflows however wide a scene is.
        _, own = np.unique(column, return_inverse=True)
        _, number = np.unique(number * (int(own.max(initial=0)) + 1) + own.reshape(-1), return_inverse=True)
    return number.reshape(-1).astype(np.int64)


def _bodies(faces: Ints, n: int) -> Ints:
    """Number of the connected body that every face belongs to, counted from 0 without gaps."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows, columns = np.repeat(faces[:, 0], 2), faces[:, 1:].reshape(-1)
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, body = np.unique(label[faces[:, 0]], return_inverse=True)
    return body.reshape(-1).astype(np.int64)


def _edges(faces: Ints) -> tuple[Ints, Flags]:
    """Edges of faces, (3 n, 2), lower corner first, edge k of all faces before edge k + 1; and which are single."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, same, count = np.unique(
        edges[:, 0] * (int(faces.max(initial=0)) + 1) + edges[:, 1], return_inverse=True, return_counts=True
    )
    return edges, count[same.reshape(-1)] == 1


def _rim(faces: Ints, corners: Floats) -> Floats:
    edges, single = _edges(faces)
    third = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    return np.concatenate([corners[edges[single, 0]], corners[edges[single, 1]], corners[third[single]]], axis=1)


def _areas(triangles: Floats) -> tuple[Floats, Floats]:
    """Areas of triangles in plan and in space, square metres."""
    a, b, c = triangles[:, :3], triangles[:, 3:6], triangles[:, 6:]
    cross = np.cross(b - a, c - a)
    return np.abs(cross[:, 2]) / 2, np.linalg.norm(cross, axis=1) / 2


def _pieces(rim: Floats, longest_m: float) -> tuple[Floats, Floats, Floats]:
    """Cut edges into pieces: their ends, (n, 3) each, and the unit vectors in plan towards their triangle, (n, 2)."""
    a, b, third = rim[:, :3], rim[:, 3:6], rim[:, 6:]
    along = (b - a)[:, :2]
    length = np.linalg.norm(along, axis=1)
    towards = (third - a)[:, :2]
    square = np.maximum(length**2, 1e-18)
    towards = towards - along * ((towards * along).sum(axis=1) / square)[:, None]
    towards /= np.maximum(np.linalg.norm(towards, axis=1), 1e-12)[:, None]
    n = np.maximum(1, np.ceil(length / longest_m)).astype(np.int64)
    which = np.repeat(np.arange(len(a)), n)
    k = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    at = (k / n[which])[:, None]
    to = ((k + 1) / n[which])[:, None]
    vector = (b - a)[which]
    return a[which] + at * vector, a[which] + to * vector, towards[which]
