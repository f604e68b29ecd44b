"""What every episode earns: success, oracle success, SPL, distance, collision (paper, section on evaluation).

An episode counts as a success by a `Profile`; `aerialdojo_gen.benchmark.scores` averages over episodes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.benchmark.profiles import Profile

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Strings = NDArray[np.str_]


@dataclass(frozen=True)
class Episodes:
    """Columns of an episode log, all of one length."""

    scene: Strings  # (n,) str; what the episode belongs to
    family: Strings
    scene_type: Strings
    partition: Strings
    setting: Strings
    modality: Strings
    stop_called: Bools  # (n,) bool; how it ended; both may hold in one step
    collision: Bools
    n_actions: NDArray[np.int64]  # (n,) int64; actions taken, Stop included, and how many were allowed
    action_budget: NDArray[np.int64]
    final_distance_m: Floats  # (n,) float64
    min_distance_m: Floats
    final_horizontal_distance_m: Floats  # (n,) float64; the same in the plane
    min_horizontal_distance_m: Floats
    path_length_m: Floats  # (n,) float64; way flown, ℓ
    reference_length_m: Floats  # (n,) float64
    euclidean_m: Floats  # (n,) float64; straight distance from start to goal
    view_distance_m: Floats  # (n,) float64

    def __len__(self) -> int:
        """Return the number of episodes."""
        return len(self.scene)

    def where(self, mask: Bools | NDArray[np.int64]) -> Episodes:
        """Return the episodes that a mask or indices select."""
        return replace(self, **{f.name: getattr(self, f.name)[mask] for f in fields(self)})


_KINDS: dict[str, Any] = {
    **dict.fromkeys(("scene", "family", "scene_type", "partition", "setting", "modality"), np.str_),
    **dict.fromkeys(("stop_called", "collision"), np.bool_),
    **dict.fromkeys(("n_actions", "action_budget"), np.int64),
}


_DERIVED = ("view_distance_m",)


def episodes_of(table: pa.Table) -> Episodes:
    """Take the metrics' columns out of a table of episodes, and check them."""
    columns = {}
    for field in fields(Episodes):
        if field.name in _DERIVED:
            continue
        kind = _KINDS.get(field.name, np.float64)
        columns[field.name] = np.asarray(table.column(field.name).to_pylist(), dtype=kind)
    episodes = Episodes(**columns, view_distance_m=_view_distance_m(table))
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


def _view_distance_m(table: pa.Table) -> Floats:
    """Take `Episodes.view_distance_m` out of a table, which an older version may have written."""
    unknown = [None] * table.num_rows
    distance, sight = (
        table[name].to_pylist() if name in table.column_names else unknown
        for name in ("viewpoint_distance_m", "target_in_sight")
    )
    return np.array(
        [np.nan if d is None or s is None else d if s else np.inf for d, s in zip(distance, sight, strict=True)],
        dtype=np.float64,
    )


@dataclass(frozen=True)
class Outcomes:
    """What every episode earns under a profile."""

    success: Bools  # (n,) bool; σ; ever within the radius, whatever happens later; ended by a collision
    success_view: Floats  # (n,) float64
    oracle_success: Bools
    spl: Floats  # (n,) float64; σ·L / max(L, ℓ), in [0, 1]
    distance_m: Floats  # (n,) float64; distance to the goal at the end, metres
    collision: Bools


def outcomes(episodes: Episodes, profile: Profile) -> Outcomes:
    """Judge every episode by a profile.

    An episode that starts at its goal has L = 0: its SPL is 1 where it succeeds without moving, 0 where it moved.
    """
    final, nearest = distances(episodes, profile)
    may = may_succeed(episodes, profile)
    success = may & (final <= profile.radius_m)
    shortest = episodes.euclidean_m if profile.straight_reference else episodes.reference_length_m
    longer = np.maximum(shortest, episodes.path_length_m)
    # Nothing to fly and nothing flown is the shortest way there is.
    efficiency = np.divide(shortest, longer, out=np.ones_like(shortest), where=longer > 0.0)
    spl = np.where(success, efficiency, 0.0)
    view = np.where(may & (episodes.view_distance_m <= profile.radius_m), 1.0, 0.0)
    # The log has no distance to viewpoints in the plane.
    view[np.isnan(episodes.view_distance_m) | profile.planar] = np.nan
    return Outcomes(success, view, nearest <= profile.radius_m, spl, final, episodes.collision)


def knows_views(episodes: Episodes, profile: Profile) -> bool:
    """Whether a log says of any episode if it is a success at any viewpoint, by a profile."""
    return not profile.planar and not bool(np.isnan(episodes.view_distance_m).all())


def distances(episodes: Episodes, profile: Profile) -> tuple[Floats, Floats]:
    """Return the last and the smallest distance to the goal, (n,) float64, metres, as a profile measures them."""
    if profile.planar:
        final, nearest = episodes.final_horizontal_distance_m, episodes.min_horizontal_distance_m
    else:
        final, nearest = episodes.final_distance_m, episodes.min_distance_m
    return final, np.minimum(nearest, final)


def may_succeed(episodes: Episodes, profile: Profile) -> Bools:
    """Tell which episodes succeed if only they are near enough."""
    may = episodes.n_actions <= episodes.action_budget
    if profile.needs_stop:
        may &= episodes.stop_called
    if profile.fails_on_collision:
        may &= ~episodes.collision
    return may
