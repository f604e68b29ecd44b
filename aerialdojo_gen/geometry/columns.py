"""Where plumb lines meet triangles: over a lattice of columns at once, or at any point of the plan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Ints

# Where in its cell a column stands: not on the edges and diagonals that meshes on round coordinates have.
_CELL_OFFSET = (0.4371, 0.5573)
_SAME_HEIGHT_M = 1e-3
_SAME_LAYER_M = 0.01
_OWN_LAYER_M = 0.05
_BIN_M = 2.0
_MOST_BINS = 1000


class Plan(NamedTuple):
    """A lattice of columns over a rectangle."""

    low: Floats  # (2,) float64; its corner, metres, world frame
    step_m: float  # From a column to the next one
    shape: tuple[int, int]  # Columns along x and y

    @classmethod
    def over(cls, low: Floats, high: Floats, step_m: float) -> Plan:
        """Lay columns over a rectangle, (2,) float64 corners in metres; one column at least along each axis."""
        nx, ny = (max(1, math.ceil(v / step_m)) for v in (high - low))
        return cls(np.asarray(low, np.float64), step_m, (nx, ny))

    def places(self, chosen: Flags) -> Floats:
        """Places in plan of columns that are marked in a (nx, ny) array, (n, 2) float64, metres."""
        return self.low + (np.argwhere(chosen) + np.array(_CELL_OFFSET)) * self.step_m


def lowest_of(triangles: Floats, plan: Plan) -> Floats:
    """Find the lowest point of triangles, (n, 9), in every column of a plan: float64 metres, NaN where is none."""
    found = np.full(plan.shape, np.inf)
    _lower(np.ascontiguousarray(triangles), plan, found)
    found[np.isinf(found)] = np.nan
    return found


def shares_of(triangles: Floats, body: Ints, n: int, lowest: Floats, plan: Plan) -> tuple[Ints, Ints, Ints]:
    """Count, for n bodies of triangles (k, 9), the columns they cover, cover once, and are lowest in; (n,) each."""
    counts = np.zeros((3, n), np.int64)
    _count(np.ascontiguousarray(triangles), body, plan, lowest, counts)
    return counts[0], counts[1], counts[2]


class ColumnIndex(NamedTuple):
    """Triangles by the squares of the plan that they lie over."""

    triangles: Floats  # (n, 9) float64
    low: Floats  # (2,) float64; corner of the first square, metres
    bin_m: float  # Edge of a square
    shape: tuple[int, int]  # Squares along x and y
    first: Ints  # (nx * ny + 1,) int64; where each square's triangles begin in `member`
    member: Ints  # (m,) int64; rows of `triangles`

    @classmethod
    def of(cls, triangles: Floats) -> ColumnIndex:
        """Sort triangles, (n, 9) float64, at least one."""
        t = np.ascontiguousarray(triangles)
        corners = t.reshape(-1, 3, 3)[:, :, :2]
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        bin_m = max(_BIN_M, float((high - low).max()) / _MOST_BINS)
        nx, ny = (int(v / bin_m) + 1 for v in high - low)
        first = np.zeros(nx * ny + 1, np.int64)
        _fill(t, low, bin_m, (nx, ny), first[1:], np.empty(0, np.int64))
        first = np.cumsum(first)
        member = np.empty(int(first[-1]), np.int64)
        _fill(t, low, bin_m, (nx, ny), first[:-1].copy(), member)
        return cls(t, low, bin_m, (nx, ny), first, member)

    def lowest_m(self, xy: Floats) -> Floats:
        """Height of the lowest triangle at points in plan, (n, 2) float64; (n,) float64 metres, NaN where is none."""
        return np.asarray(_lowest_at(np.ascontiguousarray(xy), self))

    def layers(self, points: Floats) -> tuple[Ints, Floats, Floats]:
        """Layers over 5 cm below points (n, 3), height of the highest of these, how far up the nearest layer is."""
        below, next_m, away_m = _layers_at(np.ascontiguousarray(points), self)
        return below, next_m, away_m

    def gaps_m(self, points: Floats, own: int, owner: Ints, deep_m: float) -> Floats:
        """Air below points (n, 3) down to triangles of another owner than `own`, (n,) metres; inf where is none.

        Zero where a point is sunk: where one that faces up is above it, no higher than `deep_m`.
        """
        return np.asarray(_gaps_below(np.ascontiguousarray(points), own, owner, deep_m, self))


@njit(cache=True, inline="always")
def plumb_height(x: float, y: float, t: Floats, k: int) -> tuple[float, float]:
    """Height of triangle k above a point of the plan, NaN beside it and for one that stands upright; doubled area."""
    ax, ay = t[k, 0] - x, t[k, 1] - y
    bx, by = t[k, 3] - x, t[k, 4] - y
    cx, cy = t[k, 6] - x, t[k, 7] - y
    u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    if not ((u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0)):
        return np.nan, 0.0
    area = u + v + w
    if area == 0.0:
        return np.nan, 0.0
    return (u * t[k, 2] + v * t[k, 5] + w * t[k, 8]) / area, area


@njit(cache=True, inline="always")
def _span(a: float, b: float, c: float, plan: Plan, axis: int) -> tuple[int, int]:
    """First and last column along an axis that a triangle can meet."""
    first = math.ceil((min(a, b, c) - plan.low[axis]) / plan.step_m - _CELL_OFFSET[axis])
    last = math.floor((max(a, b, c) - plan.low[axis]) / plan.step_m - _CELL_OFFSET[axis])
    return max(0, first), min(plan.shape[axis] - 1, last)


@njit(cache=True, inline="always")
def _height_in(plan: Plan, i: int, j: int, t: Floats, k: int) -> float:
    """Height of triangle k in a column of a plan."""
    x = plan.low[0] + (i + _CELL_OFFSET[0]) * plan.step_m
    return plumb_height(x, plan.low[1] + (j + _CELL_OFFSET[1]) * plan.step_m, t, k)[0]


@njit(cache=True)
def _lower(t: Floats, plan: Plan, found: Floats) -> None:
    for k in range(t.shape[0]):
        i0, i1 = _span(t[k, 0], t[k, 3], t[k, 6], plan, 0)
        j0, j1 = _span(t[k, 1], t[k, 4], t[k, 7], plan, 1)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                z = _height_in(plan, i, j, t, k)
                if z < found[i, j]:
                    found[i, j] = z


@njit(cache=True)
def _count(t: Floats, body: Ints, plan: Plan, lowest: Floats, counts: Ints) -> None:
    seen, twice, low = np.full(lowest.shape, -1), np.full(lowest.shape, -1), np.full(lowest.shape, -1)
    for k in range(t.shape[0]):
        own = body[k]
        i0, i1 = _span(t[k, 0], t[k, 3], t[k, 6], plan, 0)
        j0, j1 = _span(t[k, 1], t[k, 4], t[k, 7], plan, 1)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                z = _height_in(plan, i, j, t, k)
                if math.isnan(z):
                    continue
                if seen[i, j] != own:
                    seen[i, j] = own
                    counts[0, own] += 1
                    counts[1, own] += 1
                elif twice[i, j] != own:
                    twice[i, j] = own
                    counts[1, own] -= 1
                if z <= lowest[i, j] + _SAME_HEIGHT_M and low[i, j] != own:
                    low[i, j] = own
                    counts[2, own] += 1


@njit(cache=True)
def _fill(t: Floats, low: Floats, edge: float, shape: tuple[int, int], place: Ints, member: Ints) -> None:
    """Count the triangles of every square into `place`, or, given room in `member`, put them there."""
    counting = len(member) == 0
    for k in range(t.shape[0]):
        i0 = max(0, int((min(t[k, 0], t[k, 3], t[k, 6]) - low[0]) / edge))
        i1 = min(shape[0] - 1, int((max(t[k, 0], t[k, 3], t[k, 6]) - low[0]) / edge))
        j0 = max(0, int((min(t[k, 1], t[k, 4], t[k, 7]) - low[1]) / edge))
        j1 = min(shape[1] - 1, int((max(t[k, 1], t[k, 4], t[k, 7]) - low[1]) / edge))
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                if not counting:
                    member[place[i * shape[1] + j]] = k
                place[i * shape[1] + j] += 1


@njit(cache=True, inline="always")
def _over(x: float, y: float, index: ColumnIndex) -> Ints:
    """Triangles of the square of a point in plan; none outside of the squares."""
    # Below 0 int() rounds up, and a NaN has no place at all.
    if not (x >= index.low[0] and y >= index.low[1]):
        return index.member[:0]
    i, j = int((x - index.low[0]) / index.bin_m), int((y - index.low[1]) / index.bin_m)
    if i >= index.shape[0] or j >= index.shape[1]:
        return index.member[:0]
    square = i * index.shape[1] + j
    return index.member[index.first[square] : index.first[square + 1]]


@njit(cache=True)
def _lowest_at(xy: Floats, index: ColumnIndex) -> Floats:
    out = np.full(len(xy), np.nan)
    for p in range(len(xy)):
        best = np.inf
        for k in _over(xy[p, 0], xy[p, 1], index):
            z = plumb_height(xy[p, 0], xy[p, 1], index.triangles, k)[0]
            if z < best:
                best = z
        if best < np.inf:
            out[p] = best
    return out


@njit(cache=True)
def _layers_at(points: Floats, index: ColumnIndex) -> tuple[Ints, Floats, Floats]:
    n = len(points)
    below, next_m, away_m = np.zeros(n, np.int64), np.full(n, np.nan), np.full(n, np.inf)
    for p in range(n):
        x, y, z = points[p]
        over = _over(x, y, index)
        heights = np.empty(len(over))
        for m in range(len(over)):
            heights[m] = plumb_height(x, y, index.triangles, over[m])[0]
        last = -np.inf
        for h in np.sort(heights[~np.isnan(heights)]):
            # An edge that two triangles share is met twice.
            if h < z - _OWN_LAYER_M and h > last + _SAME_LAYER_M:
                below[p] += 1
                next_m[p] = h
            last = h
            if abs(h - z) < abs(away_m[p]):
                away_m[p] = h - z
    return below, next_m, away_m


@njit(cache=True)
def _gaps_below(points: Floats, own: int, owner: Ints, deep: float, index: ColumnIndex) -> Floats:
    out, t = np.full(len(points), np.inf), index.triangles
    for p in range(len(points)):
        x, y, z = points[p]
        for k in _over(x, y, index):
            if owner[k] == own:
                continue
            h = plumb_height(x, y, t, k)[0]
            if h <= z:
                out[p] = min(out[p], z - h)
            elif h - z <= deep:
                ax, ay = t[k, 3] - t[k, 0], t[k, 4] - t[k, 1]
                if ax * (t[k, 7] - t[k, 1]) > ay * (t[k, 6] - t[k, 0]):
                    out[p] = 0.0
    return out
