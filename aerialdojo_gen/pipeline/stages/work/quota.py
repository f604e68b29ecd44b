"""Random draws by key: which kept candidates are released by the paper's counts, and which of them train."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import DETOUR
from aerialdojo_gen.base.paper_figures import PaperScene
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.store.layout import partition

Floats = NDArray[np.float64]
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
