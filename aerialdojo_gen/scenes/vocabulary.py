"""The shape vocabulary of props: shapes, their keys, and how parts are repeated."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.scenes import lettering, shapes
from aerialdojo_gen.scenes.designs import ROUND
from aerialdojo_gen.scenes.expressions import evaluate, names_in
from aerialdojo_gen.scenes.mesh import (
    Floats,
    Mesh,
    merge,
    mirrored,
    repeated,
    rotated,
    rotation,
    stretched,
    translated,
)

SHAPES: dict[str, Callable[..., Mesh]] = {
    f.__name__: f
    for f in (
        shapes.box, shapes.cylinder, shapes.cone, shapes.sphere, shapes.capsule, shapes.torus, shapes.lathe,
        shapes.sheet, shapes.crown, shapes.prism, shapes.polygon, shapes.profile,
        shapes.sweep, shapes.block, lettering.text,
    )
}  # fmt: skip
PLACEMENT_KEYS = frozenset({"shape", "role", "at", "rotate", "tag", "design", "array", "ring", "mirror"})
ARRAY_KEYS = frozenset({"count", "step", "count2", "step2"})
RING_KEYS = frozenset({"count", "radius", "axis", "arc", "start"})
_WORDS = frozenset({("prism", "section"), ("text", "text"), ("ring", "axis")})
_AXES = {"x": 0, "y": 1, "z": 2}
_MAX_COPIES = 2000
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
    shape = part["shape"]
    found: set[str] = set()
    for key, value in part.items():
        if key in ("shape", "role", "tag", "design", "mirror") or (shape, key) in _WORDS:
            continue
        if key in ("array", "ring"):
            for inner, number in value.items():
                if (key, inner) not in _WORDS:
                    _collect(number, found)
        else:
            _collect(value, found)
    return frozenset(found)


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
    if shape not in ROUND or own.get("segments", 12) <= _SQUARE:
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


def _collect(value: Any, found: set[str]) -> None:
    if isinstance(value, str):
        found |= names_in(value)
    elif isinstance(value, list):
        for item in value:
            _collect(item, found)
    elif not isinstance(value, int | float):
        raise ShapeError(f"{value!r} is neither a number nor an expression")


def _fill(text: Any, words: Mapping[str, str]) -> str:
    if not isinstance(text, str):
        raise ShapeError(f"text must be letters, got {str(text)[:40]!r}")
    for key, word in words.items():
        text = text.replace("{" + key + "}", word)
    return text
