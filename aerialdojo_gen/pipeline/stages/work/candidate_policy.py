"""Which candidates `plan` searches where only what is released is wanted, and in which order.

A goal's cost-to-go tells the lengths of all its routes within a few per cent before one of them is searched: enough
to foresee which setting they fall into, how hard they are, and so which of them `split` will draw. Those come first,
and the searches end when there are as many routes of each setting as are released, and some more, so that `split` can
choose by the true lengths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import ReleasedPlanConfig
from aerialdojo_gen.base.constants import DETOUR, SETTINGS
from aerialdojo_gen.base.paper_figures import PaperScene
from aerialdojo_gen.pipeline.stages.work.quota import difficulty_steps, rank_candidates, select_quota
from aerialdojo_gen.pipeline.stages.work.rules import KEPT, judge
from aerialdojo_gen.pipeline.stages.work.selection import sampling_key
from aerialdojo_gen.planning.planner import Route

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# More than are released must be kept even at the end: `filter` drops a few more that only it can judge.
_LEAST_SPARE = 0.02
# Metres of a release that count as the paper's, as a share of them.
_ON_PATH = 2e-3
# Predicted detours scatter about the true ones so (a logistic of this width, from 283,000 routes of 42 scenes): where
# 1.035, 1.045 and 1.055 were predicted, 22, 49 and 73 in 100 routes had one of `DETOUR` or more.
_DETOUR_SPREAD = 0.008


@dataclass(frozen=True, eq=False)
class Candidates:
    """A scene's candidates, n of them, before any search."""

    scene: str  # Name of the scene
    lots: list[str]  # What each draws with
    euclidean_m: Floats  # (n,) float64; straight distance, and shortest length without obstacles, metres
    free_length_m: Floats
    visible: Floats  # (n,) float64; share of the target that the start sees
    predicted_m: Floats  # Length of the cheapest grid path, metres; infinite where no search is worth while

    @classmethod
    def of(cls, pairs: pa.Table, free_length_m: Floats, predicted_m: Floats) -> Candidates:
        """Take what rows of `pairs` tell of them."""
        scenes = pairs["scene"].to_pylist()
        return cls(
            scenes[0] if scenes else "",
            [sampling_key(*key) for key in zip(scenes, pairs["pair_id"].to_pylist(), strict=True)],
            pairs["euclidean_m"].to_numpy(),
            free_length_m,
            pairs["target_visible_at_start"].to_numpy(),
            predicted_m,
        )


class CandidatePolicy:
    """Says, round by round, which candidates of a scene to search next."""

    def __init__(self, candidates: Candidates, paper: PaperScene, config: ReleasedPlanConfig, seed: int) -> None:
        self._of, self._paper, self._config, self._seed = candidates, paper, config, seed
        n = len(candidates.lots)
        predicted = candidates.predicted_m
        reason, setting = self._judged(np.where(np.isfinite(predicted), "SOLVED", "NO_PATH"), predicted, np.zeros(n))
        likely = np.flatnonzero(reason == KEPT)
        order = self._ranked(likely, setting[likely], predicted[likely])
        # What is foreseen to be refused may be kept for all that: last, and the nearest to being kept first.
        unlikely = np.flatnonzero((reason != KEPT) & np.isfinite(predicted))
        self._order = {name: order[name] for name in SETTINGS}
        self._last = unlikely[np.argsort(predicted[unlikely], kind="stable")]
        self._taken = dict.fromkeys(SETTINGS, 0)
        self._margin = config.search_margin

    def first(self) -> Integers:
        """Rows of the candidates that are searched first, (m,) int64, ascending."""
        return self._up_to_margin()

    def more(self, routes: Sequence[Route | None]) -> Integers:
        """Rows of the candidates that are searched next, (m,) int64, ascending; none where there is enough."""
        searched = [(k, route) for k, route in enumerate(routes) if route is not None]
        done = np.array([k for k, _ in searched], dtype=np.int64)
        outcomes = np.array([route.outcome for _, route in searched], dtype="U24")
        lengths = np.array([route.length_m for _, route in searched])
        actions = np.array([route.n_actions for _, route in searched])
        reason, setting = self._judged(outcomes, lengths, actions, done)
        kept = reason == KEPT
        while not self._enough(done[kept], setting[kept], lengths[kept]):
            self._margin = max(2.0 * self._margin, 0.1)
            rows = self._up_to_margin()
            if len(rows):
                return rows
            if all(self._taken[name] == len(self._order[name]) for name in SETTINGS):
                rows, self._last = np.sort(self._last), self._last[:0]
                return rows
        return np.empty(0, np.int64)

    def _up_to_margin(self) -> Integers:
        rows = [np.empty(0, np.int64)]
        for name in SETTINGS:
            n = self._paper.tasks[name]
            upto = min(math.ceil(n * (1.0 + self._margin)), len(self._order[name]))
            rows.append(self._order[name][self._taken[name] : upto])
            self._taken[name] = max(upto, self._taken[name])
        return np.sort(np.concatenate(rows))

    def _judged(
        self,
        outcome: NDArray[np.str_],
        length_m: Floats,
        n_actions: NDArray[np.generic],
        rows: Integers | None = None,
    ) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
        c = self._of
        at = slice(None) if rows is None else rows
        detour = np.maximum(length_m / np.maximum(c.free_length_m[at], 1e-12), 1.0)
        return judge(
            outcome.astype("U24"), c.euclidean_m[at], length_m, n_actions.astype(np.int32), self._config.kept, detour,
            c.visible[at],
        )  # fmt: skip

    def _detour(self, rows: Integers, length_m: Floats) -> Floats:
        return np.asarray(length_m / np.maximum(self._of.free_length_m[rows], 1e-12))

    def _ranked(self, rows: Integers, setting: NDArray[np.str_], length_m: Floats) -> dict[str, Integers]:
        # A step of difficulty counts by how likely it is.
        likely = 1.0 / (1.0 + np.exp(-(self._detour(rows, length_m) - DETOUR) / _DETOUR_SPREAD))
        steps = likely + (self._of.visible[rows] == 0.0)
        places = rank_candidates(
            [self._of.lots[k] for k in rows.tolist()], setting.tolist(), length_m, self._paper.tasks,
            self._paper.path_m, self._seed, steps, self._config.prefer_harder,
        )  # fmt: skip
        return {name: rows[place] for name, place in places.items()}

    def _enough(self, rows: Integers, setting: NDArray[np.str_], length_m: Floats) -> bool:
        """Whether `split` can draw the paper's numbers and metres from the kept candidates of some rows."""
        for name, n in self._paper.tasks.items():
            if n and np.count_nonzero(setting == name) < n + max(2, math.ceil(_LEAST_SPARE * n)):
                return False
        chosen = select_quota(
            [self._of.lots[k] for k in rows.tolist()], setting.tolist(), length_m, self._paper.tasks,
            self._paper.path_m, self._seed, difficulty_steps(self._detour(rows, length_m), self._of.visible[rows]),
            self._config.prefer_harder,
        )  # fmt: skip
        # Of a few tasks no choice has the metres exactly: half a route more or less is as near as can be asked for.
        half_a_route = self._paper.path_m / (2 * max(sum(self._paper.tasks.values()), 1))
        return abs(float(length_m[chosen].sum()) - self._paper.path_m) <= _ON_PATH * self._paper.path_m + half_a_route
