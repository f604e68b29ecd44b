"""Extruded and swept shapes of the prop vocabulary: prisms, polygons, side views, sweeps, letters of signs.

Conventions as in `aerialdojo_gen.scenes.shapes`. Letters are a stroke font on a grid of 4 by 6, thickened to plates.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.polygon import orient
from shapely.ops import unary_union

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.kernels import band_faces, extruded, swept_rings
from aerialdojo_gen.scenes.mesh import Floats, Ints, Mesh, merge, mesh, outward, translated
from aerialdojo_gen.scenes.shapes import MAX_SIDES, Numbers, _numbers, _positive, circle, fan, number, rows_of, whole

_SECTIONS = ("gable", "wedge", "trapezoid")


def prism(*, size: Numbers, section: str = "gable", top: float = 0.5) -> Mesh:
    """Make a prism along x with a gable, wedge or trapezoid section; size in metres."""
    x, y, z = _positive("size", size, 3)
    top = number("top", top)
    if section not in _SECTIONS:
        raise ShapeError(f"section {section!r} is none of {', '.join(_SECTIONS)}")
    w = y / 2
    outline = {
        "gable": [(-w, 0.0), (w, 0.0), (0.0, z)],
        "wedge": [(-w, 0.0), (w, 0.0), (w, z)],
        "trapezoid": [(-w, 0.0), (w, 0.0), (w * top, z), (-w * top, z)],
    }[section]
    body = extrude(Polygon(outline), x)
    return Mesh(body.vertices[:, [2, 0, 1]] - (x / 2, 0.0, 0.0), body.faces)


def polygon(*, points: Sequence[Numbers], height: float, holes: Sequence[Sequence[Numbers]] = ()) -> Mesh:
    """Extrude a plan upwards from z = 0; `points` are (x, y), metres, in either sense of rotation."""
    _positive("height", (height,), 1)
    outline = rows_of("points", points, 2, 0)
    if isinstance(holes, str | dict) or not hasattr(holes, "__len__") or len(holes) > 100:
        raise ShapeError("holes must be 0 to 100 lists of points")
    inner = [rows_of("holes", hole, 2, 3) for hole in holes]
    return extrude(_checked(Polygon(outline, inner) if len(outline) > 2 else None), height)


def profile(*, points: Sequence[Numbers], width: float) -> Mesh:
    """Extrude a side view along y, centred on y = 0; `points` are (x, z), metres."""
    _positive("width", (width,), 1)
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
    body = extrude(Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), z1 - z0)
    return Mesh(body.vertices + np.array([0.0, 0.0, z0]), body.faces, body.corner_uv)


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
        w, h = _positive("section", section, 2)
        ring = np.array([(-w, -h), (w, -h), (w, h), (-w, h)]) / 2
    else:
        (thick,) = _positive("radius", (0.0 if radius is None else radius,), 1)
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
    steps = norm(np.roll(middle, -1, axis=0) - middle)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    edges = norm(np.roll(rings[0], -1, axis=0) - rings[0])
    around = np.concatenate([[0.0], np.cumsum(edges)])
    index = np.arange(rows * n, dtype=np.int32).reshape(rows, n)
    faces, places = band_faces(index, rows if closed else rows - 1, around, along)
    places = places[:, :, ::-1]
    if not closed:
        faces = np.concatenate([faces, fan(n, reverse=True), index[-1][fan(n)]])
        places = np.concatenate([places, np.full((2 * (n - 2), 3, 2), np.nan)])
    return outward(mesh(rings.reshape(-1, 3), faces, places))


# Strokes are parted by blanks; every point is two digits, x 0-4 and y 0-6.
_STROKES = {
    "A": "002640 1232", "B": "00063645443303 3342413000", "C": "4536160501103041",
    "D": "00062644422000", "E": "46060040 0333", "F": "460600 0333", "G": "45361605011030414323",
    "H": "0006 4046 0343", "I": "0006", "J": "4641301001", "K": "0006 460340", "L": "060040",
    "M": "0006234640", "N": "00064046", "O": "050110304145361605", "P": "00063645443303",
    "Q": "050110304145361605 2240", "R": "00063645443303 2340", "S": "453616050413334241301001",
    "T": "0646 2026", "U": "060110304146", "V": "062046", "W": "0610233046", "X": "0046 0640",
    "Y": "062346 2320", "Z": "06460040", "0": "050110304145361605", "1": "042620 1030",
    "2": "05163645440040", "3": "05163645443323 334241301001", "4": "30360242",
    "5": "460603334241301001", "6": "4536160501103041423303", "7": "064620",
    "8": "160504133344453616 1302011030414233", "9": "0110304145361605041343",
    "&": "400405162635340201102042", "-": "0333", "+": "2125 0343", "/": "0046",
    "!": "0206 0000", "?": "051636454422 2020", ".": "0000", ",": "0100",
    "'": "0506", ":": "0101 0404", "=": "0242 0444", "%": "0046 0505 4141", "#": "1016 3036 0242 0444",
    "<": "450341", ">": "054301", "*": "1234 1432 2125",
}  # fmt: skip
_THICKNESS = 0.85
_GAP = 1.5
_SPACE = 3.0
_LONGEST = 120


def text(*, text: str, height: float, depth: float = 0.0) -> Mesh:
    """Write letters `height` metres high that face +x and read along +y; without `depth` plates at x = 1 cm."""
    _positive("height", (height,), 1)
    depth = number("depth", depth)
    if len(text) > _LONGEST:
        raise ShapeError(f"text {text[:40] + '...'!r} has {len(text):,} letters, a sign {_LONGEST} at most")
    letters: list[Mesh] = []
    x = 0.0
    for character in text.upper():
        if character == " ":
            x += _SPACE
            continue
        plates, width = _glyph(character)
        for plate in plates:
            letters.append(translated(_plate(plate, depth / height * 6.0), (x, 0.0, 0.0)))
        x += width + _GAP
    if not letters:
        raise ShapeError(f"text {text!r} has no letter")
    body = merge(letters)
    width = x - _GAP
    across, up, out = (body.vertices * (height / 6.0)).T
    offset = 0.0 if depth > 0 else 0.01
    # Seen from +x, looking towards -x with z up, reading direction is +y.
    placed = np.column_stack([out + offset, across - width * height / 12.0, up])
    return Mesh(placed, body.faces)


def _plate(plan: Polygon, depth: float) -> Mesh:
    if depth > 0:
        return extrude(plan, depth)
    flat, faces = triangulate(plan)
    return mesh(np.column_stack([flat, np.zeros(len(flat))]), faces)


@lru_cache(maxsize=128)
def _glyph(character: str) -> tuple[tuple[Polygon, ...], float]:
    if character not in _STROKES:
        raise ShapeError(f"the sign font has no letter {character!r}")
    half = _THICKNESS / 2
    bodies = []
    for stroke in _STROKES[character].split():
        # Strokes run half a thickness inside the cell, so that a letter is exactly 6 units tall.
        xy = [(int(stroke[i]), half + int(stroke[i + 1]) * (6 - _THICKNESS) / 6) for i in range(0, len(stroke), 2)]
        if len(set(xy)) == 1:
            bodies.append(Polygon([(xy[0][0] + dx, xy[0][1] + dy) for dx, dy in _SQUARE]))
        else:
            bodies.append(LineString(xy).buffer(half, cap_style="square", join_style="mitre", mitre_limit=1.2))
    union = unary_union(bodies).simplify(0.01)
    low, _, high, _ = union.bounds
    plates = union.geoms if isinstance(union, MultiPolygon) else (union,)
    moved = tuple(
        Polygon(
            [(x - low, y) for x, y in p.exterior.coords], [[(x - low, y) for x, y in h.coords] for h in p.interiors]
        )
        for p in plates
    )
    return moved, high - low


_SQUARE = ((-0.42, -0.42), (0.42, -0.42), (0.42, 0.42), (-0.42, 0.42))
