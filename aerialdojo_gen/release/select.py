"""Which kept candidates train and which test."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.rng import rank


def nav_id(scene: str, pair_id: str) -> str:
    """Name a navigation task without telling its target: the pair's id would.

    Returns
    -------
    str
        The scene and 12 hexadecimal digits of a hash of the pair, e.g. ``"U_Mall_0-3f0c51d2a9be"``.
    """
    return f"{scene}-{hashlib.blake2b(f'{scene}/{pair_id}'.encode(), digest_size=6).hexdigest()}"


def train_mask(nav_ids: Sequence[str], settings: Sequence[str], fraction: float, seed: int) -> NDArray[np.bool_]:
    """Choose the navigation tasks that train, the same share in each setting.

    Parameters
    ----------
    nav_ids, settings : sequences of n str
        The tasks and their length settings.
    fraction : float
        Share that trains, in [0, 1]; a setting's number is rounded half up.
    seed : int
        Of the pipeline. A task's place depends on the seed and its id, not on its row.

    Returns
    -------
    (n,) bool
        True for training. Both instances of a task follow it.
    """
    mask = np.zeros(len(nav_ids), dtype=bool)
    for setting in sorted(set(settings)):
        rows = [i for i, s in enumerate(settings) if s == setting]
        rows.sort(key=lambda i: rank(seed, "split", nav_ids[i]))
        mask[rows[: int(fraction * len(rows) + 0.5)]] = True
    return mask
