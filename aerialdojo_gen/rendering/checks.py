"""Checks of rendered frames against what the camera must have seen.

Flags, in the order of `FLAGS`:

- ``missing``: a file lacks frames, or does not open (found by `aerialdojo_gen.rendering.recording.record_views`)
- ``black``: nearly all of the picture is black
- ``uniform``: one colour fills the picture
- ``frozen``: picture and depth equal those of the frame before, though the camera has moved
- ``depth_invalid``: depth is NaN, negative, or nearer than the near plane
- ``depth_mismatch``: depth is not what ray casts say at sampled pixels
- ``camera_inside``: most rays from the camera meet a surface from behind, or the camera touches one
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.casters import triangle_caster
from aerialdojo_gen.rendering.codecs import MAX_DEPTH_M
from aerialdojo_gen.rendering.picture import NEAR_M, Picture
from aerialdojo_gen.rendering.texels import seen_caster
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

FLAGS = ("missing", "black", "uniform", "frozen", "depth_invalid", "depth_mismatch", "camera_inside")
OF_DEPTH = frozenset({"missing", "depth_invalid", "depth_mismatch", "camera_inside"})
OF_RGB = frozenset({"missing", "black", "uniform", "frozen", "camera_inside"})
# An instance id map is drawn with the depth: what is wrong with one is wrong with the other.
CONCERNS = {"rgb": OF_RGB, "depth": OF_DEPTH, "instance": OF_DEPTH}

_BLACK_LEVEL, _BLACK_SHARE = 8, 0.98
_UNIFORM_RANGE = 6
_BEHIND_SHARE = 0.5
_SAMPLES_A_SIDE = 9
_DEPTH_TOLERANCE_M = 0.01
# One bad sample among 81 may be a sliver between two triangles; a wrong image has many.
_MISMATCH_SHARE = 0.03


def _looks_different(before: Floats, now: Floats, picture: Picture) -> bool:
    """Whether a picture must differ from the one before: the camera has moved, and not only under the same sky.

    The sky is the same from everywhere and to every side: of it alone a camera sees something else only if it tilts.
    """
    rows, columns = (slice(0, 3), slice(0, 4)) if np.isfinite(picture.depth_m).any() else (slice(2, 3), slice(0, 3))
    return not np.allclose(before[rows, columns], now[rows, columns], rtol=0.0, atol=1e-4)


@dataclass
class ViewChecks:
    """Checks of one view's frames, in their order."""

    camera: Camera
    solid: Solid  # The scene that is rendered
    flags: set[str] = field(default_factory=set)  # What has been found so far
    _picture: Picture | None = None
    _pose: Floats | None = None

    def add(self, picture: Picture, world_from_camera: Floats) -> None:
        """Check the next frame."""
        own = picture_flags(picture)
        self.flags |= own
        wrong, behind = self.against_rays(picture, world_from_camera)
        if wrong > _MISMATCH_SHARE:
            self.flags.add("depth_mismatch")
        if behind > _BEHIND_SHARE:
            self.flags.add("camera_inside")
        before = self._picture
        if (
            before is not None
            and self._pose is not None
            and "uniform" not in own
            # What hardly ever holds first: the rest looks at all of a picture.
            and _equal(before.depth_m, picture.depth_m)
            and _equal(before.rgb, picture.rgb)
            and _looks_different(self._pose, world_from_camera, picture)
        ):
            self.flags.add("frozen")
        self._picture, self._pose = picture, world_from_camera

    def against_rays(self, picture: Picture, world_from_camera: Floats) -> tuple[float, float]:
        """Compare depth with ray casts at a lattice of pixels without edges.

        Shares that are wrong, and that hit from behind.
        """
        h, w = picture.depth_m.shape
        n = _SAMPLES_A_SIDE
        rows, cols = _samples(h, w, n)
        depth = picture.depth_m
        here = depth[rows, cols].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = [
                1.0 / depth[rows + r, cols + c].astype(np.float64)
                for r, c in ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
            ]
            bend = np.maximum(
                np.abs(inverse[1] + inverse[2] - 2 * inverse[0]), np.abs(inverse[3] + inverse[4] - 2 * inverse[0])
            )
            smooth = np.where(np.isfinite(here), bend * here**2 < _DEPTH_TOLERANCE_M / 2, bend == 0.0)
        f = self.camera.focal_px
        local = np.stack([(cols + 0.5 - w / 2) / f, (rows + 0.5 - h / 2) / f, np.ones(len(rows))], axis=1)
        along, behind = self.solid.first_hit(world_from_camera[:3, 3], local @ world_from_camera[:3, :3].T)
        cast = along / np.linalg.norm(local, axis=1)
        near = np.minimum(here, cast) <= MAX_DEPTH_M
        compared = smooth & near
        if not compared.any():
            return 0.0, behind
        with np.errstate(invalid="ignore"):
            wrong = ~(np.abs(here - cast) <= _DEPTH_TOLERANCE_M + 2e-6 * np.minimum(here, cast) ** 2)
        return float(wrong[compared].mean()), behind


class Solid:
    """A scene for ray casts that tell front from back."""

    def __init__(self, scene: Scene, caster: TriangleRayCaster | None = None) -> None:
        vertices, faces = soup(scene.instances)
        corners = vertices[faces]
        self._normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # What is there from both sides has no inside.
        both = [scene.materials[p.material].double_sided for i in scene.instances for p in i.parts]
        self._normal[np.repeat(both, [len(p.faces) for i in scene.instances for p in i.parts])] = 0.0
        self._caster = seen_caster(scene, caster or TriangleRayCaster(vertices, faces))

    def first_hit(self, origin: Floats, directions: Floats) -> tuple[Floats, float]:
        """First hits of rays, (n,) metres, and the share of hits from behind: near 1 inside a solid."""
        distance, face = self._caster.first_hit(origin, directions)
        hit = face >= 0
        away = np.einsum("ij,ij->i", self._normal[face[hit]], directions[hit]) > 0.0
        return distance, float(away.mean()) if hit.any() else 0.0


def kept_solid(scene: Scene) -> Solid:
    """Return the scene's solid, over its one Embree scene."""
    return context_of(scene).part("solid", lambda: Solid(scene, triangle_caster(scene)))


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
def _darkness(rgb: NDArray[np.uint8]) -> tuple[float, int]:
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
    """Whether two pictures are equal: some rows first, which hardly ever are."""
    return bool(np.array_equal(one[::32], other[::32]) and np.array_equal(one, other))


@lru_cache
def _samples(height: int, width: int, a_side: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows, cols = np.meshgrid(_lattice(height, a_side), _lattice(width, a_side), indexing="ij")
    return rows.ravel(), cols.ravel()


def _lattice(n: int, k: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(1, n - 2, k + 2)[1:-1].astype(np.int64))
