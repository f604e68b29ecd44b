"""What every episode earns: success, oracle success, SPL, distance, collision (paper, section on evaluation).

An episode counts as a success by a `Profile`; `aerialdojo_gen.benchmark.scores` averages over episodes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.errors import StoreError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Strings = NDArray[np.str_]


@dataclass(frozen=True)
class Episodes:
    """Columns of an episode log, all of one length.

    Attributes
    ----------
    scene, family, scene_type, partition, setting, modality : (n,) str
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
    scene_type: Strings
    partition: Strings
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

    def where(self, mask: Bools | NDArray[np.int64]) -> Episodes:
        """Return the episodes that a mask or indices select."""
        return replace(self, **{f.name: getattr(self, f.name)[mask] for f in fields(self)})


_KINDS: dict[str, Any] = {
    **dict.fromkeys(("scene", "family", "scene_type", "partition", "setting", "modality"), np.str_),
    **dict.fromkeys(("stop_called", "collision"), np.bool_),
    **dict.fromkeys(("n_actions", "action_budget"), np.int64),
}


def episodes_of(table: pa.Table) -> Episodes:
    """Take the metrics' columns out of a table of episodes, and check them.

    Parameters
    ----------
    table : pyarrow.Table
        Rows of `aerialdojo_gen.store.schemas` ``episodes``.

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
    final, nearest = distances(episodes, profile)
    success = may_succeed(episodes, profile) & (final <= profile.radius_m)
    shortest = episodes.euclidean_m if profile.straight_reference else episodes.reference_length_m
    longer = np.maximum(shortest, episodes.path_length_m)
    # Nothing to fly and nothing flown is the shortest way there is.
    efficiency = np.divide(shortest, longer, out=np.ones_like(shortest), where=longer > 0.0)
    spl = np.where(success, efficiency, 0.0)
    return Outcomes(success, nearest <= profile.radius_m, spl, final, episodes.collision)


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
