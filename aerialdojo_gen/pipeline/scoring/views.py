"""Render the pictures that scorers judge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.portable import product
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import Body
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures
from aerialdojo_gen.rendering.raycast import RayRenderer, pixel_rays

Floats = NDArray[np.float64]

# A part that takes this share of the picture is large enough: a square of a fourteenth of its edge.
_LARGE = 0.005
# What is nearer than the object's nearest part stands before it; a surface this level is a floor, seen from above.
_NEARER, _FLOOR = 0.95, 0.8
_IN_FRONT_M = 0.05
# Of the pixels, one in so many rows and columns is tested first.
_EVERY = 4


def take_view(
    renderer: RayRenderer,
    alone: TriangleRayCaster,
    thing: Body,
    own_instance: int,
    camera: Camera,
    position_m: Floats,
    yaw_rad: float,
    measures: CandidateMeasures,
    parts: Sequence[NDArray[np.int64]],
) -> AnchorView:
    """Take an object's front view from a candidate anchor (world metres, radians), the same mask anywhere."""
    pose = view_pose(position_m, yaw_rad, "front")
    picture = renderer.render(camera, pose)
    assert picture.instance is not None
    visible = picture.instance == own_instance
    # Whether the object is behind what is nearer: where it is seen there is nothing to ask.
    hidden = np.flatnonzero(~visible & (picture.instance >= 0) & boxed(camera, pose, thing.vertices))
    silhouette = visible.copy()
    directions = product(pixel_rays(camera)[0][hidden], pose[:3, :3].T)
    silhouette.flat[hidden] = alone.first_hit(position_m, directions)[1] >= 0
    shares = part_shares(alone, thing, parts, camera, pose, visible)
    marks = tuple(
        seen * min(1.0, math.sqrt(share / _LARGE))
        for seen, share in zip(measures.part_visibility, shares, strict=True)
    )
    wide = (picture.instance >= 0) & renderer.wide[picture.instance]
    nearer = standing_nearer(picture.depth_m, visible, wide, camera, pose)
    measures = replace(measures, part_visibility=marks)
    return AnchorView(picture.rgb, visible, silhouette, picture.instance < 0, measures, nearer)


def standing_nearer(
    depth: NDArray[np.float32],
    visible: NDArray[np.bool_],
    wide: NDArray[np.bool_],
    camera: Camera,
    world_from_camera: Floats,
) -> NDArray[np.bool_]:
    """Pixels (H, W) of what is nearer than the object's nearest part, but for level surfaces of what is wide."""
    if not visible.any():
        return np.zeros_like(visible)
    nearer = (depth < _NEARER * np.percentile(depth[visible], 2.0)) & ~visible
    to_check = np.flatnonzero(nearer & wide)
    if len(to_check):
        turn = np.ascontiguousarray(world_from_camera[:3, :3])
        nearer.flat[to_check] = ~_level(to_check, depth, pixel_rays(camera)[0].reshape(*depth.shape, 3), turn)
    return np.asarray(nearer)


@njit(cache=True)
def _point(depth: NDArray[np.float32], rays: Floats, turn: Floats, row: int, col: int) -> tuple[float, float, float]:
    z = np.float64(depth[row, col]) if np.isfinite(depth[row, col]) else 1e3
    x, y, z = rays[row, col, 0] * z, rays[row, col, 1] * z, rays[row, col, 2] * z
    return (
        x * turn[0, 0] + y * turn[0, 1] + z * turn[0, 2],
        x * turn[1, 0] + y * turn[1, 1] + z * turn[1, 2],
        x * turn[2, 0] + y * turn[2, 1] + z * turn[2, 2],
    )


@njit(cache=True)
def _level(pixels: NDArray[np.int64], depth: NDArray[np.float32], rays: Floats, turn: Floats) -> NDArray[np.bool_]:
    """Whether pixels, numbered row by row, show a level surface: by the points that their neighbours show."""
    height, width = depth.shape
    out = np.empty(len(pixels), np.bool_)
    for n in range(len(pixels)):
        row, col = pixels[n] // width, pixels[n] % width
        a0, a1, a2 = _point(depth, rays, turn, max(row - 1, 0), col)
        b0, b1, b2 = _point(depth, rays, turn, min(row + 1, height - 1), col)
        c0, c1, c2 = _point(depth, rays, turn, row, max(col - 1, 0))
        d0, d1, d2 = _point(depth, rays, turn, row, min(col + 1, width - 1))
        x, y, z = b0 - a0, b1 - a1, b2 - a2
        u, v, w = d0 - c0, d1 - c1, d2 - c2
        nx, ny, nz = y * w - z * v, z * u - x * w, x * v - y * u
        out[n] = abs(nz) >= _FLOOR * max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    return out


def box_px(camera: Camera, world_from_camera: Floats, vertices: Floats) -> tuple[int, int, int, int]:
    """Find the part of a picture that points, (n, 3) float64, can be in: left, top, one past right, one past bottom.

    A pixel of room around them; the whole picture where one of them reaches behind the camera, which has no place
    in it.
    """
    pose = np.ascontiguousarray(world_from_camera)
    nearest, low_u, low_v, high_u, high_v = _extent(np.ascontiguousarray(vertices), pose, camera.focal_px)
    if nearest <= _IN_FRONT_M:
        return 0, 0, camera.width, camera.height
    u, v = camera.width / 2.0, camera.height / 2.0
    u0, v0 = max(0, math.floor(low_u + u) - 1), max(0, math.floor(low_v + v) - 1)
    u1, v1 = min(camera.width, math.ceil(high_u + u) + 1), min(camera.height, math.ceil(high_v + v) + 1)
    return u0, v0, max(u1, u0), max(v1, v0)


@njit(cache=True, error_model="numpy")
def _extent(points: Floats, pose: Floats, focal_px: float) -> tuple[float, float, float, float, float]:
    """Least depth of points, and where they are about the picture's middle: left, top, right, bottom."""
    nearest, low_u, low_v, high_u, high_v = np.inf, np.inf, np.inf, -np.inf, -np.inf
    for n in range(len(points)):
        x, y, z = points[n, 0] - pose[0, 3], points[n, 1] - pose[1, 3], points[n, 2] - pose[2, 3]
        depth = x * pose[0, 2] + y * pose[1, 2] + z * pose[2, 2]
        nearest = min(nearest, depth)
        if nearest <= _IN_FRONT_M:
            break
        u = focal_px * (x * pose[0, 0] + y * pose[1, 0] + z * pose[2, 0]) / depth
        v = focal_px * (x * pose[0, 1] + y * pose[1, 1] + z * pose[2, 1]) / depth
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
    return nearest, low_u, low_v, high_u, high_v


def boxed(camera: Camera, world_from_camera: Floats, vertices: Floats) -> NDArray[np.bool_]:
    """Mark the pixels of `box_px`, (H, W) bool."""
    mask = np.zeros((camera.height, camera.width), dtype=np.bool_)
    u0, v0, u1, v1 = box_px(camera, world_from_camera, vertices)
    mask[v0:v1, u0:u1] = True
    return mask


def part_shares(
    alone: TriangleRayCaster,
    thing: Body,
    parts: Sequence[NDArray[np.int64]],
    camera: Camera,
    world_from_camera: Floats,
    visible: NDArray[np.bool_],
    enough: float = math.inf,
) -> list[float]:
    """Share of a picture's pixels that show each part; from `enough` on it may be understated, not below it."""
    counts = np.zeros(len(parts), dtype=np.int64)
    # Each pixel of a part lies in the part's box.
    around = [visible & boxed(camera, world_from_camera, thing.vertices[thing.faces[part]].reshape(-1, 3))
              for part in parts]  # fmt: skip
    coarse = np.zeros_like(visible)
    if math.isfinite(enough):
        coarse[::_EVERY, ::_EVERY] = True
    # A few pixels prove that a large part is shown; the others are tested for the rest alone.
    for some in (coarse, ~coarse):
        left = [k for k in range(len(parts)) if counts[k] < enough * visible.size]
        if left:
            pixels = np.any([around[k] for k in left], axis=0) & some
            shown = pixels_by_face(alone, len(thing.faces), camera, world_from_camera, pixels)
            for k in left:
                counts[k] += shown[parts[k]].sum()
    return [float(count) / visible.size for count in counts.tolist()]


def pixels_by_face(
    alone: TriangleRayCaster, faces: int, camera: Camera, world_from_camera: Floats, pixels: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """How many of some pixels (H, W) that show an instance show each of its faces, (faces,) int64."""
    directions = product(pixel_rays(camera)[0][pixels.ravel()], world_from_camera[:3, :3].T)
    face = alone.first_hit(world_from_camera[:3, 3], directions)[1]
    return np.bincount(face[face >= 0], minlength=faces)
