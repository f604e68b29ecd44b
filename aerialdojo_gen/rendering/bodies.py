"""Batches of small pictures of one scene, from the cameras of many bodies.

Culling, vertex work and waiting dominate the time of a small picture, not its pixels. So the views of a body are
culled together, and a picture is read back after later ones have been drawn.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.gl_occlusion import BodyCulling
from aerialdojo_gen.rendering.gl_target import read_instances, read_pixels
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M, Renderer

Floats = NDArray[np.float64]

# Pictures drawn before the first of them is read back.
_AHEAD = 4


def draw_bodies(
    renderer: Renderer, camera: Camera, poses: Floats, views: Sequence[str], instance: NDArray[np.int32] | None = None
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Pictures of all views at poses (n, 4): RGB (n, views, H, W, 3) uint8 and planar depth, inf for no hit."""
    shape = (len(poses), len(views), camera.height, camera.width)
    rgb, depth_m = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
    many = getattr(renderer, "bodies", None)
    if many is not None:
        many().draw(camera, poses, views, rgb, depth_m, instance)
        return rgb, depth_m
    for k, pose in enumerate(poses):
        for v, view in enumerate(views):
            picture = renderer.render(camera, view_pose(pose[:3], float(pose[3]), view), instance is not None)
            rgb[k, v], depth_m[k, v] = picture.rgb, picture.depth_m
            if instance is not None:
                instance[k, v] = np.asarray(picture.instance)
    return rgb, depth_m


class GlBodies:
    """Draws bodies' views with a `GlRenderer`."""

    def __init__(self, renderer: Any) -> None:
        self._renderer = renderer
        self._cullings = [BodyCulling(d.kind.chunks, d.kind.hides) for d in renderer._sets]

    def draw(
        self, camera: Camera, poses: Floats, views: Sequence[str], rgb: NDArray[np.uint8],
        depth_m: NDArray[np.float32], instance: NDArray[np.int32] | None = None,
    ) -> None:  # fmt: skip
        """Fill ``rgb`` (n, views, H, W, 3), ``depth_m`` and ``instance`` (n, views, H, W); see `draw_bodies`."""
        from aerialdojo_gen.rendering.gl import clip_from_world

        waiting: deque[tuple[Any, int, int]] = deque()
        turn = 0
        for k, pose in enumerate(poses):
            world = [view_pose(pose[:3], float(pose[3]), view) for view in views]
            clips = np.stack([clip_from_world(camera, matrix, NEAR_M, FAR_M) for matrix in world])
            eye = np.ascontiguousarray(pose[:3])
            nearness = np.zeros((len(views), camera.height, camera.width), np.float32)
            visible = [
                culling.visible_indices(clips, eye, camera.width, camera.height, nearness)
                for culling in self._cullings
            ]
            for v, matrix in enumerate(world):
                target = self._renderer.draw_triangles(
                    camera, matrix, clips[v], [of_kind[v] for of_kind in visible], instance is not None,
                    slot=turn % (_AHEAD + 1),
                )  # fmt: skip
                turn += 1
                waiting.append((target, k, v))
                if len(waiting) > _AHEAD:
                    _read(*waiting.popleft(), rgb, depth_m, instance)
        for one in waiting:
            _read(*one, rgb, depth_m, instance)


def _read(
    target: Any, k: int, v: int, rgb: NDArray[np.uint8], depth_m: NDArray[np.float32],
    instance: NDArray[np.int32] | None,
) -> None:  # fmt: skip
    read_pixels(target, rgb[k, v], depth_m[k, v])
    if instance is not None:
        instance[k, v] = read_instances(target, depth_m[k, v].shape)
