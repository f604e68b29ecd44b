"""Tables of a release and the paper's figures: in total, by family, by scene (its Table 10) and by split."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.base.paper_figures import PaperScene, benchmarks, family_counts, inventory, shares, splits
from aerialdojo_gen.dataset.stats.comparison import Column, Comparison, Figure, Listing, Row
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

_COUNTS = tuple(Column(name) for name in ("landmarks", "objects", "base", "standard", "long", "instances"))
_KM = Column("km", "km", exact=False)
SETTING_NAMES = dict(zip(SETTINGS, ("base", "standard", "long-horizon"), strict=True))


@dataclass(frozen=True)
class Made:
    """What the release holds of a scene."""

    scene: str  # Name
    family: str  # Of the scene
    scene_type: str
    landmarks: int  # How many; of the anchors those that end a search
    objects: int
    categories: frozenset[str]  # Of the objects
    tasks: dict[tuple[str, str], int]  # Navigation tasks by subset (train, test) and setting
    path_m: float  # Summed length of their routes, metres
    paper_scene: PaperScene | None  # The paper's row
    anchors: int = 0

    def of(self, setting: str, subset: str | None = None) -> int:
        """Navigation tasks of a setting, and of one subset where that is named."""
        return sum(n for (part, s), n in self.tasks.items() if s == setting and subset in (None, part))

    @property
    def instances(self) -> int:
        """Task instances: a navigation task has two."""
        return 2 * sum(self.tasks.values())


def family_order(there: Iterable[str]) -> list[str]:
    """Order families as the paper has them, others behind them by name."""
    names = set(there)
    return [*(family for family in FAMILIES.values() if family in names), *sorted(names - {*FAMILIES.values()})]


def made_of(data: Where, scene: str) -> Made:
    """Read what the release holds of a scene."""
    root = open_root(data)
    tasks: Counter[tuple[str, str]] = Counter()
    path = 0.0
    for subset in ("train", "test"):
        routes = store.read_scene(root, f"routes/{subset}", scene, ["setting", "length_m"])
        tasks.update((subset, setting) for setting in routes["setting"].to_pylist())
        path += float(np.sum(routes["length_m"].to_numpy()))
    row = store.read_scene(root, "release/scenes", scene, ["family", "scene_type"]).to_pylist()[0]
    categories = store.read_scene(root, "release/objects", scene, ["category"])["category"].to_pylist()
    return Made(
        scene=scene,
        family=row["family"],
        scene_type=row["scene_type"],
        landmarks=store.count_rows(root, "release/landmarks", scene),
        objects=len(categories),
        categories=frozenset(categories),
        tasks=dict(tasks),
        path_m=path,
        paper_scene=inventory().get(scene),
        anchors=sum(store.read_scene(root, "release/anchors", scene, ["selected"])["selected"].to_pylist()),
    )


def _whole(made: Sequence[Made]) -> bool:
    """Whether all of the paper's scenes are there, and are to be held to its figures."""
    return {m.scene for m in made if m.paper_scene} >= set(inventory())


def _figures(made: Sequence[Made]) -> tuple[int | float, ...]:
    return _sums(made, [2 * sum(m.of(s) for m in made) for s in SETTINGS])


def _paper_figures(made: Sequence[Made]) -> tuple[int | float | None, ...]:
    """The paper's figures of these scenes; none where it does not have one of them."""
    rows = [m.paper_scene for m in made if m.paper_scene]
    if len(rows) < len(made):
        return (None,) * (len(_COUNTS) + 1)
    return _sums(rows, [2 * sum(row.tasks[s] for row in rows) for s in SETTINGS])


def _sums(rows: Sequence[Made | PaperScene], settings: list[int]) -> tuple[int | float, ...]:
    """Landmarks, objects, instances by setting and in all, and kilometres."""
    counts = sum(row.landmarks for row in rows), sum(row.objects for row in rows), *settings, sum(settings)
    return *counts, sum(row.path_m for row in rows) / 1000


def in_paper_order(made: Sequence[Made]) -> list[Made]:
    """Sort scenes as the paper's Table 10 does, others behind them by name."""
    order = {name: k for k, name in enumerate(inventory())}
    return sorted(made, key=lambda m: (order.get(m.scene, len(order)), m.scene))


def scene_table(made: Sequence[Made]) -> Comparison:
    """Table of the scenes and the paper's Table 10; settings count instances."""
    rows = [Row(m.scene, _figures([m]), _paper_figures([m])) for m in made]
    rows.append(Row("all", _figures(made), _paper_figures(made)))
    title = "Scenes (the paper's Table 10)" if any(m.paper_scene for m in made) else "Scenes"
    return Comparison(title, "scene", (*_COUNTS, _KM), tuple(rows))


def family_table(made: Sequence[Made]) -> Comparison:
    """Table of the families, the paper's Table 2 (Types and Anchors) and the sums of its Table 10."""
    rows = []
    for name in (*family_order(m.family for m in made), "all"):
        group = [m for m in made if name in (m.family, "all")]
        ours, papers = _figures(group), _paper_figures(group)
        known = len(group) if papers[0] is not None else None
        types, anchors = len({m.scene_type for m in group}), sum(m.anchors for m in group)
        # The paper counts these by family: of a part of a family's scenes it says nothing.
        named = [f for n, f in family_counts().items() if name in (n, "all")]
        whole = bool(named) and known == sum(int(f["scenes"]) for f in named)
        totals = [sum(int(f[column]) for f in named) if whole else None for column in ("types", "anchors")]
        theirs = (totals[0], known, *papers[:2], totals[1], *papers[2:])
        rows.append(Row(name, (types, len(group), *ours[:2], anchors, *ours[2:]), theirs))
    columns = (Column("types"), Column("scenes"), *_COUNTS[:2], Column("anchors"), *_COUNTS[2:], _KM)
    title = "Families (the paper's Table 2)" if any(m.paper_scene for m in made) else "Families"
    return Comparison(title, "family", columns, tuple(rows))


def share_table(made: Sequence[Made]) -> Comparison:
    """Say which share of the instances has what (the paper's appendix C)."""
    total = sum(m.instances for m in made)
    whole = _whole(made)

    def share(part: Iterable[int], of: int = total) -> float | None:
        return 100.0 * sum(part) / of if of else None

    ours: dict[str, float | None] = {s: share(2 * m.of(s) for m in made) for s in SETTINGS}
    ours |= {family: share(m.instances for m in made if m.family == family) for family in FAMILIES.values()}
    ours["Mall"] = share(m.instances for m in made if m.scene_type == "Mall")
    for partition in ("ID", "OOD"):
        group = [m for m in made if store.partition(m.scene).upper() == partition]
        n = sum(m.instances for m in group)
        ours[partition] = share([n])
        ours[f"{partition} train"] = share((2 * m.of(s, "train") for m in group for s in SETTINGS), n)
    names = {"Mall": "malls", "ID train": "ID: of these, train", "OOD train": "OOD: of these, train"} | SETTING_NAMES
    rows = [Row(names.get(key, key), (own,), (shares()[key] if whole else None,)) for key, own in ours.items()]
    title = "Shares of the task instances (the paper's appendix C)" if whole else "Shares of the task instances"
    return Comparison(title, "share of", (Column("%", "%", exact=False, digits=2),), tuple(rows))


def mean_length_table(made: Sequence[Made]) -> Comparison:
    """Say how long routes are in the mean, every navigation task counted once (the paper's appendix C)."""
    rows = []
    for name in (*FAMILIES.values(), "all"):
        group = [m for m in made if name in (m.family, "all")]
        n = sum(m.instances for m in group) // 2
        if not n:
            continue
        papers, whole = _paper_figures(group), _whole(made)
        theirs = 1000.0 * papers[6] / (papers[5] / 2) if whole and papers[5] and papers[6] is not None else None
        rows.append(Row(name, (sum(m.path_m for m in group) / n,), (theirs,)))
    column = Column("m", "m", exact=False, digits=2)
    return Comparison("Mean length of the reference trajectories", "family", (column,), tuple(rows))


def benchmark_table(made: Sequence[Made]) -> Listing:
    """Set the release below the benchmarks of the paper's Table 1."""
    heads = ("benchmark", "year", "task", "DoF", "goal type", "goal specification", "tasks", "families", "scenes")
    rows = [tuple(value for key, value in row.items() if key != "source") for row in benchmarks()]
    there = {m.family for m in made}
    letters = " ".join(letter for letter, family in FAMILIES.items() if family in there)
    n = sum(m.instances for m in made)
    rows.append(("this release", "", "OGS", "4", "instance", "semantic or image", f"{n:,}", letters, f"{len(made)}"))
    notes = ("Families: U(rban), N(atural), I(nfrastructure), D(isaster).",)
    return Listing("Aerial benchmarks (the paper's Table 1)", heads, tuple(rows), notes)


def split_table(made: Sequence[Made]) -> Comparison:
    """Table of the splits and the paper's figures, in instances; without those for a part of the scenes."""
    whole = _whole(made)
    figures = {}
    for (partition, subset), cells in splits().items():
        group = [m for m in made if store.partition(m.scene).upper() == partition]
        ours = [2 * sum(m.of(s, subset) for m in group) for s in SETTINGS]
        figures[f"{partition} {subset}"] = np.array([ours, [2 * cells[s] for s in SETTINGS]])
    figures["all"] = sum(figures.values(), np.zeros((2, len(SETTINGS)), np.int64))
    rows = []
    for name, both in figures.items():
        mine, papers = ((*row.tolist(), int(row.sum())) for row in both)
        rows.append(Row(name, mine, papers if whole else (None,) * len(papers)))
    return Comparison("Splits", "split", _COUNTS[2:], tuple(rows))


def total_table(made: Sequence[Made]) -> Comparison:
    """Table of the whole benchmark; the paper's figures are the sums of its Table 10."""
    ours, papers = _figures(made), _paper_figures(made)
    known = papers[0] is not None
    sets = {"families": {m.family for m in made}, "scene types": {m.scene_type for m in made}}
    sizes = {name: len(members) for name, members in sets.items()} | {"scenes": len(made)}
    figures: dict[str, tuple[Figure, Figure]] = {name: (n, n if known else None) for name, n in sizes.items()}
    both = list(zip(ours, papers, strict=True))
    figures |= dict(zip(("landmarks", "objects"), both, strict=False))
    figures["object categories"] = len(frozenset().union(*(m.categories for m in made))), None
    names = (*(f"instances, {name}" for name in SETTING_NAMES.values()), "instances")
    figures |= dict(zip(names, both[2:6], strict=True))
    tasks = [None if n is None else int(n) // 2 for n in both[5]]
    figures["navigation tasks"] = tasks[0], tasks[1]
    figures["routes in all, km"] = both[6]
    means = [1000 * km / n if km is not None and n else None for km, n in zip(both[6], tasks, strict=True)]
    figures["mean route, m"] = means[0], means[1]
    rows = [Row(name, (mine,), (theirs,)) for name, (mine, theirs) in figures.items()]
    return Comparison("The benchmark as a whole", "", (Column("figure", exact=False),), tuple(rows))


def tables(made: Sequence[Made]) -> list[Comparison]:
    """Make all tables of figures: the whole, families, scenes, splits, shares, lengths."""
    return [
        total_table(made), family_table(made), scene_table(made), split_table(made), share_table(made),
        mean_length_table(made),
    ]  # fmt: skip
