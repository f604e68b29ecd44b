"""Input and interface of scorers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import SCORED_JPEG, encode_jpeg


@dataclass(frozen=True, eq=False)
class AnchorView:
    """The front view of a candidate anchor."""

    rgb: NDArray[np.uint8]  # (H, W, 3) uint8; sRGB
    visible: NDArray[np.bool_]  # (H, W) bool; pixels that show the object
    alone: NDArray[np.bool_]  # Pixels that would show it if nothing else were there; a superset of `visible`
    sky: NDArray[np.bool_]  # (H, W) bool; pixels that show no surface at all
    shown: float  # Share of the object that the picture shows, in [0, 1] (`aerialdojo_gen.geometry.viewpoints.Views`)
    elevation_deg: float  # Of the viewpoint, seen from the object's centroid
    clearance_m: float  # From the viewpoint to the nearest surface
    part_visibility: tuple[float, ...] = ()
    off_front_rad: float | None = None
    framed: float = 1.0
    nearer: NDArray[np.bool_] | None = None  # (H, W) bool or None
    behind: AnchorView | None = None

    def jpeg(self) -> bytes:
        """The picture as a JPEG file."""
        return encode_jpeg(self.rgb, SCORED_JPEG)


@dataclass(frozen=True)
class CandidateMeasures:
    """Measurements of a candidate anchor before it is pictured."""

    shown: float  # See `AnchorView`
    elevation_deg: float
    clearance_m: float
    part_visibility: tuple[float, ...]  # By ray casts: at least what the picture's would be
    off_front_rad: float | None
    framed: float  # See `AnchorView`: from here, and from behind, None if there is no picture from there
    framed_behind: float | None = None


class Scorer(Protocol):
    """Scores the candidates of one object against each other."""

    @property
    def name(self) -> str:
        """One of ``geometric``, ``clip``, ``vlm``; its column is ``score_<name>``."""
        ...

    def score(self, name: str, views: Sequence[AnchorView]) -> Sequence[float | None]:
        """Score how well views show an object."""
        ...
