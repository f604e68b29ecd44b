"""Pictures for scoring candidates: from the candidate itself, and from the pulled-back reference camera.

The camera of a reference picture steps back from the anchor until the object fits the picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.part_visibility import Patch, in_picture
from aerialdojo_gen.geometry.portable import dot
from aerialdojo_gen.geometry.viewpoints import level_marks, shortlist
from aerialdojo_gen.pipeline.scoring.base import AnchorView
from aerialdojo_gen.pipeline.scoring.ensemble import Verdict, scorer_ensemble
from aerialdojo_gen.pipeline.scoring.geometric import clarity_score, score_bound
from aerialdojo_gen.pipeline.stages.work.anchor_world import Candidates, World

Floats = NDArray[np.float64]

# Least picture size for models.
_MODEL_PX = 320
# Of the half picture that the object may take: a little room around it.
_FILLED = 0.94
# The camera's own room, and what it must keep to what it backs up to.
_CAMERA_M, _KEPT_M = 0.15, 0.3
# What comes between counts this much against what comes into the picture: a rail hides little, and spoils it.
_HIDDEN = 2.0
_TRIED = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)
_MIN_STEP_M = 0.25
# Share of the picture that an identifying part keeps if it had it, 12 x 12 pixels of 320 x 320, and the least of it.
_PART_SHARE, _MIN_PART_SHARE = 0.0014, 0.0007


def fitting_m(vertices: Floats, position_m: Floats, yaw_rad: float, fov_deg: float) -> float:
    """How far, metres, a level camera must go back, 0 if not, for an object's vertices (n, 3) to fit its picture."""
    half = _FILLED * math.tan(math.radians(fov_deg) / 2.0)
    x, y, z = (float(c) for c in position_m)
    return max(0.0, float(_fitting(vertices, x, y, z, math.cos(yaw_rad), math.sin(yaw_rad), half)))


@njit(cache=True)
def _fitting(vertices: Floats, x: float, y: float, z: float, cos: float, sin: float, half: float) -> float:
    most = -np.inf
    for n in range(len(vertices)):
        u, v, w = vertices[n, 0] - x, vertices[n, 1] - y, vertices[n, 2] - z
        most = max(most, max(abs(u * sin - v * cos), abs(w)) / half - (u * cos + v * sin))
    return most


def part_limit_m(patches: Sequence[Patch], seen: Floats, position_m: Floats, yaw_rad: float, fov_deg: float) -> float:
    """How far, metres, a camera may go back before an identifying part gets too small; inf where none is seen."""
    most = math.inf
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    for patch, share in zip(patches, seen.tolist(), strict=True):
        away = max(float(dot(patch.points - position_m, ahead).mean()), 0.1)
        taken = patch.area_m2 * share / (2.0 * away * math.tan(math.radians(fov_deg) / 2.0)) ** 2
        if taken > 0.0:
            floor = min(_PART_SHARE, max(_MIN_PART_SHARE, taken / 2.0))
            most = min(most, max(0.0, away * (math.sqrt(taken / floor) - 1.0)))
    return most


def steps_back_m(
    world: World, instance: int, points: Floats, positions_m: Floats, yaw_rad: Floats, fov_deg: float, most_m: Floats
) -> Floats:
    """How far, metres (n,), to pull the camera back: as far as the object needs and the way is free."""
    steps = np.zeros(len(positions_m))
    vertices = world.scene.instances[instance].vertices
    fitting = [fitting_m(vertices, p, yaw, fov_deg) for p, yaw in zip(positions_m, yaw_rad.tolist(), strict=True)]
    distance_m = np.minimum(fitting, most_m)
    some = np.flatnonzero(distance_m >= _MIN_STEP_M)
    if not len(some):
        return steps
    distance_m, places, yaws = distance_m[some], positions_m[some], yaw_rad[some]
    back = -np.array([[math.cos(yaw), math.sin(yaw), 0.0] for yaw in yaws.tolist()])
    free = world.rays.first_hit(places, back)[0] - _KEPT_M
    low, high = world.scene.bounds
    with np.errstate(divide="ignore", invalid="ignore"):
        edges = np.where(back != 0.0, (np.where(back > 0, high, low) - places) / back, np.inf)
    distance_m = np.minimum(np.minimum(distance_m, free), edges.min(axis=1) - _CAMERA_M)
    far = distance_m >= _MIN_STEP_M
    some, distance_m, places, yaws, back = some[far], distance_m[far], places[far], yaws[far], back[far]
    best, chosen = np.full(len(some), -np.inf), np.zeros(len(some))
    # From the farthest on, so that of equals the farthest is taken, which leaves room around it; the anchor's own
    # place is tried last, and taken only where it is the better one.
    for share in (*_TRIED, 0.0):
        tried = np.floor(100.0 * share * distance_m) / 100.0
        # What sees all of the points cannot be bettered, and casts no more rays.
        left = np.flatnonzero(best < len(points))
        if not len(left):
            break
        at = places[left] + tried[left, None] * back[left]
        framed = in_picture(at, yaws[left], points, fov_deg)
        promising = framed.sum(axis=1) > best[left]
        if share:
            promising[promising] = world.free.distance_m(at[promising]) > _CAMERA_M
        left, at, framed = left[promising], at[promising], framed[promising]
        viewpoint, point = np.nonzero(framed)
        # What the object itself hides is hidden from every distance: its own surface counts wherever it is met.
        seen = np.bincount(viewpoint, world.rays.visible(at[viewpoint], points[point], instance), minlength=len(left))
        value = seen - _HIDDEN * (framed.sum(axis=1) - seen)
        better = value > best[left]
        best[left[better]], chosen[left[better]] = value[better], tried[left[better]]
    steps[some] = chosen
    return steps


@dataclass(frozen=True)
class CandidateViews:
    """Candidates of an object, each with the pulled-back camera of its reference picture."""

    candidates: Candidates  # All of the object
    which: NDArray[np.int64]  # (k,) int64; rows of `candidates`
    step_back_m: Floats  # (k,) float64; camera pullback, metres
    behind: Candidates  # The pulled-back positions
    rank: Floats  # (k,) float64; ray-cast score of both positions

    @classmethod
    def of(cls, candidates: Candidates, which: NDArray[np.int64]) -> CandidateViews:
        """Look from behind the candidates `which` (k,)."""
        config, places, yaws = candidates.config, candidates.positions_m[which], candidates.yaw_rad[which]
        limits_m = [
            part_limit_m(candidates.patches, candidates.part_shares[k], places[n], float(yaws[n]), config.fov_deg)
            for n, k in enumerate(which)
        ]
        most_m = np.minimum(config.step_back_m, limits_m)
        world, instance, points = candidates.world, candidates.instance, candidates.points
        backs = steps_back_m(world, instance, points, places, yaws, config.fov_deg, most_m)
        away = np.column_stack([np.cos(yaws), np.sin(yaws), np.zeros(len(yaws))]) * backs[:, None]
        behind = candidates.moved(which, places - away)
        views, elevation = behind.views, candidates.elevation_deg[which]
        clear = clarity_score(views.visible_fraction, views.framed, np.zeros(len(which)), level_marks(elevation))
        rank = (candidates.rank[which] + behind.rank) / 2.0 * clear
        return cls(candidates, which, backs, behind, rank)

    def picture(self, n: int, size_px: int, back: AnchorView | None = None) -> AnchorView:
        """Picture a candidate, a number among `which`; the view from behind, if any, may be there already.

        What is shown is the mean of both.
        """
        view = self.candidates.picture(int(self.which[n]), size_px)
        if self.has_back(n):
            back = back or self.behind.picture(n, size_px)
            measures = replace(
                view.measures, shown=(view.measures.shown + back.measures.shown) / 2.0,
                part_visibility=_mean(view.measures.part_visibility, back.measures.part_visibility),
            )  # fmt: skip
            view = replace(view, measures=measures, behind=back)
        return view

    def has_back(self, n: int) -> bool:
        """Whether the reference picture of a candidate, a number among `which`, is taken from behind it."""
        return bool(self.step_back_m[n] > 0.0)

    def score_bound(self, n: int, back: AnchorView | None = None) -> float:
        """Bound the geometric score of number n of `which` from above without its picture; one from behind helps."""
        measures, behind = self.candidates.measures(int(self.which[n])), self.behind
        if self.has_back(n):
            seen = behind.part_visibility[n].tolist() if back is None else back.measures.part_visibility
            measures = replace(
                measures, shown=(measures.shown + float(behind.views.shown[n])) / 2.0,
                part_visibility=_mean(measures.part_visibility, seen), framed_behind=float(behind.views.framed[n]),
            )  # fmt: skip
        return score_bound(measures, self.candidates.radius_m, self.candidates.config.standoff_m, back)


def best_pictured(
    name: str,
    candidate_views: CandidateViews,
    indices: NDArray[np.int64],
    azimuth_rad: Floats,
    front: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], list[tuple[AnchorView, Verdict]]]:
    """Picture candidates that could be among the best, and shortlist: places (k,) in `indices` and their verdicts."""
    config = candidate_views.candidates.config
    scorers = scorer_ensemble(config, candidate_views.candidates.radius_m)
    separation_rad = math.radians(config.separation_deg)
    if config.weights.clip or config.weights.vlm:
        views = [candidate_views.picture(n, max(config.picture_px, _MODEL_PX)) for n in indices.tolist()]
        pictured = dict(enumerate(zip(views, scorers.judge(name, views), strict=True)))
        score = np.array([verdict.score for _, verdict in pictured.values()])
    else:
        pictured = {}
        score = np.array([candidate_views.score_bound(n) for n in indices.tolist()])
    backs: dict[int, AnchorView] = {}
    while True:
        # A shortlist of exact scores only is final: bounds are never below scores.
        best = shortlist(score, azimuth_rad, config.shortlist, separation_rad, front)
        chosen = (*shortlist(score, azimuth_rad, config.shortlist, separation_rad).tolist(), *best.tolist())
        open_ones = [n for n in chosen if n not in pictured]
        if not open_ones:
            return best, [pictured[n] for n in best.tolist()]
        n = open_ones[0]
        which = int(indices[n])
        if candidate_views.has_back(which) and n not in backs:
            backs[n] = candidate_views.behind.picture(which, config.picture_px)
            score[n] = candidate_views.score_bound(which, backs[n])
            continue
        view = candidate_views.picture(which, config.picture_px, backs.get(n))
        pictured[n] = view, scorers.judge(name, [view])[0]
        score[n] = pictured[n][1].score


def _mean(here: Sequence[float], there: Sequence[float]) -> tuple[float, ...]:
    return tuple((a + b) / 2.0 for a, b in zip(here, there, strict=True))
