"""Pictures for scoring candidates: from the candidate itself, and from the pulled-back reference camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.viewpoints import level_marks, shortlist
from aerialdojo_gen.pipeline.scoring.base import AnchorView
from aerialdojo_gen.pipeline.scoring.ensemble import Verdict, scorer_ensemble
from aerialdojo_gen.pipeline.scoring.geometric import clarity_score, most
from aerialdojo_gen.pipeline.stages.work.anchor_world import Candidates
from aerialdojo_gen.pipeline.stages.work.camera_pullback import part_limit_m, steps_back_m

Floats = NDArray[np.float64]

# Least picture size for models.
_MODEL_PX = 320


@dataclass(frozen=True)
class CandidateViews:
    """Candidates of an object, each with the pulled-back camera of its reference picture."""

    found: Candidates  # All of the object
    which: NDArray[np.int64]  # (k,) int64; rows of `found`
    step_back_m: Floats  # (k,) float64; camera pullback, metres
    behind: Candidates  # The pulled-back positions
    rank: Floats  # (k,) float64; ray-cast score of both positions

    @classmethod
    def of(cls, found: Candidates, which: NDArray[np.int64]) -> CandidateViews:
        """Look from behind the candidates `which` (k,)."""
        config, places, yaws = found.config, found.positions_m[which], found.yaw_rad[which]
        limits_m = [
            part_limit_m(found.patches, found.seen[k], places[n], float(yaws[n]), config.fov_deg)
            for n, k in enumerate(which)
        ]
        most = np.minimum(config.step_back_m, limits_m)
        backs = steps_back_m(found.world, found.instance, found.points, places, yaws, config.fov_deg, most)
        away = np.column_stack([np.cos(yaws), np.sin(yaws), np.zeros(len(yaws))]) * backs[:, None]
        behind = found.moved(which, places - away)
        views, elevation = behind.views, found.elevation_deg[which]
        clear = clarity_score(views.visible_fraction, views.framed, np.zeros(len(which)), level_marks(elevation))
        rank = (found.rank[which] + behind.rank) / 2.0 * clear
        return cls(found, which, backs, behind, rank)

    def picture(self, n: int, size_px: int, back: AnchorView | None = None) -> AnchorView:
        """Picture a candidate, a number among `which`; the view from behind, if any, may be there already.

        What is shown is the mean of both.
        """
        view = self.found.picture(int(self.which[n]), size_px)
        if self.has_back(n):
            back = back or self.behind.picture(n, size_px)
            known = replace(
                view.known, shown=(view.known.shown + back.known.shown) / 2.0,
                part_visibility=_mean(view.known.part_visibility, back.known.part_visibility),
            )  # fmt: skip
            view = replace(view, known=known, behind=back)
        return view

    def has_back(self, n: int) -> bool:
        """Whether the reference picture of a candidate, a number among `which`, is taken from behind it."""
        return bool(self.step_back_m[n] > 0.0)

    def most(self, n: int, back: AnchorView | None = None) -> float:
        """Bound the geometric score of number n of `which` from above without its picture; one from behind helps."""
        known, behind = self.found.measures(int(self.which[n])), self.behind
        if self.has_back(n):
            seen = behind.part_visibility[n].tolist() if back is None else back.known.part_visibility
            known = replace(
                known, shown=(known.shown + float(behind.views.shown[n])) / 2.0,
                part_visibility=_mean(known.part_visibility, seen), framed_behind=float(behind.views.framed[n]),
            )  # fmt: skip
        return most(known, self.found.radius_m, self.found.config.standoff_m, back)


def best_pictured(
    name: str,
    candidate_views: CandidateViews,
    few: NDArray[np.int64],
    azimuth_rad: Floats,
    front: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], list[tuple[AnchorView, Verdict]]]:
    """Picture candidates that could be among the best, and shortlist: indices (k,) into `few` and their verdicts."""
    config = candidate_views.found.config
    scorers, separation_rad = (
        scorer_ensemble(config, candidate_views.found.radius_m),
        math.radians(config.separation_deg),
    )
    if config.weights.clip or config.weights.vlm:
        views = [candidate_views.picture(n, max(config.picture_px, _MODEL_PX)) for n in few.tolist()]
        found = dict(enumerate(zip(views, scorers.judge(name, views), strict=True)))
        score = np.array([verdict.score for _, verdict in found.values()])
    else:
        found = {}
        score = np.array([candidate_views.most(n) for n in few.tolist()])
    backs: dict[int, AnchorView] = {}
    while True:
        # A shortlist of exact scores only is final: bounds are never below scores.
        best = shortlist(score, azimuth_rad, config.shortlist, separation_rad, front)
        chosen = (*shortlist(score, azimuth_rad, config.shortlist, separation_rad).tolist(), *best.tolist())
        open_ones = [n for n in chosen if n not in found]
        if not open_ones:
            return best, [found[n] for n in best.tolist()]
        n = open_ones[0]
        which = int(few[n])
        if candidate_views.has_back(which) and n not in backs:
            backs[n] = candidate_views.behind.picture(which, config.picture_px)
            score[n] = candidate_views.most(which, backs[n])
            continue
        view = candidate_views.picture(which, config.picture_px, backs.get(n))
        found[n] = view, scorers.judge(name, [view])[0]
        score[n] = found[n][1].score


def _mean(here: Sequence[float], there: Sequence[float]) -> tuple[float, ...]:
    return tuple((a + b) / 2.0 for a, b in zip(here, there, strict=True))
