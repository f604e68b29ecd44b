"""A scene's triangles merged by material: what a renderer draws as one body.

The segmentation mask then tells the shader the material of every pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.scenes.model import Part, Scene


@dataclass(frozen=True, eq=False)
class Surface:
    """All triangles of one material.

    Attributes
    ----------
    material : str
        Name of the material.
    vertices : (n, 3) float64
        Metres, world frame.
    uv : (n, 2) float64
        Texture coordinates in tiles.
    faces : (m, 3) int64
        Indices into `vertices`.
    """

    material: str
    vertices: NDArray[np.float64]
    uv: NDArray[np.float64]
    faces: NDArray[np.int64]


def surfaces(scene: Scene) -> list[Surface]:
    """Merge a scene's triangles by material.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    list of Surface
        Ordered by material name.
    """
    by_material: dict[str, list[Part]] = {}
    for instance in scene.instances:
        for part in instance.parts:
            by_material.setdefault(part.material, []).append(part)
    return [_merge(material, by_material[material]) for material in sorted(by_material)]


def _merge(material: str, parts: list[Part]) -> Surface:
    offsets = np.cumsum([0, *(len(p.vertices) for p in parts[:-1])])
    return Surface(
        material,
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.uv for p in parts]).astype(np.float64),
        np.concatenate([p.faces.astype(np.int64) + o for p, o in zip(parts, offsets, strict=True)]),
    )
