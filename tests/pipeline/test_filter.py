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

CONFIG = FilterConfig()


def verdict(outcome="SOLVED", euclidean=10.0, length=12.0, n_actions=20, config=CONFIG, **figures):
    told = {name: np.array([value]) for name, value in figures.items()}
    reason, setting = judge(
        np.array([outcome]),
        np.array([euclidean]),
        np.array([length]),
        np.array([n_actions], np.int32),
        config,
        **told,
    )
    return reason[0], setting[0]


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ({}, ("kept", "base")),
        ({"euclidean": 3.0, "length": 6.0}, ("too_close", "base")),
        ({"euclidean": 3.0000001, "length": 6.0}, ("kept", "base")),
        ({"euclidean": 4.0, "length": 4.9999999}, ("too_short", "")),
        ({"euclidean": 4.0, "length": 5.0}, ("kept", "base")),
        ({"euclidean": 25.0, "length": 29.999}, ("kept", "base")),
        ({"euclidean": 25.0, "length": 30.0}, ("kept", "standard")),
        ({"euclidean": 50.0, "length": 60.0}, ("kept", "long_horizon")),
        ({"euclidean": 90.0, "length": 99.999}, ("kept", "long_horizon")),
        ({"euclidean": 90.0, "length": 100.0}, ("too_long", "")),
        ({"euclidean": 10.0, "length": 10.5}, ("kept", "base")),
        ({"euclidean": 10.0, "length": 10.4999}, ("near_straight", "base")),
        ({"n_actions": 90}, ("kept", "base")),
        ({"n_actions": 91}, ("over_budget", "base")),
        ({"euclidean": 40.0, "length": 50.0, "n_actions": 180}, ("kept", "standard")),
        ({"euclidean": 40.0, "length": 50.0, "n_actions": 181}, ("over_budget", "standard")),
        ({"euclidean": 70.0, "length": 80.0, "n_actions": 301}, ("over_budget", "long_horizon")),
        ({"outcome": "NO_PATH", "length": 0.0}, ("no_path", "")),
        ({"outcome": "START_IN_COLLISION", "length": 0.0}, ("start_in_collision", "")),
        ({"outcome": "GOAL_IN_COLLISION", "length": 0.0}, ("goal_in_collision", "")),
        ({"outcome": "BUDGET_EXHAUSTED", "length": 0.0}, ("budget_exhausted", "")),
        ({"euclidean": 0.0, "length": 8.0}, ("too_close", "base")),
    ],
)
def test_rules_at_their_boundaries(case, expected):
    assert verdict(**case) == expected


HARD = FilterConfig(min_plan_detour=1.05, max_visible_at_start=0.1)


@pytest.mark.parametrize(
    ("detour", "visible", "config", "expected"),
    [
        (1.0, 1.0, CONFIG, "kept"),
        (np.nan, np.nan, CONFIG, "kept"),
        (1.05, 0.1, HARD, "kept"),
        (1.0499, 0.1, HARD, "small_plan_detour"),
        (1.0499, 0.2, HARD, "small_plan_detour"),
        (1.05, 0.1001, HARD, "target_in_view"),
        (np.nan, 0.0, HARD, "small_plan_detour"),
        (1.2, np.nan, HARD, "target_in_view"),
        (1.0, 0.0, FilterConfig(max_visible_at_start=0.0), "kept"),
        (1.0, 1e-9, FilterConfig(max_visible_at_start=0.0), "target_in_view"),
        (1.06, 1.0, FilterConfig(min_plan_detour=1.06), "kept"),
    ],
)
def test_rules_of_difficulty_at_their_boundaries(detour, visible, config, expected):
    told = {"config": config, "plan_detour": detour, "visible_at_start": visible}
    assert verdict(**told) == (expected, "base")
    # The paper's own rules come first.
    assert verdict(length=10.1, **told)[0] == "near_straight"


def test_what_nobody_told_is_not_kept_where_it_is_asked_for():
    assert verdict(config=HARD)[0] == "small_plan_detour"
    assert verdict()[0] == "kept"


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["SOLVED", "NO_PATH", "BUDGET_EXHAUSTED"]),
            st.floats(0, 150), st.floats(0, 200), st.integers(0, 400),
        ),
        min_size=1,
    )
)  # fmt: skip
def test_kept_rows_hold_every_rule_and_every_row_has_a_reason(rows):
    outcome, euclidean, length, n_actions = (np.array(c) for c in zip(*rows, strict=True))
    reason, setting = judge(outcome, euclidean, length, n_actions.astype(np.int32), CONFIG)
    budgets = {"base": (5, 30, 90), "standard": (30, 60, 180), "long_horizon": (60, 100, 300)}
    for (o, d, ell, n), r, s in zip(rows, reason, setting, strict=True):
        assert r
        holds = o == "SOLVED" and d > 3 and 5 <= ell < 100 and ell >= 1.05 * d
        if r == "kept":
            low, high, budget = budgets[s]
            assert holds
            assert low <= ell < high
            assert n <= budget
        else:
            assert not holds or n > budgets[s][2]


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
