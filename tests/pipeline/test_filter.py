"""The paper's rules, each at its boundary, a reason for every candidate, and what an agent sees at its stop.

An agent that flies a route stops without the Approach: where it sees nothing of its target there is no task.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.handmade import job_of, write_rows, write_scene
from support.walled import SCENE, VIEWPOINTS, walled

from aerialdojo_gen.base.config.sections import FilterConfig
from aerialdojo_gen.pipeline.stages.work.filter import run
from aerialdojo_gen.pipeline.stages.work.rules import judge
from aerialdojo_gen.rendering.casters import all_in_sight, in_sight
from aerialdojo_gen.store.schemas import APPROACH, STOP

EDGE = 1e-7
# Lengths and distances at the bounds of the paper's rules, just beside them, and anywhere.
AT_BOUNDS = [b + d for b in (3, 5, 20, 30, 40, 60, 100) for d in (-EDGE, 0.0, EDGE)]
METRES = st.sampled_from(AT_BOUNDS) | st.floats(0, 150)
RANGES = {"base": (5, 30), "standard": (30, 60), "long_horizon": (60, 100)}
BUDGETS = {"base": 90, "standard": 180, "long_horizon": 300}
ACTIONS = st.sampled_from([b + d for b in BUDGETS.values() for d in (0, 1)]) | st.integers(0, 400)
OUTCOMES = ["SOLVED"] * 5 + ["NO_PATH", "BUDGET_EXHAUSTED", "START_IN_COLLISION", "GOAL_IN_COLLISION"]
# At the bound of the ratio of length and distance, or either as it comes.
LENGTHS = st.tuples(METRES, METRES) | METRES.map(lambda d: (d, 1.05 * d)) | METRES.map(lambda d: (d, 1.0499 * d))
SHARES = st.sampled_from([0.0, 1e-9, 0.1, 0.1001, 1.0, np.nan])
DETOURS = st.sampled_from([1.0, 1.0499, 1.05, 1.06, np.nan])


def by_the_paper(outcome, euclidean, length, n_actions, detour, visible, config):
    """The first rule that a candidate breaks, one rule after another."""
    if outcome != "SOLVED":
        return outcome.lower(), ""
    setting = next((name for name, (low, high) in RANGES.items() if low <= length < high), "")
    broken = {
        "too_close": euclidean <= 3,
        "too_short": length < 5,
        "too_long": length >= 100,
        "near_straight": length < 1.05 * euclidean,
        "over_budget": n_actions > BUDGETS.get(setting, math.inf),
        "small_plan_detour": config.min_plan_detour > 1 and not detour >= config.min_plan_detour,
        "target_in_view": config.max_visible_at_start < 1 and not visible <= config.max_visible_at_start,
    }
    return next((rule for rule, breaks in broken.items() if breaks), "kept"), setting


@given(
    st.lists(st.tuples(st.sampled_from(OUTCOMES), LENGTHS, ACTIONS, DETOURS, SHARES), min_size=1),
    st.sampled_from([{}, {"min_plan_detour": 1.05, "max_visible_at_start": 0.1}, {"max_visible_at_start": 0.0}]),
)
def test_a_candidate_is_rejected_by_the_first_rule_that_it_breaks(rows, values):
    config = FilterConfig(**values)
    outcome, lengths, n_actions, detour, visible = (np.array(c) for c in zip(*rows, strict=True))
    reason, setting = judge(outcome, *lengths.T, n_actions.astype(np.int32), config, detour, visible)
    expected = [by_the_paper(o, *metres, *more, config) for o, metres, *more in rows]
    assert list(zip(reason.tolist(), setting.tolist(), strict=True)) == expected


def test_what_nobody_told_is_not_kept_where_it_is_asked_for():
    known = np.array(["SOLVED"]), np.array([10.0]), np.array([12.0]), np.array([20], np.int32)
    assert judge(*known, FilterConfig())[0] == "kept"
    assert judge(*known, FilterConfig(min_plan_detour=1.05))[0] == "small_plan_detour"


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
