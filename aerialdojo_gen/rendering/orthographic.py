"""Parallel projections of a scene, by ray casts: maps and side views, with everything before a plane cut away."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.geometry.arrays import Bytes, Floats
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.texels import masked_caster, scene_texels
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Material, Scene

# A map's light, as shares of a colour: from everywhere, from above, from the sun's side, from the sun.
_AMBIENT, _FROM_ABOVE, _FROM_SIDE, _SUN = 0.55, 0.11, 0.05, 0.47
# Cut faces show the inside: the material's colour, darker.
_CUT_LEVEL = 0.38
_EARTH = (107.0, 96.0, 84.0)
_OFF_SURFACE_M = 0.02


@dataclass(frozen=True, eq=False)
class Plane:
    """Image plane and extent; the part of the world behind it is shown."""

    origin: Floats  # (3,) float64; a point of the plane, metres, world frame: picture coordinates (0, 0)
    right: Floats  # (3,) float64; orthogonal unit vectors in the plane
    up: Floats
    extent_m: tuple[float, float, float, float]  # Left, right, bottom and top in picture coordinates, metres

    @classmethod
    def above(cls, z_m: float, extent_m: tuple[float, float, float, float]) -> Plane:
        """Plane of a map: from height z straight down, north up; extent west, east, south and north, metres."""
        return cls(np.array([0.0, 0.0, z_m]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), extent_m)

    @property
    def forward(self) -> Floats:
        """Viewing direction, (3,) float64."""
        return np.cross(self.up, self.right)

    def project(self, points: ArrayLike) -> Floats:
        """Picture coordinates (n, 2), metres, of points (n, 3) in the world frame."""
        return np.asarray((np.asarray(points, dtype=np.float64) - self.origin) @ np.stack([self.right, self.up]).T)


class OrthographicPictures:
    """Takes parallel projections of a scene."""

    def __init__(self, scene: Scene) -> None:
        self._texels = scene_texels(scene)
        vertices, materials = self._texels.vertices, self._texels.materials
        self._rays = masked_caster(scene)
        self._double_sided = np.array([m.double_sided for m in materials])[self._texels.material]
        self._unlit = np.array([m.unlit for m in materials])[self._texels.material]
        self._sun = np.array(scene.sun, dtype=np.float64) / np.linalg.norm(scene.sun)
        sky = np.array(scene.sky, dtype=np.float64)
        ground = [instance for instance in scene.instances if instance.category == "ground"]
        self._ground = TriangleRayCaster(*soup(ground)) if ground else None
        self._floor_m, self._ceiling_m = float(vertices[:, 2].min()), float(vertices[:, 2].max())
        self._sky = sky + (np.array([236.0, 238.0, 240.0]) - sky) * 0.6

    def from_above(self, extent_m: tuple[float, float, float, float], pixel_m: float) -> Bytes:
        """Take a map of everything: `take` by a plane above the scene; west, east, south and north, metres."""
        return self.take(Plane.above(self._ceiling_m + 1.0, extent_m), pixel_m)

    def take(self, plane: Plane, pixel_m: float) -> Bytes:
        """Take a picture with pixels of `pixel_m` metres; (H, W, 3) uint8 sRGB, row 0 at the top."""
        left, right, bottom, top = plane.extent_m
        width, height = max(1, round((right - left) / pixel_m)), max(1, round((top - bottom) / pixel_m))
        a = left + (np.arange(width) + 0.5) * (right - left) / width
        b = top - (np.arange(height) + 0.5) * (top - bottom) / height
        origins = (
            plane.origin + a[None, :, None] * plane.right + b[:, None, None] * plane.up
        ).reshape(-1, 3)  # fmt: skip
        forward = plane.forward
        distance, face = self._rays.first_hit(origins, np.broadcast_to(forward, origins.shape))
        out = np.tile(self._sky, (len(origins), 1))
        hit = np.flatnonzero(face >= 0)
        face, points = face[hit], origins[hit] + distance[hit, None] * forward
        normal = self._texels.normals(face)
        away = normal @ forward > 0.0
        double_sided = self._double_sided[face]
        normal[away & double_sided] *= -1.0
        cut = away & ~double_sided
        colour = self._texels.colours(face, points, lambda material: _downscaled(material, pixel_m))
        level = _AMBIENT + normal @ np.array([*(_FROM_SIDE * self._sun[:2]), _FROM_ABOVE])
        level += _SUN * self._sunlit(points, normal)
        level[self._unlit[face]] = 1.0
        out[hit] = colour * np.where(cut, _CUT_LEVEL, level)[:, None]
        if abs(forward[2]) < 1e-9:
            # Ground is a sheet without thickness: fill in the earth below it.
            surface = self._ground_height(plane.origin + a[:, None] * plane.right)
            out[(b[:, None] < surface[None, :]).ravel()] = _EARTH
        return np.clip(out + 0.5, 0.0, 255.0).astype(np.uint8).reshape(height, width, 3)

    def _ground_height(self, columns: Floats) -> Floats:
        """Height of the ground below points (n, 3), z ignored; the lowest vertex's where there is none."""
        from_above = np.column_stack([columns[:, :2], np.full(len(columns), self._ceiling_m + 1.0)])
        if self._ground is None:
            return np.full(len(columns), self._floor_m)
        distance, _ = self._ground.first_hit(from_above, np.tile([0.0, 0.0, -1.0], (len(columns), 1)))
        return np.where(np.isfinite(distance), self._ceiling_m + 1.0 - distance, self._floor_m)

    def surface_below(self, points: Floats) -> Floats:
        """Height z of the first surface under each of the points (n, 3), metres; NaN where there is none."""
        distance, _ = self._rays.first_hit(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
        return np.where(np.isfinite(distance), points[:, 2] - distance, np.nan)

    def _sunlit(self, points: Floats, normal: Floats) -> Floats:
        """Cosine of the sun's light on each point, 0 in shadow."""
        lit = np.maximum(normal @ self._sun, 0.0)
        towards = np.flatnonzero(lit > 0.0)
        start = points[towards] + _OFF_SURFACE_M * normal[towards]
        distance, _ = self._rays.first_hit(start, np.broadcast_to(self._sun, start.shape))
        lit[towards[np.isfinite(distance)]] = 0.0
        return lit


def _downscaled(material: Material, pixel_m: float) -> Bytes | None:
    """The texture with texels no smaller than a pixel, so that sampling one of them is enough."""
    if material.texture is None:
        return None
    texels = max(1, min(material.texture.shape[1], round(material.tile_m / pixel_m)))
    if texels == material.texture.shape[1]:
        return material.texture
    height = max(1, round(texels * material.texture.shape[0] / material.texture.shape[1]))
    return np.asarray(cv2.resize(material.texture, (texels, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def orthographic_pictures(scene: Scene) -> OrthographicPictures:
    """Return the orthographic camera of the scene's context, over its one Embree scene."""
    return context_of(scene).part("orthographic pictures", lambda: OrthographicPictures(scene))
