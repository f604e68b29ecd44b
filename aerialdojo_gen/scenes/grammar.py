"""Grammar of layouts: poses along lines, in rows, over areas; natural outlines; frames on the ground; slabs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import rotate, translate
from shapely.geometry import LinearRing, LineString, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.arrays import Floats
from aerialdojo_gen.geometry.portable import unit
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.mesh import Mesh, Parts, by_material, merge, posed, rotation, translated
from aerialdojo_gen.scenes.shapes import box, extrude, sweep
from aerialdojo_gen.scenes.site import Site

Polyline = Sequence[Sequence[float]]


class Pose(NamedTuple):
    """Where a thing goes: metres, and degrees counter-clockwise from +x."""

    x: float
    y: float
    yaw_deg: float


def smooth_path(path: Polyline, rounds: int = 3) -> list[tuple[float, float]]:
    """Round a polyline's corners by Chaikin's corner cutting; the ends stay."""
    points = np.asarray(path, dtype=np.float64)
    for _ in range(rounds):
        a, b = points[:-1], points[1:]
        cut = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1).reshape(-1, 2)
        points = np.concatenate([points[:1], cut[1:-1], points[-1:]])
    return [(float(x), float(y)) for x, y in points]


def s_curve(a: Sequence[float], b: Sequence[float], steps: int = 10) -> list[tuple[float, float]]:
    """Lead a line from `a` to a parallel one at `b`, both running along x, metres."""
    t = np.linspace(0.0, 1.0, steps + 1)
    y = a[1] + (b[1] - a[1]) * t * t * (3.0 - 2.0 * t)
    return [(float(u), float(v)) for u, v in zip(a[0] + (b[0] - a[0]) * t, y, strict=True)]


def eased_path(path: Polyline, steps: int) -> list[tuple[float, float]]:
    """Replace every leg of a polyline that is not along x by an S-curve of so many steps, as tracks change lanes."""
    out = [(float(path[0][0]), float(path[0][1]))]
    for a, b in pairwise(path):
        out += s_curve(a, b, steps if a[1] != b[1] else 1)[1:]
    return out


def along(
    path: Polyline,
    spacing_m: float,
    offset_m: float = 0.0,
    start_m: float = 0.0,
    end_m: float = 0.0,
    turn_deg: float = 0.0,
) -> list[Pose]:
    """Poses along a polyline, about `spacing_m` apart and `offset_m` to its left; `turn_deg` 90 faces left of it."""
    line = LineString(path)
    length = line.length - start_m - end_m
    if length <= 0.0:
        return []
    count = max(round(length / spacing_m), 1)
    poses = []
    for k in range(count + 1):
        s = start_m + length * k / count
        before, after = line.interpolate(max(s - 0.05, 0.0)), line.interpolate(min(s + 0.05, line.length))
        yaw = math.atan2(after.y - before.y, after.x - before.x)
        p = line.interpolate(s)
        x, y = p.x - offset_m * np.sin(yaw), p.y + offset_m * np.cos(yaw)
        poses.append(Pose(float(x), float(y), float(np.degrees(yaw)) + turn_deg))
    return poses


def noise_around(seed: int, angles: Floats, bends: float) -> Floats:
    """Noise from -1 to 1 at angles (n,), radians, that closes around a circle: the more bends, the rougher."""
    noise = OpenSimplex(seed=seed)
    return np.array([noise.noise2(bends * float(np.cos(a)), bends * float(np.sin(a))) for a in angles])


def blob(x: float, y: float, radius_m: float, seed: int, ragged: float = 0.25, corners: int = 28) -> Polygon:
    """Make a round area with a wavy outline (a clearing, a pond, a patch of moss), metres, world frame."""
    angles = np.arange(corners) * 2 * np.pi / corners
    r = radius_m * (1.0 + ragged * noise_around(seed, angles, 1.3) / 0.6)
    return Polygon(np.column_stack([x + r * np.cos(angles), y + r * np.sin(angles)]))


def ragged_outline(ring: LinearRing, seed: int, amplitude_m: float, step_m: float) -> Polygon:
    """Make a natural outline from a coarse one: resampled every `step_m` and pushed in and out by noise, metres."""
    count = int(ring.length / step_m)
    at = shapely.get_coordinates([ring.interpolate(k / count, normalized=True) for k in range(count)])
    before, after = np.roll(at, 1, axis=0), np.roll(at, -1, axis=0)
    along = unit(after - before)
    wave = noise_around(seed, np.arange(count) / count * 2 * np.pi, ring.length / (2 * np.pi * 14.0))
    out = at + amplitude_m * 1.5 * wave[:, None] * np.column_stack([along[:, 1], -along[:, 0]])
    outline = Polygon(out).buffer(0)
    smooth = outline.buffer(1.5, quad_segs=3).buffer(-3.0, quad_segs=3).buffer(1.5, quad_segs=3)
    return smooth if isinstance(smooth, Polygon) else max(smooth.geoms, key=lambda g: g.area)


def stretches(path: Polyline, spacing_m: float) -> list[Pose]:
    """Return the middle of every stretch of `spacing_m`, for fence panels and rails, turned with the path.

    The stretches are shortened or lengthened to fit each straight leg; legs shorter than half a stretch have none.
    """
    out = []
    for a, b in pairwise(path):
        dx, dy = b[0] - a[0], b[1] - a[1]
        count = round(float(np.hypot(dx, dy)) / spacing_m)
        for k in range(count):
            t = (k + 0.5) / count
            out.append(Pose(a[0] + dx * t, a[1] + dy * t, math.degrees(math.atan2(dy, dx))))
    return out


def wall(site: Site, path: Polyline, height_m: float, thickness_m: float, z: float = 0.0) -> Mesh:
    """Make a wall along a path on the ground at its points (plus `z`), to be given to `Site.add`."""
    line = [(x, y, site.ground_z(x, y) + z + height_m / 2) for x, y in path]
    return sweep(path=line, section=(thickness_m, height_m))


def slab(area: BaseGeometry, z0_m: float, z1_m: float) -> Mesh:
    """Extrude a polygon between two heights: a deck, a roof, a plinth."""
    return translated(extrude(area, z1_m - z0_m), (0.0, 0.0, z0_m))


def plates(area: BaseGeometry, z0_m: float, z1_m: float) -> Mesh:
    """Extrude every polygon of an area between two heights."""
    return merge([slab(piece, z0_m, z1_m) for piece in polygons_of(area)])


def leg(a: Sequence[float], b: Sequence[float]) -> tuple[float, float]:
    """Give the length of a leg, metres, and its direction, degrees."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    return float(np.hypot(dx, dy)), math.degrees(math.atan2(dy, dx))


def between_gates(
    start: float, end: float, gates: Iterable[tuple[float, float]], least_m: float
) -> list[tuple[float, float]]:
    """List the stretches between gates, those longer than `least_m`."""
    free, at = list[tuple[float, float]](), start
    for low, high in [*sorted(gates), (end, end)]:
        if low - at > least_m:
            free.append((at, low))
        at = max(at, high)
    return free


class _Taken(NamedTuple):
    """Discs by the cells, a radius wide, that their middles lie in: `cells` has a disc of each, `after` the next."""

    radius_m: float
    corner: NDArray[np.int64]
    cells: NDArray[np.int64]
    discs: NDArray[np.float64]
    after: NDArray[np.int64]

    def add(self, n: int, x: float, y: float, own: float) -> None:
        i, j = int(x // self.radius_m) - self.corner[0], int(y // self.radius_m) - self.corner[1]
        self.discs[n] = x, y, own
        self.after[n], self.cells[i, j] = self.cells[i, j], n


@njit(cache=True)
def _room(x: float, y: float, own: float, widest: float, taken: _Taken) -> bool:
    """Whether a disc of radius `own` keeps its distance from those there are, of `widest` radius at most."""
    radius_m, corner, cells, discs, after = taken
    reach = int(np.ceil(max(widest, own) / radius_m))
    i, j = int(x // radius_m) - corner[0], int(y // radius_m) - corner[1]
    for a in range(max(i - reach, 0), min(i + reach + 1, cells.shape[0])):
        for b in range(max(j - reach, 0), min(j + reach + 1, cells.shape[1])):
            k = cells[a, b]
            while k >= 0:
                u, v, gap = x - discs[k, 0], y - discs[k, 1], max(own, discs[k, 2])
                if u * u + v * v < gap * gap:
                    return False
                k = after[k]
    return True


@njit(cache=True)
def _next_free(darts: NDArray[np.float64], k: int, widest: float, taken: _Taken) -> int:
    """Index of the next dart, from `k` on, where a disc of the least radius has room; their number where none is."""
    while k < len(darts):
        if _room(darts[k, 0], darts[k, 1], taken.radius_m, widest, taken):
            break
        k += 1
    return k


def poisson_disc(
    area: BaseGeometry,
    radius_m: float,
    rng: np.random.Generator,
    density: Callable[[float, float], float] | None = None,
    limit: int = 100_000,
) -> list[Pose]:
    """Poisson-disc poses over an area (Bridson's dart throwing), with random yaws.

    The distance grows as 1 / sqrt(density).
    """
    if area.is_empty:
        return []
    shapely.prepare(area)
    x0, y0, x1, y1 = area.bounds
    poses: list[Pose] = []
    tries = int(30 * max(area.area, 1.0) / radius_m**2)
    candidates = rng.uniform((x0, y0, 0.0), (x1, y1, 360.0), size=(min(tries, 400_000), 3))
    inside = shapely.contains_xy(area, candidates[:, 0], candidates[:, 1])

    darts, yaws = np.ascontiguousarray(candidates[inside, :2]), candidates[inside, 2].tolist()
    cells = np.full((int((x1 - x0) // radius_m) + 3, int((y1 - y0) // radius_m) + 3), -1)
    taken = _Taken(radius_m, np.array([x0 // radius_m - 1, y0 // radius_m - 1], dtype=np.int64), cells,
                   np.empty((len(darts), 3)), np.empty(len(darts), dtype=np.int64))  # fmt: skip
    n, widest, k = 0, radius_m, -1
    while True:
        # Densities take longer to ask than neighbours, and no density makes a disc smaller than this.
        k = _next_free(darts, k + 1, widest, taken)
        if k == len(darts):
            break
        x, y = darts[k].tolist()
        share = 1.0 if density is None else float(density(x, y))
        if share <= 0.01:
            continue
        own = radius_m / math.sqrt(min(share, 1.0))
        if own > radius_m and not _room(x, y, own, widest, taken):
            continue
        widest = max(widest, own)
        taken.add(n, x, y, own)
        n += 1
        poses.append(Pose(x, y, yaws[k]))
        if n >= limit:
            break
    return poses


@dataclass(frozen=True)
class Frame:
    """A frame on the ground: origin in metres, direction of its u axis in degrees counter-clockwise from +x."""

    x: float
    y: float
    yaw_deg: float = 0.0

    def at(self, u: float, v: float) -> tuple[float, float]:
        """World coordinates of a point, metres."""
        c, s = float(np.cos(np.radians(self.yaw_deg))), float(np.sin(np.radians(self.yaw_deg)))
        return self.x + c * u - s * v, self.y + s * u + c * v

    def pose(self, u: float, v: float, yaw_deg: float = 0.0) -> Pose:
        """World pose of a point that looks along `yaw_deg` from the u axis."""
        return Pose(*self.at(u, v), self.yaw_deg + yaw_deg)

    def path(self, points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
        """World coordinates of a polyline."""
        return [self.at(u, v) for u, v in points]

    def area(self, area: BaseGeometry) -> BaseGeometry:
        """World coordinates of an area."""
        return translate(rotate(area, self.yaw_deg, origin=(0, 0)), self.x, self.y)

    def parts(self, parts: Parts, z_m: float = 0.0) -> Parts:
        """World coordinates of meshes whose z starts at `z_m`."""
        turn = rotation(0.0, 0.0, self.yaw_deg)
        return [(material, posed(body, turn, (self.x, self.y, z_m))) for material, body in by_material(parts)]


def box_between(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float) -> Mesh:
    """Make an axis-parallel box between two corners, metres."""
    return translated(box(size=(x1 - x0, y1 - y0, z1 - z0)), ((x0 + x1) / 2, (y0 + y1) / 2, z0))
