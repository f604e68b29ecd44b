"""A scene's triangles as an OpenGL renderer wants them: packed once, and chosen anew for every view.

A software rasteriser takes a third of a microsecond for a triangle, seen or not; to find out that it is not seen
takes a hundredth of that. So a view draws only the triangles that face the camera, lie in its picture and hold a
pixel's centre, the nearest first, so that what stands behind is rejected by its depth before it is coloured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.geometry.morton import morton_codes
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

CHUNK_TRIANGLES = 96
_LARGEST_TEXTURE = 512
# Corners nearer than this are not projected; and how far OpenGL may round a corner, pixels.
_MORTON_BITS = 16
_NEAR_W, _ROUNDING_PX = 0.05, 0.02

# Three vertices a triangle, none shared: normal, colour and instance are those of the face.
VERTEX = np.dtype(
    [
        ("position", "<f4", 3),
        ("uv", "<f4", 2),
        ("normal", "<f4", 3),
        ("colour", "u1", 4),
        ("texel_m", "<f4"),
        ("layer", "<f4"),
        ("instance", "<f4"),
    ]
)


@dataclass(frozen=True, eq=False)
class Chunks:
    """Triangles of one kind of surface (with a texture, or without), cut into chunks.

    Attributes
    ----------
    vertices : (3 n,) structured array of `VERTEX`
        n triangles, chunk after chunk.
    starts : (k + 1,) int64
        First triangle of every chunk; the last is n.
    low, high : (k, 3) float64
        A chunk's box, metres, world frame.
    planes : (n, 4) float64
        A triangle faces the eye where ``normal . eye + d`` is positive.
    """

    vertices: NDArray[np.void]
    starts: NDArray[np.int64]
    low: Floats
    high: Floats
    planes: Floats

    def seen(self, clip_from_world: Floats, eye: Floats, width: int, height: int) -> NDArray[np.uint32]:
        """Choose what a view draws.

        Parameters
        ----------
        clip_from_world : (4, 4) float64
            OpenGL's matrix of the camera, row-major.
        eye : (3,) float64
            The camera's centre.
        width, height : int
            Pixels.

        Returns
        -------
        (3 k,) uint32
            Indices into `vertices`, chunk by chunk, the nearest first.
        """
        x, y, z, w = clip_from_world
        inside = np.ones(len(self.low), dtype=np.bool_)
        # A point is in view where -w <= x, y <= w and z >= -w in clip coordinates.
        for side in (w + x, w - x, w + y, w - y, w + z):
            # The box's corner farthest along the side's normal is the one that would be inside.
            inside &= np.where(side[:3] > 0.0, self.high, self.low) @ side[:3] + side[3] > 0.0
        found = np.flatnonzero(inside)
        away = np.maximum(self.low[found] - eye, 0.0) + np.maximum(eye - self.high[found], 0.0)
        nearest = found[np.argsort(np.einsum("ij,ij->i", away, away), kind="stable")]
        return _seen(
            nearest, self.starts, self.planes, self.vertices["position"], clip_from_world, eye, width, height
        )


@njit(cache=True)
def _seen(
    order: NDArray[np.int64],
    starts: NDArray[np.int64],
    planes: Floats,
    position: NDArray[np.float32],
    clip: Floats,
    eye: Floats,
    width: int,
    height: int,
) -> NDArray[np.uint32]:
    most = 0
    for chunk in order:
        most += starts[chunk + 1] - starts[chunk]
    out = np.empty(3 * most, dtype=np.uint32)
    n = 0
    for chunk in order:
        for t in range(starts[chunk], starts[chunk + 1]):
            if planes[t, 0] * eye[0] + planes[t, 1] * eye[1] + planes[t, 2] * eye[2] + planes[t, 3] <= 0.0:
                continue
            u0, u1, v0, v1 = np.inf, -np.inf, np.inf, -np.inf
            behind = 0
            for k in range(3 * t, 3 * t + 3):
                x, y, z = position[k, 0], position[k, 1], position[k, 2]
                w = clip[3, 0] * x + clip[3, 1] * y + clip[3, 2] * z + clip[3, 3]
                if w < _NEAR_W:
                    behind += 1
                    continue
                u = (clip[0, 0] * x + clip[0, 1] * y + clip[0, 2] * z + clip[0, 3]) / w
                v = (clip[1, 0] * x + clip[1, 1] * y + clip[1, 2] * z + clip[1, 3]) / w
                u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
            if behind == 3:
                continue
            if behind == 0:
                # To pixels, centres at whole numbers; OpenGL rounds corners to 1/256 pixel.
                left = max(math.ceil((u0 + 1.0) * 0.5 * width - 0.5 - _ROUNDING_PX), 0)
                right = min(math.floor((u1 + 1.0) * 0.5 * width - 0.5 + _ROUNDING_PX), width - 1)
                top = max(math.ceil((v0 + 1.0) * 0.5 * height - 0.5 - _ROUNDING_PX), 0)
                bottom = min(math.floor((v1 + 1.0) * 0.5 * height - 0.5 + _ROUNDING_PX), height - 1)
                if left > right or top > bottom:
                    continue
            out[n], out[n + 1], out[n + 2] = 3 * t, 3 * t + 1, 3 * t + 2
            n += 3
    return out[:n]


def chunks(scene: Scene) -> tuple[Chunks, Chunks, NDArray[np.uint8] | None]:
    """Pack a scene for OpenGL.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    textured, flat : Chunks
        Either may be empty. Triangles without an area are left out.
    textures : (n, e, e, 3) uint8 or None
        The layers of the texture array, first row at v = 0; None where no material has a texture.
    """
    names = [name for name in sorted(scene.materials) if scene.materials[name].texture is not None]
    layer = {name: float(k) for k, name in enumerate(names)}
    textured, flat = [], []
    for k, instance in enumerate(scene.instances):
        for part in instance.parts:
            material = scene.materials[part.material]
            corners = part.vertices[part.faces]
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(normal, axis=1)
            solid = length > 0.0
            rows = np.zeros((int(solid.sum()), 3), dtype=VERTEX)
            rows["position"] = corners[solid]
            rows["uv"] = part.uv[part.faces[solid]]
            rows["normal"] = (normal[solid] / length[solid, None])[:, None]
            rows["colour"][..., :3] = material.colour
            rows["instance"] = k
            if material.texture is None:
                flat.append(rows)
            else:
                rows["texel_m"] = material.tile_m / material.texture.shape[1]
                rows["layer"] = layer[part.material]
                textured.append(rows)
    return _cut(textured), _cut(flat), _layers(scene, names)


def _cut(parts: list[NDArray[np.void]]) -> Chunks:
    triangles = np.concatenate([*parts, np.zeros((0, 3), dtype=VERTEX)])
    if not len(triangles):
        none = np.zeros((0, 3))
        return Chunks(triangles.ravel(), np.zeros(1, dtype=np.int64), none, none, np.zeros((0, 4)))
    corners = triangles["position"].astype(np.float64)
    low, high = corners.min(axis=1), corners.max(axis=1)
    extent = (high - low).max(axis=1)
    # Large triangles apart from small ones, or every chunk's box would be as large as the largest in it.
    size = np.floor(np.log2(np.maximum(extent, 1.0)) / 1.5).astype(np.int64)
    order = np.lexsort((morton_codes((low + high) / 2.0, _MORTON_BITS), size))
    triangles, corners = triangles[order], corners[order]
    starts = np.arange(0, len(triangles), CHUNK_TRIANGLES)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offset = -np.einsum("ij,ij->i", normal, corners[:, 0])
    return Chunks(
        triangles.ravel(),
        np.append(starts, len(triangles)),
        np.minimum.reduceat(low[order], starts),
        np.maximum.reduceat(high[order], starts),
        np.column_stack([normal, offset]),
    )


def _layers(scene: Scene, names: list[str]) -> NDArray[np.uint8] | None:
    textures = [t for name in names if (t := scene.materials[name].texture) is not None]
    if not textures:
        return None
    edge = 1
    while edge < min(_LARGEST_TEXTURE, max(max(t.shape[:2]) for t in textures)):
        edge *= 2
    layers = np.empty((len(textures), edge, edge, 3), dtype=np.uint8)
    for k, texture in enumerate(textures):
        larger = max(texture.shape[:2]) > edge
        layers[k] = cv2.resize(
            texture[::-1], (edge, edge), interpolation=cv2.INTER_AREA if larger else cv2.INTER_NEAREST
        )
    return layers
