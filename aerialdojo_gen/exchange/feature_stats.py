"""What LeRobot keeps of a feature's values: least, most, mean, deviation and quantiles, exact."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Stats = dict[str, list[Any]]


def of_rows(values: NDArray[Any]) -> Stats:
    """Statistics of the rows of an (n, d) array.

    Min, max, mean, std and quantiles of d numbers each, and the count.
    """
    table = np.asarray(values, np.float64).reshape(len(values), -1)
    levels = np.quantile(table, list(QUANTILES.values()), axis=0)
    return {
        "min": table.min(axis=0).tolist(),
        "max": table.max(axis=0).tolist(),
        "mean": table.mean(axis=0).tolist(),
        "std": table.std(axis=0).tolist(),
        "count": [len(table)],
        **{name: levels[k].tolist() for k, name in enumerate(QUANTILES)},
    }


def of_counts(counts: NDArray[np.int64], values: NDArray[np.float64], frames: int) -> Stats:
    """Statistics of pictures from counts (channels, n) of the values (n,), shaped (channels, 1.

    1) as LeRobot has them.
    """
    total = counts.sum(axis=1).astype(np.float64)
    mean = counts @ values / total
    # Of the differences, not of the squares: those of large values cancel.
    deviation = np.sqrt(np.einsum("cv,cv->c", counts, (values[None] - mean[:, None]) ** 2) / total)
    reached = np.cumsum(counts, axis=1)
    found = {
        "min": values[(counts > 0).argmax(axis=1)],
        "max": values[-1 - (counts[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": deviation,
        **{
            name: values[(reached >= np.ceil(level * total)[:, None]).argmax(axis=1)]
            for name, level in QUANTILES.items()
        },
    }
    shaped: Stats = {name: of.reshape(-1, 1, 1).tolist() for name, of in found.items()}
    return {**shaped, "count": [frames]}
