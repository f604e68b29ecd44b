"""Which kept candidates train and which test."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.rng import rank


def lot(scene: str, pair_id: str) -> str:
    """Return what a candidate draws with: it hangs on the pair alone, so that no salt changes which are released.

    Returns
    -------
    str
        The scene and 12 hexadecimal digits of a hash of the pair. It is in no table, for it tells the pair.
    """
    return f"{scene}-{hashlib.blake2b(f'{scene}/{pair_id}'.encode(), digest_size=6).hexdigest()}"


def train_counts(settings: Sequence[str], fraction: float) -> dict[str, int]:
    """Return how many tasks of each setting train: the same share of each, rounded half up."""
    return {setting: int(fraction * n + 0.5) for setting, n in Counter(settings).items()}


def train_mask(
    lots: Sequence[str], settings: Sequence[str], trains: Mapping[str, int], seed: int
) -> NDArray[np.bool_]:
    """Choose the navigation tasks that train.

    Parameters
    ----------
    lots, settings : sequences of n str
        What the tasks draw with, and their length settings.
    trains : mapping of str to int
        How many of each setting train.
    seed : int
        Of the pipeline. A task's place depends on the seed and its lot, not on its row.

    Returns
    -------
    (n,) bool
        True for training. Both instances of a task follow it.
    """
    mask = np.zeros(len(lots), dtype=bool)
    for setting, n in trains.items():
        rows = [i for i, s in enumerate(settings) if s == setting]
        rows.sort(key=lambda i: rank(seed, "split", lots[i]))
        mask[rows[:n]] = True
    return mask
