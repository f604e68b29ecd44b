"""Deferred shading: from albedo, depth and surface of every pixel to the picture.

The rasteriser delivers unlit texture colour, depth and the material's number; normals follow from depth. Sun, shadow,
light from the sky, haze and the sky with its clouds are added here, so that every rendering backend gives nearly the
same picture. No light goes by north or east: agents are told no heading, and walls must not say it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Bytes, Flags, Floats, Int32s, Singles
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.rendering.lighting import REACH_M, HeightMap, Lighting, ShadowMap

# How much brighter the sky is on the sun's side, and how much of its light a place under others loses at most.
SIDE, _SHADED = 0.16, 0.62
# A place so far below the mean height about it, metres, sees that little of the sky; from so far before a surface.
_DEEP_M, _BEFORE_M = 5.0, 0.7
# Tone mapping: x / (x + _TOE) * _GAIN of linear light is near sRGB, and rolls off towards white.
_TOE, _GAIN = 0.155, 1.019
# Share of a colour's saturation that is kept; and where land ends in the haze of the sky, metres.
_VIVID, _END_M = 0.85, 1600.0
_GREY = np.array([0.3, 0.6, 0.1])
MUTE: Floats = _VIVID * np.eye(3) + (1.0 - _VIVID) * np.tile(_GREY, (3, 1))
# Least and greatest share of the sky that water and glass mirror; where they are looked at head-on, and along.
_MIRROR_LEAST, _MIRROR_MOST = 0.10, 0.85
# What is wet is darker.
_WET = 0.62
# A texture of what is built fades into its mean colour between one and nine texels a pixel.
_FADE_TEXELS = 9.0
# Clouds: how much longer than the zenith's the way to them is at the horizon, their size, and where they begin.
_CLOUD_FLAT, _CLOUD_SCALE = 0.12, 0.11


def shade(
    camera: Camera, world_from_camera: Floats, albedo: Bytes, depth_m: Singles,
    surface: Int32s, light: Lighting, shadow: ShadowMap, clouds: Bytes, heights: HeightMap,
) -> Bytes:  # fmt: skip
    """Light a picture: albedo (H, W, 3) uint8, planar depth and surface (H, W) give sRGB (H, W, 3) uint8."""
    out = np.empty_like(albedo)
    _shade(
        albedo, depth_m, surface, camera.focal_px, np.ascontiguousarray(world_from_camera), light.colour,
        light.texel_m, light.unlit, light.shiny, light.rows, shadow, clouds, heights, out,
    )  # fmt: skip
    return out


@njit(cache=True)
def tone(linear: float) -> float:
    """Brightness, 0-255, of linear light."""
    return linear / (linear + _TOE) * _GAIN * 255.0


def muted(colours: NDArray[Any]) -> Floats:
    """Give colours (..., 3), 0-255, a little less saturation: light makes it up."""
    return np.asarray(np.rint(colours.astype(np.float64) @ MUTE.T))


def lit_in_haze(base: Floats, normal: Floats, unit: Floats, distance: Floats, light: Lighting) -> Floats:
    """Light surfaces of the horizon: colours (n, 3) 0-255, normals, directions (unit) and distances to them."""
    flat = light.sun[:2] / (np.linalg.norm(light.sun[:2]) + 1e-9)
    up, side = 0.5 + 0.5 * normal[:, 2:], 1.0 + SIDE * (normal[:, :2] @ flat)[:, None]
    from_sky = (light.ground_rgb + (light.sky_rgb - light.ground_rgb) * up) * side
    linear = (base @ MUTE.T / 255.0) ** 2 * (from_sky + light.sun_rgb * np.maximum(normal @ light.sun, 0.0)[:, None])
    value = linear / (linear + _TOE) * _GAIN * 255.0
    end = np.clip(2.0 * distance / _END_M - 1.0, 0.0, 1.0)
    haze = np.maximum(distance**2 / (distance**2 + light.haze_m**2), end * end * (3.0 - 2.0 * end))
    sky = light.horizon + (light.zenith - light.horizon) * np.sqrt(np.maximum(unit[:, 2:], 0.0))
    return np.asarray(value + (sky - value) * haze[:, None])


@njit(cache=True)
def _bilinear(table: Bytes, u: float, v: float) -> float:
    """A table's value between its cells' middles; beyond the border that of the nearest cell."""
    rows, columns = table.shape
    u, v = min(max(u - 0.5, 0.0), columns - 1.0), min(max(v - 0.5, 0.0), rows - 1.0)
    j, i = min(int(u), columns - 2), min(int(v), rows - 2)
    a, b = u - j, v - i
    low = table[i, j] * (1.0 - a) + table[i, j + 1] * a
    return float(low * (1.0 - b) + (table[i + 1, j] * (1.0 - a) + table[i + 1, j + 1] * a) * b)


@njit(cache=True)
def _cloud(x: float, y: float, z: float, share: float, clouds: Bytes) -> float:
    """Thickness of the clouds, 0 to 1, in a direction (a unit vector) above the horizon."""
    n = clouds.shape[0]
    if n == 1:
        return 0.0
    far = _CLOUD_SCALE / (z + _CLOUD_FLAT)
    u, v = x * far * n - 0.5, y * far * n - 0.5
    j, i = math.floor(u), math.floor(v)
    a, b = u - j, v - i
    j0, j1, i0, i1 = int(j) % n, int(j + 1) % n, int(i) % n, int(i + 1) % n
    low = clouds[i0, j0] * (1.0 - a) + clouds[i0, j1] * a
    thick = (low * (1.0 - b) + (clouds[i1, j0] * (1.0 - a) + clouds[i1, j1] * a) * b) / 255.0
    thick = min(max((thick - 0.86 + 0.8 * share) * 3.2, 0.0), 1.0)
    return thick * min(z * 7.0, 1.0)


@njit(cache=True)
def _sky(x: float, y: float, z: float, rows: Floats, clouds: Bytes, out: Floats) -> None:
    """Colour of the sky, 0-255, in a direction (a unit vector); below the horizon that of haze."""
    z = max(z, 0.0)
    up = math.sqrt(z)
    thick = _cloud(x, y, z, rows[6, 1], clouds)
    # White clouds in the sun, grey ones under a closed sky.
    for c in range(3):
        blue = rows[5, c] + (rows[4, c] - rows[5, c]) * up
        white = rows[5, c] * 0.25 + 189.0 - 34.0 * rows[6, 1] * thick
        out[c] = blue + (white - blue) * thick * (0.85 - 0.35 * rows[6, 1])


@njit(cache=True)
def _sunlit(x: float, y: float, z: float, sun: ShadowMap) -> float:
    """Share of the sun that reaches a point: 0 in shadow, 1 in the light, between them at a shadow's edge."""
    pose, shadow = sun.world_from_camera, sun.depth_m
    x, y, z = x - pose[0, 3], y - pose[1, 3], z - pose[2, 3]
    depth = pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z
    n = shadow.shape[0]
    u = sun.focal_px * (pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z) / depth + n / 2.0 - 0.5
    v = sun.focal_px * (pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z) / depth + n / 2.0 - 0.5
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
def _turned(pose: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the camera's frame in the world's."""
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@njit(cache=True)
def _fade(base: Floats, albedo: Bytes, across_texels: float, facing: float) -> None:
    """Take a texture's colour the less the more texels a pixel covers: the nearest one is noise there."""
    texels_2 = across_texels**2 / max(facing, 0.02)
    sharpness = min(1.0, max(0.0, (_FADE_TEXELS**2 - texels_2) / (_FADE_TEXELS**2 - 1.0)))
    for c in range(3):
        base[c] += (albedo[c] - base[c]) * sharpness


@njit(cache=True)
def _depth_below(x: float, y: float, z: float, heights: HeightMap) -> float:
    """How far a place lies below the mean height about it, as a share of `_DEEP_M`."""
    if heights.above.shape[0] <= 1:
        return 0.0
    u, v = (x - heights.west_m) / heights.cell_m, (y - heights.south_m) / heights.cell_m
    return (heights.lowest_m + _bilinear(heights.above, u, v) * (REACH_M / 255.0) - z - _BEFORE_M) / _DEEP_M


@njit(cache=True)
def _light(base: Floats, rows: Floats, up: float, open_sky: float, lit: float, dark: float) -> None:
    """Light a colour, 0-255, by the sky and the sun, in place."""
    grey = 0.3 * base[0] + 0.6 * base[1] + 0.1 * base[2]
    for c in range(3):
        base[c] = grey + (base[c] - grey) * _VIVID
        from_sky = (rows[3, c] + (rows[2, c] - rows[3, c]) * up) * open_sky
        value = base[c] / 255.0
        base[c] = tone(value * value * dark * (from_sky + rows[1, c] * lit))


@njit(cache=True)
def _shade(
    albedo: Bytes, depth: Singles, surface: Int32s, focal: float, pose: Floats,
    colour: Floats, texel: Floats, unlit: Flags, shiny: Floats, rows: Floats, shadow: ShadowMap,
    clouds: Bytes, heights: HeightMap, out: Bytes,
) -> None:  # fmt: skip
    height, width = depth.shape
    sun = rows[0]
    flat = math.sqrt(sun[0] * sun[0] + sun[1] * sun[1]) + 1e-9
    base, sky = np.empty(3), np.empty(3)
    # Inverse depths; 0 of the sky.
    w = np.where(surface >= 0, 1.0 / depth.astype(np.float64), 0.0)
    for row in range(height):
        y = (row + 0.5 - height / 2.0) / focal
        for col in range(width):
            x = (col + 0.5 - width / 2.0) / focal
            dx, dy, dz = _turned(pose, x, y, 1.0)
            stretch = math.sqrt(dx * dx + dy * dy + dz * dz)
            k = surface[row, col]
            if k < 0:
                _sky(dx / stretch, dy / stretch, dz / stretch, rows, clouds, sky)
                for c in range(3):
                    out[row, col, c] = np.uint8(sky[c] + 0.5)
                continue
            z = depth[row, col]
            # The plane n . P = d through the pixel has 1 / z = n . (x, y, 1) / d: its slopes are n's x and y.
            a = _slope(w, row, col, 0, 1) * focal
            b = _slope(w, row, col, 1, 0) * focal
            e = w[row, col] - x * a - y * b
            norm = math.sqrt(a * a + b * b + e * e)
            facing = w[row, col] / (norm * stretch)
            inwards = _turned(pose, a, b, e)
            nx, ny, nz = -inwards[0] / norm, -inwards[1] / norm, -inwards[2] / norm
            for c in range(3):
                base[c] = colour[k, c]
            if texel[k] > 0.0:
                _fade(base, albedo[row, col], z * stretch / focal / texel[k], facing)
            px, py, pz = pose[0, 3] + dx * z, pose[1, 3] + dy * z, pose[2, 3] + dz * z
            lit = nx * sun[0] + ny * sun[1] + nz * sun[2]
            if lit <= 0.0:
                lit = 0.0
            else:
                bias = shadow.bias_m
                lit *= _sunlit(px + nx * bias, py + ny * bias, pz + nz * bias, shadow)
            deep = _depth_below(px + nx * _BEFORE_M, py + ny * _BEFORE_M, pz, heights)
            open_sky = (1.0 - _SHADED * min(max(deep, 0.0), 1.0)) * (1.0 + SIDE * (nx * sun[0] + ny * sun[1]) / flat)
            level = min(max(4.0 * nz - 3.0, 0.0), 1.0) * rows[6, 2]
            mirror = max(shiny[k], level * 0.6)
            if mirror > 0.0:
                turn = 2.0 * facing * stretch
                mx, my, mz = (dx + nx * turn) / stretch, (dy + ny * turn) / stretch, (dz + nz * turn) / stretch
                _sky(mx, my, mz, rows, clouds, sky)
                glance = 1.0 - facing
                mirror *= _MIRROR_LEAST + (_MIRROR_MOST - _MIRROR_LEAST) * glance * glance * glance
            range_2 = (z * stretch) ** 2
            haze = range_2 / (range_2 + rows[6, 0])
            if not unlit[k]:
                _light(base, rows, 0.5 + 0.5 * nz, open_sky, lit, 1.0 - (1.0 - _WET) * level)
            for c in range(3):
                value = base[c]
                if mirror > 0.0:
                    value += (sky[c] - value) * mirror
                value += (rows[5, c] - value) * haze
                out[row, col, c] = np.uint8(min(255.0, value + 0.5))
