"""An agent that flies a route stops without the Approach: where it sees nothing of its target there is no task."""

import math

import numpy as np
import pytest
from support.handmade import job_of, write_rows, write_scene
from support.walled import SCENE, VIEWPOINTS, walled

from aerialdojo_gen.base.config.sections import FilterConfig
from aerialdojo_gen.pipeline.stages.work.filter import run
from aerialdojo_gen.rendering.casters import all_in_sight, in_sight
from aerialdojo_gen.store.schemas import APPROACH, STOP

FORWARD_5 = 3
GOAL = VIEWPOINTS[0]
# Before the wall, behind it, and above the roof: where the last move ends and the Approach begins.
ENDS = {"before": (2.0, 0.0, 0.5), "behind": (3.2, 0.0, 0.5), "above": (1.5, 0.0, 3.2)}


@pytest.fixture
def data(tmp_path):
    write_scene(tmp_path, walled())
    nodes = ("crate", "wall")
    write_rows(tmp_path, "objects", [{"object_id": k, "mesh_node": node} for k, node in enumerate(nodes)], SCENE)
    pairs, plans = [], []
    for name, end in {**ENDS, "unsolved": ()}.items():
        pairs.append({"scene": SCENE, "pair_id": name, "start_object_id": 1, "euclidean_m": 9.0})
        if not end:
            plans.append({"scene": SCENE, "pair_id": name, "outcome": "NO_PATH"})
            continue
        for approach in (True, False):
            key = name if approach else f"{name}, no Approach"
            if not approach:
                pairs.append(pairs[-1] | {"pair_id": key})
            poses = [(end[0], end[1] - 5.0, end[2]), end, *([GOAL] if approach else [])]
            plans.append({
                "scene": SCENE, "pair_id": key, "outcome": "SOLVED", "length_m": 12.0, "n_actions": len(poses),
                **{f"{axis}_m": [p[k] for p in poses] for k, axis in enumerate("xyz")},
                "yaw_rad": [math.pi / 2] * len(poses),
                "action": [FORWARD_5, *([APPROACH] if approach else []), STOP],
            })  # fmt: skip
    for table, rows in (("pairs", pairs), ("plans", plans)):
        write_rows(tmp_path, table, rows, SCENE)
    return tmp_path


def test_a_stop_behind_a_wall_or_over_a_roof_makes_no_task(data):
    made = run(job_of("filter", data, SCENE), FilterConfig())
    reasons = dict(zip(*(made.tables["verdicts"][name].to_pylist() for name in ("pair_id", "reason")), strict=True))
    hidden = {"behind", "above", "behind, no Approach", "above, no Approach"}
    kept = {"before": "kept", "before, no Approach": "kept"}
    assert reasons == {**kept, "unsolved": "no_path", **dict.fromkeys(hidden, "target_hidden")}
    assert made.counts["target_hidden"] == 4
    assert made.rows_out == 2


def test_what_is_seen_hangs_on_the_place_and_the_target():
    scene, ends = walled(), np.array([*ENDS.values()])
    assert all_in_sight(scene, ["crate"] * 3, ends).tolist() == [True, False, False]
    assert all_in_sight(scene, ["wall"] * 3, ends).tolist() == [in_sight(scene, "wall", end) for end in ends]
    assert all_in_sight(scene, [], np.empty((0, 3))).tolist() == []
