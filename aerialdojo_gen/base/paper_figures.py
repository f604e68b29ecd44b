"""The paper's own figures, carried as CSV files beside the pipelines.

Its Tables 1, 2, 4, 5 and 10, its table of splits, and the shares that its appendix C names.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from aerialdojo_gen.base.constants import SETTINGS
from aerialdojo_gen.base.shipped import home


@dataclass(frozen=True)
class PaperScene:
    """One row of the paper's Table 10."""

    scene: str  # Name
    landmarks: int  # How many are annotated
    objects: int
    base: int  # Navigation tasks of each length setting; a task has two instances
    standard: int
    long_horizon: int
    path_m: float  # Summed length of the reference trajectories, metres

    @property
    def tasks(self) -> dict[str, int]:
        """Navigation tasks by setting."""
        return {name: getattr(self, name) for name in SETTINGS}


@cache
def inventory() -> dict[str, PaperScene]:
    """Read the paper's Table 10: 42 scenes by name."""
    return {
        row["scene"]: PaperScene(
            row["scene"], int(row["landmarks"]), int(row["objects"]), int(row["base"]) // 2,
            int(row["standard"]) // 2, int(row["long_horizon"]) // 2, 1000.0 * float(row["path_km"]),
        )
        for row in _rows("inventory.csv")
    }  # fmt: skip


def paper_counts() -> dict[str, tuple[int, int]]:
    """Return the numbers of landmarks and objects by scene."""
    return {name: (row.landmarks, row.objects) for name, row in inventory().items()}


@cache
def splits() -> dict[tuple[str, str], dict[str, int]]:
    """Read the paper's table of splits."""
    return {(r["partition"], r["subset"]): {s: int(r[s]) // 2 for s in SETTINGS} for r in _rows("splits.csv")}


@dataclass(frozen=True)
class PaperResult:
    """A row of the paper's Table 4 (Base) or 5 (Standard): flown in its simulator, Unreal Engine."""

    setting: str  # ``base`` or ``standard``
    group: str  # ``open`` or ``closed``, of the model's source
    model: str
    mean: dict[tuple[str, float], float]  # By metric and radius in metres
    spread: dict[tuple[str, float], float]
    source: str  # Table of the paper


_MEASURED = {
    ("sr", 3.0): "sr_3m", ("osr", 3.0): "osr_3m", ("spl", 3.0): "spl_3m", ("dts_m", 3.0): "dts_3m",
    ("cr", 3.0): "cr_3m", ("sr", 5.0): "sr_5m", ("osr", 5.0): "osr_5m",
}  # fmt: skip


@cache
def results() -> tuple[PaperResult, ...]:
    """Read the paper's Tables 4 and 5, in their order."""

    def values(row: dict[str, str], kind: str) -> dict[tuple[str, float], float]:
        return {
            (metric, radius_m): float(row[f"{column}_{kind}"]) / (1.0 if metric == "dts_m" else 100.0)
            for (metric, radius_m), column in _MEASURED.items()
        }

    return tuple(
        PaperResult(r["setting"], r["group"], r["model"], values(r, "mean"), values(r, "std"), r["source"])
        for r in _rows("results.csv")
    )


@cache
def benchmarks() -> tuple[dict[str, str], ...]:
    """Read the paper's Table 1, cells as they are printed; families are letters, as scenes' names begin."""
    return tuple(_rows("benchmarks.csv"))


@cache
def family_counts() -> dict[str, dict[str, float]]:
    """Read the paper's Table 2 by family: types, scenes, landmarks, objects, anchors, instances, path_km."""
    return {
        row["family"]: {name: float(value) for name, value in row.items() if name not in ("family", "source")}
        for row in _rows("families.csv")
    }


@cache
def shares() -> dict[str, float]:
    """Read the shares of appendix C, per cent of all task instances, or of the partition's for ``ID train``."""
    return {row["share"]: float(row["percent"]) for row in _rows("shares.csv")}


def files() -> list[Path]:
    """Return the CSV files that stages take quotas from."""
    return [home() / "pipelines" / "paper" / name for name in ("inventory.csv", "splits.csv")]


def _rows(name: str) -> list[dict[str, str]]:
    with (home() / "pipelines" / "paper" / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
