"""The default scorer: the paper's "visual informativeness", made explicit from the instance mask of the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

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
# Above the rounding error of a score.
_ROUNDING = 1e-9


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
    marks = view.marks
    if view.behind is not None:
        marks = {name: _mixed(term, view.behind.marks[name]) for name, term in marks.items()}
    return _parts(view.known, marks, radius_m, standoff_m)


def most(known: CandidateMeasures, radius_m: float, standoff_m: float, behind: AnchorView | None = None) -> float:
    """Bound the score of every picture from a viewpoint from above, by what is known of the viewpoint without one."""
    marks = dict.fromkeys(("unoccluded", "size", "centred", "contrast", "sky", "open"), 1.0)
    marks["framed"] = known.framed
    if behind is not None:
        marks = {name: _mixed(term, behind.marks[name]) for name, term in marks.items()}
    elif known.framed_behind is not None:
        marks["framed"] = _mixed(known.framed, known.framed_behind)
    return _parts(known, marks, radius_m, standoff_m).score + _ROUNDING


def _mixed(here: float, behind: float) -> float:
    return (1.0 - _BEHIND) * here + _BEHIND * behind


def _parts(known: CandidateMeasures, marks: dict[str, Any], radius_m: float, standoff_m: float) -> Parts:
    room = standoff_m - radius_m
    clear = min(max((known.clearance_m - radius_m) / room, 0.0), 1.0) if room > 0.0 else 1.0
    tells = float(part_score(np.array([known.part_visibility]))[0]) if known.part_visibility else None
    off = front_score(None if known.off_front_rad is None else np.array([known.off_front_rad]))
    front = None if off is None else float(off[0])
    level = float(level_marks(known.elevation_deg))
    return Parts(shown=known.shown, level=level, clear=clear, tells=tells, front=front, **marks)


class GeometricScorer:
    """Scores by `judge`; see `aerialdojo_gen.pipeline.scoring.base.Scorer`."""

    name = "geometric"

    def __init__(self, radius_m: float, standoff_m: float) -> None:
        self._radius_m, self._standoff_m = radius_m, standoff_m

    def score(self, name: str, views: Sequence[AnchorView]) -> list[float | None]:
        """Score views whatever the object is called."""
        return [judge(view, self._radius_m, self._standoff_m).score for view in views]
