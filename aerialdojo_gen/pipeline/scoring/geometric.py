"""The default scorer: the paper's "visual informativeness", made explicit from the instance mask of the picture.

Where a thing has a front or parts that make its name true, how well these are seen counts beside its silhouette.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.viewpoints import level_marks
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures

Floats = NDArray[np.float64]

WEIGHTS = {
    "unoccluded": 0.25, "shown": 0.25, "size": 0.1, "centred": 0.1, "contrast": 0.05, "sky": 0.025, "level": 0.1,
    "clear": 0.125,
}  # fmt: skip
# The weighted mean is multiplied by the `clarity_score` of these, of `unoccluded` and of `level`.
FACTORS = ("framed", "open")
PARTS_WEIGHT, FRONT_WEIGHT = 0.35, 0.3
_ANGLES_RAD, _MARKS = np.radians([0.0, 25.0, 60.0, 60.001, 120.0]), (1.0, 1.0, 0.5, 0.15, 0.0)
# Share of the reference picture in a term, if it is taken from further back.
_BEHIND = 0.7
# Above the rounding error of a score.
_ROUNDING = 1e-9


def part_score(part_visibility: Floats) -> Floats:
    """Score how well identifying parts (…, t), 0 to 1, are seen: half the worst one, half their mean."""
    return np.asarray((part_visibility.min(axis=-1) + part_visibility.mean(axis=-1)) / 2.0)


def front_score(off_front_rad: ArrayLike | None) -> Floats | None:
    """Mark angles off the front: full up to 25°, half at 60°, little beyond; None for an object without a front."""
    return None if off_front_rad is None else _interpolate(off_front_rad, _ANGLES_RAD, _MARKS)


def clarity_score(unoccluded: ArrayLike, framed: ArrayLike, foreground: ArrayLike, level: ArrayLike) -> Floats:
    """Factor in (0, 1] for what hides the object, cuts it off or stands nearer, and for looking up or down."""
    return np.asarray(
        _interpolate(unoccluded, (0.4, 0.95), (0.4, 1.0))
        * _interpolate(framed, (0.5, 0.98), (0.6, 1.0))
        * _interpolate(foreground, (0.05, 0.5), (1.0, 0.5))
        * _interpolate(level, (0.0, 1.0), (0.7, 1.0))
    )


def _interpolate(value: ArrayLike, at: ArrayLike, marks: ArrayLike) -> Floats:
    return np.asarray(np.interp(np.asarray(value), np.asarray(at), np.asarray(marks)))


def recognisability(score: ArrayLike, parts: ArrayLike | None, front: ArrayLike | None) -> Floats:
    """Combine the silhouette's score with those of parts and front; None leaves its weight to the first."""
    known = [(w, np.asarray(mark)) for w, mark in ((PARTS_WEIGHT, parts), (FRONT_WEIGHT, front)) if mark is not None]
    rest = 1.0 - sum(weight for weight, _ in known)
    return np.asarray(rest * np.asarray(score) + sum(weight * mark for weight, mark in known))


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
        silhouette = sum(weight * getattr(self, name) for name, weight in WEIGHTS.items())
        clear = clarity_score(self.unoccluded, self.framed, 1.0 - self.open, self.level)
        return float(recognisability(silhouette, self.tells, self.front) * clear)

    @property
    def columns(self) -> dict[str, float | None]:
        """The terms as columns of the table ``anchors``."""
        return {f"part_{name}": value for name, value in asdict(self).items()}


def judge(view: AnchorView, radius_m: float, standoff_m: float) -> Parts:
    """Take a view's terms, those of the picture rather from the picture behind it, where there is one."""
    marks = view.marks
    if view.behind is not None:
        marks = {name: _mixed(term, view.behind.marks[name]) for name, term in marks.items()}
    return _parts(view.measures, marks, radius_m, standoff_m)


def score_bound(
    measures: CandidateMeasures, radius_m: float, standoff_m: float, behind: AnchorView | None = None
) -> float:
    """Bound the score of every picture from a viewpoint from above, by what is known of the viewpoint without one."""
    marks = dict.fromkeys(("unoccluded", "size", "centred", "contrast", "sky", "open"), 1.0)
    marks["framed"] = measures.framed
    if behind is not None:
        marks = {name: _mixed(term, behind.marks[name]) for name, term in marks.items()}
    elif measures.framed_behind is not None:
        marks["framed"] = _mixed(measures.framed, measures.framed_behind)
    return _parts(measures, marks, radius_m, standoff_m).score + _ROUNDING


def _mixed(here: float, behind: float) -> float:
    return (1.0 - _BEHIND) * here + _BEHIND * behind


def _parts(measures: CandidateMeasures, marks: dict[str, Any], radius_m: float, standoff_m: float) -> Parts:
    room = standoff_m - radius_m
    clear = min(max((measures.clearance_m - radius_m) / room, 0.0), 1.0) if room > 0.0 else 1.0
    tells = float(part_score(np.array(measures.part_visibility))) if measures.part_visibility else None
    off = front_score(measures.off_front_rad)
    level = float(level_marks(measures.elevation_deg))
    front = None if off is None else float(off)
    return Parts(shown=measures.shown, level=level, clear=clear, tells=tells, front=front, **marks)


class GeometricScorer:
    """Scores by `judge`; see `aerialdojo_gen.pipeline.scoring.base.Scorer`."""

    name = "geometric"

    def __init__(self, radius_m: float, standoff_m: float) -> None:
        self._radius_m, self._standoff_m = radius_m, standoff_m

    def score(self, name: str, views: Sequence[AnchorView]) -> list[float | None]:
        """Score views whatever the object is called."""
        return [judge(view, self._radius_m, self._standoff_m).score for view in views]
