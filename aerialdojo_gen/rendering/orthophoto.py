"""A scene from straight above, without perspective: its colours in the sun, for maps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.scenes.model import Scene

_SHADE = 0.55
_HAZE = 0.25


def orthophoto(scene: Scene, pixel_m: float) -> NDArray[np.uint8]:
    """Picture a scene's flight area from above by one ray down and one to the sun a pixel.

    Textures are shown by their mean colours, a little paled, so that marks on the map stand out.

    Parameters
    ----------
    scene : Scene
        Any scene.
    pixel_m : float
        Edge of a pixel, metres.

    Returns
    -------
    (H, W, 3) uint8
        sRGB; north is up, the picture covers ``scene.bounds`` from west to east and north to south.
    """
    parts = [part for instance in scene.instances for part in instance.parts]
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    vertices = np.concatenate([part.vertices for part in parts])
    faces = np.concatenate([p.faces + np.int32(o) for p, o in zip(parts, offsets, strict=True)])
    colours = np.array([scene.materials[part.material].colour for part in parts], dtype=np.float64)
    colour = np.append(np.repeat(colours, [len(part.faces) for part in parts], axis=0), [scene.sky], axis=0)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    normals = np.append(normals, [[0.0, 0.0, 1.0]], axis=0)

    (west, south), (east, north) = scene.bounds[:, :2]
    columns, rows = max(round((east - west) / pixel_m), 1), max(round((north - south) / pixel_m), 1)
    x = west + (np.arange(columns) + 0.5) * (east - west) / columns
    y = north - (np.arange(rows) + 0.5) * (north - south) / rows
    top = float(vertices[:, 2].max()) + 1.0
    eyes = np.column_stack([*(a.ravel() for a in np.meshgrid(x, y)), np.full(rows * columns, top)])
    caster = TriangleRayCaster(vertices, faces)
    distance, face = caster.first_hit(eyes, np.tile([0.0, 0.0, -1.0], (len(eyes), 1)))

    # A hair above the ground, which would shade itself otherwise.
    places = eyes - [0.0, 0.0, 1.0] * (np.where(np.isfinite(distance), distance, 0.0)[:, None] - 0.02)
    sun = np.asarray(scene.sun) / np.linalg.norm(scene.sun)
    lit = ~np.isfinite(caster.first_hit(places, np.tile(sun, (len(places), 1)))[0])
    facing = np.clip(normals[face] @ sun, 0.0, 1.0) / max(float(sun[2]), 0.2)
    light = _SHADE + (1.0 - _SHADE) * np.where(lit, np.minimum(facing, 1.3), 0.0)
    rgb = np.clip(colour[face] * light[:, None], 0.0, 255.0) * (1.0 - _HAZE) + 255.0 * _HAZE
    return np.rint(rgb).astype(np.uint8).reshape(rows, columns, 3)
