"""What all renderers have: their interface, their output, their depth range."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.scenes.light import Light

# Planar depths between which surfaces are drawn, metres.
NEAR_M, FAR_M = 0.1, 2000.0


@dataclass(frozen=True, eq=False)
class Picture:
    """Output of a renderer for one camera."""

    rgb: NDArray[np.uint8]  # (H, W, 3) uint8; sRGB
    depth_m: NDArray[np.float32]  # (H, W) float32; planar depth, metres; inf where nothing is hit
    instance: NDArray[np.int32] | None = None  # (H, W) int32 or None


class Renderer(ABC):
    """A scene ready to be rendered; a context manager that frees its memory at its end."""

    name: str
    device: str  # As the driver names it
    light: Light  # That it draws by: at first the scene's own

    @abstractmethod
    def render(self, camera: Camera, world_from_camera: NDArray[np.float64], instances: bool = False) -> Picture:
        """Take a picture from a pose (4, 4); its arrays are not changed by later calls."""

    def render_views(
        self, camera: Camera, poses: Sequence[NDArray[np.float64]], instances: bool = False
    ) -> list[Picture]:
        """Take several pictures."""
        return [self.render(camera, pose, instances) for pose in poses]

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
