"""The paper's own figures (its Table 10 and its table of splits), carried as CSV files beside the pipelines."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class PaperScene:
    """One row of the paper's Table 10.

    Attributes
    ----------
    scene : str
        Name.
    landmarks, objects : int
        How many are annotated.
    base, standard, long_horizon : int
        Navigation tasks of each length setting; a task has two instances.
    path_m : float
        Summed length of the reference trajectories, metres.
    """

    scene: str
    landmarks: int
    objects: int
    base: int
    standard: int
    long_horizon: int
    path_m: float

    @property
    def tasks(self) -> dict[str, int]:
        """Navigation tasks by setting."""
        return {"base": self.base, "standard": self.standard, "long_horizon": self.long_horizon}


@cache
def inventory() -> dict[str, PaperScene]:
    """Read the paper's Table 10: 42 scenes by name."""
    rows = _rows("inventory.csv")
    return {
        row["scene"]: PaperScene(
            scene=row["scene"],
            landmarks=int(row["landmarks"]),
            objects=int(row["objects"]),
            base=int(row["base"]) // 2,
            standard=int(row["standard"]) // 2,
            long_horizon=int(row["long_horizon"]) // 2,
            path_m=1000.0 * float(row["path_km"]),
        )
        for row in rows
    }


def paper_counts() -> dict[str, tuple[int, int]]:
    """Return the numbers of landmarks and objects by scene."""
    return {name: (row.landmarks, row.objects) for name, row in inventory().items()}


@cache
def splits() -> dict[tuple[str, str], dict[str, int]]:
    """Read the paper's table of splits.

    Returns
    -------
    dict
        ``{("ID", "train"): {"base": 20320, "standard": 24199, "long_horizon": 12302}, …}``, navigation tasks.
    """
    settings = ("base", "standard", "long_horizon")
    return {(r["partition"], r["subset"]): {s: int(r[s]) // 2 for s in settings} for r in _rows("splits.csv")}


def files() -> list[Path]:
    """Return the CSV files that the figures are read from."""
    # In a checkout the pipelines lie beside the package, in a wheel within it.
    package = Path(__file__).resolve().parent
    root = package.parent if (package.parent / "pipelines").is_dir() else package / "_shipped"
    return [root / "pipelines" / "paper" / name for name in ("inventory.csv", "splits.csv")]


def _rows(name: str) -> list[dict[str, str]]:
    path = next(path for path in files() if path.name == name)
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
