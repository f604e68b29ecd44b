"""Land and water beyond a scene's edge: a ring mesh that begins at the edge's own heights and materials."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.portable import norm, power
from aerialdojo_gen.scenes.horizon.border import OUTWARDS, Stretch, is_water
from aerialdojo_gen.scenes.horizon.kinds import Kind
from aerialdojo_gen.scenes.terrain import smooth

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Distances of the rings from the edge, metres; the last is within the range of all renderers.
RINGS_M: Floats = np.array([0.0, 3, 8, 16, 28, 45, 70, 105, 155, 225, 320, 450, 640, 900, 1250, 1650])
_FAN = 10  # Sectors of a corner
# Where the edge's own heights, a road, and the level land end, metres from the edge.
_BLEND_M, _ROAD_M, _HILLS_M, _ISLANDS_M = 60.0, 300.0, 200.0, 800.0
_SHORE_M = 70.0
# Pavement that meets the edge for longer than a road is wide ends this far from it, metres.
_WIDEST_ROAD_M, _YARD_M = 20.0, 28.0
_STEP_M = 0.25
_NATURAL = frozenset(
    {"grass", "meadow", "dirt", "sand", "snow", "rock", "moss", "leaf_litter", "gravel", "mud", "soil"}
)


@dataclass(frozen=True, eq=False)
class Land:
    """A ring mesh, and of each face its material and its kind."""

    vertices: Floats  # (n, 3) float64
    faces: Ints  # (m, 3) int64
    material: list[str]  # By face
    open_land: NDArray[np.bool_]  # (m,) bool; neither water nor a road nor a wall
    water: NDArray[np.bool_]  # (m,) bool


class Noise:
    """Smooth noise in about -1 to 1 at any points, the same for the same seed."""

    def __init__(self, seed: int, scene: str) -> None:
        self._table = generator(seed, "horizon", scene).uniform(-1.0, 1.0, (64, 64))

    def __call__(self, x: Floats, y: Floats, wave_m: float, shift: float = 0.0) -> Floats:
        """Noise with lumps of a wavelength, metres; by `shift`, other lumps."""
        u, v = x / wave_m + 17.3 * shift, y / wave_m - 11.9 * shift
        j, i = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        a, b = u - j, v - i
        a, b = smooth(a), smooth(b)
        at = self._table
        low = at[i % 64, j % 64] * (1.0 - a) + at[i % 64, (j + 1) % 64] * a
        high = at[(i + 1) % 64, j % 64] * (1.0 - a) + at[(i + 1) % 64, (j + 1) % 64] * a
        return np.asarray(low * (1.0 - b) + high * b)


@dataclass(frozen=True, eq=False)
class _Strips:
    """Strips from the edge outwards, side by side; those of a corner begin in a point."""

    foot: Floats  # (n, 2, 3) float64; left and right end at the edge
    way: Floats  # (n, 2, 2) float64; unit vectors outwards
    material: list[str]
    water: NDArray[np.bool_]
    border: list[Floats]  # Points of the edge, from left to right

    @classmethod
    def of(cls, border: Sequence[Stretch], base: str) -> _Strips:
        foot, way, material, points = [], [], [], []
        for k, one in enumerate(border):
            out = OUTWARDS[one.side]
            foot.append(one.points[[0, -1]])
            way.append(np.stack([out, out]))
            material.append(one.material)
            points.append(one.points)
            after = border[(k + 1) % len(border)]
            if after.side == one.side:
                continue
            start = (one.side - 1) * np.pi / 2
            for n in range(_FAN):
                angle = start + np.pi / 2 * np.array([n, n + 1]) / _FAN
                near = one if n < _FAN / 2 else after
                corner = one.points[-1]
                foot.append(np.stack([corner, corner]))
                way.append(np.stack([np.cos(angle), np.sin(angle)], axis=1))
                material.append(near.material if near.water else base)
                points.append(corner[None])
        water = np.array([is_water(name) for name in material])
        return cls(np.array(foot), np.array(way), material, water, points)


def base_material(border: Sequence[Stretch], kind: Kind) -> str:
    """Choose the material of the land: what most of the scene's edge is made of, if that is natural ground."""
    if kind.ground:
        return kind.ground
    natural = _longest((one.material, one.points) for one in border if one.material.split(":")[0] in _NATURAL)
    return natural or (kind.fields or ("grass",))[0]


def _longest(stretches: Iterable[tuple[str, Floats]]) -> str:
    """Material that most of some stretches (k, 3) is made of; empty without any."""
    length: dict[str, float] = {}
    for material, points in stretches:
        length[material] = length.get(material, 0.0) + float(norm(points[-1] - points[0]))
    return max(length, key=lambda name: length[name], default="")


def make_land(border: Sequence[Stretch], kind: Kind, top_m: float, noise: Noise) -> Land:
    """Build the ring; it ends in a wall as high as the highest eye, in the haze."""
    base = base_material(border, kind)
    strips = _Strips.of(border, base)
    grid = _positions(strips, noise)
    z = _welded(_heights(strips, grid, kind, noise))
    vertices = np.concatenate([grid, z[..., None]], axis=-1)
    vertices[:, :, 0] = strips.foot
    parts = [*_quads(strips, vertices, kind, base, noise), *_inner(strips, vertices), *_walls(vertices, base)]
    parts.append(_end(vertices, top_m, kind))
    corners = np.concatenate([p[0] for p in parts])
    keep = norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) > 1e-7
    material = [name for p in parts for name in p[1]]
    open_land, water = (np.concatenate([p[k] for p in parts])[keep] for k in (2, 3))
    points, index = np.unique(corners[keep].reshape(-1, 3), axis=0, return_inverse=True)
    return Land(points, index.reshape(-1, 3), [m for m, k in zip(material, keep, strict=True) if k], open_land, water)


def _positions(strips: _Strips, noise: Noise) -> Floats:
    """Places (n, 2, rings, 2) of both edges of each strip; roads and shores wind a little."""
    d = RINGS_M[None, None, :, None]
    straight = strips.foot[:, :, None, :2] + strips.way[:, :, None] * d
    across = np.stack([-strips.way[..., 1], strips.way[..., 0]], axis=-1)[:, :, None]
    # Opposite sides wind alike: what crosses the site goes on as it is.
    x, y = strips.way[:, :, None, 0], strips.way[:, :, None, 1]
    wind = noise(100.0 * (x * x - y * y) + RINGS_M, 200.0 * x * y + 0.0 * RINGS_M, 160.0, 3.0)
    aside = np.minimum(0.3 * RINGS_M, 50.0) * smooth(RINGS_M / 60.0) * wind
    return np.asarray(straight + across * aside[..., None])


def _shore_distance(strips: _Strips, grid: Floats) -> Floats:
    """Distance (n, 2, rings) along a ring from the nearest strip of water; inf without any."""
    left = grid[:, 0]
    step = norm(np.roll(left, -1, axis=0) - left)
    n = len(step)
    far = np.full((n, len(RINGS_M)), np.inf)
    wet = strips.water | np.roll(strips.water, 1)
    far[wet] = 0.0
    # Twice round, each way.
    for k in range(2 * n):
        far[(k + 1) % n] = np.minimum(far[(k + 1) % n], far[k % n] + step[k % n])
    for k in range(2 * n, 0, -1):
        far[(k - 1) % n] = np.minimum(far[(k - 1) % n], far[k % n] + step[(k - 1) % n])
    return np.stack([far, np.roll(far, -1, axis=0)], axis=1)


def _heights(strips: _Strips, grid: Floats, kind: Kind, noise: Noise) -> Floats:
    x, y, d = grid[..., 0], grid[..., 1], RINGS_M[None, None]
    z0 = strips.foot[..., 2][..., None] + 0.0 * d
    dry = ~strips.water
    level = float(np.median(strips.foot[dry][..., 2])) if dry.any() else float(strips.foot[..., 2].mean())
    hills = 0.55 + 0.6 * noise(x, y, 620.0) + 0.3 * noise(x, y, 240.0, 1.0)
    if kind.steep:
        ridge = 1.0 - np.abs(noise(x, y, 540.0)) * 1.5 + 0.25 * noise(x, y, 170.0, 1.0)
        hills = power(np.maximum(ridge, 0.1), 1.4)
    relief = kind.near_m * (noise(x, y, 90.0, 2.0) + 0.4 * noise(x, y, 35.0, 4.0)) * smooth(d / 90.0)
    relief = relief + kind.hills_m * np.maximum(hills, 0.0) * smooth((d - _HILLS_M) / 900.0)
    land = z0 + (level + relief - z0) * smooth(d / _BLEND_M)
    if strips.water.any():
        water = float(np.median(strips.foot[strips.water][..., 2]))
        shore = _shore_distance(strips, grid)
        low = water + 0.25 + (np.maximum(land, water + 0.25) - water - 0.25) * smooth(shore / (_SHORE_M + 0.15 * d))
        land = land + (low - land) * smooth(d / _BLEND_M)
        islands = np.maximum(noise(x, y, 700.0, 6.0) - 0.25, 0.0) * 1.6 * kind.hills_m
        islands = islands * smooth((d - _ISLANDS_M) / 500.0)
        land = np.where(strips.water[:, None, None], z0 + islands, land)
    return np.asarray(land)


def _welded(z: Floats) -> Floats:
    """Join what is nearly as high on both sides of a seam, beyond the edge itself."""
    z = z.copy()
    right, left = z[:, 1], np.roll(z[:, 0], -1, axis=0)
    close = np.abs(right - left) < _STEP_M
    close[:, 0] = False
    mean = (right + left) / 2.0
    z[:, 1] = np.where(close, mean, right)
    z[:, 0] = np.roll(np.where(close, mean, left), 1, axis=0)
    return z


_Faces = tuple[Floats, list[str], NDArray[np.bool_], NDArray[np.bool_]]


def _quads(strips: _Strips, v: Floats, kind: Kind, base: str, noise: Noise) -> list[_Faces]:
    """The rings but the innermost: two triangles a strip."""
    out: list[_Faces] = []
    beyond, reach = _without_shallows(strips), _reaches(strips)
    for r in range(1, len(RINGS_M) - 1):
        a, b, c, d = v[:, 0, r], v[:, 0, r + 1], v[:, 1, r + 1], v[:, 1, r]
        middle = (a + b + c + d) / 4.0
        pick = noise(middle[:, 0], middle[:, 1], 45.0 + RINGS_M[r] / 3.0, 5.0)
        names, land = [], []
        for k, material in enumerate(strips.material):
            natural = not strips.water[k] and (material == base or RINGS_M[r] >= reach[k])
            if strips.water[k]:
                names.append(kind.far if b[k, 2] > strips.foot[k, 0, 2] + 2.0 else beyond[k])
            elif not natural:
                names.append(material)
            elif RINGS_M[r] >= 450.0:
                names.append(kind.far)
            elif kind.fields and RINGS_M[r] >= 45.0 and pick[k] > -0.2:
                names.append(kind.fields[int((pick[k] + 0.2) * 997.0) % len(kind.fields)])
            else:
                names.append(base)
            land.append(natural)
        faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        out.append((faces, names * 2, np.tile(land, 2), np.tile(strips.water, 2)))
    return out


def _runs(strips: _Strips) -> list[list[int]]:
    """Strips of one material side by side, all round."""
    names, n = strips.material, len(strips.material)
    starts = [k for k in range(n) if names[k] != names[k - 1]]
    ends = [*starts[1:], starts[0] + n] if starts else []
    return [[k % n for k in range(first, after)] for first, after in zip(starts, ends, strict=True)]


def _without_shallows(strips: _Strips) -> list[str]:
    """Materials of the strips beyond the edge: patches in the sea end there, they would be bands to the horizon."""
    water, n = strips.water, len(strips.material)
    sea = _longest((strips.material[k], strips.border[k]) for k in np.flatnonzero(water))
    out = list(strips.material)
    for run in _runs(strips):
        if water[run[0]] and water[run[0] - 1] and water[(run[-1] + 1) % n]:
            for k in run:
                out[k] = sea
    return out


def _reaches(strips: _Strips) -> Floats:
    """Distances (n,) to which the strips keep their material, metres: a yard wider than a road soon ends."""
    width, out = norm(strips.foot[:, 1] - strips.foot[:, 0]), np.full(len(strips.material), _ROAD_M)
    for run in _runs(strips):
        if strips.material[run[0]].split(":")[0] not in _NATURAL and width[run].sum() > _WIDEST_ROAD_M:
            out[run] = _YARD_M
    return out


def _inner(strips: _Strips, v: Floats) -> list[_Faces]:
    """The innermost ring: every point of the edge is a corner of a triangle."""
    out: list[_Faces] = []
    for k, points in enumerate(strips.border):
        left, right = v[k, 0, 1], v[k, 1, 1]
        half = max(len(points) // 2, 1)
        faces = [(points[i], left, points[i + 1]) for i in range(min(half, len(points) - 1))]
        faces += [(points[i], right, points[i + 1]) for i in range(half, len(points) - 1)]
        middle = points[min(half, len(points) - 1)]
        faces.append((middle, left, right))
        # Counter-clockwise from above: outwards is to the right of the way round.
        n = len(faces)
        natural = np.full(n, False)
        out.append((np.array(faces), [strips.material[k]] * n, natural, np.full(n, bool(strips.water[k]))))
    return out


def _walls(v: Floats, base: str) -> list[_Faces]:
    """Faces, seen from both sides, where the land on the two sides of a seam does not meet."""
    out = []
    after = np.roll(np.arange(len(v)), -1)
    gap = norm(v[:, 1] - v[after, 0])
    for k in np.flatnonzero(gap.max(axis=1) > 1e-3):
        for r in range(len(RINGS_M) - 1):
            if gap[k, r : r + 2].max() > 1e-3:
                a, b, c, d = v[k, 1, r], v[k, 1, r + 1], v[after[k], 0, r + 1], v[after[k], 0, r]
                out += [(a, b, c), (a, c, d), (a, c, b), (a, d, c)]
    if not out:
        return []
    no = np.zeros(len(out), dtype=bool)
    return [(np.array(out), [base] * len(out), no, no)]


def _end(v: Floats, top_m: float, kind: Kind) -> _Faces:
    """The wall behind everything, facing inwards."""
    a, b = v[:, 0, -1], v[:, 1, -1]
    up_a, up_b = a.copy(), b.copy()
    up_a[:, 2], up_b[:, 2] = np.maximum(a[:, 2], top_m), np.maximum(b[:, 2], top_m)
    faces = np.concatenate([np.stack([a, up_a, up_b], axis=1), np.stack([a, up_b, b], axis=1)])
    no = np.zeros(len(faces), dtype=bool)
    return faces, [kind.far] * len(faces), no, no
