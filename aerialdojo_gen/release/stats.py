"""What the release holds, beside the paper's tables: in all, by family, by scene (its Table 10) and by split."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerialdojo_gen import store
from aerialdojo_gen.paper import PaperScene, inventory, splits
from aerialdojo_gen.release.comparison import Column, Comparison, Row
from aerialdojo_gen.schemas import FAMILIES, SETTINGS

_COUNTS = tuple(Column(name) for name in ("landmarks", "objects", "base", "standard", "long", "instances"))
_KM = Column("km", "km", exact=False)


@dataclass(frozen=True)
class Made:
    """What the release holds of a scene.

    Attributes
    ----------
    scene : str
        Name.
    family, scene_type : str
        Of the scene.
    landmarks, objects : int
        How many.
    categories : frozenset of str
        Of the objects.
    tasks : dict of (str, str) to int
        Navigation tasks by subset (train, test) and setting.
    path_m : float
        Summed length of their routes, metres.
    paper : PaperScene or None
        The paper's row.
    """

    scene: str
    family: str
    scene_type: str
    landmarks: int
    objects: int
    categories: frozenset[str]
    tasks: dict[tuple[str, str], int]
    path_m: float
    paper: PaperScene | None

    def of(self, setting: str, subset: str | None = None) -> int:
        """Navigation tasks of a setting, and of one subset where that is named."""
        return sum(n for (part, s), n in self.tasks.items() if s == setting and subset in (None, part))

    @property
    def instances(self) -> int:
        """Task instances: a navigation task has two."""
        return 2 * sum(self.tasks.values())


def made_of(data: Path, scene: str) -> Made:
    """Read what the release holds of a scene.

    Raises
    ------
    StoreError
        A part of the scene is missing or damaged.
    """
    tasks: Counter[tuple[str, str]] = Counter()
    path = 0.0
    for subset in ("train", "test"):
        routes = store.read_scene(data, f"routes/{subset}", scene, ["setting", "length_m"])
        tasks.update((subset, setting) for setting in routes["setting"].to_pylist())
        path += float(np.sum(routes["length_m"].to_numpy()))
    row = store.read_scene(data, "release/scenes", scene, ["family", "scene_type"]).to_pylist()[0]
    categories = store.read_scene(data, "release/objects", scene, ["category"])["category"].to_pylist()
    return Made(
        scene=scene,
        family=row["family"],
        scene_type=row["scene_type"],
        landmarks=store.count_rows(data, "release/landmarks", scene),
        objects=len(categories),
        categories=frozenset(categories),
        tasks=dict(tasks),
        path_m=path,
        paper=inventory().get(scene),
    )


def _figures(made: Sequence[Made]) -> tuple[int | float, ...]:
    settings = [2 * sum(m.of(s) for m in made) for s in SETTINGS]
    return (
        sum(m.landmarks for m in made), sum(m.objects for m in made), *settings, sum(settings),
        sum(m.path_m for m in made) / 1000,
    )  # fmt: skip


def _paper_figures(made: Sequence[Made]) -> tuple[int | float | None, ...]:
    """The paper's figures of these scenes; none where it does not have one of them."""
    rows = [m.paper for m in made if m.paper]
    if len(rows) < len(made):
        return (None,) * (len(_COUNTS) + 1)
    settings = [2 * sum(row.tasks[s] for row in rows) for s in SETTINGS]
    return (
        sum(row.landmarks for row in rows), sum(row.objects for row in rows), *settings, sum(settings),
        sum(row.path_m for row in rows) / 1000,
    )  # fmt: skip


def in_paper_order(made: Sequence[Made]) -> list[Made]:
    """Sort scenes as the paper's Table 10 does, others behind them by name."""
    order = {name: k for k, name in enumerate(inventory())}
    return sorted(made, key=lambda m: (order.get(m.scene, len(order)), m.scene))


def scene_table(made: Sequence[Made]) -> Comparison:
    """Set the scenes beside the paper's Table 10; settings count instances."""
    rows = [Row(m.scene, _figures([m]), _paper_figures([m])) for m in made]
    rows.append(Row("all", _figures(made), _paper_figures(made)))
    title = "Scenes (the paper's Table 10)" if any(m.paper for m in made) else "Scenes"
    return Comparison(title, "scene", (*_COUNTS, _KM), tuple(rows))


def family_table(made: Sequence[Made]) -> Comparison:
    """Sum the scenes, and the paper's Table 10, by family."""
    groups = [(family, [m for m in made if m.family == family]) for family in FAMILIES.values()]
    groups += [
        (f, [m for m in made if m.family == f]) for f in sorted({m.family for m in made} - {*FAMILIES.values()})
    ]
    rows = []
    for name, group in [*(g for g in groups if g[1]), ("all", list(made))]:
        ours, paper = _figures(group), _paper_figures(group)
        known = len(group) if paper[0] is not None else None
        rows.append(Row(name, (len(group), *ours), (known, *paper)))
    return Comparison("Families", "family", (Column("scenes"), *_COUNTS, _KM), tuple(rows))


def split_table(made: Sequence[Made]) -> Comparison:
    """Set the splits beside the paper's table of them, in instances; a part of the scenes has no paper's figures."""
    whole = {m.scene for m in made} >= set(inventory())
    rows = []
    for (partition, subset), cells in splits().items():
        group = [m for m in made if store.partition(m.scene).upper() == partition]
        ours = [2 * sum(m.of(s, subset) for m in group) for s in SETTINGS]
        paper = [2 * cells[s] for s in SETTINGS]
        known = (*paper, sum(paper)) if whole else (None,) * 4
        rows.append(Row(f"{partition} {subset}", (*ours, sum(ours)), known))
    ours_all = tuple(sum(column) for column in zip(*(row.ours for row in rows), strict=True))
    paper_all = (
        tuple(sum(column) for column in zip(*(row.paper for row in rows), strict=True)) if whole else (None,) * 4
    )
    return Comparison("Splits", "split", _COUNTS[2:], (*rows, Row("all", ours_all, paper_all)))


def total_table(made: Sequence[Made]) -> Comparison:
    """Say what the benchmark holds as a whole.

    The paper's own summary (its Table 2) is not among the files that come with this program: its figures here are the
    sums of its Table 10.
    """
    ours, paper = _figures(made), _paper_figures(made)
    known = paper[0] is not None
    rows = [
        Row(name, (n,), (n if known else None,))
        for name, n in (
            ("families", len({m.family for m in made})),
            ("scene types", len({m.scene_type for m in made})),
            ("scenes", len(made)),
        )
    ]
    rows += [Row(c.name, (a,), (b,)) for c, a, b in zip(_COUNTS[:2], ours, paper, strict=False)]
    rows.append(Row("object categories", (len(frozenset().union(*(m.categories for m in made))),), (None,)))
    names = ("instances, base", "instances, standard", "instances, long-horizon", "instances")
    rows += [Row(name, (a,), (b,)) for name, a, b in zip(names, ours[2:6], paper[2:6], strict=True)]
    tasks = [None if n is None else int(n) // 2 for n in (ours[5], paper[5])]
    rows.append(Row("navigation tasks", (tasks[0],), (tasks[1],)))
    rows.append(Row("routes in all, km", (ours[6],), (paper[6],)))
    means = [
        1000 * km / n if km is not None and n else None for km, n in zip((ours[6], paper[6]), tasks, strict=True)
    ]
    rows.append(Row("mean route, m", (means[0],), (means[1],)))
    return Comparison("The benchmark as a whole", "", (Column("figure", exact=False),), tuple(rows))


def tables(made: Sequence[Made]) -> list[Comparison]:
    """Make all tables: the whole, families, scenes, splits."""
    return [total_table(made), family_table(made), scene_table(made), split_table(made)]
