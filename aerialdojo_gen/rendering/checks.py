"""Checks of rendered frames against ray casts and for defects.

Flags, in the order of `FLAGS`:

- ``missing``: a file lacks frames, or does not open (found by `aerialdojo_gen.rendering.recording.record_views`)
- ``black``: nearly all of the picture is black
- ``uniform``: one colour fills the picture
- ``frozen``: picture and depth equal those of the previous frame, though the camera has moved
- ``depth_invalid``: depth is NaN, negative, or nearer than the near plane
- ``depth_mismatch``: depth differs from ray casts at sampled pixels
- ``camera_inside``: most rays from the camera hit a surface from behind, or the camera touches one
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Bytes, Floats, Ints
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.codecs import MAX_DEPTH_M
from aerialdojo_gen.rendering.picture import NEAR_M, Picture
from aerialdojo_gen.rendering.texels import masked_caster
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

FLAGS = ("missing", "black", "uniform", "frozen", "depth_invalid", "depth_mismatch", "camera_inside")
DEPTH_FLAGS = frozenset({"missing", "depth_invalid", "depth_mismatch", "camera_inside"})
RGB_FLAGS = frozenset({"missing", "black", "uniform", "frozen", "camera_inside"})
# An instance id map is drawn with the depth, so it shares its flags.
FLAGS_OF_MODALITY = {"rgb": RGB_FLAGS, "depth": DEPTH_FLAGS, "instance": DEPTH_FLAGS}

_BLACK_LEVEL, _BLACK_SHARE = 8, 0.98
_UNIFORM_RANGE = 6
_BEHIND_SHARE = 0.5
_SAMPLES_A_SIDE = 9
_DEPTH_TOLERANCE_M = 0.01
# One bad sample among 81 may be a sliver between two triangles; a wrong image has many.
_MISMATCH_SHARE = 0.03


def _must_differ(before: Floats, now: Floats, picture: Picture) -> bool:
    """Whether a picture must differ from the previous one: the camera has moved; of sky alone, it has tilted."""
    rows, columns = (slice(0, 3), slice(0, 4)) if np.isfinite(picture.depth_m).any() else (slice(2, 3), slice(0, 3))
    return not np.allclose(before[rows, columns], now[rows, columns], rtol=0.0, atol=1e-4)


@dataclass
class ViewChecks:
    """Checks of one view's frames, in their order."""

    camera: Camera
    solid: Solid  # The scene that is rendered
    flags: set[str] = field(default_factory=set)
    _picture: Picture | None = None
    _pose: Floats | None = None

    def add(self, picture: Picture, world_from_camera: Floats) -> None:
        """Check the next frame."""
        own = picture_flags(picture)
        self.flags |= own
        wrong, behind = self.compare_with_rays(picture, world_from_camera)
        if wrong > _MISMATCH_SHARE:
            self.flags.add("depth_mismatch")
        if behind > _BEHIND_SHARE:
            self.flags.add("camera_inside")
        before = self._picture
        if (
            before is not None
            and self._pose is not None
            and "uniform" not in own
            # The rarest condition first: the others compare whole pictures.
            and _equal(before.depth_m, picture.depth_m)
            and _equal(before.rgb, picture.rgb)
            and _must_differ(self._pose, world_from_camera, picture)
        ):
            self.flags.add("frozen")
        self._picture, self._pose = picture, world_from_camera

    def compare_with_rays(self, picture: Picture, world_from_camera: Floats) -> tuple[float, float]:
        """Compare depth with ray casts at a lattice of smooth pixels: share that differs, share hit from behind."""
        h, w = picture.depth_m.shape
        rows, cols = _samples(h, w)
        depth = picture.depth_m
        measured = depth[rows, cols].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = [
                1.0 / depth[rows + r, cols + c].astype(np.float64)
                for r, c in ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
            ]
            bend = np.maximum(
                np.abs(inverse[1] + inverse[2] - 2 * inverse[0]), np.abs(inverse[3] + inverse[4] - 2 * inverse[0])
            )
            smooth = np.where(np.isfinite(measured), bend * measured**2 < _DEPTH_TOLERANCE_M / 2, bend == 0.0)
        f = self.camera.focal_px
        local = np.stack([(cols + 0.5 - w / 2) / f, (rows + 0.5 - h / 2) / f, np.ones(len(rows))], axis=1)
        along, behind = self.solid.first_hit(world_from_camera[:3, 3], local @ world_from_camera[:3, :3].T)
        cast = along / np.linalg.norm(local, axis=1)
        near = np.minimum(measured, cast) <= MAX_DEPTH_M
        compared = smooth & near
        if not compared.any():
            return 0.0, behind
        with np.errstate(invalid="ignore"):
            wrong = ~(np.abs(measured - cast) <= _DEPTH_TOLERANCE_M + 2e-6 * np.minimum(measured, cast) ** 2)
        return float(wrong[compared].mean()), behind


class Solid:
    """Ray casts that distinguish front faces from back faces."""

    def __init__(self, scene: Scene) -> None:
        vertices, faces = soup(scene.instances)
        corners = vertices[faces]
        self._normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # Double-sided surfaces have no inside.
        both = [scene.materials[p.material].double_sided for i in scene.instances for p in i.parts]
        self._normal[np.repeat(both, [len(p.faces) for i in scene.instances for p in i.parts])] = 0.0
        self._caster = masked_caster(scene)

    def first_hit(self, origin: Floats, directions: Floats) -> tuple[Floats, float]:
        """First hits of rays, (n,) metres, and the share of hits from behind: near 1 inside a solid."""
        distance, face = self._caster.first_hit(origin, directions)
        hit = face >= 0
        away = np.einsum("ij,ij->i", self._normal[face[hit]], directions[hit]) > 0.0
        return distance, float(away.mean()) if hit.any() else 0.0


def scene_solid(scene: Scene) -> Solid:
    """Return the scene's solid, over its one Embree scene."""
    return context_of(scene).part("solid", lambda: Solid(scene))


def picture_flags(picture: Picture) -> set[str]:
    """Check a frame by itself."""
    flags = set()
    dark, widest = _darkness(picture.rgb)
    nearest = float(np.min(picture.depth_m))
    if dark > _BLACK_SHARE:
        flags.add("black")
    if widest <= _UNIFORM_RANGE:
        flags.add("uniform")
    if np.isnan(nearest) or nearest < 0.99 * NEAR_M:
        flags.add("depth_invalid")
    elif nearest < 1.2 * NEAR_M:
        flags.add("camera_inside")
    return flags


@njit(cache=True)
def _darkness(rgb: Bytes) -> tuple[float, int]:
    """Share of black pixels and widest range of a colour, of every fourth pixel each way."""
    least_red = least_green = least_blue = np.uint8(255)
    most_red = most_green = most_blue = np.uint8(0)
    black = pixels = 0
    for row in range(0, rgb.shape[0], 4):
        for col in range(0, rgb.shape[1], 4):
            red, green, blue = rgb[row, col, 0], rgb[row, col, 1], rgb[row, col, 2]
            least_red, most_red = min(least_red, red), max(most_red, red)
            least_green, most_green = min(least_green, green), max(most_green, green)
            least_blue, most_blue = min(least_blue, blue), max(most_blue, blue)
            black += max(red, green, blue) < _BLACK_LEVEL
            pixels += 1
    widest = max(most_red - least_red, most_green - least_green, most_blue - least_blue)
    return black / pixels, int(widest)


def _equal(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether two pictures are equal; some rows first, which rarely are."""
    return bool(np.array_equal(one[::32], other[::32]) and np.array_equal(one, other))


@lru_cache
def _samples(height: int, width: int) -> tuple[Ints, Ints]:
    """Rows and columns of a lattice of pixels within a picture's border."""
    lattices = (np.unique(np.linspace(1, n - 2, _SAMPLES_A_SIDE + 2)[1:-1].astype(np.int64)) for n in (height, width))
    rows, cols = np.meshgrid(*lattices, indexing="ij")
    return rows.ravel(), cols.ravel()
