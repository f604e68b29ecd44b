"""Trees and houses beyond a scene's edge, in few triangles, on the land that is there."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.scenes.horizon.kinds import Kind
from aerialdojo_gen.scenes.horizon.land import Land, Noise
from aerialdojo_gen.scenes.mesh import Mesh, mesh

Floats = NDArray[np.float64]
# A thing: its bodies with their materials, in its own frame, where it stands, its turn in radians.
SceneryItem = tuple[list[tuple[str, Mesh]], Floats, float]

# Distances from the edge between which things stand, and within which they have all their parts, metres.
_TREES_M, _HOUSES_M, _NEAR_M, _GAP_M = 260.0, 380.0, 70.0, 5.0
_WALLS = {
    "detached": ("shutters:#d9c7a2", "shutters:#b9b2a4", "facade_brick"),
    "terraces": ("facade_brick", "shutters:#d6c4a0", "facade_flats:#bfae98"),
    "blocks": ("facade_flats", "facade_office", "facade_brick"),
    "sheds": ("corrugated:#8c9296", "facade_industrial", "corrugated:#7d6a58"),
    "farms": ("shutters:#d9c7a2", "planks:#7a5f45"),
    "cubes": ("plaster:#c9a877",),
    "cabins": ("planks:#6f4d33",),
}  # fmt: skip
_ROOFS = ("#8e4b36", "#7a4334", "#5d5a58", "#6d5344")
_FLAT = ("#8d8b86", "#7b7a77", "#a09c94")


class _Draws:
    """Places on the open land, drawn by area, nearest first."""

    def __init__(self, land: Land, bounds: Floats, wet: bool) -> None:
        self._caster = TriangleRayCaster(land.vertices, land.faces.astype(np.int32))
        self._fits = land.open_land | land.water if wet else land.open_land
        self._bounds = bounds

    def ground(self, xy: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Height (n,) of the land at places (n, 2), and whether a thing may stand there."""
        top = np.column_stack([xy, np.full(len(xy), 3000.0)])
        distance, face = self._caster.first_hit(top, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
        fits = (face >= 0) & self._fits[face]
        return np.where(face >= 0, 3000.0 - distance, 0.0), fits

    def away(self, xy: Floats) -> Floats:
        """Distance (n,) of places from the edge."""
        low, high = self._bounds[0, :2], self._bounds[1, :2]
        return norm(xy - np.clip(xy, low, high))

    def spread(self, per_ha: float, reach_m: float, rng: np.random.Generator, step_m: float) -> Floats:
        """Places (n, 2) in a jittered grid about the scene, thinner with distance."""
        low, high = self._bounds[0, :2] - reach_m, self._bounds[1, :2] + reach_m
        nx, ny = (int(n) for n in (high - low) // step_m)
        cells = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1).reshape(-1, 2)
        xy = low + (cells + rng.uniform(0.2, 0.8, cells.shape)) * step_m
        away = self.away(xy)
        chance = per_ha * step_m**2 / 1e4 * np.clip(1.15 - away / reach_m, 0.0, 1.0)
        return xy[(rng.uniform(size=len(xy)) < chance) & (away > _GAP_M)]


def scatter_scenery(
    land: Land, kind: Kind, bounds: Floats, noise: Noise, rng: np.random.Generator, budget: int
) -> Iterator[SceneryItem]:
    """Yield houses, then trees, until `budget` triangles are spent."""
    draws = _Draws(land, bounds, kind.wet)
    houses: list[tuple[float, float, float]] = []
    for thing, radius in _houses(draws, kind, rng):
        spent = sum(len(body.faces) for _, body in thing[0])
        if spent > budget * 0.8:
            break
        budget -= spent
        houses.append((*thing[1][:2], radius))
        yield thing
    taken = np.array(houses).reshape(-1, 3)
    for thing in _trees(draws, kind, noise, rng, taken):
        budget -= sum(len(body.faces) for _, body in thing[0])
        if budget < 0:
            return
        yield thing


def _houses(draws: _Draws, kind: Kind, rng: np.random.Generator) -> Iterator[tuple[SceneryItem, float]]:
    if kind.houses == "none" or not kind.houses_ha:
        return
    size = {"blocks": 34.0, "sheds": 46.0, "terraces": 26.0}.get(kind.houses, 21.0)
    xy = draws.spread(kind.houses_ha, _HOUSES_M, rng, size)
    xy = xy[np.argsort(draws.away(xy), kind="stable")]
    half = 0.34 * size
    corners = xy[:, None] + half * np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
    z, fits = (a.reshape(-1, 5) for a in draws.ground(corners.reshape(-1, 2)))
    for at, heights, fit, away in zip(xy, z, fits, draws.away(xy), strict=True):
        # Steep land, roads and water carry none.
        if not fit.all() or np.ptp(heights) > 0.35 * half or away < half + 3.0:
            continue
        turn = float(rng.integers(4)) * np.pi / 2
        turn += rng.uniform(-0.2, 0.2) if kind.houses in ("farms", "cabins") else 0.0
        yield (_house(kind.houses, size, rng), np.array([*at, float(heights.min())]), turn), half * 1.2


def _house(style: str, size: float, rng: np.random.Generator) -> list[tuple[str, Mesh]]:
    """A house of a style that fits a plot, on z = 0, rooted below."""
    walls = _WALLS[style][int(rng.integers(len(_WALLS[style])))]
    if style in ("blocks", "cubes"):
        unit = 3.2 if style == "blocks" else 2.9
        w, d = np.round(rng.uniform(0.4, 0.66, 2) * size / unit) * unit
        storeys = rng.integers(3, 8) if style == "blocks" else rng.integers(1, 3)
        flat = _FLAT[int(rng.integers(len(_FLAT)))] if style == "blocks" else "#c4a274"
        return [(walls, _walls(w, d, float(storeys) * unit)), (flat, _lid(w, d, float(storeys) * unit))]
    w, d, high, rise = {
        "detached": (rng.uniform(8, 12), rng.uniform(7, 9), 3.0 * rng.integers(1, 3), rng.uniform(2.5, 4.0)),
        "terraces": (rng.uniform(13, 18), rng.uniform(9, 11), 3.0 * rng.integers(2, 4), rng.uniform(3.0, 4.5)),
        "sheds": (rng.uniform(22, 32), rng.uniform(14, 24), rng.uniform(6, 11), rng.uniform(1.0, 2.5)),
        "farms": (rng.uniform(10, 16), rng.uniform(7, 9), 3.0 * rng.integers(1, 3), rng.uniform(3.5, 5.0)),
        "cabins": (rng.uniform(8, 11), rng.uniform(7, 9), 3.0, rng.uniform(3.0, 4.5)),
    }[style]
    roof = {"cabins": "#e8edf2", "sheds": "#777d80"}.get(style) or _ROOFS[int(rng.integers(len(_ROOFS)))]
    out = [(walls, _walls(w, d, high, rise)), (roof, _gable(w, d, high, rise))]
    if style == "sheds" and rng.uniform() < 0.2:
        out.append(("#8f5a48", _turned(6, (1.4, -_ROOT_M), (1.4 * 0.7, rng.uniform(22, 34)))))
    return out


_ROOT_M = 3.0


def _walls(w: float, d: float, high: float, rise: float = 0.0) -> Mesh:
    x, y = w / 2, d / 2
    low = [(-x, -y), (x, -y), (x, y), (-x, y)]
    v = [(*p, -_ROOT_M) for p in low] + [(*p, high) for p in low]
    f = [t for k in range(4) for t in ((k, (k + 1) % 4, (k + 1) % 4 + 4), (k, (k + 1) % 4 + 4, k + 4))]
    if rise:
        v += [(-x, 0.0, high + rise), (x, 0.0, high + rise)]
        f += [(5, 6, 9), (7, 4, 8)]
    return mesh(v, f)


def _lid(w: float, d: float, high: float) -> Mesh:
    x, y = w / 2, d / 2
    return mesh([(-x, -y, high), (x, -y, high), (x, y, high), (-x, y, high)], [(0, 1, 2), (0, 2, 3)])


def _gable(w: float, d: float, high: float, rise: float) -> Mesh:
    over = 0.4
    x, y, drop = w / 2 + over, d / 2 + over, high - over * 2 * rise / d
    v = [(-x, -y, drop), (x, -y, drop), (x, y, drop), (-x, y, drop), (-x, 0, high + rise), (x, 0, high + rise)]
    return mesh(v, [(0, 1, 5), (0, 5, 4), (2, 3, 4), (2, 4, 5)])


@lru_cache(maxsize=64)
def _turned(sides: int, *profile: tuple[float, float], tip: float | None = None, twist: float = 0.0) -> Mesh:
    v: list[tuple[float, float, float]] = []
    for k, (r, z) in enumerate(profile):
        angle = 2 * np.pi * (np.arange(sides) + 0.5 * (k % 2)) / sides + twist
        v += [(float(r * np.cos(a)), float(r * np.sin(a)), z) for a in angle]
    f: list[tuple[int, int, int]] = []
    for k in range(len(profile) - 1):
        for n in range(sides):
            a, b = k * sides + n, k * sides + (n + 1) % sides
            c, d = a + sides, b + sides
            f += [(a, b, c), (b, d, c)] if k % 2 == 0 else [(a, b, d), (a, d, c)]
    if tip is not None:
        v.append((0.0, 0.0, tip))
        top = (len(profile) - 1) * sides
        f += [(top + n, top + (n + 1) % sides, len(v) - 1) for n in range(sides)]
    return mesh(v, f)


def _trees(draws: _Draws, kind: Kind, noise: Noise, rng: np.random.Generator, taken: Floats) -> Iterator[SceneryItem]:
    if not kind.trees_ha:
        return
    step = 9.0 if kind.trees_ha < 60 else 6.0
    xy = draws.spread(kind.trees_ha * 3.0, _TREES_M, rng, step)
    wood = noise(xy[:, 0], xy[:, 1], 120.0, 7.0) < 2.0 * kind.wood - 1.0
    # Outside woods one of five stands.
    xy = xy[wood | (rng.uniform(size=len(xy)) < 0.3)]
    if len(taken):
        near = norm(xy[:, None] - taken[None, :, :2]) < taken[None, :, 2] + 2.0
        xy = xy[~near.any(axis=1)]
    z, fits = draws.ground(xy)
    away = draws.away(xy)
    for k in np.argsort(away, kind="stable"):
        if fits[k]:
            species = kind.trees[int(rng.integers(len(kind.trees)))]
            crown = kind.crowns[int(rng.integers(len(kind.crowns)))]
            bodies = _tree(species, crown, rng.uniform(), away[k] < _NEAR_M)
            yield bodies, np.array([*xy[k], z[k]]), float(rng.uniform(0, 2 * np.pi))


def _tree(species: str, crown: str, draw: float, near: bool) -> list[tuple[str, Mesh]]:
    if species == "scrub":
        high = 0.8 + 1.6 * draw
        return [(crown, _turned(5, (high * 0.6, -0.2), (high * 0.75, high * 0.5), tip=high))]
    high = round(6.0 + 7.0 * draw, 1)
    if species == "spire":
        high = round(high * 1.25, 1)
        low, foot = (high * 0.2, high * 0.12), (0.22, -1.0)
        if not near:
            return [(crown, _turned(5, low, tip=high))]
        cones = _turned(6, low, tip=high * 0.7), _turned(6, (high * 0.15, high * 0.42), tip=high, twist=0.5)
        return [*((crown, cone) for cone in cones), ("#5a4534", _turned(3, foot, (0.18, high * 0.2)))]
    if species == "palm":
        return [("#7d6a50", _turned(3, (0.22, -1.0), (0.15, high))), (crown, _fronds(high, 3.2))]
    r = high * (0.26 + 0.1 * draw)
    stem = ("#5a4534", _turned(3, (0.26, -1.0), (0.2, high * 0.4)))
    if near:
        return [stem, (crown, _turned(6, (r * 0.55, high * 0.3), (r, high * 0.52), (r * 0.78, high * 0.8), tip=high))]
    return [stem, (crown, _turned(5, (r * 0.6, high * 0.28), (r, high * 0.6), tip=high))]


def _fronds(high: float, reach: float) -> Mesh:
    v: list[tuple[float, float, float]] = [(0.0, 0.0, high)]
    f: list[tuple[int, int, int]] = []
    for k in range(7):
        a = 2 * np.pi * k / 7
        for turn, out, z in ((-0.28, 0.55, 0.5), (0.28, 0.55, 0.5), (0.0, 1.0, -1.1)):
            v.append((reach * out * float(np.cos(a + turn)), reach * out * float(np.sin(a + turn)), high + z))
        n = len(v) - 3
        for t in ((0, n, n + 1), (n, n + 2, n + 1)):
            f += [t, t[::-1]]
    return mesh(v, f)
