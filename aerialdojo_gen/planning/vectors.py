"""LLVM's vectors of float32 for Numba's intrinsics; `b` is the builder of instructions."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

INT32 = ir.IntType(32)


def floats(lanes: int) -> ir.VectorType:
    """Vector of so many float32."""
    return ir.VectorType(ir.FloatType(), lanes)


def constant(kind: ir.VectorType, value: float) -> ir.Constant:
    """Vector with one constant in all lanes."""
    return ir.Constant(kind, [value] * kind.count)


def splat(b: Any, value: Any, kind: ir.VectorType) -> Any:
    """Vector with one value in all lanes."""
    undefined = ir.Constant(kind, ir.Undefined)
    one = b.insert_element(undefined, value, ir.Constant(INT32, 0))
    return b.shuffle_vector(one, undefined, constant(ir.VectorType(INT32, kind.count), 0))


def pointer(b: Any, data: Any, index: Any, kind: ir.VectorType) -> Any:
    """Where in an array a vector begins."""
    return b.bitcast(b.gep(data, [index]), kind.as_pointer())


def load(b: Any, data: Any, index: Any, kind: ir.VectorType) -> Any:
    """Vector of an array's elements from an index on."""
    return b.load(pointer(b, data, index, kind), align=4)


def data_of(context: Any, b: Any, signature: Any, args: Any, *places: int) -> list[Any]:
    """Pointers to the first elements of some array arguments."""
    return [context.make_array(signature.args[n])(context, b, args[n]).data for n in places]
