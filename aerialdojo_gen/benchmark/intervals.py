"""How sure a score is, and a difference of two: intervals that take the scene for the unit.

Episodes of one scene are alike, so they are no independent draws: what is drawn anew is the scene, within its family.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from aerialdojo_gen.base import rng
from aerialdojo_gen.benchmark.metrics import METRICS, Floats, Summary

RESAMPLES = 9_999
LEVEL = 0.95


def bootstrap(scenes: Sequence[Floats]) -> tuple[Floats, Floats]:
    """95 % percentile intervals, low and high (m,), of the families' mean; scenes are resampled within a family."""
    width = scenes[0].shape[1] if scenes else len(METRICS)
    ends = np.full((2, width), math.nan)
    if not scenes or min(map(len, scenes)) < 2:
        return ends[0], ends[1]
    from scipy.stats import bootstrap as resampled

    # A measure that is not known of a scene has no interval, and leaves the others theirs.
    known = np.all([np.isfinite(part).all(axis=0) for part in scenes], axis=0)

    def mean_of_families(*parts: Any, axis: int) -> Any:
        return sum(np.mean(part, axis=axis) for part in parts) / len(parts)

    draws = rng.generator(0, "bootstrap", *(len(part) for part in scenes))
    found = resampled(
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
