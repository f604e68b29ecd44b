"""Arithmetic in asset files: ``"body_h*0.5+0.1"`` over a prop's parameters."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache

from aerialdojo_gen.base.errors import ShapeError

_LONGEST = 200
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


def _round(value: float, digits: float = 0) -> float:
    return round(value, int(digits)) if digits else round(value)


_FUNCTIONS: dict[str, Callable[..., float]] = {
    "min": min, "max": max, "abs": abs, "sqrt": math.sqrt, "round": _round, "floor": math.floor, "ceil": math.ceil,
    "sin": lambda d: math.sin(math.radians(d)), "cos": lambda d: math.cos(math.radians(d)),
    "tan": lambda d: math.tan(math.radians(d)), "atan2": lambda y, x: math.degrees(math.atan2(y, x)),
}  # fmt: skip
# Minimum and maximum number of arguments, where it is not one.
_ARITY = {"min": (2, 99), "max": (2, 99), "round": (1, 2), "atan2": (2, 2)}
_CONSTANTS = {"pi": math.pi}


def names_in(text: str) -> frozenset[str]:
    """List the names in an arithmetic expression of numbers, names, ``+ - * / // %``.

    Brackets and a few functions.
    """
    return _parse(text)[1]


def evaluate(text: str, names: Mapping[str, float]) -> float:
    """Compute an expression; `ShapeError` for what `names_in` refuses, an unknown name or no finite result."""
    tree, used = _parse(text)
    unknown = sorted(used - names.keys())
    if unknown:
        raise ShapeError(f"{text!r} speaks of the unknown parameter {unknown[0]!r}")
    try:
        value = float(_value(tree, names))
    except (ArithmeticError, ValueError) as error:
        raise ShapeError(f"{text!r}: {error}") from error
    if not math.isfinite(value):
        raise ShapeError(f"{text!r} is {value}, no finite number")
    return value


@lru_cache(maxsize=4096)
def _parse(text: str) -> tuple[ast.expr, frozenset[str]]:
    if len(text) > _LONGEST:
        raise ShapeError(f"{text[:40] + '...'!r} has {len(text):,} characters, an expression {_LONGEST} at most")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise ShapeError(f"{text!r} is no arithmetic expression") from error
    used: set[str] = set()
    _check(tree, text, used)
    return tree, frozenset(used)


def _check(node: ast.expr, text: str, used: set[str]) -> None:
    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            return
        case ast.Name(id=name):
            if name not in _CONSTANTS:
                used.add(name)
        case ast.BinOp() if type(node.op) in _BINARY:
            _check(node.left, text, used)
            _check(node.right, text, used)
        case ast.UnaryOp() if type(node.op) in _UNARY:
            _check(node.operand, text, used)
        case ast.Call(func=ast.Name(id=name), keywords=[]) if name in _FUNCTIONS:
            least, most = _ARITY.get(name, (1, 1))
            if not least <= len(node.args) <= most:
                raise ShapeError(f"{text!r}: {name} does not take {len(node.args)} arguments")
            for argument in node.args:
                _check(argument, text, used)
        case _:
            raise ShapeError(f"{text!r} is no arithmetic expression: {ast.unparse(node)!r} is not allowed")


def _value(node: ast.expr, names: Mapping[str, float]) -> float:
    match node:
        case ast.Constant(value=int() | float() as number):
            return number
        case ast.Name(id=name):
            return names[name] if name in names else _CONSTANTS[name]
        case ast.BinOp():
            return _BINARY[type(node.op)](_value(node.left, names), _value(node.right, names))
        case ast.UnaryOp():
            return _UNARY[type(node.op)](_value(node.operand, names))
        case ast.Call(func=ast.Name(id=name)):
            return _FUNCTIONS[name](*(_value(a, names) for a in node.args))
    raise ShapeError(f"{ast.unparse(node)!r} is not allowed")
