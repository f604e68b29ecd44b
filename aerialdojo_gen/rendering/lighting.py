"""What lights a scene: surface tables, sky colours, and the sun's shadow map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.scenes.model import Material, Scene

Floats = NDArray[np.float64]

# Distance of the shadow map's sun, in radii of the scene: its rays are then within 5° of parallel.
_SUN_RADII = 12.0
_ENDLESS_M = 1e9


@dataclass(frozen=True, eq=False)
class Lighting:
    """Inputs of shading; row k of the tables is surface k."""

    colour: Floats  # (n, 3) float64; the material's mean colour, 0-255
    texel_m: Floats  # (n,) float64
    unlit: NDArray[np.bool_]  # (n,) bool; whether light is baked into the material's colours
    sun: Floats  # (3,) float64; unit vector towards the sun
    zenith: Floats  # (3,) float64; the sky's colours, 0-255
    horizon: Floats


def light_of(scene: Scene, materials: Sequence[str] = ()) -> Lighting:
    """Collect the inputs of shading."""
    found = [scene.materials[name] for name in materials]
    sky = np.array(scene.sky, dtype=np.float64)
    sun = np.array(scene.sun, dtype=np.float64)
    return Lighting(
        colour=np.array([m.colour for m in found], dtype=np.float64).reshape(-1, 3),
        texel_m=np.array([_texel_m(m) for m in found]),
        unlit=np.array([m.unlit for m in found], dtype=bool),
        sun=sun / np.linalg.norm(sun),
        zenith=sky * np.array([0.72, 0.84, 0.97]),
        horizon=sky + (np.array([236.0, 238.0, 240.0]) - sky) * 0.6,
    )


def _texel_m(material: Material) -> float:
    if material.atlas:
        return _ENDLESS_M
    return 0.0 if material.texture is None else material.tile_m / material.texture.shape[1]


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """Depth as seen from the sun."""

    camera: Camera
    world_from_camera: Floats  # (4, 4) float64
    depth_m: NDArray[np.float32]  # (n, n) float32; planar depth of the lit surfaces; inf where there is none

    @cached_property
    def texel_m(self) -> float:
        """Edge of a texel at the distance of the scene's centre, metres, to within a tenth."""
        hit = self.depth_m[np.isfinite(self.depth_m)]
        return float(hit.mean()) / self.camera.focal_px if len(hit) else 0.0


def sun_view(scene: Scene, size_px: int = 2048) -> tuple[Camera, Floats, float, float]:
    """The shadow map's camera, twelve scene radii away: TinyRenderer has no parallel projection."""
    boxes = np.stack([i.bounds for i in scene.instances])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    centre, radius = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0 + 1.0
    sun = np.array(scene.sun, dtype=np.float64)
    distance = _SUN_RADII * radius
    pose = look_at_pose(centre + sun / np.linalg.norm(sun) * distance, centre)
    camera = Camera(size_px, size_px, 2.0 * math.degrees(math.asin(radius / distance)))
    return camera, pose, distance - radius, distance + radius
