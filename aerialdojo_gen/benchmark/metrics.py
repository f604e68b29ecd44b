"""Success rules, outcomes of episodes under a rule, and scores with their intervals: SR, SR-view, OSR, SPL, DTS, CR.

A scene's score is the mean of its episodes, a family's the mean of its scenes, the overall score the mean of the
families (paper, section on evaluation); ± is the standard deviation over scenes. SR-view is not in the paper.
Episodes of one scene are alike, so they are no independent draws: intervals resample scenes within their family.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.store.schemas import FAMILIES


@dataclass(frozen=True)
class Profile:
    """A rule of success.

    Distances are always measured to the goal anchor, which lies 1 m from the target's surface. Benchmarks that
    measure to the target itself judge by up to that metre and half the target's size differently.
    """

    name: str  # What ``--profile`` takes
    radius_m: float  # Distance to the goal, metres, that still counts as there; the boundary is inside
    needs_stop: bool = True  # Whether the agent must have called Stop
    fails_on_collision: bool = True  # Whether a collision rules success out
    planar: bool = False  # Whether distances are taken in the plane, height left out
    straight_reference: bool = False
    about: str = ""  # Where the rule comes from, one line

    @property
    def own(self) -> bool:
        """Whether it is the benchmark's own rule, at any radius."""
        return self.name.startswith("aerialdojo")


PROFILES = {
    profile.name: profile
    for profile in (
        Profile(
            "aerialdojo", 3.0, about="an explicit Stop within 3 m of the anchor, without collision, within budget"
        ),
        Profile("aerialdojo-5m", 5.0, about="the same at 5 m, reported beside it"),
        Profile("uav-on", 20.0, about="UAV-ON: Stop within 20 m, a collision ends the episode"),
        Profile("aerialvln", 20.0, planar=True, about="AerialVLN: Stop within 20 m in the plane"),
        Profile(
            "openfly", 20.0, needs_stop=False, fails_on_collision=False, straight_reference=True,
            about="OpenFly: the episode ends within 20 m, however it ends; SPL against the straight distance",
        ),
    )
}  # fmt: skip
DEFAULT_PROFILES = ("aerialdojo", "aerialdojo-5m")


def profile_named(name: str) -> Profile:
    """Return a profile by its name."""
    check_known("no profile", [name], PROFILES)
    return PROFILES[name]


def at_radius(profile: Profile, radius_m: float) -> Profile:
    """Return a success rule with another radius, named by it."""
    if radius_m == profile.radius_m:
        return profile
    name = "aerialdojo" if profile.own else profile.name
    about = f"{profile.name} at {radius_m:g} m"
    return replace(profile, name=f"{name}-{radius_m:g}m", radius_m=radius_m, about=about)


Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Strings = NDArray[np.str_]
# A structured array, (n,): a field a column of the log, and `view_distance_m`. Distances and lengths are metres.
Episodes = NDArray[np.void]

_KINDS: dict[str, Any] = {
    **dict.fromkeys(("scene", "family", "scene_type", "partition", "setting", "modality"), np.str_),
    **dict.fromkeys(("stop_called", "collision"), np.bool_),  # Both may hold in one step
    **dict.fromkeys(("n_actions", "action_budget"), np.int64),
}
_LENGTHS = (
    "final_distance_m", "min_distance_m", "final_horizontal_distance_m", "min_horizontal_distance_m", "path_length_m",
    "reference_length_m", "euclidean_m",
)  # fmt: skip


def episodes_of(table: pa.Table) -> Episodes:
    """Take the metrics' columns out of a table of episodes, and check them."""
    kinds = _KINDS | dict.fromkeys(_LENGTHS, np.float64)
    columns = {name: np.asarray(table[name].to_pylist(), dtype=kind) for name, kind in kinds.items()}
    # A table that an older version has written may lack the views.
    distance, sight = (
        table[name].to_pylist() if name in table.column_names else [None] * table.num_rows
        for name in ("viewpoint_distance_m", "target_in_sight")
    )
    views = [np.nan if d is None or s is None else d if s else np.inf for d, s in zip(distance, sight, strict=True)]
    if np.isnan(columns["euclidean_m"]).any():
        raise StoreError(
            "these episodes have no scores: the release withholds the goals; its owner scores a submission"
        )
    for name in _LENGTHS:
        if not (np.isfinite(columns[name]) & (columns[name] >= 0.0)).all():
            raise StoreError(f"episodes: {name} has values that are no length: run the evaluation again")
    for where in ("", "horizontal_"):
        if (columns[f"min_{where}distance_m"] > columns[f"final_{where}distance_m"] + 1e-9).any():
            raise StoreError("episodes: a smallest distance exceeds the last one: run the evaluation again")
    columns["view_distance_m"] = np.array(views, dtype=np.float64)
    episodes = np.empty(table.num_rows, [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        episodes[name] = column
    return episodes


class Outcomes(NamedTuple):
    """Measures of every episode under a profile, (n,) each."""

    sr: Bools  # Success, σ
    sr_view: Floats  # NaN where views are not known
    osr: Bools  # Ever within the radius, whatever happens later
    spl: Floats  # σ·L / max(L, ℓ), in [0, 1]
    dts_m: Floats  # Distance to the goal at the end, metres
    cr: Bools  # Ended by a collision


def outcomes(episodes: Episodes, profile: Profile, nearest_m: Floats | None = None) -> Outcomes:
    """Judge every episode by a profile; one that begins at its goal has SPL 1 if it succeeds unmoved, else 0.

    `nearest_m` stands in for the log's smallest distances, which are those at poses.
    """
    final, nearest = distances(episodes, profile)
    nearest = nearest if nearest_m is None else np.minimum(nearest_m, final)
    may = may_succeed(episodes, profile)
    success = may & (final <= profile.radius_m)
    shortest = episodes["euclidean_m"] if profile.straight_reference else episodes["reference_length_m"]
    longer = np.maximum(shortest, episodes["path_length_m"])
    # Zero over zero: nothing to fly and nothing flown.
    efficiency = np.divide(shortest, longer, out=np.ones_like(shortest), where=longer > 0.0)
    spl = np.where(success, efficiency, 0.0)
    view = np.where(may & (episodes["view_distance_m"] <= profile.radius_m), 1.0, 0.0)
    # The log has no distance to viewpoints in the plane.
    view[np.isnan(episodes["view_distance_m"]) | profile.planar] = np.nan
    return Outcomes(success, view, nearest <= profile.radius_m, spl, final, episodes["collision"])


def knows_views(episodes: Episodes, profile: Profile) -> bool:
    """Whether SR-view is known for any episode, by a profile."""
    return not profile.planar and not bool(np.isnan(episodes["view_distance_m"]).all())


def distances(episodes: Episodes, profile: Profile) -> tuple[Floats, Floats]:
    """Return the last and the smallest distance to the goal, (n,) float64, metres, as a profile measures them."""
    plane = "horizontal_" if profile.planar else ""
    final = episodes[f"final_{plane}distance_m"]
    return final, np.minimum(episodes[f"min_{plane}distance_m"], final)


def may_succeed(episodes: Episodes, profile: Profile) -> Bools:
    """Which episodes succeed if they end near enough to the goal."""
    may = episodes["n_actions"] <= episodes["action_budget"]
    if profile.needs_stop:
        may &= episodes["stop_called"]
    if profile.fails_on_collision:
        may &= ~episodes["collision"]
    return may


class Score(NamedTuple):
    """Means over some episodes, or means of such means."""

    episodes: int  # Number of episodes
    sr: float
    sr_view: float
    osr: float
    spl: float
    dts_m: float
    cr: float


class Measure(NamedTuple):
    """How what is averaged over episodes is shown."""

    head: str  # Heading of its column; the arrow points to the better
    direction: int = 1  # 1 if higher is better, -1 if lower is
    metres: bool = False  # Else a share


MEASURES = {
    "sr": Measure("SR ↑"),
    "sr_view": Measure("SR-view ↑"),
    "osr": Measure("OSR ↑"),
    "spl": Measure("SPL ↑"),
    "dts_m": Measure("DTS ↓", -1, metres=True),
    "cr": Measure("CR ↓", -1),
}
METRICS = tuple(MEASURES)
# The paper's own.
PAPER_METRICS = tuple(metric for metric in METRICS if metric != "sr_view")


def score(values: Floats) -> Score:
    """Average the `METRICS` of episodes, (n, 6); NaN where there are none."""
    n = len(values)
    return Score(n, *(math.fsum(column) / n if n else math.nan for column in values.T))


def mean_score(scores: Sequence[Score]) -> Score:
    """Average scores, each with the same weight; every value is NaN where there are none."""
    means = score(np.array([s[1:] for s in scores], dtype=np.float64).reshape(-1, len(METRICS)))
    return means._replace(episodes=sum(s.episodes for s in scores))


def deviation(scores: Sequence[Score]) -> Score:
    """Standard deviation of scores (n - 1 in the denominator); NaN for fewer than two."""
    values = np.array([s[1:] for s in scores])
    spread = values.std(axis=0, ddof=1) if len(scores) > 1 else np.full(len(METRICS), math.nan)
    return Score(sum(s.episodes for s in scores), *(float(v) for v in spread))


@dataclass(frozen=True)
class Summary:
    """Scores of a log under a profile."""

    scenes: dict[str, Score]  # By scene, in the order of names
    family_of: dict[str, str]  # By scene
    families: dict[str, Score]  # Means over a family's scenes; families without episodes are left out
    overall: Score  # Mean of the families that are there
    deviation: Score  # Standard deviation over all scenes

    def scene_scores(self) -> list[Floats]:
        """Return the `METRICS` of every family's scenes, (scenes, 6) each."""
        return [
            np.array([score[1:] for name, score in self.scenes.items() if self.family_of[name] == family])
            for family in self.families
        ]


def summarize_values(values: Floats, scene: Strings, family: Strings) -> Summary:
    """Average the `METRICS` of episodes, (n, 6), by scene, family and overall."""
    masks = {name: scene == name for name in sorted(set(scene.tolist()))}
    scenes = {name: score(values[mask]) for name, mask in masks.items()}
    family_of = {name: str(family[mask][0]) for name, mask in masks.items()}
    order = [*FAMILIES.values(), *sorted(set(family_of.values()) - set(FAMILIES.values()))]
    families = {
        name: mean_score([scenes[member] for member, own in family_of.items() if own == name])
        for name in order
        if name in family_of.values()
    }
    return Summary(scenes, family_of, families, mean_score([*families.values()]), deviation([*scenes.values()]))


def summarize(episodes: Episodes, profile: Profile) -> Summary:
    """Average a log by scene, family and overall."""
    return summarize_values(np.column_stack(outcomes(episodes, profile)), episodes["scene"], episodes["family"])


RESAMPLES = 9_999


def bootstrap(scenes: Sequence[Floats]) -> Floats:
    """Return the 95 % percentile intervals, (2, 6), of the families' mean of scenes' `METRICS`; NaN for unknown."""
    ends = np.full((2, len(METRICS)), math.nan)
    if not scenes or min(map(len, scenes)) < 2:
        return ends
    from scipy.stats import bootstrap as resampled

    # A measure that is not known of a scene has no interval, and leaves the others theirs.
    known = np.all([np.isfinite(part).all(axis=0) for part in scenes], axis=0)

    def mean_of_families(*parts: Any, axis: int) -> Any:
        return sum(np.mean(part, axis=axis) for part in parts) / len(parts)

    found = resampled(
        tuple(part[:, known] for part in scenes), mean_of_families, n_resamples=RESAMPLES, confidence_level=0.95,
        axis=0, method="percentile", rng=rng.generator(0, "bootstrap", *map(len, scenes)),
    ).confidence_interval  # fmt: skip
    ends[:, known] = found.low, found.high
    return ends


def success_curve(episodes: Episodes, profile: Profile, radii_m: Floats) -> tuple[Floats, Floats]:
    """Overall SR and OSR, fractions (r,), at radii in metres, everything else by the profile."""
    # An episode's share of the overall mean: its scene's among its family's scenes, its family's among the families.
    _, first, scene, flown = np.unique(episodes["scene"], return_index=True, return_inverse=True, return_counts=True)
    families, family, scenes = np.unique(episodes["family"][first], return_inverse=True, return_counts=True)
    weight = (1.0 / (flown * scenes[family] * len(families)))[scene]
    final, nearest = distances(episodes, profile)
    may = may_succeed(episodes, profile)
    return _share_within(final[may], weight[may], radii_m), _share_within(nearest, weight, radii_m)


def _share_within(distance_m: Floats, weight: Floats, radii_m: Floats) -> Floats:
    order = np.argsort(distance_m)
    share = np.concatenate([[0.0], np.cumsum(weight[order])])
    return np.asarray(share[np.searchsorted(distance_m[order], radii_m, side="right")])
