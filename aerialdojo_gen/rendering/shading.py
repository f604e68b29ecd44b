"""Deferred shading: from albedo, depth and surface of every pixel to the picture.

The rasteriser delivers unlit texture colour, depth and the surface's number; sun, sky light, haze and the sky itself
are added here, so that every rendering backend gives the same picture. Light is computed in sRGB values, which is
not physics, but what the eye expects of a game.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.rendering.surfaces import Surface
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

_AMBIENT, _FROM_ABOVE, _FROM_SIDE, _SUN = 0.52, 0.12, 0.07, 0.50
_HAZE_M = 420.0


@dataclass(frozen=True, eq=False)
class Lighting:
    """What shading must know of a scene; row k of the tables is surface k.

    Attributes
    ----------
    normal : (n, 3) float64
        Unit normals, world frame.
    colour : (n, 3) float64
        The material's mean colour, 0-255.
    texel_m : (n,) float64
        Edge of a texel, metres; 0 for a flat material.
    sun : (3,) float64
        Unit vector towards the sun.
    zenith, horizon : (3,) float64
        The sky's colours, 0-255.
    """

    normal: Floats
    colour: Floats
    texel_m: Floats
    sun: Floats
    zenith: Floats
    horizon: Floats


def lighting(scene: Scene, surfaces: list[Surface]) -> Lighting:
    """Collect what shading must know.

    Parameters
    ----------
    scene : Scene
    surfaces : list of Surface
        As `aerialdojo_gen.rendering.surfaces.surfaces` gives them.

    Returns
    -------
    Lighting
    """
    materials = [scene.materials[s.material] for s in surfaces]
    sky = np.array(scene.sky, dtype=np.float64)
    sun = np.array(scene.sun, dtype=np.float64)
    return Lighting(
        normal=np.array([s.normal for s in surfaces]).reshape(-1, 3),
        colour=np.array([m.colour for m in materials], dtype=np.float64).reshape(-1, 3),
        texel_m=np.array([0.0 if m.texture is None else m.tile_m / m.texture.shape[1] for m in materials]),
        sun=sun / np.linalg.norm(sun),
        zenith=sky * np.array([0.72, 0.84, 0.97]),
        horizon=sky + (np.array([236.0, 238.0, 240.0]) - sky) * 0.6,
    )


def shade(
    camera: Camera,
    world_from_camera: Floats,
    albedo: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    surface: NDArray[np.int32],
    light: Lighting,
) -> tuple[NDArray[np.uint8], float]:
    """Light a picture.

    Parameters
    ----------
    camera : Camera
    world_from_camera : (4, 4) float64
    albedo : (H, W, 3) uint8
        Texture colour without light.
    depth_m : (H, W) float32
        Planar depth; inf where nothing is hit.
    surface : (H, W) int32
        Number of the surface, -1 where nothing is hit.
    light : Lighting

    Returns
    -------
    rgb : (H, W, 3) uint8
        sRGB.
    behind_fraction : float
        Share of the pixels showing a surface that see its back; 0 where no pixel shows one.
    """
    out = np.empty_like(albedo)
    hits, behind = _shade(
        albedo, depth_m, surface, camera.focal_px, np.ascontiguousarray(world_from_camera), light.normal,
        light.colour, light.texel_m, light.sun, light.zenith, light.horizon, out,
    )  # fmt: skip
    return out, behind / max(hits, 1)


@njit(cache=True)
def _shade(albedo, depth, surface, focal, pose, normal, colour, texel, sun, zenith, horizon, out):  # type: ignore[no-untyped-def]
    height, width = depth.shape
    base = np.empty(3)
    hits, behind = 0, 0
    for row in range(height):
        y = (row + 0.5 - height / 2.0) / focal
        for col in range(width):
            x = (col + 0.5 - width / 2.0) / focal
            dx = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2]
            dy = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2]
            dz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2]
            stretch = math.sqrt(dx * dx + dy * dy + dz * dz)
            k = surface[row, col]
            if k < 0:
                # The horizon lies where nothing is hit below it too: the ground fades into haze there.
                up = max(0.0, dz / stretch) ** 0.55
                for c in range(3):
                    out[row, col, c] = np.uint8(horizon[c] + (zenith[c] - horizon[c]) * up + 0.5)
                continue
            z = depth[row, col]
            nx, ny, nz = normal[k, 0], normal[k, 1], normal[k, 2]
            facing = -(dx * nx + dy * ny + dz * nz) / stretch
            hits += 1
            if facing < 0.0:
                behind += 1
                nx, ny, nz, facing = -nx, -ny, -nz, -facing
            for c in range(3):
                base[c] = colour[k, c]
            if texel[k] > 0.0:
                # The rasteriser picks the nearest texel: far away, fade into the mean colour instead of noise.
                texels = z * stretch / focal / math.sqrt(max(facing, 0.02)) / texel[k]
                keep = min(1.0, max(0.0, (9.0 - texels) / 8.0))
                for c in range(3):
                    base[c] += (albedo[row, col, c] - base[c]) * keep
            lit = max(0.0, nx * sun[0] + ny * sun[1] + nz * sun[2])
            level = 0.52 + 0.12 * nz + 0.05 * nx + 0.03 * ny + 0.50 * lit
            haze = 1.0 - math.exp(-z * stretch / 420.0)
            haze *= haze
            for c in range(3):
                value = base[c] * level
                value += (horizon[c] - value) * haze
                out[row, col, c] = np.uint8(min(255.0, value + 0.5))
    return hits, behind
