"""How hard a release's tasks are, and what its splits leave unseen, by setting and by scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import DETOUR
from aerialdojo_gen.dataset.stats.comparison import Column, Comparison, Figure, own_table, quantile
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import SETTINGS, SPLIT_COLUMNS

Floats = NDArray[np.float64]

_ROUTE = ("plan_detour", "straight_line_free", "target_visible_at_start", "climb_m")
_NAMES = dict(zip(SETTINGS, ("base", "standard", "long-horizon"), strict=True))


@dataclass(frozen=True)
class Tasks:
    """One entry per navigation task; NaN if the release has no value."""

    scene: NDArray[np.str_]  # (n,) arrays of str; `target_split` is empty where the release does not say
    setting: NDArray[np.str_]
    partition: NDArray[np.str_]
    subset: NDArray[np.str_]
    plan_detour: Floats  # (n,) float64
    straight_line_free: Floats  # (n,) float64; 1 or 0
    target_visible_at_start: Floats
    climb_m: Floats
    target_seen_in_train: Floats
    start_seen_in_train: Floats
    target_held_out: Floats
    start_held_out: Floats
    target_split: NDArray[np.str_]

    def __len__(self) -> int:
        """Count the navigation tasks."""
        return len(self.scene)

    @property
    def has_columns(self) -> bool:
        """Whether the release says how hard its tasks are: one of an older version does not."""
        return bool(np.isfinite(self.plan_detour).any())

    def of(self, mask: NDArray[np.bool_]) -> Tasks:
        """Take some of them."""
        return Tasks(**{name: values[mask] for name, values in vars(self).items()})


def read_tasks(data: Where, scenes: Sequence[str]) -> Tasks:
    """Read how hard the tasks of a release's scenes are."""
    root = open_root(data)
    found: dict[str, list[Any]] = {name: [] for name in Tasks.__dataclass_fields__}
    for scene in scenes:
        for subset in ("train", "test"):
            routes = store.read_scene(root, f"routes/{subset}", scene, ["nav_id", "setting", *_ROUTE])
            tasks = store.read_scene(root, f"tasks/{subset}", scene, ["nav_id", *SPLIT_COLUMNS])
            own = tasks.take(pc.index_in(routes["nav_id"], value_set=tasks["nav_id"].combine_chunks()))
            n = routes.num_rows
            found["scene"] += [scene] * n
            found["subset"] += [subset] * n
            found["partition"] += [store.partition(scene).upper()] * n
            found["setting"] += routes["setting"].to_pylist()
            found["target_split"] += [split or "" for split in own["target_split"].to_pylist()]
            for name in _ROUTE:
                found[name].append(_numbers(routes[name]))
            for name in SPLIT_COLUMNS:
                if name != "target_split":
                    found[name].append(_numbers(own[name]))
    words = {name: np.array(found[name], dtype=np.str_) for name in _WORDS}
    numbers = {name: np.concatenate([np.empty(0), *parts]) for name, parts in found.items() if name not in _WORDS}
    both: dict[str, Any] = words | numbers
    return Tasks(**both)


_WORDS = ("scene", "setting", "partition", "subset", "target_split")


def _numbers(column: pa.ChunkedArray) -> Floats:
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)


def _percent(mask: NDArray[np.bool_]) -> Figure:
    return 100.0 * float(np.mean(mask)) if len(mask) else None


# The last two are of the table by setting alone: scenes fit a terminal without them.
_COLUMNS = (
    Column("tasks", exact=False),
    Column("detour", exact=False, digits=3),
    Column("p90", exact=False, digits=2),
    Column(f"<{DETOUR} %", "%", exact=False),
    Column("free %", "%", exact=False),
    Column("view %", "%", exact=False),
    Column("climb m", "m", exact=False),
    Column("climb p90", "m", exact=False),
    Column("half %", "%", exact=False),
)
_OF_SCENES = 7
NOTES = (
    "tasks: navigation tasks. detour: plan_detour, length over the shortest without",
    f"obstacles, median and 90th percentile, and the share below {DETOUR}. free: the",
    "straight line from start to goal is free. view: the start sees something of the",
    "target; half: half of it or more. climb: metres flown upwards, median and p90.",
)


def _figures(tasks: Tasks) -> tuple[Figure, ...]:
    return (
        len(tasks),
        quantile(tasks.plan_detour, 0.5),
        quantile(tasks.plan_detour, 0.9),
        _percent(tasks.plan_detour < DETOUR),
        _percent(tasks.straight_line_free == 1.0),
        _percent(tasks.target_visible_at_start > 0.0),
        quantile(tasks.climb_m, 0.5),
        quantile(tasks.climb_m, 0.9),
        _percent(tasks.target_visible_at_start >= 0.5),
    )


def setting_table(tasks: Tasks) -> Comparison:
    """Say how hard tasks are by length setting."""
    rows = [(_NAMES[s], _figures(tasks.of(tasks.setting == s))) for s in SETTINGS]
    rows.append(("all", _figures(tasks)))
    return own_table("Difficulty by length setting", "setting", _COLUMNS, rows, NOTES)


def scene_table(tasks: Tasks) -> Comparison:
    """Say how hard tasks are by scene, in the order in which the scenes were read."""
    names = list(dict.fromkeys(tasks.scene.tolist()))
    rows = [(name, _figures(tasks.of(tasks.scene == name))[:_OF_SCENES]) for name in names]
    rows.append(("all", _figures(tasks)[:_OF_SCENES]))
    return own_table("Difficulty by scene", "scene", _COLUMNS[:_OF_SCENES], rows)


def seen_table(tasks: Tasks) -> Comparison:
    """Say which test tasks of the split by tasks ask for what no training task of their partition has."""
    columns = (
        Column("tasks", exact=False),
        Column("new target", exact=False), Column("target %", "%", exact=False, digits=2),
        Column("new start", exact=False), Column("start %", "%", exact=False, digits=2),
        Column("new both", exact=False),
    )  # fmt: skip
    test = tasks.of(tasks.subset == "test")

    def figures(part: Tasks) -> tuple[Figure, ...]:
        target, start = part.target_seen_in_train == 0.0, part.start_seen_in_train == 0.0
        return (
            len(part),
            int(target.sum()),
            _percent(target),
            int(start.sum()),
            _percent(start),
            int(sum(target & start)),
        )

    rows = [(f"{p} test", figures(test.of(test.partition == p))) for p in ("ID", "OOD")]
    notes = ("Test tasks by the paper's split; new: no training task of the partition has it.",)
    return own_table("What the paper's split leaves unseen", "split", columns, [*rows, ("all", figures(test))], notes)


def held_out_table(tasks: Tasks) -> Comparison:
    """Count the split by objects."""
    columns = (
        Column("tasks", exact=False),
        *(Column(_NAMES[s].replace("-horizon", ""), exact=False) for s in SETTINGS),
        Column("new target", exact=False), Column("new start", exact=False), Column("new both", exact=False),
    )  # fmt: skip

    def figures(part: Tasks) -> tuple[Figure, ...]:
        target, start = part.target_held_out == 1.0, part.start_held_out == 1.0
        settings = (int(np.sum(part.setting == s)) for s in SETTINGS)
        return len(part), *settings, int(target.sum()), int(start.sum()), int(np.sum(target & start))

    rows = [
        (f"{p} {side}", figures(tasks.of((tasks.partition == p) & (tasks.target_split == side))))
        for p in ("ID", "OOD") for side in ("train", "test")
    ]  # fmt: skip
    notes = ("new: of an object that is held out, which no training task of this split has.",)
    return own_table("The split by objects", "target_split", columns, [*rows, ("all", figures(tasks))], notes)


def difficulty_tables(tasks: Tasks) -> list[Comparison]:
    """Make all tables of difficulty and of splits; none of a release that does not tell them."""
    if not tasks.has_columns:
        return []
    made = [setting_table(tasks), scene_table(tasks)]
    if (tasks.target_split != "").any():
        made += [seen_table(tasks), held_out_table(tasks)]
    return made
