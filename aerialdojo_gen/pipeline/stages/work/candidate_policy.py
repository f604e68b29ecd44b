"""Which candidates `plan` searches, batch by batch, and which kept ones `split` releases.

Without a quota that is all of them. For the paper's counts, a goal's cost-to-go predicts the lengths of all its
routes within a few per cent before any search, and so their setting and difficulty, and which of them will be
released. Those are searched first, until each setting has as many routes as are released, plus a margin, so that the
last draw can select by the true lengths.

Draws are random by key: which kept candidates are released, and which train.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import QuotaConfig
from aerialdojo_gen.base.constants import DETOUR, SETTINGS
from aerialdojo_gen.base.paper_figures import PaperScene, inventory, splits
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.geometry.portable import exp
from aerialdojo_gen.pipeline.stages.work.rules import KEPT, judge
from aerialdojo_gen.store.layout import partition

if TYPE_CHECKING:
    from aerialdojo_gen.planning.planner import Route

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Least margin of kept routes: `filter` rejects a few more by rules that only it can check.
_MIN_SPARE = 0.02
# Tolerance of the summed length, relative to the paper's.
_ON_PATH = 2e-3
# Width of the logistic error of predicted detours (283,000 routes of 42 scenes): of routes with a predicted detour of
# 1.035, 1.045 and 1.055, 22, 49 and 73 % had one of `DETOUR` or more.
_DETOUR_SPREAD = 0.008
_HALVINGS = 60
# Metres over which a tilt of 1 changes a route's odds by e; tilts are searched between -_STEEPEST and _STEEPEST.
_SCALE_M = 10.0
_STEEPEST = 1e4


def apportion(total: int, sizes: Mapping[str, int]) -> dict[str, int]:
    """Apportion a total in proportion to sizes (largest remainders, ties by name)."""
    whole = sum(sizes.values())
    if not whole:
        return dict.fromkeys(sizes, 0)
    shares = {name: total * size // whole for name, size in sizes.items()}
    by_rest = sorted(sizes, key=lambda name: (-(total * sizes[name] % whole), name))
    for name in by_rest[: total - sum(shares.values())]:
        shares[name] += 1
    return shares


def train_quotas(
    scene: str, scenes: Mapping[str, PaperScene], splits: Mapping[tuple[str, str], Mapping[str, int]]
) -> dict[str, int]:
    """Return a scene's share of the paper's training tasks of its partition, by the paper's figures alone."""
    alike = [row for row in scenes.values() if partition(row.scene) == partition(scene)]
    totals = splits[partition(scene).upper(), "train"]
    return {s: apportion(total, {row.scene: row.tasks[s] for row in alike})[scene] for s, total in totals.items()}


def difficulty_level(plan_detour: Floats, visible_at_start: Floats) -> NDArray[np.int64]:
    """Difficulty level (n,), 0 to 2: one for a plan detour of `DETOUR`, one for a target unseen at the start."""
    return (plan_detour >= DETOUR).astype(np.int64) + (visible_at_start == 0.0)


@dataclass(frozen=True, eq=False)
class Accepted:
    """n candidates that the rules keep."""

    sampling_keys: Sequence[str]  # Keys for random draws
    settings: Sequence[str]  # Length settings
    length_m: Floats  # (n,) float64; lengths of the routes, metres
    levels: Floats | NDArray[np.int64] | float = 0.0  # Difficulty levels, (n,) or one of all


def select_quota(
    kept: Accepted, counts: Mapping[str, int], path_m: float, seed: int, preference: float = 0.0
) -> NDArray[np.bool_]:
    """Weighted sample without replacement (Gumbel's trick), (n,) bool.

    The counts of each setting hold, lengths sum to `path_m` by tilting the weights, harder tasks are preferred. A
    task's chance depends on its key, length and level, never on its row.
    """
    mask = np.zeros(len(kept.settings), dtype=bool)
    for name, rows in rank_candidates(kept, counts, path_m, seed, preference).items():
        mask[rows[: counts[name]]] = True
    return mask


def rank_candidates(
    kept: Accepted, counts: Mapping[str, int], path_m: float, seed: int, preference: float = 0.0
) -> dict[str, NDArray[np.int64]]:
    """Rows of each setting's tasks in the order of selection by `select_quota`, the best Gumbel scores first."""
    # By key: ties are broken by it, not by row order.
    by_key = np.argsort(np.asarray(kept.sampling_keys))
    settings, length_m = np.asarray(kept.settings)[by_key], kept.length_m
    groups = {name: by_key[settings == name] for name in sorted(counts)}
    gumbel_scores = np.array([_gumbel(seed, key) for key in kept.sampling_keys]) + preference * kept.levels

    def ranked(tilt: float) -> dict[str, NDArray[np.int64]]:
        scores = gumbel_scores + tilt * length_m / _SCALE_M
        return {name: rows[np.argsort(-scores[rows], kind="stable")] for name, rows in groups.items()}

    def total(order: Mapping[str, NDArray[np.int64]]) -> float:
        return float(sum(length_m[rows[: counts[name]]].sum() for name, rows in order.items()))

    low, high = -_STEEPEST, _STEEPEST
    best = ranked(0.0)
    nearest = abs(total(best) - path_m)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        order = ranked(middle)
        reached = total(order)
        if abs(reached - path_m) < nearest:
            best, nearest = order, abs(reached - path_m)
        if reached < path_m:
            low = middle
        else:
            high = middle
        if abs(reached - path_m) <= 1e-4 * path_m:
            break
    return best


def _gumbel(seed: int, key: str) -> float:
    uniform = (rank(seed, "quota", key) + 0.5) / 2**64
    return -math.log(-math.log(uniform))


def sampling_key(scene: str, pair_id: str) -> str:
    """A candidate's key for random draws; it depends on the pair alone, so that the salt changes no selection."""
    return f"{scene}-{hashlib.blake2b(f'{scene}/{pair_id}'.encode(), digest_size=6).hexdigest()}"


def train_counts(settings: Sequence[str], fraction: float) -> dict[str, int]:
    """Training tasks per setting: the same share of each, rounded half up."""
    return {setting: int(fraction * n + 0.5) for setting, n in Counter(settings).items()}


def train_mask(
    keys: Sequence[str], settings: Sequence[str], trains: Mapping[str, int], seed: int
) -> NDArray[np.bool_]:
    """Training mask (n,) bool; it depends on the seed and a task's key, not on its row."""
    mask = np.zeros(len(keys), dtype=bool)
    for setting, n in trains.items():
        rows = [i for i, s in enumerate(settings) if s == setting]
        rows.sort(key=lambda i: rank(seed, "split", keys[i]))
        mask[rows[:n]] = True
    return mask


@dataclass(frozen=True, eq=False)
class Candidates:
    """A scene's n candidates before any search."""

    scene: str  # Name of the scene
    sampling_keys: list[str]  # Keys for random draws
    euclidean_m: Floats  # (n,) float64; straight distance, and shortest length without obstacles, metres
    free_length_m: Floats
    visible: Floats  # (n,) float64; share of the target that the start sees
    predicted_m: Floats  # Length of the cheapest grid path, metres; infinite if there is no path, or if it is unknown

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
    """Selects the candidates of a scene; this one searches every candidate, and releases every kept one."""

    compares = False  # Whether it compares all candidates of a scene by predicted lengths, and so needs them at once

    def initial_batch(self, candidates: Candidates) -> Integers:
        """Rows to search first, (m,) int64, ascending."""
        return np.arange(len(candidates.sampling_keys))

    def next_batch(self, routes: Sequence[Route | None]) -> Integers:
        """Rows to search next, (m,) int64, ascending; empty if enough are kept. `routes` has a row a candidate."""
        return np.empty(0, np.int64)

    def release(self, kept: Accepted) -> NDArray[np.bool_]:
        """Draw what is released, (n,) bool."""
        return np.ones(len(kept.settings), dtype=bool)

    def train_counts(self, settings: Sequence[str], fraction: float) -> dict[str, int]:
        """Training tasks per setting of the released tasks, of which this fraction trains unless a quota says it."""
        return train_counts(settings, fraction)


class PaperQuota(CandidatePolicy):
    """Searches and releases as many candidates of a scene as the paper has, as near as possible to its metres."""

    compares = True

    def __init__(self, paper_scene: PaperScene, config: QuotaConfig, seed: int) -> None:
        self._paper_scene, self._config = paper_scene, config
        self._rules = paper_scene.tasks, paper_scene.path_m, seed, config.prefer_harder
        self._margin = config.search_margin
        self._taken = dict.fromkeys(SETTINGS, 0)

    def initial_batch(self, candidates: Candidates) -> Integers:
        """Rows that are likely to be released, and a margin."""
        self._candidates = candidates
        predicted = candidates.predicted_m
        rows = np.arange(len(predicted))
        outcome = np.where(np.isfinite(predicted), "SOLVED", "NO_PATH")
        reason, setting = self._judge(rows, outcome, predicted, np.zeros(len(rows)))
        likely = np.flatnonzero(reason == KEPT)
        # A difficulty level counts by its probability.
        detoured = 1.0 / (1.0 + exp(-(self._detour(likely, predicted[likely]) - DETOUR) / _DETOUR_SPREAD))
        levels = detoured + (candidates.visible[likely] == 0.0)
        order = rank_candidates(self._accepted(likely, setting[likely], predicted[likely], levels), *self._rules)
        # Candidates predicted to be rejected come last, the shortest first: some are kept after all.
        unlikely = np.flatnonzero((reason != KEPT) & np.isfinite(predicted))
        self._order = {name: likely[order[name]] for name in SETTINGS}
        self._last = unlikely[np.argsort(predicted[unlikely], kind="stable")]
        return self._within_margin()

    def next_batch(self, routes: Sequence[Route | None]) -> Integers:
        """Rows within a larger margin."""
        searched = [(k, route) for k, route in enumerate(routes) if route is not None]
        done = np.array([k for k, _ in searched], dtype=np.int64)
        outcomes = np.array([route.outcome for _, route in searched], dtype="U24")
        lengths = np.array([route.length_m for _, route in searched])
        actions = np.array([route.n_actions for _, route in searched])
        reason, setting = self._judge(done, outcomes, lengths, actions)
        kept = reason == KEPT
        rows = done[kept]
        levels = difficulty_level(self._detour(rows, lengths[kept]), self._candidates.visible[rows])
        kept_rows = self._accepted(rows, setting[kept], lengths[kept], levels)
        while not self._enough(kept_rows):
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
            n = self._paper_scene.tasks[name]
            end = min(math.ceil(n * (1.0 + self._margin)), len(self._order[name]))
            rows.append(self._order[name][self._taken[name] : end])
            self._taken[name] = max(end, self._taken[name])
        return np.sort(np.concatenate(rows))

    def _judge(
        self, rows: Integers, outcome: NDArray[np.str_], length_m: Floats, n_actions: NDArray[np.generic]
    ) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
        c = self._candidates
        return judge(
            outcome.astype("U24"), c.euclidean_m[rows], length_m, n_actions.astype(np.int32), self._config.rules,
            np.maximum(self._detour(rows, length_m), 1.0), c.visible[rows],
        )  # fmt: skip

    def _detour(self, rows: Integers, length_m: Floats) -> Floats:
        return np.asarray(length_m / np.maximum(self._candidates.free_length_m[rows], 1e-12))

    def _accepted(
        self, rows: Integers, setting: NDArray[np.str_], length_m: Floats, levels: Floats | Integers
    ) -> Accepted:
        return Accepted(
            [self._candidates.sampling_keys[k] for k in rows.tolist()], setting.tolist(), length_m, levels
        )

    def _enough(self, kept: Accepted) -> bool:
        """Whether the paper's counts and total length can be selected from these."""
        setting = np.asarray(kept.settings)
        for name, n in self._paper_scene.tasks.items():
            if n and np.count_nonzero(setting == name) < n + max(2, math.ceil(_MIN_SPARE * n)):
                return False
        # A few tasks cannot match the total length exactly: allow half a route.
        half_a_route = self._paper_scene.path_m / (2 * max(sum(self._paper_scene.tasks.values()), 1))
        total = float(kept.length_m[self.release(kept)].sum())
        return abs(total - self._paper_scene.path_m) <= _ON_PATH * self._paper_scene.path_m + half_a_route

    def release(self, kept: Accepted) -> NDArray[np.bool_]:
        """Draw the paper's counts, with lengths that sum to its metres."""
        return select_quota(kept, *self._rules)

    def train_counts(self, settings: Sequence[str], fraction: float) -> dict[str, int]:
        """Take the scene's share of the paper's training tasks."""
        return train_quotas(self._paper_scene.scene, inventory(), splits())


def policy_of(scene: str, quota: QuotaConfig | None, seed: int) -> CandidatePolicy:
    """Make a scene's policy: by the paper's counts if there is a quota and the paper has the scene."""
    paper_scene = inventory().get(scene) if quota else None
    return CandidatePolicy() if quota is None or paper_scene is None else PaperQuota(paper_scene, quota, seed)
