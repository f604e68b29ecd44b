"""Letters of signs: a stroke font on a grid of 4 by 6, thickened to plates."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.ops import unary_union

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.scenes.mesh import Mesh, merge, mesh, translated
from aerialdojo_gen.scenes.shapes import _positive, extrude, number, triangulate

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
