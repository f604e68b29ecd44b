"""Which candidates `plan` searches, and in which order, if it searches only as many as a release needs.

A goal's cost-to-go predicts the lengths of all its routes within a few per cent before any search, and so their
setting and difficulty, and which of them `split` will select. Those are searched first, until each setting has
as many routes as are released, plus a margin, so that `split` can select by the true lengths.
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
from aerialdojo_gen.pipeline.stages.work.quota import difficulty_level, rank_candidates, select_quota
from aerialdojo_gen.pipeline.stages.work.rules import KEPT, judge
from aerialdojo_gen.pipeline.stages.work.selection import sampling_key
from aerialdojo_gen.planning.planner import Route

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Least margin of kept routes: `filter` rejects a few more by rules that only it can check.
_LEAST_SPARE = 0.02
# Tolerance of the summed length, relative to the paper's.
_ON_PATH = 2e-3
# Width of the logistic error of predicted detours (283,000 routes of 42 scenes): of routes with a predicted detour of
# 1.035, 1.045 and 1.055, 22, 49 and 73 % had one of `DETOUR` or more.
_DETOUR_SPREAD = 0.008


@dataclass(frozen=True, eq=False)
class Candidates:
    """A scene's n candidates before any search."""

    scene: str  # Name of the scene
    sampling_keys: list[str]  # Keys for random draws
    euclidean_m: Floats  # (n,) float64; straight distance, and shortest length without obstacles, metres
    free_length_m: Floats
    visible: Floats  # (n,) float64; share of the target that the start sees
    predicted_m: Floats  # Length of the cheapest grid path, metres; infinite if there is no path

    @classmethod
    def of(cls, pairs: pa.Table, free_length_m: Floats, predicted_m: Floats) -> Candidates:
        """Make them of rows of `pairs`."""
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
    """Selects, batch by batch, which candidates of a scene to search next."""

    def __init__(self, candidates: Candidates, paper: PaperScene, config: ReleasedPlanConfig, seed: int) -> None:
        self._candidates, self._paper, self._config, self._seed = candidates, paper, config, seed
        n = len(candidates.sampling_keys)
        predicted = candidates.predicted_m
        reason, setting = self._judge(np.where(np.isfinite(predicted), "SOLVED", "NO_PATH"), predicted, np.zeros(n))
        likely = np.flatnonzero(reason == KEPT)
        order = self._rank(likely, setting[likely], predicted[likely])
        # Candidates predicted to be rejected come last, the shortest first: some are kept after all.
        unlikely = np.flatnonzero((reason != KEPT) & np.isfinite(predicted))
        self._order = {name: order[name] for name in SETTINGS}
        self._last = unlikely[np.argsort(predicted[unlikely], kind="stable")]
        self._taken = dict.fromkeys(SETTINGS, 0)
        self._margin = config.search_margin

    def initial_batch(self) -> Integers:
        """Rows of the first batch, (m,) int64, ascending."""
        return self._within_margin()

    def next_batch(self, routes: Sequence[Route | None]) -> Integers:
        """Rows of the next batch, (m,) int64, ascending; empty if enough are kept."""
        searched = [(k, route) for k, route in enumerate(routes) if route is not None]
        done = np.array([k for k, _ in searched], dtype=np.int64)
        outcomes = np.array([route.outcome for _, route in searched], dtype="U24")
        lengths = np.array([route.length_m for _, route in searched])
        actions = np.array([route.n_actions for _, route in searched])
        reason, setting = self._judge(outcomes, lengths, actions, done)
        kept = reason == KEPT
        while not self._has_enough(done[kept], setting[kept], lengths[kept]):
            self._margin = max(2.0 * self._margin, 0.1)
            rows = self._within_margin()
            if len(rows):
                return rows
            if all(self._taken[name] == len(self._order[name]) for name in SETTINGS):
                rows, self._last = np.sort(self._last), self._last[:0]
                return rows
        return np.empty(0, np.int64)

    def _within_margin(self) -> Integers:
        rows = [np.empty(0, np.int64)]
        for name in SETTINGS:
            n = self._paper.tasks[name]
            end = min(math.ceil(n * (1.0 + self._margin)), len(self._order[name]))
            rows.append(self._order[name][self._taken[name] : end])
            self._taken[name] = max(end, self._taken[name])
        return np.sort(np.concatenate(rows))

    def _judge(
        self,
        outcome: NDArray[np.str_],
        length_m: Floats,
        n_actions: NDArray[np.generic],
        rows: Integers | None = None,
    ) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
        c = self._candidates
        at = slice(None) if rows is None else rows
        detour = np.maximum(length_m / np.maximum(c.free_length_m[at], 1e-12), 1.0)
        return judge(
            outcome.astype("U24"), c.euclidean_m[at], length_m, n_actions.astype(np.int32), self._config.kept, detour,
            c.visible[at],
        )  # fmt: skip

    def _detour(self, rows: Integers, length_m: Floats) -> Floats:
        return np.asarray(length_m / np.maximum(self._candidates.free_length_m[rows], 1e-12))

    def _rank(self, rows: Integers, setting: NDArray[np.str_], length_m: Floats) -> dict[str, Integers]:
        # A difficulty level counts by its probability.
        likely = 1.0 / (1.0 + np.exp(-(self._detour(rows, length_m) - DETOUR) / _DETOUR_SPREAD))
        levels = likely + (self._candidates.visible[rows] == 0.0)
        places = rank_candidates(
            [self._candidates.sampling_keys[k] for k in rows.tolist()], setting.tolist(), length_m, self._paper.tasks,
            self._paper.path_m, self._seed, levels, self._config.prefer_harder,
        )  # fmt: skip
        return {name: rows[place] for name, place in places.items()}

    def _has_enough(self, rows: Integers, setting: NDArray[np.str_], length_m: Floats) -> bool:
        """Whether `split` can select the paper's counts and total length from these kept candidates."""
        for name, n in self._paper.tasks.items():
            if n and np.count_nonzero(setting == name) < n + max(2, math.ceil(_LEAST_SPARE * n)):
                return False
        levels = difficulty_level(self._detour(rows, length_m), self._candidates.visible[rows])
        chosen = select_quota(
            [self._candidates.sampling_keys[k] for k in rows.tolist()], setting.tolist(), length_m, self._paper.tasks,
            self._paper.path_m, self._seed, levels, self._config.prefer_harder,
        )  # fmt: skip
        # A few tasks cannot match the total length exactly: allow half a route.
        half_a_route = self._paper.path_m / (2 * max(sum(self._paper.tasks.values()), 1))
        return abs(float(length_m[chosen].sum()) - self._paper.path_m) <= _ON_PATH * self._paper.path_m + half_a_route
