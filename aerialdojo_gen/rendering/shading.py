"""Deferred shading: from albedo, depth and surface of every pixel to the picture.

The rasteriser delivers unlit texture colour, depth and the material's number; normals follow from depth. Sun, shadow,
sky light, haze and the sky itself are added here, so that every rendering backend gives the same picture. Light is
computed in sRGB values: not physical, but it looks as in a game.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.rendering.lighting import Lighting, ShadowMap

Floats = NDArray[np.float64]

# Light on a surface, as shares of its colour: ambient, from above, a little from east and north so that the shaded
# faces of a building differ, and from the sun.
_AMBIENT, _FROM_ABOVE, _FROM_EAST, _FROM_NORTH, _SUN = 0.55, 0.11, 0.05, 0.03, 0.47
# Haze grows with the square of distance up to about this range, metres.
_HAZE_RANGE_M = 420.0
# A texture fades into its mean colour between one and nine texels a pixel.
_FADE_TEXELS = 9.0


def shade(
    camera: Camera,
    world_from_camera: Floats,
    albedo: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    surface: NDArray[np.int32],
    light: Lighting,
    shadow: ShadowMap,
) -> NDArray[np.uint8]:
    """Light a picture: albedo (H, W, 3) uint8, planar depth and surface (H, W) give sRGB (H, W, 3) uint8."""
    out = np.empty_like(albedo)
    _shade(
        albedo,
        depth_m,
        surface,
        camera.focal_px,
        np.ascontiguousarray(world_from_camera),
        light.colour,
        light.texel_m,
        light.unlit,
        np.stack([light.sun, light.zenith, light.horizon]),
        shadow.depth_m,
        np.ascontiguousarray(shadow.world_from_camera),
        shadow.camera.focal_px,
        0.03 + 1.5 * shadow.texel_m,
        out,
    )
    return out


@njit(cache=True)
def _sunlit(x: float, y: float, z: float, shadow: NDArray[np.float32], pose: Floats, focal: float) -> float:
    """Share of the sun that reaches a point: 0 in shadow, 1 in the light, between them at a shadow's edge."""
    x, y, z = x - pose[0, 3], y - pose[1, 3], z - pose[2, 3]
    depth = pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z
    n = shadow.shape[0]
    u = focal * (pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z) / depth + n / 2.0 - 0.5
    v = focal * (pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z) / depth + n / 2.0 - 0.5
    col, row = math.floor(u), math.floor(v)
    if col < 0 or row < 0 or col > n - 2 or row > n - 2:
        return 1.0
    a, b = u - col, v - row
    top = (1.0 - a) * (depth <= shadow[row, col]) + a * (depth <= shadow[row, col + 1])
    bottom = (1.0 - a) * (depth <= shadow[row + 1, col]) + a * (depth <= shadow[row + 1, col + 1])
    return float((1.0 - b) * top + b * bottom)


@njit(cache=True)
def _slope(w: Floats, row: int, col: int, down: int, right: int) -> float:
    """Change of inverse depth a pixel, along a row or a column, of the surface that the pixel shows.

    Inverse depth is linear on a plane: of the two sides, the one where it bends less belongs to that surface.
    """
    height, width = w.shape
    best, slope = np.inf, 0.0
    for side in (-1, 1):
        r1, c1 = row + side * down, col + side * right
        r2, c2 = r1 + side * down, c1 + side * right
        if r2 < 0 or c2 < 0 or r2 >= height or c2 >= width:
            continue
        bend = abs(w[row, col] - 2.0 * w[r1, c1] + w[r2, c2])
        if bend < best:
            best, slope = bend, side * (w[r1, c1] - w[row, col])
    return slope


@njit(cache=True)
def _shade(
    albedo: NDArray[np.uint8],
    depth: NDArray[np.float32],
    surface: NDArray[np.int32],
    focal: float,
    pose: Floats,
    colour: Floats,
    texel: Floats,
    unlit: NDArray[np.bool_],
    sky: Floats,
    shadow: NDArray[np.float32],
    sun_pose: Floats,
    sun_focal: float,
    bias_m: float,
    out: NDArray[np.uint8],
) -> None:
    height, width = depth.shape
    sun, zenith, horizon = sky[0], sky[1], sky[2]
    base = np.empty(3)
    w = np.zeros((height, width))
    for row in range(height):
        for col in range(width):
            if surface[row, col] >= 0:
                w[row, col] = 1.0 / depth[row, col]
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
                # Below the horizon, beyond the ground's edge: haze.
                up = max(0.0, dz / stretch) ** 0.55
                for c in range(3):
                    out[row, col, c] = np.uint8(horizon[c] + (zenith[c] - horizon[c]) * up + 0.5)
                continue
            z = depth[row, col]
            # The plane n . P = d through the pixel has 1 / z = n . (x, y, 1) / d: its slopes are n's x and y.
            a = _slope(w, row, col, 0, 1) * focal
            b = _slope(w, row, col, 1, 0) * focal
            e = w[row, col] - x * a - y * b
            norm = math.sqrt(a * a + b * b + e * e)
            facing = w[row, col] / (norm * stretch)
            nx = -(pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * e) / norm
            ny = -(pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * e) / norm
            nz = -(pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * e) / norm
            for c in range(3):
                base[c] = colour[k, c]
            if texel[k] > 0.0:
                # The rasteriser samples the nearest texel: fade into the mean colour with distance, against noise.
                texels = z * stretch / focal / math.sqrt(max(facing, 0.02)) / texel[k]
                sharpness = min(1.0, max(0.0, (_FADE_TEXELS - texels) / (_FADE_TEXELS - 1.0)))
                for c in range(3):
                    base[c] += (albedo[row, col, c] - base[c]) * sharpness
            lit = nx * sun[0] + ny * sun[1] + nz * sun[2]
            if lit <= 0.0:
                lit = 0.0
            else:
                # Offset by more than a texel of the map, against self-shadowing.
                px = pose[0, 3] + dx * z + nx * bias_m
                py = pose[1, 3] + dy * z + ny * bias_m
                pz = pose[2, 3] + dz * z + nz * bias_m
                lit *= _sunlit(px, py, pz, shadow, sun_pose, sun_focal)
            level = _AMBIENT + _FROM_ABOVE * nz + _FROM_EAST * nx + _FROM_NORTH * ny + _SUN * lit
            if unlit[k]:
                level = 1.0
            range_m = z * stretch / _HAZE_RANGE_M
            haze = 1.0 - math.exp(-range_m)
            haze *= haze
            for c in range(3):
                value = base[c] * level
                value += (horizon[c] - value) * haze
                out[row, col, c] = np.uint8(min(255.0, value + 0.5))
