"""Small pictures by casting a ray a pixel: no start-up, exact at any size, with the instance of every pixel.

For thumbnails and for scores that must be the same on every machine. Of the shading only the shadows are missing. A
picture of 96 x 96 takes a tenth of what TinyRenderer needs to visit a scene's triangles; from about 500 x 500 on
TinyRenderer is the faster one.
"""

from __future__ import annotations

from functools import lru_cache
from types import TracebackType
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.casters import triangle_caster
from aerialdojo_gen.rendering.lighting import Lighting, ShadowMap, light_of
from aerialdojo_gen.rendering.picture import Picture
from aerialdojo_gen.rendering.shading import shade
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
_WIDE_M = 4.0


class RayRenderer:
    """A scene to be pictured by ray casts; see `aerialdojo_gen.rendering.backend.Renderer`.

    Parameters
    ----------
    scene : Scene
        Both sides of its triangles are seen.
    caster : TriangleRayCaster, optional
        Over the triangles of its instances in their order, where there is one already.

    Attributes
    ----------
    wide : (instances,) bool
        Whether an instance is more than 4 m wide both ways.
    """

    name = "rays"
    device = "Embree"

    def __init__(self, scene: Scene, caster: TriangleRayCaster | None = None) -> None:
        materials = sorted(scene.materials)
        number = {name: k for k, name in enumerate(materials)}
        parts = [(k, part) for k, instance in enumerate(scene.instances) for part in instance.parts]
        counts = [len(part.faces) for _, part in parts]
        vertices, faces = soup([part for _, part in parts])
        self._owner = np.repeat(np.array([k for k, _ in parts], np.int32), counts)
        self._material = np.repeat(np.array([number[part.material] for _, part in parts], np.int32), counts)
        self._corners = vertices[faces]
        self._uv = np.concatenate([part.uv for _, part in parts]).astype(np.float64)[faces]
        # What is that wide both ways and level is ground, a road, a floor or a roof.
        bounds = np.array([instance.bounds for instance in scene.instances]).reshape(-1, 2, 3)
        self.wide: NDArray[np.bool_] = (bounds[:, 1, :2] - bounds[:, 0, :2]).min(axis=1) > _WIDE_M
        self._rays = caster or TriangleRayCaster(vertices, faces)
        self._light: Lighting = light_of(scene, materials)
        textures = [scene.materials[name].texture for name in materials]
        flat = [np.array([[scene.materials[name].colour]], np.uint8) for name in materials]
        tiles = [f if t is None else t for t, f in zip(textures, flat, strict=True)]
        self._texels = np.concatenate([t.reshape(-1, 3) for t in tiles])
        self._tiles = np.column_stack(
            [
                np.cumsum([0, *(t.shape[0] * t.shape[1] for t in tiles[:-1])]),
                [t.shape[0] for t in tiles],
                [t.shape[1] for t in tiles],
            ]
        ).astype(np.int64)
        # One texel that nothing hides from the sun, far below all points: none may lie in the sun camera's plane.
        below = np.eye(4)
        below[2, 3] = -1e6
        self._no_shadow = ShadowMap(Camera(1, 1, 90.0), below, np.full((1, 1), np.inf, np.float32))

    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = True) -> Picture:
        """Take a picture; the instance id map comes with it unasked."""
        local, length = pixel_rays(camera)
        shape = (camera.height, camera.width)
        directions = local @ world_from_camera[:3, :3].T
        distance, face = self._rays.first_hit(world_from_camera[:3, 3], directions)
        hit = face >= 0
        points = world_from_camera[:3, 3] + directions[hit] * (distance[hit] / length[hit])[:, None]
        albedo = np.zeros((len(face), 3), np.uint8)
        found = face[hit]
        albedo[hit] = _albedo(
            points, self._corners[found], self._uv[found], self._material[found], self._tiles, self._texels
        )
        # Shading divides by depth, and a camera may touch a surface.
        depth = np.where(hit, np.maximum(distance / length, 1e-3), np.inf).astype(np.float32).reshape(shape)
        surface = np.where(hit, self._material[face], np.int32(-1)).reshape(shape)
        rgb = shade(
            camera, world_from_camera, albedo.reshape(*shape, 3), depth, surface, self._light, self._no_shadow
        )
        return Picture(rgb, depth, np.where(hit, self._owner[face], np.int32(-1)).reshape(shape))

    def close(self) -> None:
        """Do nothing: the memory is Python's own."""

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing."""


@lru_cache(maxsize=4)
def pixel_rays(camera: Camera) -> tuple[Floats, Floats]:
    """Directions through a camera's pixels, (n, 3) float64, z = 1, camera frame, and their lengths, (n,) float64."""
    rays = camera.rays().reshape(-1, 3)
    return rays, np.linalg.norm(rays, axis=1)


@njit(cache=True, error_model="numpy")
def _albedo(
    points: Floats, corners: Floats, uv: Floats, material: Ints, tiles: NDArray[np.int64], texels: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Colour of the nearest texel at points on triangles, (n, 3) uint8.

    Parameters
    ----------
    points : (n, 3) float64
    corners : (n, 3, 3) float64
        Of each point's triangle.
    uv : (n, 3, 2) float64
        At its corners, in tiles.
    material : (n,) int32
    tiles : (m, 3) int64
        A material's first texel, rows and columns.
    texels : (t, 3) uint8
    """
    out = np.empty((len(points), 3), np.uint8)
    for n in range(len(points)):
        ee = ef = ff = ep = fp = 0.0
        for axis in range(3):
            at = corners[n, 0, axis]
            e, f, p = corners[n, 1, axis] - at, corners[n, 2, axis] - at, points[n, axis] - at
            ee, ef, ff, ep, fp = ee + e * e, ef + e * f, ff + f * f, ep + e * p, fp + f * p
        area = ee * ff - ef * ef
        # Where the point is between the corners; a sliver has its first corner's colour.
        s, t = 0.0, 0.0
        if area > 0.0:
            s, t = (ff * ep - ef * fp) / area, (ee * fp - ef * ep) / area
        u = uv[n, 0, 0] + s * (uv[n, 1, 0] - uv[n, 0, 0]) + t * (uv[n, 2, 0] - uv[n, 0, 0])
        v = uv[n, 0, 1] + s * (uv[n, 1, 1] - uv[n, 0, 1]) + t * (uv[n, 2, 1] - uv[n, 0, 1])
        first, rows, columns = tiles[material[n], 0], tiles[material[n], 1], tiles[material[n], 2]
        column = min(int((u - np.floor(u)) * columns), columns - 1)
        row = min(int((1.0 - (v - np.floor(v))) * rows), rows - 1)
        texel = first + row * columns + column
        out[n, 0], out[n, 1], out[n, 2] = texels[texel, 0], texels[texel, 1], texels[texel, 2]
    return out


def ray_renderer(scene: Scene) -> RayRenderer:
    """Return the scene's ray renderer."""
    return context_of(scene).part("ray renderer", lambda: RayRenderer(scene, triangle_caster(scene)))
