"""Uniforms, vertex layouts and tables of the OpenGL programs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.rendering.gl_geometry import VERTEX

Floats = NDArray[np.float64]

_FORMATS = {
    "position": "3f", "uv": "2f", "normal": "3f", "colour": "4f1", "texel_m": "1f", "layer": "1f", "instance": "1f",
}  # fmt: skip


def table_texture(gl: Any, values: NDArray[Any], dtype: str) -> Any:
    """Upload a table (n, m, 1) that is read between its cells, and repeats."""
    texture = gl.texture(values.shape[1::-1], 1, np.ascontiguousarray(values), dtype=dtype, alignment=1)
    texture.filter = (gl.LINEAR, gl.LINEAR)
    return texture


def columns(matrix: Floats) -> bytes:
    """Give a matrix as OpenGL wants it, column by column."""
    return np.ascontiguousarray(matrix.T, dtype=np.float32).tobytes()


def write(uniforms: dict[str, Any], values: dict[str, bytes]) -> None:
    """Write the uniforms that a program has."""
    for name, uniform in uniforms.items():
        uniform.write(values[name])


def set_all(program: Any, **values: Any) -> None:
    """Set the uniforms that the program has: a compiler drops unused ones."""
    for name, value in values.items():
        if name in program:
            if isinstance(value, bytes):
                program[name].write(value)
            else:
                program[name].value = tuple(value.tolist()) if isinstance(value, np.ndarray) else value


def content(program: Any, buffer: Any) -> tuple[Any, ...]:
    """Vertex layout of the buffer: the fields that the program reads, and padding for the others."""
    layout = " ".join(form if name in program else f"{VERTEX[name].itemsize}x" for name, form in _FORMATS.items())
    return (buffer, layout, *(name for name in _FORMATS if name in program))
