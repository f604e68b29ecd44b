"""Small pictures by ray casting: no start-up, exact at any size, with the instance of every pixel.

For thumbnails and for scores that must be the same on every machine; shaded, without shadows, clouds and
the horizon. A picture of 96 x 96 takes a tenth of the time of TinyRenderer, which is faster from about 500 x 500 on.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Bytes, Flags, Floats, Int32s, Ints, Singles
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.portable import product
from aerialdojo_gen.rendering.lighting import NO_CLOUDS, HeightMap, Lighting, ShadowMap, light_of
from aerialdojo_gen.rendering.picture import Picture, Renderer
from aerialdojo_gen.rendering.shading import shade
from aerialdojo_gen.rendering.texels import Backdrop, masked_caster, scene_texels
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.light import Light
from aerialdojo_gen.scenes.model import Scene

_WIDE_M = 4.0


class RayRenderer(Renderer):
    """A renderer by ray casts, of both sides of triangles."""

    name, device = "rays", "Embree"

    def __init__(self, scene: Scene) -> None:
        texels = scene_texels(scene)
        counts = [len(instance.faces) for instance in scene.instances]
        self._owner = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
        self._material = texels.material.astype(np.int32)
        self._corners, self._uv = texels.vertices[texels.faces], texels.uv[texels.faces]
        # Instances that wide both ways are ground, roads, floors or roofs.
        bounds = np.array([instance.bounds for instance in scene.instances]).reshape(-1, 2, 3)
        self.wide: Flags = (bounds[:, 1, :2] - bounds[:, 0, :2]).min(axis=1) > _WIDE_M
        self._rays = masked_caster(scene)
        self._vertex_colours = texels if texels.has_vertex_colours else None
        self._backdrop = Backdrop(scene)
        self._scene, self._materials = scene, [material.name for material in texels.materials]
        self.relight(scene.light)
        tiles = [np.array([[m.colour]], np.uint8) if m.texture is None else m.texture for m in texels.materials]
        self._texels = np.concatenate([t.reshape(-1, 3) for t in tiles])
        sizes = np.array([t.shape[:2] for t in tiles], np.int64)
        self._tiles = np.column_stack([np.cumsum(sizes.prod(axis=1)) - sizes.prod(axis=1), sizes])
        # One texel without an occluder, far below all points: none may lie in the sun camera's plane.
        far_below = np.eye(4)
        far_below[2, 3] = -1e6
        self._open_sky = HeightMap.nowhere()
        self._no_shadow = ShadowMap.of(Camera(1, 1, 90.0), far_below, np.full((1, 1), np.inf, np.float32))

    def relight(self, light: Light) -> None:
        """Draw by another light from now on."""
        self.light = light
        self._light: Lighting = light_of(self._scene, self._materials, light)

    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = True) -> Picture:
        """Take a picture, always with its instance id map."""
        local, length = pixel_rays(camera)
        shape = (camera.height, camera.width)
        directions = product(local, world_from_camera[:3, :3].T)
        distance, face = self._rays.first_hit(world_from_camera[:3, 3], directions)
        albedo, depth, surface, owner = _hit_attributes(
            np.ascontiguousarray(world_from_camera[:3, 3]), directions, distance, length, face, self._corners,
            self._uv, self._material, self._owner, self._tiles, self._texels,
        )  # fmt: skip
        if self._vertex_colours is not None:
            hit = np.flatnonzero(face >= 0)
            points = world_from_camera[:3, 3] + (distance[hit] / length[hit])[:, None] * directions[hit]
            albedo[hit] = self._vertex_colours.with_vertex_colours(face[hit], points, albedo[hit])
        depth, surface = depth.reshape(shape), surface.reshape(shape)
        rgb = shade(
            camera, world_from_camera, albedo.reshape(*shape, 3), depth, surface, self._light, self._no_shadow,
            NO_CLOUDS, self._open_sky,
        )  # fmt: skip
        self._backdrop.paint(rgb, surface < 0, camera, world_from_camera)
        return Picture(rgb, depth, owner.reshape(shape))


@lru_cache(maxsize=4)
def pixel_rays(camera: Camera) -> tuple[Floats, Floats]:
    """Directions through a camera's pixels, (n, 3) float64, z = 1, camera frame, and their lengths, (n,) float64."""
    rays = camera.rays().reshape(-1, 3)
    return rays, np.linalg.norm(rays, axis=1)


@njit(cache=True, error_model="numpy")
def _hit_attributes(
    eye: Floats, directions: Floats, distance: Floats, length: Floats, face: Int32s, corners: Floats, uv: Floats,
    material: Int32s, owner: Int32s, tiles: Ints, texels: Bytes,
) -> tuple[Bytes, Singles, Int32s, Int32s]:  # fmt: skip
    """Colour of the nearest texel, planar depth, material and instance of n ray hits."""
    rays = len(face)
    albedo, depth = np.zeros((rays, 3), np.uint8), np.full(rays, np.inf, np.float32)
    surface, instance = np.full(rays, -1, np.int32), np.full(rays, -1, np.int32)
    for n in range(rays):
        k = face[n]
        if k < 0:
            continue
        surface[n], instance[n] = material[k], owner[k]
        along = distance[n] / length[n]
        # Shading divides by depth, and a camera may touch a surface.
        depth[n] = max(along, 1e-3)
        ee = ef = ff = ep = fp = 0.0
        for axis in range(3):
            at = corners[k, 0, axis]
            e, f = corners[k, 1, axis] - at, corners[k, 2, axis] - at
            p = eye[axis] + directions[n, axis] * along - at
            ee, ef, ff, ep, fp = ee + e * e, ef + e * f, ff + f * f, ep + e * p, fp + f * p
        area = ee * ff - ef * ef
        # Where the point is between the corners; a sliver has its first corner's colour.
        s, t = 0.0, 0.0
        if area > 0.0:
            s, t = (ff * ep - ef * fp) / area, (ee * fp - ef * ep) / area
        u = uv[k, 0, 0] + s * (uv[k, 1, 0] - uv[k, 0, 0]) + t * (uv[k, 2, 0] - uv[k, 0, 0])
        v = uv[k, 0, 1] + s * (uv[k, 1, 1] - uv[k, 0, 1]) + t * (uv[k, 2, 1] - uv[k, 0, 1])
        first, rows, columns = tiles[material[k], 0], tiles[material[k], 1], tiles[material[k], 2]
        column = min(int((u - np.floor(u)) * columns), columns - 1)
        row = min(int((1.0 - (v - np.floor(v))) * rows), rows - 1)
        texel = first + row * columns + column
        albedo[n, 0], albedo[n, 1], albedo[n, 2] = texels[texel, 0], texels[texel, 1], texels[texel, 2]
    return albedo, depth, surface, instance


def ray_renderer(scene: Scene) -> RayRenderer:
    """Return the scene's ray renderer."""
    return context_of(scene).part("ray renderer", lambda: RayRenderer(scene))
