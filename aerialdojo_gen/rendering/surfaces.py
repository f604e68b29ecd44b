"""A scene's triangles sorted into surfaces that a renderer can draw and light as one.

A surface is one material facing one way: all of a scene's triangles of the same material whose normals fall into the
same small cone. The rasteriser then needs one body a surface, and its segmentation mask tells the shader the material
and the normal of every pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.scenes.model import Scene

# Cells of this size on the unit cube: cones of about 15°, so that gentle terrain shades without visible steps.
_CELLS = 4


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one material that face about the same way.

    Attributes
    ----------
    material : str
        Name of the material.
    normal : (3,) float64
        Area-weighted mean of the triangles' normals, a unit vector, world frame.
    vertices : (n, 3) float64
        Metres, world frame.
    uv : (n, 2) float64
        Texture coordinates in tiles.
    faces : (m, 3) int64
        Indices into `vertices`.
    """

    material: str
    normal: NDArray[np.float64]
    vertices: NDArray[np.float64]
    uv: NDArray[np.float64]
    faces: NDArray[np.int64]


def surfaces(scene: Scene) -> list[Surface]:
    """Sort a scene's triangles by material and normal.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    list of Surface
        Ordered by material name, then by direction; triangles without an area are left out.
    """
    by_material: dict[str, list[tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.int32]]]] = {}
    for instance in scene.instances:
        for part in instance.parts:
            by_material.setdefault(part.material, []).append((part.vertices, part.uv, part.faces))
    found: list[Surface] = []
    for material in sorted(by_material):
        pieces = by_material[material]
        offsets = np.cumsum([0, *(len(v) for v, _, _ in pieces)])[:-1]
        vertices = np.concatenate([v for v, _, _ in pieces])
        uv = np.concatenate([t for _, t, _ in pieces]).astype(np.float64)
        faces = np.concatenate([f.astype(np.int64) + o for (_, _, f), o in zip(pieces, offsets, strict=True)])
        found.extend(_by_normal(material, vertices, uv, faces))
    return found


def _by_normal(
    material: str, vertices: NDArray[np.float64], uv: NDArray[np.float64], faces: NDArray[np.int64]
) -> list[Surface]:
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(doubled, axis=1)
    faces, doubled, area = faces[area > 1e-12], doubled[area > 1e-12], area[area > 1e-12]
    cell = np.rint(doubled / area[:, None] * _CELLS).astype(np.int64) + _CELLS
    side = 2 * _CELLS + 1
    code = (cell[:, 0] * side + cell[:, 1]) * side + cell[:, 2]
    found = []
    for value in np.unique(code):
        mine = code == value
        normal = doubled[mine].sum(axis=0)
        used, local = np.unique(faces[mine], return_inverse=True)
        found.append(
            Surface(
                material, normal / np.linalg.norm(normal), vertices[used], uv[used], local.reshape(-1, 3)
            )
        )  # fmt: skip
    return found
