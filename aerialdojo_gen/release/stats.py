"""What the release holds, beside the paper's tables: tasks by scene and setting, metres of route, splits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerialdojo_gen import store
from aerialdojo_gen.paper import PaperScene, inventory, splits
from aerialdojo_gen.schemas import SETTINGS


@dataclass(frozen=True)
class Made:
    """What the release holds of a scene.

    Attributes
    ----------
    scene : str
        Name.
    landmarks, objects : int
        How many.
    tasks : dict of (str, str) to int
        Navigation tasks by subset (train, test) and setting.
    path_m : float
        Summed length of their routes, metres.
    paper : PaperScene or None
        The paper's row.
    """

    scene: str
    landmarks: int
    objects: int
    tasks: dict[tuple[str, str], int]
    path_m: float
    paper: PaperScene | None

    def of(self, setting: str) -> int:
        """Navigation tasks of a setting."""
        return self.tasks.get(("train", setting), 0) + self.tasks.get(("test", setting), 0)


def made_of(data: Path, scene: str) -> Made:
    """Read what the release holds of a scene.

    Raises
    ------
    StoreError
        The scene is not in the release.
    """
    tasks: Counter[tuple[str, str]] = Counter()
    path = 0.0
    for subset in ("train", "test"):
        routes = store.read_scene(data, f"routes/{subset}", scene, ["setting", "length_m"])
        tasks.update((subset, setting) for setting in routes["setting"].to_pylist())
        path += float(np.sum(routes["length_m"].to_numpy()))
    landmarks, objects = (store.count_rows(data, f"release/{table}", scene) for table in ("landmarks", "objects"))
    return Made(scene, landmarks, objects, dict(tasks), path, inventory().get(scene))


def made_lines(made: Sequence[Made]) -> list[str]:
    """Set the release beside the paper's Table 10: ``ours`` where they agree, ``ours/paper`` where not.

    Settings count instances, two of which a navigation task has; kilometres are those of the tasks' routes.
    """
    head = f"{'scene':<22}{'landmarks':>10}{'objects':>9}"
    head += "".join(f"{s.replace('_horizon', ''):>15}" for s in (*SETTINGS, "instances")) + f"{'km (paper)':>22}"
    lines, unlike = [head], 0
    for m in made:
        ours = [m.landmarks, m.objects, *(2 * m.of(s) for s in SETTINGS)]
        paper = [m.paper.landmarks, m.paper.objects, *(2 * m.paper.tasks[s] for s in SETTINGS)] if m.paper else ours
        ours.append(sum(ours[2:]))
        paper = [*paper, sum(paper[2:])] if m.paper else ours
        unlike += sum(a != b for a, b in zip(ours, paper, strict=True))
        cells = [f"{a:,}" if a == b else f"{a:,}/{b:,}" for a, b in zip(ours, paper, strict=True)]
        km = f"{m.path_m / 1000:,.1f}" + (f" ({m.paper.path_m / 1000:,.1f})" if m.paper else "")
        lines.append(_line(m.scene, cells, km))
    total = [sum(m.landmarks for m in made), sum(m.objects for m in made)]
    total += [2 * sum(m.of(s) for m in made) for s in SETTINGS]
    total.append(sum(total[2:]))
    km = f"{sum(m.path_m for m in made) / 1000:,.1f}"
    if all(m.paper for m in made):
        km += f" ({sum(m.paper.path_m for m in made if m.paper) / 1000:,.1f})"
    widths = (10, 9, 15, 15, 15, 15)
    lines.append(
        f"{'all':<22}" + "".join(f"{t:,}".rjust(w) for t, w in zip(total, widths, strict=True)) + f"{km:>22}"
    )
    if any(m.paper for m in made):
        lines.append("every number is the paper's" if not unlike else f"{unlike} numbers are not the paper's")
    return lines


def _line(name: str, cells: Sequence[str], km: str) -> str:
    widths = (10, 9, 15, 15, 15, 15)
    return f"{name:<22}" + "".join(c.rjust(w) for c, w in zip(cells, widths, strict=True)) + f"{km:>22}"


def split_lines(made: Sequence[Made]) -> list[str]:
    """Set the release beside the paper's table of splits, in instances, as `made_lines` does."""
    lines = [f"{'partition':<12}{'subset':<8}" + "".join(f"{s:>18}" for s in (*SETTINGS, "instances"))]
    whole = {m.scene for m in made} >= set(inventory())
    for (partition, subset), cells in splits().items():
        ours = [
            2 * sum(m.tasks.get((subset, s), 0) for m in made if store.partition(m.scene).upper() == partition)
            for s in SETTINGS
        ]
        paper = [2 * cells[s] for s in SETTINGS] if whole else ours
        pairs = zip([*ours, sum(ours)], [*paper, sum(paper)], strict=True)
        lines.append(
            f"{partition:<12}{subset:<8}"
            + "".join(f"{a:,}".rjust(18) if a == b else f"{a:,}/{b:,}".rjust(18) for a, b in pairs)
        )
    return lines
