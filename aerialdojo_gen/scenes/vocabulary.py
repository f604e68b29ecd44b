"""The shape vocabulary of props: shapes, their keys, how parts are repeated, and the letters of signs."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from typing import Any

import numpy as np
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.ops import unary_union

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.scenes import shapes
from aerialdojo_gen.scenes.expressions import evaluate, names_in
from aerialdojo_gen.scenes.mesh import (
    Floats,
    Mesh,
    merge,
    mesh,
    mirrored,
    repeated,
    rotated,
    rotation,
    stretched,
    translated,
)
from aerialdojo_gen.scenes.shapes import extrude, triangulate

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
_DOT = ((-0.42, -0.42), (0.42, -0.42), (0.42, 0.42), (-0.42, 0.42))
_LONGEST = 120


def text(*, text: str, height: float, depth: float = 0.0) -> Mesh:
    """Write letters `height` metres high that face +x and read along +y; without `depth` plates at x = 1 cm."""
    shapes.positive("height", (height,), 1)
    depth = shapes.number("depth", depth)
    if len(text) > _LONGEST:
        raise ShapeError(f"text {text[:40] + '...'!r} has {len(text):,} letters, a sign {_LONGEST} at most")
    letters: list[Mesh] = []
    x = 0.0
    for character in text.upper():
        if character == " ":
            x += _SPACE
            continue
        plates, width = _glyph(character)
        letters += [translated(_plate(plate, depth / height * 6.0), (x, 0.0, 0.0)) for plate in plates]
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
            bodies.append(Polygon([(xy[0][0] + dx, xy[0][1] + dy) for dx, dy in _DOT]))
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


SHAPES: dict[str, Callable[..., Mesh]] = {
    f.__name__: f
    for f in (
        shapes.box, shapes.cylinder, shapes.cone, shapes.sphere, shapes.capsule, shapes.torus, shapes.lathe,
        shapes.sheet, shapes.crown, shapes.prism, shapes.polygon, shapes.profile,
        shapes.sweep, shapes.block, text,
    )
}  # fmt: skip
PLACEMENT_KEYS = frozenset({"shape", "role", "at", "rotate", "tag", "design", "array", "ring", "mirror"})
ARRAY_KEYS = frozenset({"count", "step", "count2", "step2"})
RING_KEYS = frozenset({"count", "radius", "axis", "arc", "start"})
_WORDS = frozenset({("prism", "section"), ("text", "text"), ("ring", "axis")})
_AXES = {"x": 0, "y": 1, "z": 2}
_MAX_COPIES = 2000
# Shapes that turn about their own z axis.
_ROUND = frozenset({"cylinder", "cone", "lathe", "torus", "capsule"})
# Turned bodies of so few sides are square posts; an axis so near to x, y or z lies along it.
_SQUARE, _ALONG = 4, 0.999
_UNTURNED = np.eye(3)
_BODIES: dict[str, Mesh] = {}
_KEPT_BODIES = 4000
# A hundred times what the largest prop of the catalogue has.
MAX_TRIANGLES = 300_000


@cache
def shape_keys(shape: str) -> tuple[frozenset[str], frozenset[str]]:
    """List a shape's required keys, and all its keys."""
    parameters = inspect.signature(SHAPES[shape]).parameters
    required = frozenset(n for n, p in parameters.items() if p.default is inspect.Parameter.empty)
    return required, frozenset(parameters)


def names_used(part: Mapping[str, Any]) -> frozenset[str]:
    """List the parameters used in a part's expressions; `ShapeError` for what is no expression."""
    words, tables = ("shape", "role", "tag", "design", "mirror"), ("array", "ring")
    given = [(part["shape"], key, value) for key, value in part.items() if key not in (*words, *tables)]
    given += [(table, key, value) for table in tables for key, value in part.get(table, {}).items()]
    return frozenset[str]().union(*(_names_in(value) for what, key, value in given if (what, key) not in _WORDS))


def _names_in(value: Any) -> frozenset[str]:
    if isinstance(value, str):
        return names_in(value)
    if isinstance(value, list):
        return frozenset[str]().union(*map(_names_in, value))
    if not isinstance(value, int | float):
        raise ShapeError(f"{value!r} is neither a number nor an expression")
    return frozenset()


def part_mesh(
    part: Mapping[str, Any],
    names: Mapping[str, float],
    words: Mapping[str, str],
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Mesh:
    """Make one part of a prop, repeated and placed in the prop's frame, which is stretched by three factors."""
    shape, whole = part["shape"], np.array(stretch)
    own = {k: v if (shape, k) in _WORDS else _number(v, names) for k, v in part.items() if k not in PLACEMENT_KEYS}
    if shape == "text":
        own["text"] = _fill(own["text"], words)
    body, turn = _shape_body(shape, own), _UNTURNED
    if "rotate" in part:
        turn = rotation(*_triple("rotate", part["rotate"], names))
        body = rotated(body, turn)
    if "ring" not in part:
        body = stretched(body, _round_factors(shape, own, turn, whole))
    if "array" in part:
        body = _arrayed(body, part["array"], names, np.ones(3) if "ring" in part else whole)
    if "ring" in part:
        axis = _AXES[part["ring"].get("axis", "z")]
        body = stretched(_ringed(body, part["ring"], names), _factors_about(axis, whole))
    if "at" in part:
        body = translated(body, np.array(_triple("at", part["at"], names)) * whole)
    for axis in part.get("mirror", ""):
        body = merge([body, mirrored(body, _AXES[axis])])
    return body


def _shape_body(shape: str, own: Mapping[str, Any]) -> Mesh:
    """Make a shape, or find it: the same bars and wheels recur in every stretch of a prop, and in others."""
    # As text, in which 1, 1.0 and true differ, and 0.0 and -0.0.
    key = f"{shape} {own!r}"
    if key not in _BODIES:
        if len(_BODIES) >= _KEPT_BODIES:
            _BODIES.clear()
        _BODIES[key] = SHAPES[shape](**own)
    return _BODIES[key]


def copies_in(part: Mapping[str, Any], names: Mapping[str, float]) -> int:
    """Number of copies that `part_mesh` makes of a part, consecutive and of equally many faces."""
    count = 2 ** len(part.get("mirror", ""))
    for table, keys in (("array", ("count", "count2")), ("ring", ("count",))):
        for key in keys:
            if key in part.get(table, {}):
                count *= round(_number(part[table][key], names))
    return count


def _round_factors(shape: str, own: Mapping[str, Any], turn: Floats, stretch: Floats) -> Floats:
    """Factors (3,) by which a body is stretched so that what is round stays round."""
    if shape == "sphere" and own.get("radius") is not None:
        return np.full(3, np.sort(stretch)[1])
    if shape not in _ROUND or own.get("segments", 12) <= _SQUARE:
        return stretch
    axis = int(np.argmax(np.abs(turn[:, 2])))
    return _factors_about(axis, stretch) if abs(float(turn[axis, 2])) > _ALONG else stretch


def _factors_about(axis: int, stretch: Floats) -> Floats:
    """Factors (3,) that keep a body round about an axis; wheels grow with the height, and so touch the ground."""
    x, y, z = stretch.tolist()
    across = math.sqrt(x * y) if axis == 2 else z
    factors = np.full(3, across)
    factors[axis] = stretch[axis]
    return factors


def _arrayed(body: Mesh, array: Mapping[str, Any], names: Mapping[str, float], stretch: Floats) -> Mesh:
    for count_key, step_key in (("count", "step"), ("count2", "step2")):
        if count_key not in array:
            continue
        count = _count(array[count_key], names, len(body.faces))
        step = np.array(_triple(step_key, array.get(step_key), names)) * stretch
        body = repeated(body, step * np.arange(count)[:, None])
    return body


def _ringed(body: Mesh, ring: Mapping[str, Any], names: Mapping[str, float]) -> Mesh:
    count = _count(ring["count"], names, len(body.faces))
    axis = _AXES[ring.get("axis", "z")]
    arc = shapes.number("arc", _number(ring.get("arc", 360.0), names))
    start = shapes.number("start", _number(ring.get("start", 0.0), names))
    offset = np.zeros(3)
    offset[1 if axis == 0 else 0] = shapes.number("radius", _number(ring.get("radius", 0.0), names))
    body = translated(body, offset)
    step = arc / count if arc == 360.0 else arc / max(count - 1, 1)
    copies = []
    for k in range(count):
        angles = [0.0, 0.0, 0.0]
        angles[axis] = start + k * step
        copies.append(rotated(body, rotation(*angles)))
    return merge(copies)


def _count(value: Any, names: Mapping[str, float], triangles: int) -> int:
    """Read how often so many triangles are repeated."""
    count = round(shapes.number("count", _number(value, names)))
    if not 1 <= count <= _MAX_COPIES:
        raise ShapeError(f"count must be 1 to {_MAX_COPIES}, got {count}")
    if count * triangles > MAX_TRIANGLES:
        raise ShapeError(f"count {count} makes {count * triangles:,} triangles, the maximum is {MAX_TRIANGLES:,}")
    return count


def _triple(key: str, value: Any, names: Mapping[str, float]) -> tuple[float, float, float]:
    numbers = _number(value, names)
    if not isinstance(numbers, list) or len(numbers) != 3:
        raise ShapeError(f"{key} needs three numbers")
    x, y, z = (shapes.number(key, n) for n in numbers)
    return x, y, z


def _number(value: Any, names: Mapping[str, float]) -> Any:
    if isinstance(value, str):
        return evaluate(value, names)
    if isinstance(value, list):
        return [_number(v, names) for v in value]
    if not isinstance(value, int | float):
        raise ShapeError(f"{str(value)[:40]!r} is neither a number nor an expression")
    return value


def _fill(text: Any, words: Mapping[str, str]) -> str:
    if not isinstance(text, str):
        raise ShapeError(f"text must be letters, got {str(text)[:40]!r}")
    for key, word in words.items():
        text = text.replace("{" + key + "}", word)
    return text
