"""The metrics SR, SR-view, OSR, SPL, DTS and CR: outcomes averaged over scenes and families.

After the paper's section on evaluation, SR-view apart. A scene has the mean of its episodes, a family that of its
scenes, and the overall score is the mean of the families; ± is the standard deviation over scenes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.benchmark.metrics import Bools, Episodes, Floats, Outcomes, distances, may_succeed, outcomes
from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.store.schemas import FAMILIES


@dataclass(frozen=True)
class Score:
    """Means over some episodes, or means of such means."""

    episodes: int  # How many stand behind it
    sr: float
    sr_view: float
    osr: float
    spl: float
    dts_m: float  # Distance to the goal at the end of the episode, metres
    cr: float


METRICS = ("sr", "sr_view", "osr", "spl", "dts_m", "cr")
# The paper's own.
PAPER_METRICS = tuple(metric for metric in METRICS if metric != "sr_view")


def score(judged: Outcomes, mask: Bools | slice = slice(None)) -> Score:
    """Average outcomes over episodes; every value is NaN where there are none."""
    columns = (
        judged.success,
        judged.success_view,
        judged.oracle_success,
        judged.spl,
        judged.distance_m,
        judged.collision,
    )
    chosen = [np.asarray(column[mask], dtype=np.float64) for column in columns]
    n = len(chosen[0])
    return Score(n, *(math.fsum(c) / n if n else math.nan for c in chosen))


def mean_score(scores: Sequence[Score]) -> Score:
    """Average scores, each with the same weight; every value is NaN where there are none."""
    return Score(
        sum(s.episodes for s in scores),
        *(math.fsum(getattr(s, m) for s in scores) / len(scores) if scores else math.nan for m in METRICS),
    )


def deviation(scores: Sequence[Score]) -> Score:
    """Standard deviation of scores (n - 1 in the denominator); NaN for fewer than two."""
    values = np.array([[getattr(s, m) for m in METRICS] for s in scores])
    spread = values.std(axis=0, ddof=1) if len(scores) > 1 else np.full(len(METRICS), math.nan)
    return Score(sum(s.episodes for s in scores), *(float(v) for v in spread))


@dataclass(frozen=True)
class Summary:
    """Scores of a log under a profile."""

    profile: Profile  # The rule
    scenes: dict[str, Score]  # By scene, in the order of names
    families: dict[str, Score]  # Means over a family's scenes; families without episodes are left out
    overall: Score  # Mean of the families that are there
    deviation: Score  # Standard deviation over all scenes

    @property
    def missing_families(self) -> list[str]:
        """Families without episodes, which the overall score does not speak of."""
        return [family for family in FAMILIES.values() if family not in self.families]


def summarize(episodes: Episodes, profile: Profile) -> Summary:
    """Average a log by scene, family and overall."""
    judged = outcomes(episodes, profile)
    scenes: dict[str, Score] = {}
    members: dict[str, list[Score]] = {}
    for name in sorted(set(episodes.scene.tolist())):
        mask = episodes.scene == name
        scenes[name] = score(judged, mask)
        members.setdefault(str(episodes.family[mask][0]), []).append(scenes[name])
    order = [*FAMILIES.values(), *sorted(members.keys() - set(FAMILIES.values()))]
    families = {family: mean_score(members[family]) for family in order if family in members}
    return Summary(profile, scenes, families, mean_score(list(families.values())), deviation(list(scenes.values())))


def weighted_score(episodes: Episodes, profile: Profile) -> Score:
    """Average a log over all its episodes, each with the same weight: the paper's appendix C's other population."""
    return score(outcomes(episodes, profile))


def slices(episodes: Episodes, column: str, order: Sequence[str]) -> Iterator[tuple[str, Episodes]]:
    """Yield the parts of a log by a column's value (``setting``, ``scene_type``, …), those that have episodes."""
    values = getattr(episodes, column)
    for value in order:
        if (values == value).any():
            yield value, episodes.where(values == value)


def success_curve(episodes: Episodes, profile: Profile, radii_m: Floats) -> tuple[Floats, Floats]:
    """Overall SR and OSR, fractions (r,), at radii in metres, everything else by the profile."""
    # An episode's share of the overall mean: its scene's among its family's scenes, its family's among the families.
    weight = np.empty(len(episodes))
    families = sorted(set(episodes.family.tolist()))
    for family in families:
        scenes = sorted(set(episodes.scene[episodes.family == family].tolist()))
        for name in scenes:
            mask = episodes.scene == name
            weight[mask] = 1.0 / (mask.sum() * len(scenes) * len(families))
    final, nearest = distances(episodes, profile)
    may = may_succeed(episodes, profile)
    return _share_within(final[may], weight[may], radii_m), _share_within(nearest, weight, radii_m)


def _share_within(distance_m: Floats, weight: Floats, radii_m: Floats) -> Floats:
    order = np.argsort(distance_m)
    share = np.concatenate([[0.0], np.cumsum(weight[order])])
    return np.asarray(share[np.searchsorted(distance_m[order], radii_m, side="right")])
