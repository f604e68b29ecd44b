"""The paper's numbers of landmarks and objects a scene (its Table 10)."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path


@cache
def paper_counts() -> dict[str, tuple[int, int]]:
    """Read ``pipelines/paper/inventory.csv`` of the checkout, or the copy that a wheel carries.

    Returns
    -------
    dict of str to (int, int)
        By scene: number of landmarks, number of objects.
    """
    package = Path(__file__).resolve().parents[1]
    root = package.parent if (package.parent / "pipelines").is_dir() else package / "_shipped"
    with (root / "pipelines" / "paper" / "inventory.csv").open(encoding="utf-8", newline="") as file:
        return {row["scene"]: (int(row["landmarks"]), int(row["objects"])) for row in csv.DictReader(file)}
