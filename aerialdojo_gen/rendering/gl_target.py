"""Reading of OpenGL's render targets: two numbers per pixel, its colour's four bytes and its depth's bits."""

from __future__ import annotations

import threading
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.rendering.picture import Picture

# Read buffers per thread: allocating them costs more than reading.
_thread = threading.local()


def clear_depth(target: Any, colours: int) -> None:
    """Clear a target's depth only: the sky covers all colours."""
    # One attachment has its mask alone, several have a tuple of them.
    none, every = (False,) * 4, (True,) * 4
    if colours:
        target.color_mask = none if colours == 1 else (none,) * colours
    target.clear(depth=1.0)
    if colours:
        target.color_mask = every if colours == 1 else (every,) * colours


def read_picture(target: Any, camera: Camera, instances: bool) -> Picture:
    """Read a picture of a camera, with its instance id map where it has one."""
    shape = (camera.height, camera.width)
    rgb, depth = np.empty((*shape, 3), dtype=np.uint8), np.empty(shape, dtype=np.float32)
    read_pixels(target, rgb, depth)
    return Picture(rgb, depth, read_instances(target, shape) if instances else None)


def read_instances(target: Any, shape: tuple[int, int]) -> NDArray[np.int32]:
    """Read the instance id map, (H, W) int32, of a target that was drawn with one; -1 where nothing is hit."""
    numbers = np.empty(shape, dtype=np.float32)
    target.read_into(numbers, components=1, attachment=1, dtype="f4")
    return numbers.astype(np.int32) - 1


def read_pixels(target: Any, rgb: NDArray[np.uint8], depth_m: NDArray[np.float32]) -> None:
    """Read what was drawn into RGB (H, W, 3) uint8 and planar depth (H, W), inf where nothing is hit."""
    shape = depth_m.shape
    if getattr(_thread, "shape", None) != shape:
        # Colours as raw bytes, and depths.
        _thread.shape, _thread.pixels = shape, np.empty((*shape, 2), np.float32)
        _thread.rgba = np.empty(shape, np.float32)
    target.read_into(_thread.pixels, components=2, dtype="u4")
    cv2.split(_thread.pixels, [_thread.rgba, depth_m])
    cv2.cvtColor(_thread.rgba.view(np.uint8).reshape(*shape, 4), cv2.COLOR_RGBA2RGB, dst=rgb)
