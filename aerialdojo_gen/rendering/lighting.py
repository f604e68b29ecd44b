"""What lights a scene: surface tables, sun, sky and haze by the weather, the sun's shadow map, and clouds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.arrays import Bytes, Flags, Floats, Singles
from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.rendering.casters import triangle_caster
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.light import Light
from aerialdojo_gen.scenes.model import Material, Scene
from aerialdojo_gen.scenes.noise import fractal

# Distance of the shadow map's sun, in radii of the scene: its rays are then within 5° of parallel.
_SUN_RADII = 12.0
_ENDLESS_M = 1e9
_CLOUDS_PX = 256
# Cells of the map of heights along the scene's longer side, and by how much it is blurred, metres.
_HEIGHT_CELLS, _BLUR_M = 256, 1.6
# The highest that it distinguishes from higher ones, above the lowest ground, metres.
REACH_M = 60.0
_COARSE_PX, _WINDOWS_STAY = 256, 3.0
# Surfaces in which the sky is mirrored.
_SHINY = frozenset({"water", "glass", "window", "curtain_wall", "ice"})


@dataclass(frozen=True)
class _Air:
    """What a weather makes of sun and sky, as linear shares of a white surface's brightness."""

    sun: tuple[float, float, float]
    sky: tuple[float, float, float]  # From above
    ground: tuple[float, float, float]  # From below
    clouds: float  # Share of the sky
    haze_m: float  # Range of sight
    grey: float = 0.0  # How far the sky's colours go to those below
    zenith: tuple[float, float, float] = (172.0, 178.0, 184.0)
    horizon: tuple[float, float, float] = (206.0, 209.0, 212.0)
    wet: float = 0.0


_AIR = {
    "clear": _Air((0.98, 0.93, 0.83), (0.30, 0.345, 0.42), (0.17, 0.155, 0.135), 0.35, 800.0),
    "overcast": _Air((0.10, 0.10, 0.10), (0.66, 0.68, 0.70), (0.27, 0.27, 0.26), 1.0, 600.0, 0.9),
    "haze": _Air((0.50, 0.47, 0.40), (0.44, 0.45, 0.46), (0.23, 0.22, 0.21), 0.2, 170.0, 0.75,
                 (196, 200, 204), (222, 221, 216)),
    "dusk": _Air((0.86, 0.50, 0.24), (0.29, 0.28, 0.34), (0.15, 0.13, 0.12), 0.5, 420.0, 0.8,
                 (92, 106, 150), (240, 190, 148)),
    "wet": _Air((0.06, 0.06, 0.06), (0.56, 0.58, 0.61), (0.22, 0.22, 0.22), 1.0, 260.0, 0.95,
                (150, 156, 163), (190, 194, 198), 1.0),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Lighting:
    """Inputs of shading; row k of the tables is surface k."""

    colour: Floats  # (n, 3) float64; the material's mean colour, 0-255
    texel_m: Floats  # (n,) float64
    unlit: Flags  # (n,) bool; whether light is baked into the material's colours
    shiny: Floats  # (n,) float64; whether the sky is mirrored, 0 or 1
    sun: Floats  # (3,) float64; unit vector towards the sun
    sun_rgb: Floats  # (3,) float64; light on a white surface, linear
    sky_rgb: Floats
    ground_rgb: Floats
    zenith: Floats  # (3,) float64; the sky's colours, 0-255
    horizon: Floats
    haze_m: float
    clouds: float  # Share of the sky
    wet: float  # Whether level ground is wet, 0 or 1

    @property
    def rows(self) -> Floats:
        """All but the tables, (7, 3) float64, for compiled code."""
        last = np.array([self.haze_m**2, self.clouds, self.wet])
        return np.stack([self.sun, self.sun_rgb, self.sky_rgb, self.ground_rgb, self.zenith, self.horizon, last])


def light_of(scene: Scene, materials: Sequence[str] = (), light: Light | None = None) -> Lighting:
    """Collect the inputs of shading."""
    found = [scene.materials[name] for name in materials]
    light = light or scene.light
    air, sky = _AIR[light.weather], np.array(scene.sky, dtype=np.float64)
    sun = np.array(light.sun, dtype=np.float64)
    sun /= np.linalg.norm(sun)
    # A low sun is redder and weaker.
    low = 1.0 - min(max(float(sun[2]) / math.sin(math.radians(28.0)), 0.0), 1.0)
    zenith, horizon = sky * np.array([0.72, 0.84, 0.97]), sky + (np.array([236.0, 238.0, 240.0]) - sky) * 0.6
    return Lighting(
        colour=np.array([m.colour for m in found], dtype=np.float64).reshape(-1, 3),
        texel_m=np.array([texel_m(m) for m in found]),
        unlit=np.array([m.unlit for m in found], dtype=bool),
        shiny=np.array([float(is_shiny(m)) for m in found]),
        sun=sun,
        sun_rgb=np.array(air.sun) * (1.0 - low * np.array([0.05, 0.22, 0.42])),
        sky_rgb=np.array(air.sky),
        ground_rgb=np.array(air.ground),
        zenith=zenith + (np.array(air.zenith) - zenith) * air.grey,
        horizon=horizon + (np.array(air.horizon) - horizon) * air.grey,
        haze_m=air.haze_m,
        clouds=air.clouds,
        wet=air.wet,
    )


def is_shiny(material: Material) -> bool:
    """Whether the sky is mirrored in a material of the catalogue."""
    return not material.foreign and material.name.split(":")[0] in _SHINY


def is_fine(material: Material) -> bool:
    """Whether a texture is larger than those of surfaces without openings: it shows a façade."""
    return material.texture is not None and max(material.texture.shape[:2]) > _COARSE_PX


def texel_m(material: Material) -> float:
    """Edge of a texel, metres, by which a pattern fades with distance; rows of windows are seen from far away."""
    if material.atlas:
        return _ENDLESS_M
    if material.texture is None:
        return 0.0
    return material.tile_m / material.texture.shape[1] * (_WINDOWS_STAY if is_fine(material) else 1.0)


@lru_cache(maxsize=8)
def cloud_map(scene: str) -> Bytes:
    """Thickness of the clouds, (256, 256) uint8, tileable: half of the sky is above 127."""
    draws = generator(0, "clouds", scene)
    lumps = fractal(_CLOUDS_PX, 4, 6, draws, 0.58)
    out = np.clip(127.5 + 70.0 * lumps, 0.0, 255.0).astype(np.uint8)
    out.flags.writeable = False
    return out


NO_CLOUDS: Bytes = np.zeros((1, 1), np.uint8)


class HeightMap(NamedTuple):
    """Height of the highest surface about each place, blurred: what is below it sees less of the sky."""

    west_m: float
    south_m: float
    cell_m: float
    lowest_m: float
    above: Bytes  # (n, m) uint8; height above the lowest, in 255ths of `REACH_M`; rows run north

    @classmethod
    def nowhere(cls) -> HeightMap:
        """A map on which nothing is below anything."""
        return cls(0.0, 0.0, 1.0, -1e6, np.zeros((1, 1), np.uint8))


def height_map(scene: Scene) -> HeightMap:
    """Return the scene's map of heights, made by rays from above."""
    return context_of(scene).part("height map", lambda: _height_map(scene))


def _height_map(scene: Scene) -> HeightMap:
    import cv2

    low, high = scene.bounds
    cell = float((high - low)[:2].max()) / _HEIGHT_CELLS
    n, m = (max(math.ceil(span / cell), 2) for span in (high - low)[[1, 0]])
    y, x = np.meshgrid(low[1] + (np.arange(n) + 0.5) * cell, low[0] + (np.arange(m) + 0.5) * cell, indexing="ij")
    top = float(max(i.bounds[1, 2] for i in scene.instances)) + 1.0
    origins = np.column_stack([x.ravel(), y.ravel(), np.full(n * m, top)])
    distance, _ = triangle_caster(scene).first_hit(origins, np.tile([0.0, 0.0, -1.0], (n * m, 1)))
    heights = np.where(np.isfinite(distance), top - distance, float(low[2])).reshape(n, m).astype(np.float32)
    blurred = cv2.GaussianBlur(heights, (0, 0), _BLUR_M / cell, borderType=cv2.BORDER_REPLICATE)
    above = np.clip((blurred - low[2]) * (255.0 / REACH_M) + 0.5, 0.0, 255.0).astype(np.uint8)
    return HeightMap(float(low[0]), float(low[1]), cell, float(low[2]), above)


class ShadowMap(NamedTuple):
    """Depth as seen from the sun."""

    focal_px: float
    world_from_camera: Floats  # (4, 4) float64
    depth_m: Singles  # (n, n) float32; planar depth of the lit surfaces; inf where there is none
    bias_m: float  # How far from a surface its light is looked up, against self-shadowing: more than a texel

    @classmethod
    def of(cls, camera: Camera, world_from_camera: Floats, depth_m: Singles) -> ShadowMap:
        """Take a depth picture from the sun."""
        hit = depth_m[np.isfinite(depth_m)]
        texel = float(hit.mean()) / camera.focal_px if len(hit) else 0.0
        return cls(camera.focal_px, np.ascontiguousarray(world_from_camera), depth_m, 0.03 + 1.5 * texel)


def sun_view(scene: Scene, size_px: int = 2048, light: Light | None = None) -> tuple[Camera, Floats, float, float]:
    """The shadow map's camera, twelve scene radii away: TinyRenderer has no parallel projection."""
    boxes = np.stack([i.bounds for i in scene.instances])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    centre, radius = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0 + 1.0
    sun = np.array((light or scene.light).sun, dtype=np.float64)
    distance = _SUN_RADII * radius
    pose = look_at_pose(centre + sun / np.linalg.norm(sun) * distance, centre)
    camera = Camera(size_px, size_px, 2.0 * math.degrees(math.asin(radius / distance)))
    return camera, pose, distance - radius, distance + radius
