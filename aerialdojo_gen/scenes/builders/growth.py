"""Limbs, leaf clumps and rocks, of which plants and stones are made; shrubs, ferns, reeds, mushrooms and rocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.geometry.portable import UP, cross, dot, norm, product, unit
from aerialdojo_gen.scenes.builders import builder
from aerialdojo_gen.scenes.kernels import band_faces, limb_vertices
from aerialdojo_gen.scenes.mesh import Floats, Ints, Mesh, Parts, mesh, outward, translated
from aerialdojo_gen.scenes.shapes import circle, fan, lathe, sphere

_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
_CLUMP_CORNERS = 46
_BLADE = np.array(
    [(0, 1, 4), (0, 4, 2), (1, 3, 4), (4, 3, 2), (0, 5, 1), (0, 2, 5), (1, 5, 3), (5, 2, 3)], dtype=np.int32
)


def limb(points: ArrayLike, radii: Sequence[float], sides: int = 6) -> Mesh:
    """Make a tapering trunk or branch along points (n, 3), metres; closed, u around and v along in metres."""
    line = np.ascontiguousarray(points, dtype=np.float64)
    tip = radii[-1] == 0.0
    rings = len(line) - 1 if tip else len(line)
    if len(radii) < rings:
        raise ValueError("a limb needs a radius at each of its points")
    cos, sin = circle(sides)
    vertices, along = limb_vertices(line, np.asarray(radii, dtype=np.float64), rings, cos, sin)
    width = 2 * np.pi * max(radii) / sides
    index = np.arange(rings * sides, dtype=np.int32).reshape(rings, sides)
    faces, places = band_faces(index, rings - 1, np.arange(sides + 1) * width, along)
    # Ends of caps and tip come after the sides.
    foot, top = fan(sides, reverse=True), index[-1][fan(sides)]
    caps = foot if tip else np.stack([foot, top], axis=1).reshape(-1, 3)
    corners, given = [faces, caps], [places, np.full((len(caps), 3, 2), np.nan)]
    if tip:
        vertices = np.concatenate([vertices, line[-1:]])
        k, low, high = np.arange(sides), np.full(sides, along[-2]), np.full(sides, along[-1])
        corners.append(np.stack([index[-1], np.roll(index[-1], -1), np.full(sides, rings * sides)], axis=1))
        ends = (k * width, low, (k + 1) * width, low, (k + 0.5) * width, high)
        given.append(np.stack(ends, axis=1).reshape(-1, 3, 2))
    return outward(mesh(vertices, np.concatenate(corners), np.concatenate(given)))


def clump(
    rng: np.random.Generator,
    centre: ArrayLike,
    radii: ArrayLike,
    ragged: float = 0.3,
    belly: float = 0.6,
) -> Mesh:
    """Make a clump of leaves: a closed ellipsoid, lumpy by a share of its radii, 88 triangles."""
    directions, faces = _ball()
    turn = rng.uniform(0, 2 * np.pi)
    c, s = np.cos(turn), np.sin(turn)
    v = product(directions, np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
    lumps = np.cos(product(v, rng.normal(scale=3.0, size=(3, 4))) + rng.uniform(0, 2 * np.pi, size=4)).mean(axis=1)
    v = v * (1.0 + ragged * (0.6 * lumps + rng.uniform(-0.8, 0.7, size=len(v))))[:, None]
    v[:, 2] = np.where(v[:, 2] < 0, v[:, 2] * belly, v[:, 2])
    return mesh(v * np.asarray(radii) + np.asarray(centre), faces)


@cache
def _ball() -> tuple[Floats, Ints]:
    """Spread points evenly over the unit sphere and triangulate it."""
    k = np.arange(_CLUMP_CORNERS) + 0.5
    z = 1.0 - 2.0 * k / _CLUMP_CORNERS
    r = np.sqrt(1.0 - z * z)
    return _hull(np.column_stack([r * np.cos(_GOLDEN * k), r * np.sin(_GOLDEN * k), z]))


def _hull(points: Floats) -> tuple[Floats, Ints]:
    """Convex hull of points about the origin: its corners, and faces wound outwards."""
    # It takes as long to load as all else that a catalogue needs.
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    used = np.sort(hull.vertices)
    index = np.zeros(len(points), dtype=np.int32)
    index[used] = np.arange(len(used))
    v, faces = points[used], index[hull.simplices]
    normals = cross(v[faces[:, 1]] - v[faces[:, 0]], v[faces[:, 2]] - v[faces[:, 0]])
    inward = dot(normals, v[faces].mean(axis=1) - v.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    order = np.lexsort(faces.T[::-1])
    return v, faces[order]


def whorl(
    rng: np.random.Generator,
    z: float,
    reach: float,
    droop: float,
    rise: float,
    branches: int = 7,
    core: ArrayLike = (0.0, 0.0),
) -> Mesh:
    """Make a tier of a conifer: branches, in metres, that hang outwards like the ribs of a torn umbrella."""
    n = 2 * branches
    angles = (np.arange(n) + rng.uniform(-0.25, 0.25, size=n)) * 2 * np.pi / n + rng.uniform(0, 2 * np.pi)
    tips = np.arange(n) % 2 == 0
    radius = np.where(tips, reach * rng.uniform(0.85, 1.15, size=n), reach * rng.uniform(0.5, 0.62, size=n))
    drop = np.where(tips, droop * rng.uniform(0.8, 1.2, size=n), droop * 0.3)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), z - drop])
    vertices = np.concatenate([rim, [[0.0, 0.0, z + rise], [0.0, 0.0, z - droop * 0.15]]])
    vertices[:, :2] += np.asarray(core)
    k = np.arange(n)
    nxt = (k + 1) % n
    top = np.column_stack([k, nxt, np.full(n, n)])
    under = np.column_stack([nxt, k, np.full(n, n + 1)])
    return mesh(vertices, np.concatenate([top, under]))


def blade(root: ArrayLike, bend: ArrayLike, tip: ArrayLike, width: float) -> Mesh:
    """Make a frond or leaf: two long facets a side from a root over a bend to a tip, 1 cm thick at the bend."""
    a, b, c = (np.asarray(p, dtype=np.float64) for p in (root, bend, tip))
    across = cross(c - a, UP)
    length = float(norm(across))
    across = np.array([1.0, 0.0, 0.0]) if length < 1e-6 else across / length
    w = across * width / 2
    lift = np.array([0.0, 0.0, 0.01])
    return outward(mesh(np.array([a, b + w, b - w, c, b + lift, b - lift]), _BLADE))


def stone(rng: np.random.Generator, radii: ArrayLike, corners: int = 22, sunk: float = 0.3) -> Mesh:
    """Make an angular rock (half extents in metres) on z = 0, `sunk` of its height below.

    Few `corners` make it blocky.
    """
    p = rng.normal(size=(corners, 3))
    p = unit(p)
    p *= rng.uniform(0.82, 1.05, size=(corners, 1))
    v, faces = _hull(p)
    v = v * np.asarray(radii)
    low, high = v[:, 2].min(), v[:, 2].max()
    return mesh(v - (0.0, 0.0, low + sunk * (high - low)), faces)


def split_by_slope(m: Mesh, cosine: float) -> tuple[Mesh, Mesh]:
    """Part a mesh into what faces up (normal's z above `cosine`), where moss lies, and the rest."""
    a, b, c = (m.vertices[m.faces[:, k]] for k in range(3))
    normals = cross(b - a, c - a)
    up = normals[:, 2] > cosine * norm(normals)
    return mesh(m.vertices, m.faces[up]), mesh(m.vertices, m.faces[~up])


def vec(x: float, y: float, z: float) -> Floats:
    """Make a point or an offset, (3,) float64, metres."""
    return np.array([x, y, z], dtype=np.float64)


@builder
def bush(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Bush of three clumps with berries or blossoms on its outside."""
    height, berries = params["height"], round(params["berries"])
    out: Parts = []
    for k in range(3):
        angle = k * 2.1 + rng.uniform(-0.4, 0.4)
        r = height * rng.uniform(0.42, 0.55)
        p = np.array([np.cos(angle) * r * 0.65, np.sin(angle) * r * 0.65, height * 0.42])
        out.append(("leaves", clump(rng, p, (r, r, height * rng.uniform(0.4, 0.52)), 0.3, 1.0)))
        out.append(("stem", limb([vec(0.0, 0.0, -0.2), p], [0.05, 0.02], 5)))
    skin = np.concatenate([body.vertices for role, body in out if role == "leaves"])
    skin = skin[skin[:, 2] > 0.2 * height]
    for p in skin[rng.permutation(len(skin))[:berries]]:
        out.append(("berry", translated(sphere(radius=0.055, subdivisions=0), p)))
    return out


@builder
def fern(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Fern: a funnel of arching fronds."""
    spread = params["spread"]
    fronds = 11
    out: Parts = []
    for k in range(fronds):
        angle = (k + rng.uniform(-0.25, 0.25)) * 2 * np.pi / fronds
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        reach = spread * rng.uniform(0.8, 1.1)
        up = np.array([0.0, 0.0, 1.0])
        bend = way * reach * 0.5 + up * spread * rng.uniform(0.55, 0.75)
        tip = way * reach + up * spread * rng.uniform(0.25, 0.45)
        out.append(("frond", blade(way * 0.04 - up * 0.05, bend, tip, spread * 0.3)))
    return out


@builder
def reeds(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Clump of reeds, some with brown heads."""
    height = params["height"]
    out: Parts = []
    for k in range(14):
        x, y = rng.normal(scale=0.3, size=2)
        lean = rng.normal(scale=0.12, size=2)
        h = height * rng.uniform(0.7, 1.1)
        top = (x + lean[0] * h, y + lean[1] * h, h)
        if k % 3 == 0:
            out.append(("blade", limb([(x, y, -0.2), top], [0.018, 0.012], 4)))
            head = (top[0] + lean[0] * 0.2, top[1] + lean[1] * 0.2, h + 0.22)
            out.append(("head", limb([top, head], [0.04, 0.035], 6)))
        else:
            bend = (x + lean[0] * h * 0.4, y + lean[1] * h * 0.4, h * 0.6)
            out.append(("blade", blade((x, y, -0.1), bend, top, 0.09)))
    return out


@builder
def mushrooms(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Cluster of large mushrooms with spotted caps."""
    size, count = params["size"], round(params["count"])
    out: Parts = []
    for k in range(count):
        s = size * (1.0 if k == 0 else rng.uniform(0.4, 0.8))
        angle, far = k * 2.4, 0.0 if k == 0 else size * rng.uniform(0.55, 0.9)
        at = np.array([np.cos(angle) * far, np.sin(angle) * far, -0.05])
        stem = lathe(points=[(0.17 * s, 0.0), (0.12 * s, 0.5 * s), (0.13 * s, 0.82 * s)], segments=6)
        cap = [(0.0, 0.74 * s), (0.44 * s, 0.7 * s), (0.5 * s, 0.78 * s), (0.36 * s, 0.98 * s), (0.0, 1.08 * s)]
        out.append(("stem", translated(stem, at)))
        out.append(("cap", translated(lathe(points=cap, segments=8), at)))
        for j in range(5 if k == 0 else 2):
            turn, far = j * 2.4 + k, 0.28 * s if j else 0.0
            p = at + vec(np.cos(turn) * far, np.sin(turn) * far, (1.0 if j else 1.06) * s)
            out.append(("spot", translated(sphere(radii=(0.07 * s, 0.07 * s, 0.05 * s), subdivisions=0), p)))
    return out


@builder
def flowers(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Patch of tall flowers over a tuft of leaves."""
    spread, height = params["spread"], params["height"]
    out: Parts = []
    for k in range(12):
        angle, far = k * 2.4, spread * float(np.sqrt((k + 0.5) / 12))
        x, y = np.cos(angle) * far, np.sin(angle) * far
        h = height * rng.uniform(0.75, 1.15)
        out.append(("leaf", blade((x, y, -0.05), (x + 0.1, y + 0.05, h * 0.4), (x + 0.22, y + 0.1, h * 0.3), 0.1)))
        out.append(("leaf", limb([(x, y, -0.1), (x, y, h)], [0.014, 0.01], 3)))
        out.append(("flower", translated(sphere(radii=(0.085, 0.085, 0.06), subdivisions=0), (x, y, h))))
    return out


@builder
def boulder(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Boulder; what faces up is the role `top` (moss, or the stone itself)."""
    size, flat = params["size"], params["flat"]
    radii = (size * rng.uniform(0.85, 1.1), size * rng.uniform(0.7, 0.95), size * flat)
    top, sides = split_by_slope(stone(rng, radii, 26, 0.28), 0.5)
    return [("top", top), ("rock", sides)]


@builder
def rock_pile(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Heap of angular rocks: six below, three above, one on top."""
    size = params["size"]
    out: Parts = []
    for count, far, z, s in ((6, 0.58, 0.0, 0.46), (3, 0.28, 0.24, 0.42), (1, 0.0, 0.5, 0.36)):
        for k in range(count):
            angle = k * 2 * np.pi / count + z + rng.uniform(-0.2, 0.2)
            r = size * s * rng.uniform(0.85, 1.15)
            body = stone(rng, (r, r * rng.uniform(0.75, 1.0), r * rng.uniform(0.6, 0.8)), 14, 0.2)
            at = (np.cos(angle) * size * far, np.sin(angle) * size * far, z * size)
            out.append(("rock" if k % 2 else "rock_dark", translated(body, at)))
    return out
