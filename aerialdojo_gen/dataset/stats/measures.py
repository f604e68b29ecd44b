"""How hard a release's tasks are, what its splits leave unseen, what its goals show and how its references fly.

A table is a row of measures, taken of groups of rows of the data frames that `read_tasks` and `read_goals` make.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import DETOUR
from aerialdojo_gen.dataset.stats.comparison import Column, Comparison, Figure, Row
from aerialdojo_gen.dataset.stats.tables import SETTING_NAMES, family_order
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURNS
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import SPLIT_COLUMNS

# Before the goal the camera should see it, whichever way the drone goes.
_ARRIVAL_M = 3.0
_BELONGS = ("family", "scene_type", "partition")
_ROUTE = (
    "nav_id", "setting", "length_m", "detour_ratio", "n_actions", "min_clearance_m", "plan_detour",
    "straight_line_free", "target_visible_at_start", "climb_m", "action",
)  # fmt: skip
_GOAL = ("object_id", "selected", "off_front_rad", "part_unoccluded", "part_framed")


def read_tasks(data: Where, scenes: Sequence[str]) -> pd.DataFrame:
    """Read a row per navigation task: where it belongs, its length, how hard it is, how its reference flies.

    Truth values are 1 and 0, and NaN as numbers where the release says neither; `target_split` is empty there.
    """
    root = open_root(data)
    parts = []
    for scene in scenes:
        belongs = store.read_scene(root, "release/scenes", scene, _BELONGS).to_pylist()[0]
        for subset in ("train", "test"):
            routes = store.read_scene(root, f"routes/{subset}", scene, _ROUTE)
            tasks = store.read_scene(root, f"tasks/{subset}", scene, ["nav_id", *SPLIT_COLUMNS])
            own = tasks.take(pc.index_in(routes["nav_id"], value_set=tasks["nav_id"].combine_chunks()))
            columns = {name: routes[name] for name in _ROUTE} | {name: own[name] for name in SPLIT_COLUMNS}
            columns |= {name: c.cast(pa.float64()) for name, c in columns.items() if pa.types.is_boolean(c.type)}
            columns["target_split"] = pc.fill_null(columns["target_split"], "")
            for name, value in {**belongs, "scene": scene, "subset": subset}.items():
                columns[name] = pa.array([value] * routes.num_rows, pa.string())
            parts.append(pa.table(columns))
    table = pa.concat_tables(parts)
    turns, ahead, sideways = _flown(table["action"].combine_chunks())
    return table.drop_columns("action").to_pandas().assign(n_turns=turns, ahead_m=ahead, sideways_m=sideways)


def _flown(lists: pa.ListArray) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Turns of every route, and the metres that it flies ahead and sideways before the last three."""
    counts = np.diff(lists.offsets.to_numpy()).astype(np.int64)
    actions, first = lists.flatten().to_numpy(), np.cumsum(counts) - counts
    metres = np.abs(DISPLACEMENTS[actions])
    flown = np.cumsum(metres.sum(axis=1))
    ends = np.repeat(flown[first + counts - 1], counts)
    ahead, sideways = np.where((ends - flown >= _ARRIVAL_M)[:, None], metres[:, :2], 0.0).T
    turns = (TURNS[actions] != 0).astype(np.int64)
    return np.add.reduceat(turns, first), np.add.reduceat(ahead, first), np.add.reduceat(sideways, first)


def read_goals(data: Where, scenes: Sequence[str]) -> pd.DataFrame:
    """Read a row per object: its family, what its picture shows, and its selected anchor's scores."""
    root = open_root(data)
    parts = []
    for scene in scenes:
        family = store.read_scene(root, "release/scenes", scene, ["family"])["family"][0].as_py()
        anchors = store.read_scene(root, "release/anchors", scene, _GOAL).to_pandas()
        objects = store.read_scene(root, "release/objects", scene, ["object_id", "tells_shown", "step_back_m"])
        chosen = anchors[anchors["selected"]].drop_duplicates("object_id", keep="last")
        parts.append(objects.to_pandas().merge(chosen, on="object_id", how="left").assign(family=family))
    return pd.concat(parts, ignore_index=True)


class Measure(NamedTuple):
    """A column of a table, and how its figure is taken of a group of rows."""

    name: str
    of: Callable[[pd.DataFrame], Figure]
    unit: str = ""
    digits: int = 1


def _table(
    title: str, key: str, measures: Sequence[Measure], groups: Mapping[str, pd.DataFrame], notes: Sequence[str] = ()
) -> Comparison:
    """Make a table that the paper has nothing of."""
    columns = tuple(Column(m.name, m.unit, exact=False, digits=m.digits) for m in measures)
    rows = (Row(name, tuple(m.of(own) for m in measures), (None,) * len(columns)) for name, own in groups.items())
    return Comparison(title, key, columns, tuple(rows), tuple(notes))


def _quantile(name: str, q: float) -> Callable[[pd.DataFrame], Figure]:
    """Quantile of the values that are known, None without any."""

    def take(rows: pd.DataFrame) -> Figure:
        known = rows[name].dropna().to_numpy(np.float64)
        return float(np.quantile(known, q)) if len(known) else None

    return take


def _percent(mask: Any, known: Any = slice(None)) -> Figure:
    """Share of the rows, or of those that are known, of which something is so."""
    found = np.asarray(mask)[known]
    return 100.0 * float(np.mean(found)) if len(found) else None


def _share(name: str, holds: Callable[[Any], Any]) -> Callable[[pd.DataFrame], Figure]:
    return lambda rows: _percent(holds(rows[name]))


def _share_of_known(name: str, holds: Callable[[Any], Any] = lambda share: share) -> Callable[[pd.DataFrame], Figure]:
    """Share of the known values that are so; without a condition their mean, as they are shares."""
    return lambda rows: _percent(holds(rows[name]), np.isfinite(rows[name].to_numpy()))


def _count(*conditions: tuple[str, object]) -> Callable[[pd.DataFrame], Figure]:
    """Rows of which all conditions hold, each a column and its value."""
    return lambda rows: int(np.logical_and.reduce([rows[name] == value for name, value in conditions]).sum())


def _by_setting(tasks: pd.DataFrame) -> dict[str, pd.DataFrame]:
    return {name: tasks[tasks["setting"] == s] for s, name in SETTING_NAMES.items()} | {"all": tasks}


# The last two are of the table by setting alone: scenes fit a terminal without them.
_OF_SCENES = 7
_DIFFICULTY = (
    Measure("tasks", len),
    Measure("detour", _quantile("plan_detour", 0.5), digits=3),
    Measure("p90", _quantile("plan_detour", 0.9), digits=2),
    Measure(f"<{DETOUR} %", _share("plan_detour", lambda ratio: ratio < DETOUR), "%"),
    Measure("free %", _share("straight_line_free", lambda free: free == 1.0), "%"),
    Measure("view %", _share("target_visible_at_start", lambda seen: seen > 0.0), "%"),
    Measure("climb m", _quantile("climb_m", 0.5), "m"),
    Measure("climb p90", _quantile("climb_m", 0.9), "m"),
    Measure("half %", _share("target_visible_at_start", lambda seen: seen >= 0.5), "%"),
)
_NOTES = (
    "tasks: navigation tasks. detour: plan_detour, length over the shortest without",
    f"obstacles, median and 90th percentile, and the share below {DETOUR}. free: the",
    "straight line from start to goal is free. view: the start sees something of the",
    "target; half: half of it or more. climb: metres flown upwards, median and p90.",
)


def setting_table(tasks: pd.DataFrame) -> Comparison:
    """Say how hard tasks are by length setting."""
    return _table("Difficulty by length setting", "setting", _DIFFICULTY, _by_setting(tasks), _NOTES)


def scene_table(tasks: pd.DataFrame) -> Comparison:
    """Say how hard tasks are by scene, in the order in which the scenes were read."""
    groups = {str(name): own for name, own in tasks.groupby("scene", sort=False)} | {"all": tasks}
    return _table("Difficulty by scene", "scene", _DIFFICULTY[:_OF_SCENES], groups)


def novelty_table(tasks: pd.DataFrame) -> Comparison:
    """Say which test tasks of the split by tasks ask for what no training task of their partition has."""
    measures = (
        Measure("tasks", len),
        Measure("new target", _count(("target_seen_in_train", 0.0))),
        Measure("target %", _share("target_seen_in_train", lambda seen: seen == 0.0), "%", 2),
        Measure("new start", _count(("start_seen_in_train", 0.0))),
        Measure("start %", _share("start_seen_in_train", lambda seen: seen == 0.0), "%", 2),
        Measure("new both", _count(("target_seen_in_train", 0.0), ("start_seen_in_train", 0.0))),
        Measure("new pair", _count(("pair_seen_in_train", 0.0))),
        Measure("pair %", _share("pair_seen_in_train", lambda seen: seen == 0.0), "%", 2),
    )
    test = tasks[tasks["subset"] == "test"]
    groups = {f"{p} test": test[test["partition"] == p] for p in ("ID", "OOD")} | {"all": test}
    notes = (
        "Test tasks by the paper's split; new: no training task of the partition has it. both:",
        "target and start pose. pair: start object and target, in this order.",
    )
    return _table("What the paper's split leaves unseen", "split", measures, groups, notes)


def held_out_table(tasks: pd.DataFrame) -> Comparison:
    """Count the split by objects."""
    measures = (
        Measure("tasks", len),
        *(Measure(name.replace("-horizon", ""), _count(("setting", s))) for s, name in SETTING_NAMES.items()),
        Measure("new target", _count(("target_held_out", 1.0))),
        Measure("new start", _count(("start_held_out", 1.0))),
        Measure("new both", _count(("target_held_out", 1.0), ("start_held_out", 1.0))),
    )
    groups = {
        f"{p} {side}": tasks[(tasks["partition"] == p) & (tasks["target_split"] == side)]
        for p in ("ID", "OOD") for side in ("train", "test")
    } | {"all": tasks}  # fmt: skip
    notes = ("new: of an object that is held out, which no training task of this split has.",)
    return _table("The split by objects", "target_split", measures, groups, notes)


def has_difficulty(tasks: pd.DataFrame) -> bool:
    """Whether the release says how hard its tasks are: one of an older version does not."""
    return bool(tasks["plan_detour"].notna().any())


def difficulty_tables(tasks: pd.DataFrame) -> list[Comparison]:
    """Make all tables of difficulty and of splits; none of a release that does not have them."""
    if not has_difficulty(tasks):
        return []
    splits = [novelty_table, held_out_table] if (tasks["target_split"] != "").any() else []
    return [make(tasks) for make in (setting_table, scene_table, *splits)]


def goal_table(goals: pd.DataFrame) -> Comparison:
    """Table of the quality of goals by family."""
    measures = (
        Measure("objects", len),
        Measure("fronts", lambda rows: int(rows["off_front_rad"].notna().sum())),
        Measure("front %", _share_of_known("off_front_rad", lambda off: off <= FRONT_RAD), "%"),
        Measure("parts %", _share_of_known("tells_shown", lambda shown: shown == 1.0), "%"),
        Measure("unhidden %", _share_of_known("part_unoccluded"), "%"),
        Measure("framed %", _share_of_known("part_framed"), "%"),
        Measure("back m", _quantile("step_back_m", 0.5), "m", 2),
    )
    groups = {name: goals[goals["family"] == name] for name in family_order(goals["family"])} | {"all": goals}
    notes = (
        "fronts: objects with a front; front: of those, seen from within 60° of it.",
        "parts: of the objects that parts tell, those whose reference picture shows",
        "all of these. unhidden, framed: share of the object that nothing hides there,",
        "and that is within the picture, mean. back: how far behind the anchor it is",
        "taken, median.",
    )
    return _table("What goals show", "family", measures, groups, notes)


def flight_table(tasks: pd.DataFrame) -> Comparison:
    """Say by length setting how reference routes fly."""

    def turns(rows: pd.DataFrame) -> Figure:
        actions = int(rows["n_actions"].sum())
        return 100.0 * float(rows["n_turns"].sum()) / actions if actions else None

    def sideways(rows: pd.DataFrame) -> Figure:
        metres, ahead = (rows[name].to_numpy().sum() for name in ("sideways_m", "ahead_m"))
        return 100.0 * float(metres) / float(ahead + metres) if ahead + metres else None

    measures = (
        Measure("routes", len),
        Measure("clear m", _quantile("min_clearance_m", 0.5), "m", 3),
        Measure("clear p10", _quantile("min_clearance_m", 0.1), "m", 3),
        Measure("actions", _quantile("n_actions", 0.5)),
        Measure("turns %", turns, "%"),
        Measure("sideways %", sideways, "%"),
    )
    notes = (
        "clear: smallest distance to a surface on a route, median and 10th percentile.",
        "actions: median. turns: of all actions. sideways: of the horizontal metres,",
        "but for the last three, where the camera should see the goal.",
    )
    return _table("How reference routes fly", "setting", measures, _by_setting(tasks), notes)


def goal_tables(goals: pd.DataFrame, tasks: pd.DataFrame) -> list[Comparison]:
    """Say what goals show, and how reference routes fly."""
    return [goal_table(goals), flight_table(tasks)]
