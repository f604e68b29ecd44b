"""How sure a score is, and a difference of two: intervals and tests that take the scene for the unit.

Episodes of one scene are alike, so they are no independent draws: what is drawn anew is the scene, within its family.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from aerialdojo_gen.base import rng
from aerialdojo_gen.benchmark.metrics import METRICS, Episodes, Floats, Profile, Summary, outcomes, summarize

RESAMPLES = 9_999
LEVEL = 0.95


def bootstrap(scenes: Sequence[Floats]) -> tuple[Floats, Floats]:
    """95 % percentile intervals, low and high (m,), of the mean of the families.

    Scenes are resampled within their family.
    """
    width = scenes[0].shape[1] if scenes else len(METRICS)
    ends = np.full((2, width), math.nan)
    if not scenes or min(map(len, scenes)) < 2:
        return ends[0], ends[1]
    # A measure that is not known of a scene has no interval, and leaves the others theirs.
    known = np.all([np.isfinite(part).all(axis=0) for part in scenes], axis=0)

    def mean_of_families(*parts: Any, axis: int) -> Any:
        return sum(np.mean(part, axis=axis) for part in parts) / len(parts)

    draws = rng.generator(0, "bootstrap", *(len(part) for part in scenes))
    found = stats.bootstrap(
        tuple(part[:, known] for part in scenes), mean_of_families, n_resamples=RESAMPLES, confidence_level=LEVEL,
        axis=0, method="percentile", rng=draws,
    ).confidence_interval  # fmt: skip
    ends[:, known] = found.low, found.high
    return ends[0], ends[1]


def scene_scores(summary: Summary) -> list[Floats]:
    """Return the `METRICS` of every family's scenes, (scenes, 6) float64."""
    return [
        np.array([score[1:] for name, score in summary.scenes.items() if summary.family_of[name] == family])
        for family in summary.families
    ]


def score_intervals(summary: Summary) -> tuple[tuple[float, float], ...]:
    """Return the 95 % interval of every overall metric, in the order of `METRICS`; NaN where it is not known."""
    low, high = bootstrap(scene_scores(summary))
    return tuple(zip(low.tolist(), high.tolist(), strict=True))


@dataclass(frozen=True)
class Paired:
    """Two runs on the same tasks, the second against the first."""

    first: Floats  # (6,) float64; overall `METRICS`; fractions and metres; NaN where a log does not say
    second: Floats
    difference: Floats
    low: Floats  # (6,) float64; 95 % interval of the difference, by scene; NaN where a family has a single scene
    high: Floats
    p: Floats  # Two-sided: how often a difference as large arises where the two runs are exchanged scene by scene
    tasks: int  # Flown by both
    scenes: int
    only_first: int  # Tasks that one of them solves, the other not
    only_second: int
    p_mcnemar: float  # Of these two counts, exact (binomial), two-sided; it takes episodes for independent


def paired(first: Episodes, second: Episodes, profile: Profile) -> Paired:
    """Compare two logs of the same tasks, row by row; the permutation test is exact where there are few exchanges."""
    summaries = [summarize(episodes, profile) for episodes in (first, second)]
    one, other = (scene_scores(summary) for summary in summaries)
    families = [y - x for x, y in zip(one, other, strict=True)]
    low, high = bootstrap(families)
    # A scene's share of the overall mean: its family's among the families, its own within its family.
    weight = np.concatenate([np.full(len(part), 1.0 / (len(part) * len(families))) for part in families])
    a, b = np.concatenate(one), np.concatenate(other)

    def weighted(x: Any, y: Any, axis: int) -> Any:
        # Rounded: sums in another order differ in their last digits, and would count as other differences.
        return np.round(np.sum((y - x) * weight, axis=axis), 12)

    p = np.ones(len(METRICS))
    if len(a) > 1:
        for k in range(len(METRICS)):
            if not (np.isfinite(a[:, k]) & np.isfinite(b[:, k])).all():
                p[k] = math.nan
                continue
            p[k] = stats.permutation_test(
                (a[:, k], b[:, k]), weighted, permutation_type="samples", vectorized=True, n_resamples=RESAMPLES,
                rng=rng.generator(0, "permutation"),
            ).pvalue  # fmt: skip
    x, y = (outcomes(episodes, profile).success for episodes in (first, second))
    only_first, only_second = int(np.sum(x & ~y)), int(np.sum(y & ~x))
    torn = only_first + only_second
    exact = float(stats.binomtest(only_first, torn).pvalue) if torn else 1.0
    means = [np.array(summary.overall[1:]) for summary in summaries]
    return Paired(
        means[0], means[1], means[1] - means[0], low, high, p, len(first), len(a), only_first, only_second, exact
    )  # fmt: skip
