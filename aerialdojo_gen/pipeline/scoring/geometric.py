"""The default scorer: the paper's "visual informativeness", made explicit from the instance mask of the picture."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any
from weakref import WeakKeyDictionary

import cv2
import numpy as np

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.geometry.viewpoints import level_marks
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures
from aerialdojo_gen.pipeline.scoring.recognisability import clarity_score, front_score, part_score, recognisability

WEIGHTS = {
    "unoccluded": 0.25, "shown": 0.25, "size": 0.1, "centred": 0.1, "contrast": 0.05, "sky": 0.025, "level": 0.1,
    "clear": 0.125,
}  # fmt: skip
# The weighted mean is multiplied by the `clarity_score` of these, of `unoccluded` and of `level`.
FACTORS = ("framed", "open")

# Share of the reference picture in a term, if it is taken from further back.
_BEHIND = 0.7
# Full marks from half of the picture's edge on, and from this CIE76 difference on: orange on grey asphalt has 60.
_FULL_SIZE, _FULL_CONTRAST = 0.5, 50.0
# A view is scored by the scorer, and again for the table's columns.
_TAKEN: WeakKeyDictionary[AnchorView, dict[str, Any]] = WeakKeyDictionary()
# Above the rounding error of a score.
_ROUNDING = 1e-9
# What surrounds the object: as far as this share of the picture's edge.
_RING = 1 / 16


@dataclass(frozen=True)
class Parts:
    """The terms of the geometric score, each in [0, 1], higher is better."""

    unoccluded: float  # Of the pixels that would show the object if it stood alone, the share that do
    shown: float
    size: float  # Edge of the object's box in the picture; full marks from half of the picture's edge
    centred: float  # How near the object's pixels are to the picture's centre
    contrast: float
    sky: float  # Share of sky in what surrounds it: there its outline is clear
    level: float  # Full marks from 5° below the centroid to 20° above, none from 30° below and 50° above
    clear: float  # Room around the body; full marks at the standoff
    tells: float | None = None
    front: float | None = None
    framed: float = 1.0  # Share of the object that lies within the picture's edges
    open: float = 1.0

    @property
    def score(self) -> float:
        """The weighted mean of the terms, times what the picture is worth for what hides or cuts off the object."""
        marks = asdict(self)
        silhouette = sum(weight * marks[name] for name, weight in WEIGHTS.items())
        known = [None if mark is None else np.array([mark]) for mark in (self.tells, self.front)]
        clear = clarity_score(*np.array([[self.unoccluded], [self.framed], [1.0 - self.open], [self.level]]))
        return float((recognisability(np.array([silhouette]), *known) * clear)[0])

    @property
    def columns(self) -> dict[str, float | None]:
        """The terms as columns of the table ``anchors``."""
        return {f"part_{name}": value for name, value in asdict(self).items()}


def judge(view: AnchorView, radius_m: float, standoff_m: float) -> Parts:
    """Take a view's terms, those of the picture rather from the picture behind it, where there is one."""
    marks = _pictured(view)
    if view.behind is not None:
        behind = _pictured(view.behind)
        marks = {name: _mixed(term, behind[name]) for name, term in marks.items()}
    return _parts(view, marks, radius_m, standoff_m)


def most(known: CandidateMeasures, radius_m: float, standoff_m: float, behind: AnchorView | None = None) -> float:
    """Bound the score of every picture from a viewpoint from above, by what is known of the viewpoint without one."""
    marks = dict.fromkeys(("unoccluded", "size", "centred", "contrast", "sky", "open"), 1.0)
    marks["framed"] = known.framed
    if behind is not None:
        seen = _pictured(behind)
        marks = {name: _mixed(term, seen[name]) for name, term in marks.items()}
    elif known.framed_behind is not None:
        marks["framed"] = _mixed(known.framed, known.framed_behind)
    return _parts(known, marks, radius_m, standoff_m).score + _ROUNDING


def _mixed(here: float, behind: float) -> float:
    return (1.0 - _BEHIND) * here + _BEHIND * behind


def _parts(known: AnchorView | CandidateMeasures, marks: dict[str, Any], radius_m: float, standoff_m: float) -> Parts:
    level = float(level_marks(known.elevation_deg))
    room = standoff_m - radius_m
    clear = min(max((known.clearance_m - radius_m) / room, 0.0), 1.0) if room > 0.0 else 1.0
    tells = float(part_score(np.array([known.part_visibility]))[0]) if known.part_visibility else None
    off = front_score(None if known.off_front_rad is None else np.array([known.off_front_rad]))
    return Parts(
        shown=known.shown,
        level=level,
        clear=clear,
        tells=tells,
        front=None if off is None else float(off[0]),
        **marks,
    )


def _pictured(view: AnchorView) -> dict[str, Any]:
    """Take the terms that the picture itself decides; they are taken once a view."""
    with contextlib.suppress(KeyError):
        return _TAKEN[view]
    marks = _TAKEN[view] = _picture_marks(view)
    return marks


def _picture_marks(view: AnchorView) -> dict[str, Any]:
    names = ("unoccluded", "size", "centred", "contrast", "sky", *FACTORS)
    if not view.visible.any():
        return dict.fromkeys(names, 0.0)
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
        difference = norm(lab[view.visible].mean(axis=0) - lab[ring].mean(axis=0))
        contrast, sky = min(float(difference) / _FULL_CONTRAST, 1.0), float(view.sky[ring].mean())
    foreground = 0.0
    if view.nearer is not None:
        rows, columns = np.nonzero(view.alone)
        own = view.nearer[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        foreground = max(float(view.nearer.mean()), float(own.mean()))
    marks = (
        float(view.visible.sum() / max(int(view.alone.sum()), 1)),
        min(float(edge) / _FULL_SIZE, 1.0),
        1.0 - min(float(away), 1.0),
        contrast,
        sky,
        view.framed,
        1.0 - foreground,
    )
    return dict(zip(names, marks, strict=True))


class GeometricScorer:
    """Scores by `judge`; see `aerialdojo_gen.pipeline.scoring.base.Scorer`."""

    name = "geometric"

    def __init__(self, radius_m: float, standoff_m: float) -> None:
        self._radius_m, self._standoff_m = radius_m, standoff_m

    def score(self, name: str, views: Sequence[AnchorView]) -> list[float | None]:
        """Score views whatever the object is called."""
        return [judge(view, self._radius_m, self._standoff_m).score for view in views]
