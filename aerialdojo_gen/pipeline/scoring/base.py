"""Input and interface of scorers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import SCORED_JPEG, encode_jpeg
from aerialdojo_gen.geometry.portable import norm

# Full marks from half of the picture's edge on, and from this CIE76 difference on: orange on grey asphalt has 60.
_FULL_SIZE, _FULL_CONTRAST = 0.5, 50.0
# What surrounds the object: as far as this share of the picture's edge.
_RING = 1 / 16


@dataclass(frozen=True)
class CandidateMeasures:
    """Measurements of a candidate anchor, as ray casts know them or as its picture shows."""

    shown: float  # Share of the object that is shown, in [0, 1] (`aerialdojo_gen.geometry.viewpoints.Views`)
    elevation_deg: float  # Of the viewpoint, seen from the object's centroid
    clearance_m: float  # From the viewpoint to the nearest surface
    part_visibility: tuple[float, ...] = ()  # By ray casts: at least what the picture's would be
    off_front_rad: float | None = None
    framed: float = 1.0
    framed_behind: float | None = None  # None if there is no picture from behind


@dataclass(frozen=True, eq=False)
class AnchorView:
    """The front view of a candidate anchor."""

    rgb: NDArray[np.uint8]  # (H, W, 3) uint8; sRGB
    visible: NDArray[np.bool_]  # (H, W) bool; pixels that show the object
    alone: NDArray[np.bool_]  # Pixels that would show it if nothing else were there; a superset of `visible`
    sky: NDArray[np.bool_]  # (H, W) bool; pixels that show no surface at all
    measures: CandidateMeasures
    nearer: NDArray[np.bool_] | None = None  # (H, W) bool or None
    behind: AnchorView | None = None

    def jpeg(self) -> bytes:
        """The picture as a JPEG file."""
        return encode_jpeg(self.rgb, SCORED_JPEG)

    @cached_property
    def marks(self) -> dict[str, float]:
        """The terms of `geometric.Parts` that the picture itself decides."""
        if not self.visible.any():
            return dict.fromkeys(("unoccluded", "size", "centred", "contrast", "sky", "framed", "open"), 0.0)
        height, width = self.visible.shape
        rows, columns = np.nonzero(self.visible)
        edge = np.sqrt((np.ptp(rows) + 1) * (np.ptp(columns) + 1) / (height * width))
        away = np.hypot((columns.mean() + 0.5) / width * 2.0 - 1.0, (rows.mean() + 0.5) / height * 2.0 - 1.0)
        reach = 2 * max(1, round(width * _RING)) + 1
        around = cv2.dilate(self.visible.astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
        ring = around & ~self.visible
        contrast = sky = 0.0
        # An object that fills the picture has no outline in it.
        if ring.any():
            lab = cv2.cvtColor(self.rgb.astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
            difference = norm(lab[self.visible].mean(axis=0) - lab[ring].mean(axis=0))
            contrast, sky = min(float(difference) / _FULL_CONTRAST, 1.0), float(self.sky[ring].mean())
        foreground = 0.0
        if self.nearer is not None:
            rows, columns = np.nonzero(self.alone)
            own = self.nearer[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
            foreground = max(float(self.nearer.mean()), float(own.mean()))
        return {
            "unoccluded": float(self.visible.sum() / max(int(self.alone.sum()), 1)),
            "size": min(float(edge) / _FULL_SIZE, 1.0),
            "centred": 1.0 - min(float(away), 1.0),
            "contrast": contrast,
            "sky": sky,
            "framed": self.measures.framed,
            "open": 1.0 - foreground,
        }


class Scorer(Protocol):
    """Scores the candidates of one object against each other."""

    @property
    def name(self) -> str:
        """One of ``geometric``, ``clip``, ``vlm``; its column is ``score_<name>``."""
        ...

    def score(self, name: str, views: Sequence[AnchorView]) -> Sequence[float | None]:
        """Score how well views show an object."""
        ...
