"""The default scorer: the paper's "visual informativeness", made explicit from the instance mask of the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import cv2
import numpy as np

from aerialdojo_gen.scoring.base import AnchorView
from aerialdojo_gen.scoring.knowing import fronting, knowing, telling

WEIGHTS = {
    "unoccluded": 0.25, "shown": 0.25, "size": 0.1, "centred": 0.1, "contrast": 0.05, "sky": 0.025, "level": 0.1,
    "clear": 0.125,
}  # fmt: skip

# Full marks from half of the picture's edge on, and from this CIE76 difference on: orange on grey asphalt has 60.
_FULL_SIZE, _FULL_CONTRAST = 0.5, 50.0
_LEVEL_DEG, _STEEP_DEG = 15.0, 45.0
# What surrounds the object: as far as this share of the picture's edge.
_RING = 1 / 16


@dataclass(frozen=True)
class Parts:
    """The terms of the geometric score, each in [0, 1], higher is better.

    Attributes
    ----------
    unoccluded : float
        Of the pixels that would show the object if it stood alone, the share that do.
    shown : float
        Share of the object that the picture tells: a front rather than an edge, the whole rather than a corner.
    size : float
        Edge of the object's box in the picture; full marks from half of the picture's edge.
    centred : float
        How near the object's pixels are to the picture's centre.
    contrast : float
        Difference (CIE76) between the object's mean colour and that of what surrounds it in the picture.
    sky : float
        Share of sky in what surrounds it: there its outline is clear.
    level : float
        Full marks up to 15° above or below the centroid, none from 45°.
    clear : float
        Room around the body; full marks at the standoff.
    tells : float or None
        How well the parts that make its name true are seen (`aerialdojo_gen.scoring.knowing`); None where the whole
        body tells, or nothing is known of it.
    front : float or None
        Full marks up to 25° off the object's front, little beyond 60°; None where it has none.
    """

    unoccluded: float
    shown: float
    size: float
    centred: float
    contrast: float
    sky: float
    level: float
    clear: float
    tells: float | None = None
    front: float | None = None

    @property
    def score(self) -> float:
        """The weighted mean of the terms."""
        terms = asdict(self)
        silhouette = sum(weight * terms[name] for name, weight in WEIGHTS.items())
        known = [None if mark is None else np.array([mark]) for mark in (self.tells, self.front)]
        return float(knowing(np.array([silhouette]), *known)[0])

    @property
    def columns(self) -> dict[str, float | None]:
        """The terms as columns of the table ``anchors``."""
        return {f"part_{name}": value for name, value in asdict(self).items()}


def judge(view: AnchorView, radius_m: float, standoff_m: float) -> Parts:
    """Take a view's terms.

    Parameters
    ----------
    view : AnchorView
    radius_m : float
        The body's radius: no room at all.
    standoff_m : float
        The anchors' distance from their objects.

    Returns
    -------
    Parts
    """
    steep = (abs(view.elevation_deg) - _LEVEL_DEG) / (_STEEP_DEG - _LEVEL_DEG)
    level = 1.0 - min(max(steep, 0.0), 1.0)
    room = standoff_m - radius_m
    clear = min(max((view.clearance_m - radius_m) / room, 0.0), 1.0) if room > 0.0 else 1.0
    tells = float(telling(np.array([view.told]))[0]) if view.told else None
    off = fronting(None if view.off_front_rad is None else np.array([view.off_front_rad]))
    front = None if off is None else float(off[0])
    if not view.visible.any():
        return Parts(0.0, view.shown, 0.0, 0.0, 0.0, 0.0, level, clear, tells, front)
    height, width = view.visible.shape
    rows, columns = np.nonzero(view.visible)
    edge = np.sqrt((np.ptp(rows) + 1) * (np.ptp(columns) + 1) / (height * width))
    away = np.hypot((columns.mean() + 0.5) / width * 2.0 - 1.0, (rows.mean() + 0.5) / height * 2.0 - 1.0)
    reach = 2 * max(1, round(width * _RING)) + 1
    around = cv2.dilate(view.visible.astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    ring = around & ~view.visible
    contrast = sky = 0.0
    # An object that fills the picture has no outline in it.
    if ring.any():
        lab = cv2.cvtColor(view.rgb.astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
        difference = np.linalg.norm(lab[view.visible].mean(axis=0) - lab[ring].mean(axis=0))
        contrast, sky = min(float(difference) / _FULL_CONTRAST, 1.0), float(view.sky[ring].mean())
    return Parts(
        unoccluded=float(view.visible.sum() / max(int(view.alone.sum()), 1)),
        shown=view.shown,
        size=min(float(edge) / _FULL_SIZE, 1.0),
        centred=1.0 - min(float(away), 1.0),
        contrast=contrast,
        sky=sky,
        level=level,
        clear=clear,
        tells=tells,
        front=front,
    )


class GeometricScorer:
    """Scores by `judge`; see `aerialdojo_gen.scoring.base.Scorer`.

    Parameters
    ----------
    radius_m, standoff_m : float
        As for `judge`.
    """

    name = "geometric"

    def __init__(self, radius_m: float, standoff_m: float) -> None:
        self._radius_m, self._standoff_m = radius_m, standoff_m

    def score(self, name: str, views: Sequence[AnchorView]) -> list[float | None]:
        """Score views whatever the object is called."""
        return [judge(view, self._radius_m, self._standoff_m).score for view in views]
