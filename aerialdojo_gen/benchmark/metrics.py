"""The metrics: SR, OSR, SPL, DTS and CR from a log of episodes (paper, section on evaluation).

An episode counts as a success by a `Profile`. Scores of a scene are means over its episodes, those of a family means
over its scenes, the overall score the mean of the families; ± is the standard deviation over scenes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.schemas import FAMILIES

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Strings = NDArray[np.str_]


@dataclass(frozen=True)
class Episodes:
    """Columns of an episode log, all of one length.

    Attributes
    ----------
    scene, family, setting, modality : (n,) str
        What the episode belongs to.
    stop_called, collision : (n,) bool
        How it ended; both may hold in one step.
    n_actions, action_budget : (n,) int64
        Actions taken, Stop included, and how many were allowed.
    final_distance_m, min_distance_m : (n,) float64
        Distance to the goal anchor at the end, and the smallest over all poses, the start included.
    final_horizontal_distance_m, min_horizontal_distance_m : (n,) float64
        The same in the plane.
    path_length_m : (n,) float64
        Way flown, ℓ.
    reference_length_m : (n,) float64
        Length of the reference route, L: the sum over its moves, which are horizontal or vertical.
    euclidean_m : (n,) float64
        Straight distance from start to goal.
    """

    scene: Strings
    family: Strings
    setting: Strings
    modality: Strings
    stop_called: Bools
    collision: Bools
    n_actions: NDArray[np.int64]
    action_budget: NDArray[np.int64]
    final_distance_m: Floats
    min_distance_m: Floats
    final_horizontal_distance_m: Floats
    min_horizontal_distance_m: Floats
    path_length_m: Floats
    reference_length_m: Floats
    euclidean_m: Floats

    def __len__(self) -> int:
        """Return the number of episodes."""
        return len(self.scene)

    def where(self, mask: Bools) -> Episodes:
        """Return the episodes that a mask selects."""
        return replace(self, **{f.name: getattr(self, f.name)[mask] for f in fields(self)})


_KINDS: dict[str, Any] = {
    **dict.fromkeys(("scene", "family", "setting", "modality"), np.str_),
    **dict.fromkeys(("stop_called", "collision"), np.bool_),
    **dict.fromkeys(("n_actions", "action_budget"), np.int64),
}


def episodes_of(table: pa.Table) -> Episodes:
    """Take the metrics' columns out of a table of episodes, and check them.

    Parameters
    ----------
    table : pyarrow.Table
        Rows of `aerialdojo_gen.schemas` ``episodes``.

    Returns
    -------
    Episodes

    Raises
    ------
    StoreError
        A length or distance is negative or no number, or the smallest distance exceeds the last one.
    """
    columns = {}
    for field in fields(Episodes):
        kind = _KINDS.get(field.name, np.float64)
        columns[field.name] = np.asarray(table.column(field.name).to_pylist(), dtype=kind)
    episodes = Episodes(**columns)
    for name in columns:
        if name not in _KINDS and not (np.isfinite(columns[name]) & (columns[name] >= 0.0)).all():
            raise StoreError(f"episodes: {name} has values that are no length: run the evaluation again")
    for nearest, last in (
        (episodes.min_distance_m, episodes.final_distance_m),
        (episodes.min_horizontal_distance_m, episodes.final_horizontal_distance_m),
    ):
        if (nearest > last + 1e-9).any():
            raise StoreError("episodes: a smallest distance exceeds the last one: run the evaluation again")
    return episodes


@dataclass(frozen=True)
class Outcomes:
    """What every episode earns under a profile.

    Attributes
    ----------
    success, oracle_success, collision : (n,) bool
        σ; ever within the radius, whatever happens later; ended by a collision.
    spl : (n,) float64
        σ·L / max(L, ℓ), in [0, 1].
    distance_m : (n,) float64
        Distance to the goal at the end, metres.
    """

    success: Bools
    oracle_success: Bools
    spl: Floats
    distance_m: Floats
    collision: Bools


def outcomes(episodes: Episodes, profile: Profile) -> Outcomes:
    """Judge every episode by a profile.

    An episode that starts at its goal has L = 0: its SPL is 1 where it succeeds without moving, 0 where it moved.

    Parameters
    ----------
    episodes : Episodes
        The log.
    profile : Profile
        The rule.

    Returns
    -------
    Outcomes
    """
    final, nearest = _distances(episodes, profile)
    success = _may_succeed(episodes, profile) & (final <= profile.radius_m)
    shortest = episodes.euclidean_m if profile.straight_reference else episodes.reference_length_m
    longer = np.maximum(shortest, episodes.path_length_m)
    # Nothing to fly and nothing flown is the shortest way there is.
    efficiency = np.divide(shortest, longer, out=np.ones_like(shortest), where=longer > 0.0)
    spl = np.where(success, efficiency, 0.0)
    return Outcomes(success, nearest <= profile.radius_m, spl, final, episodes.collision)


def _distances(episodes: Episodes, profile: Profile) -> tuple[Floats, Floats]:
    if profile.planar:
        final, nearest = episodes.final_horizontal_distance_m, episodes.min_horizontal_distance_m
    else:
        final, nearest = episodes.final_distance_m, episodes.min_distance_m
    return final, np.minimum(nearest, final)


def _may_succeed(episodes: Episodes, profile: Profile) -> Bools:
    """Tell which episodes succeed if only they are near enough."""
    may = episodes.n_actions <= episodes.action_budget
    if profile.needs_stop:
        may &= episodes.stop_called
    if profile.fails_on_collision:
        may &= ~episodes.collision
    return may


@dataclass(frozen=True)
class Score:
    """Means over some episodes, or means of such means.

    Attributes
    ----------
    episodes : int
        How many stand behind it.
    sr, osr, spl, cr : float
        Success rate, oracle success rate, success weighted by path length, collision rate: fractions in [0, 1].
    dts_m : float
        Distance to the goal at the end of the episode, metres.
    """

    episodes: int
    sr: float
    osr: float
    spl: float
    dts_m: float
    cr: float


METRICS = ("sr", "osr", "spl", "dts_m", "cr")


def score(judged: Outcomes, mask: Bools | slice = slice(None)) -> Score:
    """Average outcomes over episodes; every value is NaN where there are none."""
    columns = (judged.success, judged.oracle_success, judged.spl, judged.distance_m, judged.collision)
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
    """Scores of a log under a profile.

    Attributes
    ----------
    profile : Profile
        The rule.
    scenes : dict of str to Score
        By scene, in the order of names.
    families : dict of str to Score
        Means over a family's scenes; families without episodes are left out.
    overall : Score
        Mean of the families that are there.
    deviation : Score
        Standard deviation over all scenes.
    """

    profile: Profile
    scenes: dict[str, Score]
    families: dict[str, Score]
    overall: Score
    deviation: Score

    @property
    def missing_families(self) -> list[str]:
        """Families without episodes, which the overall score does not speak of."""
        return [family for family in FAMILIES.values() if family not in self.families]


def summarize(episodes: Episodes, profile: Profile) -> Summary:
    """Average a log by scene, family and overall.

    Parameters
    ----------
    episodes : Episodes
        The log of one run, or a part of it.
    profile : Profile
        The rule of success.

    Returns
    -------
    Summary
        Of an empty log: no scenes, and NaN overall.
    """
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


def slices(episodes: Episodes, column: str, order: Sequence[str]) -> Iterator[tuple[str, Episodes]]:
    """Yield the parts of a log by a column's value (``setting``, ``modality``), those that have episodes."""
    values = getattr(episodes, column)
    for value in order:
        if (values == value).any():
            yield value, episodes.where(values == value)


def success_curve(episodes: Episodes, profile: Profile, radii_m: Floats) -> tuple[Floats, Floats]:
    """Overall SR and OSR as the radius grows, everything else by the profile.

    Parameters
    ----------
    episodes : Episodes
        The log, one episode or more.
    profile : Profile
        The rule whose radius is varied.
    radii_m : (r,) float64
        Radii, metres.

    Returns
    -------
    sr, osr : (r,) float64
        Fractions; neither ever falls.
    """
    # An episode's share of the overall mean: its scene's among its family's scenes, its family's among the families.
    weight = np.empty(len(episodes))
    families = sorted(set(episodes.family.tolist()))
    for family in families:
        scenes = sorted(set(episodes.scene[episodes.family == family].tolist()))
        for name in scenes:
            mask = episodes.scene == name
            weight[mask] = 1.0 / (mask.sum() * len(scenes) * len(families))
    final, nearest = _distances(episodes, profile)
    may = _may_succeed(episodes, profile)
    return _share_within(final[may], weight[may], radii_m), _share_within(nearest, weight, radii_m)


def _share_within(distance_m: Floats, weight: Floats, radii_m: Floats) -> Floats:
    order = np.argsort(distance_m)
    share = np.concatenate([[0.0], np.cumsum(weight[order])])
    return np.asarray(share[np.searchsorted(distance_m[order], radii_m, side="right")])
