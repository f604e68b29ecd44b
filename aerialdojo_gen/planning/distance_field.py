"""Distance to the nearest surface on a regular grid: exact in a narrow band, a safe lower bound beyond it."""

from __future__ import annotations

import math

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Ints, Singles
from aerialdojo_gen.geometry.triangles import point_triangle_d2

# float32 rounds either way: take off more than it can add, so that a bound stays a bound.
_ROUNDING_M = 1e-5
# Safety factor and offset on squared distances: nothing beyond them is nearer, whatever the rounding.
_SAFETY, _SAFETY_M = 1.0 + 1e-6, 1e-9
# Triangles below this share of the squared area spanned by their edges are slivers.
_SLIVER = 1e-6


@njit(cache=True, inline="always")
def _edge_d2(wx: float, wy: float, wz: float, ux: float, uy: float, uz: float, inverse: float) -> float:
    """Squared distance from w to the segment from 0 to u, given 1 / |u|^2 (0 for a point)."""
    t = min(1.0, max(0.0, (wx * ux + wy * uy + wz * uz) * inverse))
    ex, ey, ez = wx - t * ux, wy - t * uy, wz - t * uz
    return ex * ex + ey * ey + ez * ez


@njit(cache=True, error_model="numpy", nogil=True)
def _lower_in_band(tri: Floats, origin: Floats, cell: float, band: float, field: Singles) -> None:
    """Lower `field` (squared distances) to the distance of every triangle, up to `band` from the triangle's box.

    Cells whose distance is below that to the triangle's box or plane are skipped. The distance is that of
    `aerialdojo_gen.geometry.triangles.point_triangle_d2`, with the triangle's constants hoisted out of the loop.
    """
    nx, ny, nz = field.shape
    ox, oy, oz = origin[0], origin[1], origin[2]
    band2 = band * band
    # In float32 the band's edge may seem a little further out.
    edge2 = band2 * _SAFETY + _SAFETY_M
    vertical2 = np.empty(nz)
    for k in range(tri.shape[0]):
        ax, ay, az = tri[k, 0], tri[k, 1], tri[k, 2]
        ux, uy, uz = tri[k, 3] - ax, tri[k, 4] - ay, tri[k, 5] - az
        vx, vy, vz = tri[k, 6] - ax, tri[k, 7] - ay, tri[k, 8] - az
        ex, ey, ez = vx - ux, vy - uy, vz - uz
        mx, my, mz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
        ee, mm = ex * ex + ey * ey + ez * ez, mx * mx + my * my + mz * mz
        iu, iv, ie = 1.0 / uu if uu > 0.0 else 0.0, 1.0 / vv if vv > 0.0 else 0.0, 1.0 / ee if ee > 0.0 else 0.0
        im = 1.0 / mm if mm > 0.0 else 0.0
        plane2 = band2 * mm
        # A sliver's normal is noise: the distance to its plane is meaningless.
        i_plane = im if mm > _SLIVER * uu * vv else 0.0
        lx, ly, lz = min(0.0, ux, vx), min(0.0, uy, vy), min(0.0, uz, vz)
        hx, hy, hz = max(0.0, ux, vx), max(0.0, uy, vy), max(0.0, uz, vz)
        x0 = max(0, math.ceil((ax + lx - band - ox) / cell - 0.5))
        x1 = min(nx - 1, math.floor((ax + hx + band - ox) / cell - 0.5))
        y0 = max(0, math.ceil((ay + ly - band - oy) / cell - 0.5))
        y1 = min(ny - 1, math.floor((ay + hy + band - oy) / cell - 0.5))
        z0 = max(0, math.ceil((az + lz - band - oz) / cell - 0.5))
        z1 = min(nz - 1, math.floor((az + hz + band - oz) / cell - 0.5))
        for l in range(z0, z1 + 1):  # noqa: E741
            wz = oz + (l + 0.5) * cell - az
            gz = max(0.0, max(lz - wz, wz - hz))
            vertical2[l] = gz * gz
        for i in range(x0, x1 + 1):
            wx = ox + (i + 0.5) * cell - ax
            gx = max(0.0, max(lx - wx, wx - hx))
            for j in range(y0, y1 + 1):
                wy = oy + (j + 0.5) * cell - ay
                gy = max(0.0, max(ly - wy, wy - hy))
                lateral2 = gx * gx + gy * gy
                if lateral2 > edge2:
                    continue
                for l in range(z0, z1 + 1):  # noqa: E741
                    limit2 = min(np.float64(field[i, j, l]) * _SAFETY + _SAFETY_M, edge2)
                    if lateral2 + vertical2[l] > limit2:
                        continue
                    wz = oz + (l + 0.5) * cell - az
                    h = wx * mx + wy * my + wz * mz
                    if h * h > plane2 or h * h * i_plane > limit2:
                        continue
                    wu, wv = wx * ux + wy * uy + wz * uz, wx * vx + wy * vy + wz * vz
                    # Barycentric coordinates of the foot on the plane, times mm: inside, the plane decides.
                    s, t = vv * wu - uv * wv, uu * wv - uv * wu
                    if mm > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= mm:
                        d2 = h * h * im
                    else:
                        d2 = min(
                            _edge_d2(wx, wy, wz, ux, uy, uz, iu),
                            min(
                                _edge_d2(wx, wy, wz, vx, vy, vz, iv),
                                _edge_d2(wx - ux, wy - uy, wz - uz, ex, ey, ez, ie),
                            ),
                        )
                    if d2 < field[i, j, l]:
                        field[i, j, l] = d2


@njit(cache=True, nogil=True)
def _mark_outside_seeds(tri: Floats, origin: Floats, cell: float, margin_below: Ints, n: Ints, seeds: Flags) -> None:
    """Mark the cells outside the grid of `n` cells that hold a surface point, and some with a centre as near to one.

    `seeds` begins `margin_below` cells below the grid's first cell.
    """
    half2 = 0.75 * cell * cell
    low, high, at = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    for t in range(tri.shape[0]):
        within = True
        for a in range(3):
            least = min(tri[t, a], tri[t, a + 3], tri[t, a + 6]) - origin[a]
            most = max(tri[t, a], tri[t, a + 3], tri[t, a + 6]) - origin[a]
            within = within and least >= 0.0 and most <= n[a] * cell
            low[a] = max(0, math.floor(least / cell) + margin_below[a])
            high[a] = min(seeds.shape[a] - 1, math.floor(most / cell) + margin_below[a])
        if within:
            continue
        for i in range(low[0], high[0] + 1):
            at[0] = i - margin_below[0]
            for j in range(low[1], high[1] + 1):
                at[1] = j - margin_below[1]
                flat = 0 <= at[0] < n[0] and 0 <= at[1] < n[1]
                for k in range(low[2], high[2] + 1):
                    at[2] = k - margin_below[2]
                    if seeds[i, j, k] or (flat and 0 <= at[2] < n[2]):
                        continue
                    x, y, z = (
                        origin[0] + (at[0] + 0.5) * cell,
                        origin[1] + (at[1] + 0.5) * cell,
                        origin[2] + (at[2] + 0.5) * cell,
                    )
                    seeds[i, j, k] = point_triangle_d2(x, y, z, tri, t) <= half2 * (1.0 + 1e-6)


@njit(cache=True, nogil=True)
def _lower_row(row: Singles, other: Singles, add: np.float32) -> None:
    """Lower a row to another one plus a number; a function of its own, so that it is vectorised."""
    for k in range(len(row)):
        value = other[k] + add
        row[k] = value if value < row[k] else row[k]


@njit(cache=True, nogil=True)
def _fill_outside_band(
    field: Singles, cell: float, band: float, cap: float, seeds: Flags, margin_below: Ints
) -> None:
    """Turn squared distances into distances, and fill in lower bounds beyond the band.

    The cell that holds the nearest surface point has its centre within half a cell's diagonal of it: so a cell's
    distance is at least that to the nearest such cell, less half a diagonal. `seeds` are such cells, inside and
    outside the grid: it begins `margin_below` cells below the grid's first cell.
    """
    nx, ny, nz = field.shape
    mx, my, mz = seeds.shape
    bx, by, bz = margin_below[0], margin_below[1], margin_below[2]
    half = cell * math.sqrt(3.0) / 2
    reach = math.ceil((cap + half) / cell) + 1
    far = np.float32(1e6)
    # Distances in cells, squared, one axis after the other (separable Euclidean distance transform).
    along_z = np.empty((mx, my, nz), np.float32)
    for i in range(mx):
        for j in range(my):
            along_z[i, j] = far
            for upward in (True, False):
                away = 100000
                for n in range(mz):
                    k = n if upward else mz - 1 - n
                    away = 0 if seeds[i, j, k] else away + 1
                    if bz <= k < bz + nz:
                        along_z[i, j, k - bz] = min(along_z[i, j, k - bz], np.float32(away * away))
    along_y = np.empty((mx, ny, nz), np.float32)
    for i in range(mx):
        for j in range(ny):
            row = along_y[i, j]
            row[:] = along_z[i, j + by]
            for m in range(max(0, j + by - reach), min(my, j + by + reach + 1)):
                _lower_row(row, along_z[i, m], np.float32((m - j - by) * (m - j - by)))
    row = np.empty(nz, np.float32)
    for i in range(nx):
        for j in range(ny):
            row[:] = far
            for m in range(max(0, i + bx - reach), min(mx, i + bx + reach + 1)):
                _lower_row(row, along_y[m, j], np.float32((m - i - bx) * (m - i - bx)))
            for k in range(nz):
                if field[i, j, k] <= band * band:
                    field[i, j, k] = max(0.0, math.sqrt(field[i, j, k]) - _ROUNDING_M)
                else:
                    bound = max(band, math.sqrt(row[k]) * cell - half)
                    field[i, j, k] = min(bound, cap) - _ROUNDING_M


def _seeds(triangles: Floats, origin: Floats, field: Singles, cell: float, cap: float) -> tuple[Flags, Ints]:
    """Cells near enough to a surface to hold its points, (mx, my, mz) bool, and their margin below the grid."""
    half = cell * math.sqrt(3.0) / 2
    n = np.array(field.shape, np.int64)
    # In float32 the corners of a cell may seem a little further from its centre.
    near = field <= half * half * (1.0 + 1e-6)
    if not len(triangles):
        return near, np.zeros(3, np.int64)
    corners = (triangles.reshape(-1, 3) - origin) / cell
    # Surfaces beyond the cap do not matter.
    most = math.ceil((cap + half) / cell) + 1
    margin_below = np.clip(np.ceil(-corners.min(axis=0)), 0, most).astype(np.int64)
    margin_above = np.clip(np.floor(corners.max(axis=0)) + 1 - n, 0, most).astype(np.int64)
    if not (margin_below.any() or margin_above.any()):
        return near, margin_below
    seeds = np.zeros(tuple(margin_below + n + margin_above), np.bool_)
    inner = tuple(slice(b, b + m) for b, m in zip(margin_below.tolist(), n.tolist(), strict=True))
    seeds[inner] = near
    _mark_outside_seeds(triangles, np.asarray(origin, np.float64), cell, margin_below, n, seeds)
    return seeds, margin_below


def build_distance_field(
    triangles: Floats, origin: Floats, shape: tuple[int, int, int], cell_m: float, band_m: float, cap_m: float
) -> Singles:
    """Distance (nx, ny, nz) float32 from cell centres to the nearest triangle: a lower bound, exact in the band."""
    if band_m < cell_m * math.sqrt(3.0) / 2:
        raise ValueError(f"band_m = {band_m} is less than half the diagonal of a cell of {cell_m} m")
    field = np.full(shape, np.float32(4e12))
    _lower_in_band(triangles, origin, cell_m, band_m, field)
    _fill_outside_band(field, cell_m, band_m, cap_m, *_seeds(triangles, origin, field, cell_m, cap_m))
    return field
