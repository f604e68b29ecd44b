"""What all renderers have: their output, their depth range, and that they are closed."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

# Planar depths between which surfaces are drawn, metres.
NEAR_M, FAR_M = 0.1, 2000.0


@dataclass(frozen=True, eq=False)
class Picture:
    """Output of a renderer for one camera."""

    rgb: NDArray[np.uint8]  # (H, W, 3) uint8; sRGB
    depth_m: NDArray[np.float32]  # (H, W) float32; planar depth, metres; inf where nothing is hit
    instance: NDArray[np.int32] | None = None  # (H, W) int32 or None


class Closable:
    """What holds memory until it is closed: a context manager."""

    def close(self) -> None:
        """Free the memory; a second call does nothing."""

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the memory."""
        self.close()
