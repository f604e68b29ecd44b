"""Arithmetic in asset files: ``"body_h*0.5+0.1"`` over a prop's parameters, or over arrays of numbers."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.geometry.portable import atan2, exp, power

Floats = NDArray[np.float64]
Computed = Callable[[Mapping[str, Any]], Any]

_LONGEST = 200
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


def _round(value: float, digits: float = 0) -> float:
    return round(value, int(digits)) if digits else round(value)


def eased(t: Floats | float, start: Floats | float, end: Floats | float) -> Floats:
    """Climb smoothly from 0 at `start` to 1 at `end`: numbers, or arrays of one shape."""
    u = np.clip((np.asarray(t, dtype=np.float64) - start) / (end - start), 0.0, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))


# Functions with the least and the largest number of their arguments: of numbers, and of arrays.
_Functions = Mapping[str, tuple[Callable[..., Any], int, int]]
_FUNCTIONS: _Functions = {
    "min": (min, 2, 99), "max": (max, 2, 99), "abs": (abs, 1, 1), "sqrt": (math.sqrt, 1, 1), "round": (_round, 1, 2),
    "floor": (math.floor, 1, 1), "ceil": (math.ceil, 1, 1), "sin": (lambda d: math.sin(math.radians(d)), 1, 1),
    "cos": (lambda d: math.cos(math.radians(d)), 1, 1), "tan": (lambda d: math.tan(math.radians(d)), 1, 1),
    "atan2": (lambda y, x: math.degrees(math.atan2(y, x)), 2, 2),
}  # fmt: skip
_OF_ARRAYS: _Functions = {
    "min": (np.minimum, 2, 2), "max": (np.maximum, 2, 2), "abs": (np.abs, 1, 1), "sqrt": (np.sqrt, 1, 1),
    "exp": (exp, 1, 1), "pow": (power, 2, 2), "hypot": (np.hypot, 2, 2), "clip": (np.clip, 3, 3),
    "eased": (eased, 3, 3), "choose": (lambda t, a, b: np.where(t > 0.0, a, b), 3, 3),
    "sin": (lambda d: np.sin(np.radians(d)), 1, 1), "cos": (lambda d: np.cos(np.radians(d)), 1, 1),
    "atan2": (lambda y, x: np.degrees(atan2(y, x)), 2, 2),
}  # fmt: skip
_CONSTANTS = {"pi": math.pi}


def names_in(text: str) -> frozenset[str]:
    """List the names in an arithmetic expression of numbers, names, ``+ - * / // %``, brackets, a few functions."""
    return _parse(text)[1]


def evaluate_arrays(text: str, names: Mapping[str, Floats | float]) -> Floats:
    """Compute an expression over arrays of one shape, with their own functions.

    Among them are ``exp``, ``pow``, ``hypot``, ``clip(t, low, high)``, ``eased(t, start, end)``, which climbs from
    0 to 1, and ``choose(t, a, b)``: a where t is positive, else b.
    """
    computed, used = _parse(text, arrays=True)
    if not names.keys() >= used:
        raise ShapeError(f"{text!r} uses the unknown name {min(used - names.keys())!r}")
    with np.errstate(all="ignore"):
        value = np.asarray(computed(names), dtype=np.float64)
    if not np.isfinite(value).all():
        raise ShapeError(f"{text!r} gives numbers that are not finite")
    return value


def evaluate(text: str, names: Mapping[str, float]) -> float:
    """Compute an expression; `ShapeError` for what `names_in` refuses, an unknown name or no finite result."""
    computed, used = _parse(text)
    if not names.keys() >= used:
        raise ShapeError(f"{text!r} uses the unknown parameter {min(used - names.keys())!r}")
    try:
        value = float(computed(names))
    except (ArithmeticError, ValueError) as error:
        raise ShapeError(f"{text!r}: {error}") from error
    if not math.isfinite(value):
        raise ShapeError(f"{text!r} is {value}, no finite number")
    return value


@lru_cache(maxsize=4096)
def _parse(text: str, arrays: bool = False) -> tuple[Computed, frozenset[str]]:
    if len(text) > _LONGEST:
        raise ShapeError(f"{text[:40] + '...'!r} has {len(text):,} characters, an expression {_LONGEST} at most")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise ShapeError(f"{text!r} is no arithmetic expression") from error
    used: set[str] = set()
    computed = _compiled(tree, text, used, _OF_ARRAYS if arrays else _FUNCTIONS)
    return computed, frozenset(used)


def _compiled(node: ast.expr, text: str, used: set[str], functions: _Functions) -> Computed:
    """Check an expression, collect its names, and make a function of them: it is computed many times."""

    def inner(part: ast.expr) -> Computed:
        return _compiled(part, text, used, functions)

    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return lambda _names: number
        case ast.Name(id=name) if name in _CONSTANTS:
            return lambda names: names.get(name, _CONSTANTS[name])
        case ast.Name(id=name):
            used.add(name)
            return lambda names: names[name]
        case ast.BinOp() if type(node.op) in _BINARY:
            left, right, both = inner(node.left), inner(node.right), _BINARY[type(node.op)]
            return lambda names: both(left(names), right(names))
        case ast.UnaryOp() if type(node.op) in _UNARY:
            operand, sign = inner(node.operand), _UNARY[type(node.op)]
            return lambda names: sign(operand(names))
        case ast.Call(func=ast.Name(id=name), keywords=[]) if name in functions:
            function, least, most = functions[name]
            if not least <= len(node.args) <= most:
                raise ShapeError(f"{text!r}: {name} does not take {len(node.args)} arguments")
            arguments = [inner(one) for one in node.args]
            return lambda names: function(*[one(names) for one in arguments])
    raise ShapeError(f"{text!r} is no arithmetic expression: {ast.unparse(node)!r} is not allowed")
