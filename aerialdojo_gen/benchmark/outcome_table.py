"""One tidy table: a row per episode of all runs, with what reports group by and what they average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from aerialdojo_gen.benchmark.intervals import score_intervals
from aerialdojo_gen.benchmark.metrics import (
    Bools,
    Floats,
    Profile,
    Score,
    Summary,
    outcomes,
    score,
    summarize_values,
    values_of,
)
from aerialdojo_gen.benchmark.runs import Run

GROUPS = ("scene", "family", "scene_type", "partition", "setting", "modality")
# They have 29 % of the paper's tasks.
MALLS = ("U_Mall_0", "U_Mall_1")


@dataclass(frozen=True)
class Cut:
    """Some episodes, and how they are judged and averaged; what is None or empty is left to another cut."""

    run: int | None = None
    profile: Profile | None = None
    where: tuple[tuple[str, str], ...] = ()  # Column and value
    weighted: bool = False  # Whether every episode has the same weight, else every family
    along_way: bool = False  # Whether the smallest distance is that of the way, else that of the poses

    def __or__(self, other: Cut) -> Cut:
        """Combine two cuts."""
        return Cut(
            self.run if other.run is None else other.run,
            other.profile or self.profile,
            self.where + other.where,
            self.weighted or other.weighted,
            self.along_way or other.along_way,
        )


class OutcomeTable:
    """Episodes of some runs, their groups as columns; judged by a profile when it is first needed."""

    def __init__(self, runs: Sequence[Run], labels: Mapping[str, Sequence[Any]] | None = None) -> None:
        self.runs = runs
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(run.episodes, name) for run in runs]) for name in GROUPS
        }
        columns["malls"] = np.where(np.isin(columns["scene"], MALLS), "malls", "other scenes")
        columns["run"] = np.repeat(np.arange(len(runs)), [len(run.episodes) for run in runs])
        self.columns = columns | {name: np.concatenate(parts) for name, parts in (labels or {}).items()}
        self.judged, self.summary, self.intervals = cache(self._judged), cache(self._summary), cache(self._interval)

    def _judged(self, profile: Profile, along_way: bool = False) -> Floats:
        """Return the `METRICS` of every episode, (n, 6), by a profile."""
        logs = [run.episodes for run in self.runs]
        if along_way:
            nearest = [run.path_clearance_to_goal_m for run in self.runs]
            logs = [replace(log, min_distance_m=m) for log, m in zip(logs, nearest, strict=True) if m is not None]
        return np.concatenate([values_of(outcomes(log, profile)) for log in logs])

    def mask(self, cut: Cut) -> Bools:
        """Select the episodes of a cut."""
        mask = np.ones(len(self.columns["run"]), np.bool_)
        for name, value in (*cut.where, *([] if cut.run is None else [("run", cut.run)])):
            mask &= self.columns[name] == value
        return mask

    def values(self, name: str, cut: Cut, order: Sequence[str] | None = None) -> list[str]:
        """List the values of a column that a cut has, in an order."""
        there = set(self.columns[name][self.mask(cut)].tolist()) - {""}
        return sorted(there) if order is None else [value for value in order if value in there]

    def _summary(self, cut: Cut) -> Summary:
        """Average a cut by scene, family and overall."""
        mask = self.mask(cut)
        assert cut.profile is not None
        scene, family = (self.columns[name][mask] for name in ("scene", "family"))
        return summarize_values(self.judged(cut.profile, cut.along_way)[mask], scene, family)

    def _interval(self, cut: Cut) -> Sequence[tuple[float, float]]:
        """Return the 95 % intervals of a cut's overall metrics, in the order of `METRICS`."""
        return score_intervals(self.summary(cut))

    def score(self, cut: Cut) -> Score:
        """Average a cut to one score."""
        if not cut.weighted:
            return self.summary(cut).overall
        assert cut.profile is not None
        return score(self.judged(cut.profile, cut.along_way)[self.mask(cut)])
