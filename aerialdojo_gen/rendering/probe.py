"""A small scene whose pictures are known: what a renderer is checked with before it is trusted."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

# The corners of a box's six faces, counter-clockwise seen from outside; bit 0 of a corner is x, bit 1 y, bit 2 z.
_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


@lru_cache(maxsize=1)
def probe_scene() -> Scene:
    """Build a yard of 16 m: a checkered ground, two walls, a red cube and slanted bars before the sky."""
    checks = np.kron([[60, 150], [150, 60]], np.ones((8, 8)))[..., None].repeat(3, axis=2).astype(np.uint8)
    materials = {
        "checks": Material("checks", (105, 105, 105), checks, 2.0),
        "grey": Material("grey", (140, 140, 140)),
        "red": Material("red", (210, 30, 30)),
    }
    bars = [_box(f"bar_{k}", (3.0 + k, 3.2, 2.0), (3.2 + k, 3.4, 6.0), "grey", lean=0.3 * k) for k in range(3)]
    instances = (
        _box("ground", (-12.0, -12.0, -1.0), (12.0, 12.0, 0.0), "checks"),
        _box("north", (-8.0, 8.0, 0.0), (8.0, 9.0, 4.0), "grey"),
        _box("south", (-8.0, -9.0, 0.0), (8.0, -8.0, 4.0), "checks"),
        _box("cube", (2.0, 1.0, 1.0), (3.0, 2.0, 2.0), "red"),
        *bars,
    )
    return Scene("Probe", instances, materials, np.array([[-12.0, -12.0, 0.0], [12.0, 12.0, 12.0]]))


def _box(
    node: str, low: tuple[float, float, float], high: tuple[float, float, float], material: str, lean: float = 0.0
) -> Instance:
    """Make a box; one that leans is sheared along x by so many metres over its height."""
    ends = np.array([low, high])
    vertices, faces = [], []
    for k, face in enumerate(_FACES):
        for corner in face:
            bits = [corner & 1, corner >> 1 & 1, corner >> 2 & 1]
            x, y, z = (ends[bit, axis] for axis, bit in enumerate(bits))
            vertices.append((x + lean * bits[2], y, z))
        faces += [(4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3)]
    at: NDArray[np.float64] = np.array(vertices)
    uv = (at[:, :2] + at[:, 2:]).astype(np.float32) / np.float32(2.0)
    return Instance(node, "probe", "", {}, (Part(at, np.array(faces, dtype=np.int32), uv, material),))
