"""How many candidates `filter` kept of each scene, compared with the paper's counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow.compute as pc

from aerialdojo_gen.base.errors import PoolError
from aerialdojo_gen.base.paper_figures import PaperScene, inventory
from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where
from aerialdojo_gen.store.schemas import SETTINGS


@dataclass(frozen=True)
class Pool:
    """A scene's kept candidates, and the paper's counts."""

    scene: str  # Name
    candidates: int
    judged: int
    kept: dict[str, int]  # Kept candidates by setting
    paper_row: PaperScene | None  # The paper's row; None for a scene that the paper does not have
    path_m: tuple[float, float] | None  # (float, float) or None

    @property
    def short(self) -> dict[str, int]:
        """Missing tasks per setting; settings with enough are left out."""
        required = self.paper_row.tasks if self.paper_row else {}
        return {s: n - self.kept[s] for s, n in required.items() if self.kept[s] < n}

    @property
    def reaches_path(self) -> bool:
        """Whether a selection can have the paper's total length to within 1 %."""
        if self.paper_row is None or self.path_m is None:
            return False
        return self.path_m[0] <= 1.01 * self.paper_row.path_m and self.path_m[1] >= 0.99 * self.paper_row.path_m


def pool_of(root: Where, scene: str) -> Pool:
    """Count the candidates that `filter` kept of a scene."""
    verdicts = store.read_scene(root, "verdicts", scene)
    keep = verdicts["keep"].to_numpy(zero_copy_only=False)
    setting = np.asarray(verdicts["setting"].to_pylist(), dtype=object)
    plans = store.read_scene(root, "plans", scene, ["pair_id", "length_m"])
    rows = pc.index_in(verdicts["pair_id"], value_set=plans["pair_id"].combine_chunks())
    length = plans["length_m"].take(rows).to_numpy()
    lengths = {s: np.sort(length[keep & (setting == s)]) for s in SETTINGS}
    paper_row = inventory().get(scene)
    path = None
    if paper_row is not None and all(len(lengths[s]) >= n for s, n in paper_row.tasks.items()):
        least = sum(float(lengths[s][:n].sum()) for s, n in paper_row.tasks.items())
        most = sum(float(lengths[s][len(lengths[s]) - n :].sum()) for s, n in paper_row.tasks.items())
        path = least, most
    judged = sum(reason != "not_needed" for reason in verdicts["reason"].to_pylist())
    return Pool(scene, verdicts.num_rows, judged, {s: len(v) for s, v in lengths.items()}, paper_row, path)


def require_pools(root: Where, scenes: Sequence[str]) -> None:
    """Raise a `PoolError` that names every scene and setting with fewer kept candidates than the paper has tasks."""
    shortages = [
        f"{pool.scene}: {n} {setting} tasks short: {pool.kept[setting]} are kept, "
        f"the paper has {pool.kept[setting] + n}"
        for pool in (pool_of(root, scene) for scene in scenes)
        for setting, n in pool.short.items()
    ]
    if shortages:
        remedy = "move objects or obstacles in the recipe, or draft the annotations anew with another --within"
        raise PoolError("\n".join([*shortages, f"nothing is released; {remedy}"]))


def pool_lines(pools: Sequence[Pool], width: int | None = None) -> list[str]:
    """Format pools as a table: kept / required, and the range of kilometres that a selection can reach."""
    heads = ["candidates", "judged", *(s.replace("_horizon", "") for s in SETTINGS), "km reachable/paper"]
    rows = []
    for pool in pools:
        cells = [f"{pool.candidates}", f"{pool.judged}"]
        for s in SETTINGS:
            required = f"/{pool.paper_row.tasks[s]}" if pool.paper_row else ""
            cells.append(f"{pool.kept[s]}{required}{'!' if s in pool.short else ' '}")
        reach = f"{pool.path_m[0] / 1000:.1f}-{pool.path_m[1] / 1000:.1f}" if pool.path_m else "-"
        paper_km = (
            f"/{pool.paper_row.path_m / 1000:.1f}{' ' if pool.reaches_path else '!'}" if pool.paper_row else " "
        )
        cells.append(reach + paper_km)
        rows.append((pool.scene, cells))
    return TextTable("scene", [Column(head) for head in heads], rows).lines(width)
