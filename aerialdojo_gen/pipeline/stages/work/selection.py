"""Which kept candidates train and which test."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.rng import rank


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
