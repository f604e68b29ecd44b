"""Solids of the prop vocabulary: boxes, turned bodies, rough ellipsoids, extruded and swept shapes.

Every function returns a `Mesh` with outward faces in the prop's own frame; lengths are metres, and the base centre is
what scene_assets/README.md says of the shape. A `ShapeError` names a size that makes no body, or a count that makes
too large a one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.portable import distances_along, norm, product, unit
from aerialdojo_gen.scenes.kernels import band_faces, extruded, swept_rings
from aerialdojo_gen.scenes.mesh import Floats, Ints, Mesh, merge, mesh, outward, translated

Numbers = Sequence[float]

# What makes vertices is bounded: the largest of the catalogue are 32 segments, 10 sides, 41 points, 119 m.
MAX_SEGMENTS, MAX_SIDES, MAX_POINTS = 256, 64, 2000
_FARTHEST_M = 10_000.0

_BOX_FACES = np.array([
    (0, 3, 2), (0, 2, 1), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
], dtype=np.int32)  # fmt: skip

# Corners of three golden rectangles.
_S, _L = 0.5257311121191336, 0.85065080835204
_ICOSAHEDRON = np.array([
    (-_S, _L, 0.0), (_S, _L, 0.0), (-_S, -_L, 0.0), (_S, -_L, 0.0), (0.0, -_S, _L), (0.0, _S, _L),
    (0.0, -_S, -_L), (0.0, _S, -_L), (_L, 0.0, -_S), (_L, 0.0, _S), (-_L, 0.0, -_S), (-_L, 0.0, _S),
])  # fmt: skip
_ICOSAHEDRON_FACES = np.array([
    (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
    (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7),
    (9, 8, 1),
], dtype=np.int32)  # fmt: skip


def box(*, size: Numbers, taper: Numbers = (1.0, 1.0)) -> Mesh:
    """Make a box on its bottom face; `taper` is the top's size along x and y as a fraction of the bottom's."""
    x, y, z = positive("size", size, 3)
    fx, fy = _numbers("taper", taper, 2)
    u, v = 0.5 * x, 0.5 * y
    bottom = [(-u, -v, 0.0), (u, -v, 0.0), (u, v, 0.0), (-u, v, 0.0)]
    return mesh([*bottom, *((a * fx, b * fy, z) for a, b, _ in bottom)], _BOX_FACES)


def sheet(*, size: Numbers) -> Mesh:
    """Make a horizontal rectangle, 2 cm thick, so that it shows and collides from both sides."""
    x, y = positive("size", size, 2)
    return box(size=(x, y, 0.02))


def cylinder(*, radius: float, height: float, radius_top: float | None = None, segments: float = 12) -> Mesh:
    """Make an upright cylinder, or a frustum where `radius_top` differs from `radius`."""
    positive("radius, height", (radius, height), 2)
    top = radius if radius_top is None else radius_top
    return lathe(points=((radius, 0.0), (top, height)), segments=segments)


def cone(*, radius: float, height: float, segments: float = 12) -> Mesh:
    """Make an upright cone."""
    positive("radius, height", (radius, height), 2)
    return lathe(points=((radius, 0.0), (0.0, height)), segments=segments)


def sphere(
    *, radius: float | None = None, radii: Numbers | None = None, subdivisions: float = 1, half: bool = False
) -> Mesh:
    """Make an ellipsoid about its centre; `half` keeps the upper half, closed by a flat bottom."""
    x, y, z = _radii(radius, radii)
    level = whole("subdivisions", subdivisions, 0, 4)
    if half:
        angles = np.linspace(0.0, np.pi / 2, 3 + level)
        body = lathe(points=tuple((float(np.cos(a)), float(np.sin(a))) for a in angles), segments=8 + 4 * level)
        return mesh(body.vertices * (x, y, z), body.faces)
    vertices, faces = _icosphere(level)
    return Mesh(vertices * (x, y, z), faces)


def capsule(*, radius: float, height: float, segments: float = 8) -> Mesh:
    """Make an upright capsule; the straight part runs from z = 0 to `height`."""
    positive("radius", (radius,), 1)
    number("height", height)
    angles = np.linspace(0.0, np.pi / 2, 3)
    lower = [(radius * float(np.sin(a)), -radius * float(np.cos(a))) for a in angles]
    upper = [(radius * float(np.cos(a)), height + radius * float(np.sin(a))) for a in angles]
    return lathe(points=(*lower, *upper), segments=segments)


def torus(*, radius: float, tube: float, segments: float = 16, sides: float = 6) -> Mesh:
    """Make a ring about the z axis; `radius` is that of the tube's middle line, `tube` that of the tube."""
    positive("radius, tube", (radius, tube), 2)
    n = whole("sides", sides, 3, MAX_SIDES)
    angles = np.arange(n) * 2 * np.pi / n
    ring = [(radius + tube * float(np.cos(a)), tube * float(np.sin(a))) for a in angles]
    return lathe(points=(*ring, ring[0]), segments=segments)


def lathe(*, points: Sequence[Numbers], segments: float = 12) -> Mesh:
    """Turn a profile of (radius, z) in metres about z; closed, u around and v along the profile."""
    profile = np.array(rows_of("points", points, 2))
    profile[np.abs(profile[:, 0]) < 1e-9, 0] = 0.0
    n = whole("segments", segments, 3, MAX_SEGMENTS)
    if (profile[:, 0] < 0).any() or not (profile[:, 0] > 0).any():
        raise ShapeError("a lathe needs points of radius >= 0, one of them > 0")
    profile = profile[np.concatenate([[True], np.any(np.diff(profile, axis=0) != 0.0, axis=1)])]
    closed = len(profile) > 3 and bool(np.all(profile[0] == profile[-1]))
    rows = profile[:-1] if closed else profile
    vertices, rings = _ring_vertices(rows, n)
    around = np.arange(n + 1) * (2 * np.pi * float(rows[:, 0].max()) / n)
    sides, places = band_faces(rings, len(profile) - 1, around, distances_along(profile))
    faces, uvs = [sides], [places]
    for ring, down in () if closed else ((rings[0], True), (rings[-1], False)):
        if ring[0] != ring[1]:
            faces.append(ring[fan(n, down)])
            uvs.append(np.full((n - 2, 3, 2), np.nan))
    return outward(mesh(vertices, np.concatenate(faces), np.concatenate(uvs)))


def crown(
    *,
    radii: Numbers | None = None,
    radius: float | None = None,
    noise: float = 0.2,
    subdivisions: float = 2,
    seed: float = 0,
) -> Mesh:
    """Make a rough ellipsoid for foliage, rocks and rubble: half extents in metres, `noise` 0 to 0.6 of them."""
    scale = _radii(radius, radii)
    if not 0.0 <= number("noise", noise) <= 0.6:
        raise ShapeError(f"noise {noise:g} is outside 0 to 0.6")
    vertices, faces = _icosphere(whole("subdivisions", subdivisions, 0, 4))
    rng = generator(whole("seed", seed, 0, 2**31), "shape-crown")
    waves = rng.normal(size=(10, 3)) * np.repeat([2.0, 4.0], 5)[:, None]
    phases = rng.uniform(0, 2 * np.pi, size=10)
    weights = np.repeat([1.0, 0.6], 5)
    lumps = (np.cos(product(vertices, waves.T) + phases) * weights).sum(axis=1) / weights.sum() * 1.6
    rough = rng.uniform(-0.5, 0.5, size=len(vertices))
    factor = 1.0 + noise * np.clip(lumps + rough, -1.0, 1.0)
    return mesh(vertices * factor[:, None] * scale, faces)


@lru_cache(maxsize=64)
def circle(n: int) -> tuple[Floats, Floats]:
    """Cosines and sines (n,) of the middles of n equal parts of a turn."""
    # Half a step of turn lets a square (4 segments) stand with its sides along x and y.
    angles = (np.arange(n) + 0.5) * 2 * np.pi / n
    return np.cos(angles), np.sin(angles)


@lru_cache(maxsize=64)
def fan(n: int, reverse: bool = False) -> Ints:
    """Triangles (n - 2, 3) of a ring of n vertices from its first, counter-clockwise as the ring or clockwise."""
    k = np.arange(1, n - 1, dtype=np.int32)
    return np.stack([0 * k, k + 1, k] if reverse else [0 * k, k, k + 1], axis=1)


def _ring_vertices(rows: Floats, n: int) -> tuple[Floats, Ints]:
    """Vertices of the rings of a turned body, and their indices (r, n); a ring of radius 0 is one vertex."""
    cos, sin = circle(n)
    sizes = [1 if r == 0.0 else n for r in rows[:, 0].tolist()]
    rings = np.empty((len(rows), n), dtype=np.int32)
    vertices = np.empty((sum(sizes), 3))
    start = 0
    for k, (r, z) in enumerate(rows.tolist()):
        own = vertices[start : start + sizes[k]]
        own[:, 0], own[:, 1], own[:, 2] = (0.0, 0.0, z) if r == 0.0 else (r * cos, r * sin, z)
        rings[k] = start if r == 0.0 else np.arange(start, start + n)
        start += sizes[k]
    return vertices, rings


@lru_cache(maxsize=8)
def _icosphere(subdivisions: int) -> tuple[Floats, Ints]:
    """Vertices and faces of an icosahedron about the origin, each face cut into four so many times."""
    if not subdivisions:
        return unit(_ICOSAHEDRON), _ICOSAHEDRON_FACES
    vertices, faces = _icosphere(subdivisions - 1)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, first, which = np.unique(edges[:, 0] + edges[:, 1] * len(vertices), return_index=True, return_inverse=True)
    ab, bc, ca = which.reshape(-1, 3).T + len(vertices)
    a, b, c = faces.T
    middles = vertices[edges[first]].sum(axis=1) / 2.0
    cut = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return unit(np.concatenate([vertices, middles])), cut.astype(np.int32)


def _radii(radius: float | None, radii: Numbers | None) -> tuple[float, ...]:
    if (radius is None) == (radii is None):
        raise ShapeError("give radius or radii, one of them")
    return positive("radii", (radius,) * 3 if radius is not None else radii or (), 3)


def _numbers(key: str, values: Numbers, count: int) -> tuple[float, ...]:
    if isinstance(values, str | dict) or not hasattr(values, "__len__") or len(values) != count:
        raise ShapeError(f"{key} needs {count} numbers")
    return tuple(number(key, v) for v in values)


def number(key: str, value: Any) -> float:
    """Check a shape's number, metres or a fraction, against its bounds."""
    # Most are plain: the general question costs as much as the rest.
    if type(value) is not float and (isinstance(value, bool) or not isinstance(value, int | float | np.number)):
        raise ShapeError(f"{key} must be a number, got {str(value)[:40]!r}")
    held = float(value)
    if not -_FARTHEST_M <= held <= _FARTHEST_M:
        raise ShapeError(f"{key} must lie within {_FARTHEST_M:,.0f}, got {held:g}")
    return held


def whole(key: str, value: Any, low: int, high: int) -> int:
    """Check a count against its bounds; expressions give floats, which are truncated."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not low <= value < high + 1:
        raise ShapeError(f"{key} must be {low} to {high}, got {str(value)[:40]}")
    return int(value)


def rows_of(key: str, rows: Any, width: int, least: int = 2) -> list[tuple[float, ...]]:
    """Check a shape's list of points against its bounds."""
    if isinstance(rows, str | dict) or not hasattr(rows, "__len__") or not least <= len(rows) <= MAX_POINTS:
        raise ShapeError(f"{key} must be {least} to {MAX_POINTS:,} points")
    return [_numbers(key, row, width) for row in rows]


def positive(key: str, values: Numbers, count: int) -> tuple[float, ...]:
    """Check numbers of a shape that must be above 0."""
    numbers = _numbers(key, values, count)
    if min(numbers) <= 0.0:
        raise ShapeError(f"{key} must be positive, got {', '.join(f'{n:g}' for n in numbers)}")
    return numbers


def prism(*, size: Numbers, section: str = "gable", top: float = 0.5) -> Mesh:
    """Make a prism along x with a gable, wedge or trapezoid section; size in metres."""
    x, y, z = positive("size", size, 3)
    top = number("top", top)
    w = y / 2
    outlines = {
        "gable": [(-w, 0.0), (w, 0.0), (0.0, z)],
        "wedge": [(-w, 0.0), (w, 0.0), (w, z)],
        "trapezoid": [(-w, 0.0), (w, 0.0), (w * top, z), (-w * top, z)],
    }
    if section not in outlines:
        raise ShapeError(f"section {section!r} is none of {', '.join(outlines)}")
    body = extrude(Polygon(outlines[section]), x)
    return Mesh(body.vertices[:, [2, 0, 1]] - (x / 2, 0.0, 0.0), body.faces)


def polygon(*, points: Sequence[Numbers], height: float, holes: Sequence[Sequence[Numbers]] = ()) -> Mesh:
    """Extrude a plan upwards from z = 0; `points` are (x, y), metres, in either sense of rotation."""
    positive("height", (height,), 1)
    outline = rows_of("points", points, 2, 0)
    if isinstance(holes, str | dict) or not hasattr(holes, "__len__") or len(holes) > 100:
        raise ShapeError("holes must be 0 to 100 lists of points")
    inner = [rows_of("holes", hole, 2, 3) for hole in holes]
    return extrude(_checked(Polygon(outline, inner) if len(outline) > 2 else None), height)


def profile(*, points: Sequence[Numbers], width: float) -> Mesh:
    """Extrude a side view along y, centred on y = 0; `points` are (x, z), metres."""
    positive("width", (width,), 1)
    outline = rows_of("points", points, 2, 0)
    return upright([_checked(Polygon(outline) if len(outline) > 2 else None)], width)


def upright(faces: Sequence[Polygon], width_m: float, y_m: float = 0.0) -> Mesh:
    """Extrude side views, polygons of (x, z) in metres, along y, centred on `y_m`; patterns are projected anew."""
    bodies = []
    for face in faces:
        body = extrude(face, width_m)
        vertices = body.vertices[:, [0, 2, 1]]
        vertices[:, 1] = y_m + width_m / 2 - vertices[:, 1]
        bodies.append(Mesh(vertices, body.faces))
    return merge(bodies)


def block(*, corners: Numbers, z: Numbers) -> Mesh:
    """Make an axis-parallel block from ``[x0, y0, x1, y1]`` between two heights, metres."""
    x0, y0, x1, y1 = _numbers("corners", corners, 4)
    z0, z1 = _numbers("z", z, 2)
    return translated(extrude(Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), z1 - z0), (0.0, 0.0, z0))


def sweep(
    *,
    path: Sequence[Numbers],
    radius: float | None = None,
    section: Numbers | None = None,
    closed: bool = False,
    sides: float = 6,
) -> Mesh:
    """Sweep a round or rectangular section along a path in metres; closed, mitred at corners."""
    line = np.array(rows_of("path", path, 3, 1))
    line = line[np.concatenate([[True], norm(np.diff(line, axis=0)) > 1e-9])]
    if len(line) < (3 if closed else 2):
        raise ShapeError("a sweep needs a path of two distinct points, three where it is closed")
    if (radius is None) == (section is None):
        raise ShapeError("give radius or section, one of them")
    if section is not None:
        w, h = positive("section", section, 2)
        ring = np.array([(-w, -h), (w, -h), (w, h), (-w, h)]) / 2
    else:
        (thick,) = positive("radius", (0.0 if radius is None else radius,), 1)
        n = whole("sides", sides, 3, MAX_SIDES)
        ring = np.stack(circle(n), axis=1) * thick
    rings = swept_rings(line, ring, closed)
    if not len(rings):
        raise ShapeError("the path turns back on itself")
    return _skin(rings, closed)


def extrude(plan: Polygon, height: float) -> Mesh:
    """Extrude a shapely polygon from z = 0 to `height` metres; wall textures run on around the corners."""
    if not isinstance(plan, Polygon) or plan.is_empty:
        raise ShapeError("the outline has no area, or is in pieces")
    outlines = _without_straight_corners(orient(plan))
    rings = [shapely.linearrings(outline) for outline in outlines]
    corners = shapely.get_coordinates(shapely.constrained_delaunay_triangles(Polygon(rings[0], rings[1:])))
    starts = np.cumsum([0, *(len(outline) for outline in outlines)])
    vertices, faces, uv = extruded(np.concatenate(outlines), starts, corners.reshape(-1, 4, 2), float(height))
    assert len(faces), "a triangle with a corner that is no vertex"
    return mesh(vertices, faces, uv)


def triangulate(plan: Polygon) -> tuple[Floats, Ints]:
    """Triangulate a polygon with holes: vertices (n, 2), exterior first, and counter-clockwise faces (m, 3)."""
    vertices, _, faces = triangulate_all([plan])
    return vertices, faces


def triangulate_all(plans: Sequence[Polygon]) -> tuple[Floats, NDArray[np.int64], Ints]:
    """Triangulate polygons with holes: vertices (n, 2), the polygon of each, and counter-clockwise faces (m, 3)."""
    rings, owner = shapely.get_rings(np.asarray(plans, dtype=object), return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    first = np.flatnonzero(np.diff(ring, append=-1) == 0)
    vertices, whose = points[first], owner[ring[first]]
    # Constrained Delaunay: plain ear clipping leaves triangles without area, and with them cracks.
    pieces = shapely.constrained_delaunay_triangles(np.asarray(plans, dtype=object))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    of = np.repeat(np.arange(len(plans)), 3 * shapely.get_num_geometries(pieces))
    # A corner is the last vertex of its polygon at its place; sorted, it follows that one.
    x, y = np.concatenate([vertices, corners]).T
    order = np.lexsort((y, x, np.concatenate([whose, of])))
    last = np.maximum.accumulate(np.where(order < len(vertices), np.arange(len(order)), 0))
    index = np.empty(len(order), dtype=np.int32)
    index[order] = order[last]
    faces = index[len(vertices) :].reshape(-1, 3)
    assert np.array_equal(vertices[faces].reshape(-1, 2), corners), "a triangle with a corner that is no vertex"
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    faces[turned] = faces[turned][:, ::-1]
    return vertices, whose, faces


def _without_straight_corners(plan: Polygon) -> list[Floats]:
    """Rings of a polygon, (n, 2) each, the exterior first; straight corners add triangles to lids and no shape."""
    rings = []
    points, ring = shapely.get_coordinates(shapely.get_rings(plan), return_index=True)
    for closed in np.split(points, np.flatnonzero(np.diff(ring)) + 1):
        xy = closed[:-1]
        turned = np.concatenate([xy[-1:], xy, xy[:1]])
        before, after = turned[1:-1] - turned[:-2], turned[2:] - turned[1:-1]
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        corners = xy[np.abs(turn) > 1e-9 * (1.0 + norm(before) * norm(after))]
        if len(corners) < 3:
            raise ShapeError("the outline has no area")
        rings.append(corners)
    return rings


def _checked(plan: Polygon | None) -> Polygon:
    if plan is None or not plan.is_valid or plan.area <= 0.0:
        raise ShapeError("the outline is no simple polygon of three or more points")
    return plan


def _skin(rings: Floats, closed: bool) -> Mesh:
    rows, n = rings.shape[:2]
    middle = rings.mean(axis=1)
    along, around = (np.concatenate([[0.0], np.cumsum(norm(np.roll(p, -1, axis=0) - p))]) for p in (middle, rings[0]))
    index = np.arange(rows * n, dtype=np.int32).reshape(rows, n)
    faces, places = band_faces(index, rows if closed else rows - 1, around, along)
    places = places[:, :, ::-1]
    if not closed:
        faces = np.concatenate([faces, fan(n, reverse=True), index[-1][fan(n)]])
        places = np.concatenate([places, np.full((2 * (n - 2), 3, 2), np.nan)])
    return outward(mesh(rings.reshape(-1, 3), faces, places))
