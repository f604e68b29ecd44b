"""What all renderers have: their interface, their output, their depth range."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np

from aerialdojo_gen.geometry.arrays import Bytes, Floats, Int32s, Singles
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.scenes.light import Light

# Planar depths between which surfaces are drawn, metres.
NEAR_M, FAR_M = 0.1, 2000.0


@dataclass(frozen=True, eq=False)
class Picture:
    """Output of a renderer for one camera."""

    rgb: Bytes  # (H, W, 3) uint8; sRGB
    depth_m: Singles  # (H, W) float32; planar depth, metres; inf where nothing is hit
    instance: Int32s | None = None  # (H, W) int32 or None


class Renderer(ABC):
    """A scene ready to be rendered; a context manager that frees its memory at its end."""

    name: str
    device: str  # As the driver names it
    light: Light  # That it draws by: at first the scene's own

    @abstractmethod
    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = False) -> Picture:
        """Take a picture from a pose (4, 4); its arrays are not changed by later calls."""

    def render_views(self, camera: Camera, poses: Sequence[Floats], instances: bool = False) -> list[Picture]:
        """Take several pictures; cheaper than one by one where neighbours share their eye."""
        shape = (len(poses), camera.height, camera.width)
        rgb, depth_m = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
        instance = np.empty(shape, np.int32) if instances else None
        self.render_into(camera, poses, rgb, depth_m, instance)
        return [Picture(rgb[k], depth_m[k], None if instance is None else instance[k]) for k in range(len(poses))]

    def render_bodies(
        self, camera: Camera, poses: Floats, views: Sequence[str], instance: Int32s | None = None
    ) -> tuple[Bytes, Singles]:
        """Take all views at poses (n, 4): RGB (n, views, H, W, 3) uint8 and planar depth, inf for no hit.

        Instance ids go into `instance` (n, views, H, W), if it is given.
        """
        shape = (len(poses), len(views), camera.height, camera.width)
        rgb, depth_m = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
        world = [view_pose(pose[:3], float(pose[3]), view) for pose in poses for view in views]
        flat = None if instance is None else instance.reshape(-1, *shape[2:])
        self.render_into(camera, world, rgb.reshape(-1, *shape[2:], 3), depth_m.reshape(-1, *shape[2:]), flat)
        return rgb, depth_m

    def render_into(
        self, camera: Camera, poses: Sequence[Floats], rgb: Bytes, depth_m: Singles, instance: Int32s | None
    ) -> None:
        """Take pictures into arrays (n, H, W, 3) and (n, H, W)."""
        for k, pose in enumerate(poses):
            picture = self.render(camera, pose, instance is not None)
            rgb[k], depth_m[k] = picture.rgb, picture.depth_m
            if instance is not None and picture.instance is not None:
                instance[k] = picture.instance

    @abstractmethod
    def relight(self, light: Light) -> None:
        """Draw by another light from now on."""

    def close(self) -> None:  # noqa: B027 - one that holds nothing has nothing to free
        """Free the memory; a second call does nothing."""

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the memory."""
        self.close()
