"""Samples joined to batches, and batches taken apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

# What a sample has once, and not for every step.
WHOLE = ("step", "tokens", "image", "has_image")


def collate(samples: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Join samples to a batch, as `Trajectories.batch` gives it: a ``collate_fn`` that needs no torch.

    Parameters
    ----------
    samples : sequence of dict
        Of one data set; of different T they are padded at their front.

    Returns
    -------
    dict
        Arrays that lead with the sample, and lists of texts.
    """
    window = max(len(sample["mask"]) for sample in samples)
    out: dict[str, Any] = {}
    for name, first in samples[0].items():
        values = [sample[name] for sample in samples]
        if isinstance(first, str):
            out[name] = values
        elif name in WHOLE:
            out[name] = np.stack(values)
        else:
            out[name] = np.stack(
                [np.concatenate([np.zeros((window - len(v), *v.shape[1:]), v.dtype), v]) for v in values]
            )
    return out


def unbatched(batch: dict[str, Any], k: int, whole: bool) -> dict[str, Any]:
    """Return one of a batch's samples; a whole trajectory without what it was padded with."""
    begin = int(batch["mask"][k].argmax()) if whole else 0
    return {
        name: value[k] if isinstance(value, list) or name in WHOLE else value[k, begin:]
        for name, value in batch.items()
    }


def scattered(seen: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[Any]:
    """Put rows in their places of a mask, and zeros elsewhere."""
    out = np.zeros((*mask.shape, *seen.shape[1:]), seen.dtype)
    out[mask] = seen
    return out
