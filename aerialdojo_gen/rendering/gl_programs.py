"""What goes to OpenGL's memory and comes from it: uniforms, vertex layouts, tables, render targets.

A target has two numbers per pixel: the four bytes of its colour, and the bits of its depth.
"""

from __future__ import annotations

import threading
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.arrays import Bytes, Floats, Int32s, Singles
from aerialdojo_gen.rendering.gl_geometry import VERTEX

# Read buffers per thread: allocating them costs more than reading.
_thread = threading.local()

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


def clear_depth(target: Any, colours: int) -> None:
    """Clear a target's depth only: the sky covers all colours."""
    # One attachment has its mask alone, several have a tuple of them.
    none, every = (False,) * 4, (True,) * 4
    if colours:
        target.color_mask = none if colours == 1 else (none,) * colours
    target.clear(depth=1.0)
    if colours:
        target.color_mask = every if colours == 1 else (every,) * colours


def read_pixels(target: Any, rgb: Bytes, depth_m: Singles, instance: Int32s | None = None) -> None:
    """Read what was drawn: RGB (H, W, 3), planar depth (H, W), inf for no hit, instances (H, W), -1 for no hit."""
    shape = depth_m.shape
    if getattr(_thread, "shape", None) != shape:
        # Colours as raw bytes, and depths.
        _thread.shape, _thread.pixels = shape, np.empty((*shape, 2), np.float32)
        _thread.rgba = np.empty(shape, np.float32)
    target.read_into(_thread.pixels, components=2, dtype="u4")
    cv2.split(_thread.pixels, [_thread.rgba, depth_m])
    cv2.cvtColor(_thread.rgba.view(np.uint8).reshape(*shape, 4), cv2.COLOR_RGBA2RGB, dst=rgb)
    if instance is not None:
        numbers = np.empty(shape, dtype=np.float32)
        target.read_into(numbers, components=1, attachment=1, dtype="f4")
        instance[:] = numbers.astype(np.int32) - 1
