"""What statistics and figures are made of: a release's navigation tasks and its goals, as pandas data frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURNS
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
