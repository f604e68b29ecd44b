"""Wrong words on difficulty and on the splits, each found by a check of its own and by no other."""

import numpy as np
from support.handmade import box, instance
from support.planting import check

from aerialdojo_gen.dataset.validate.difficulty import _edge_on
from aerialdojo_gen.pipeline.stages.work.pair_objects import surface_points
from aerialdojo_gen.store.schemas import SPLIT_COLUMNS

SIDES = ("routes/train", "routes/test")

# What is done to which route, and by which check that is found.
ROUTES = (
    (lambda r: r.update(plan_detour=r["plan_detour"] + 0.01), lambda _: True, "plan_detour"),
    (lambda r: r.update(plan_detour=0.9), lambda _: True, "plan_detour"),
    (lambda r: r.update(climb_m=r["climb_m"] + 1.0), lambda _: True, "climb"),
    (lambda r: r.update(straight_line_free=not r["straight_line_free"]), lambda _: True, "straight_line"),
    (lambda r: r.update(target_visible_at_start=1.0, visible_view_at_start="front"),
     lambda r: r["target_visible_at_start"] == 0.0, "start_view"),
    (lambda r: r.update(visible_view_at_start=None), lambda r: r["target_visible_at_start"] > 0.3, "start_view"),
    (lambda r: r.update(target_visible_at_start=0.0, visible_view_at_start=None),
     lambda r: r["target_visible_at_start"] > 0.5, "start_view"),
    (lambda r: r.update(visible_view_at_start="behind"), lambda _: True, "unknown_word"),
    (lambda r: r.update(agent_action=r["action"]), lambda r: 16 in r["action"], "agent_action"),
    (lambda r: r.update(agent_action=r["agent_action"][:-1]), lambda _: True, "agent_action"),
    (lambda r: r.update(agent_action=[]), lambda _: True, "agent_action"),
    (lambda r: r.update(agent_action=[1, 1, *r["agent_action"]]), lambda _: True, "agent_action"),
    (lambda r: r.update(free_length_m=None), lambda _: True, "difficulty_told"),
    (lambda r: r.update(agent_action=None), lambda _: True, "difficulty_told"),
    (lambda r: r.update(free_length_m=r["free_length_m"] * 0.7, plan_detour=r["plan_detour"] / 0.7),
     lambda _: True, "free_length"),
    (lambda r: r.update(free_length_m=r["free_length_m"] * 1.3, plan_detour=max(1.0, r["plan_detour"] / 1.3)),
     lambda _: True, "free_length"),
)  # fmt: skip


def test_wrong_words_on_difficulty(planted):
    """Each in a route of its own: found there, by its check and by no other."""
    expected, used = {}, set()
    for change, wanted, found_by in ROUTES:
        row = planted.edit(
            "routes/train", change, lambda r, wanted=wanted: r["nav_id"] not in used and bool(wanted(r))
        )
        used.add(row["nav_id"])
        expected.setdefault(found_by, []).append(f"nav_id={row['nav_id']}")
    assert check(planted) == {name: sorted(keys) for name, keys in expected.items()}


def test_points_of_a_face_that_is_seen_edge_on_may_count_or_not():
    """Single precision meets such a face anywhere along itself: N_Forest_0 has a table as high as a start."""
    points, normals = surface_points("S", 0, instance("table", box((0, 0, 0), (2, 1, 1))), 60)
    tops = int((normals[:, 2] > 0.9).sum())
    assert tops > 5
    assert [_edge_on(np.array([-10.0, 0.5, z]), points, normals) for z in (1.0, 1.001, 1.2)] == [tops, tops, 0]


def test_a_release_of_an_older_version_is_not_at_fault(planted):
    def forget(row):
        row.update(dict.fromkeys(
            ("free_length_m", "plan_detour", "straight_line_free", "climb_m", "target_visible_at_start",
             "visible_view_at_start", "agent_action")))  # fmt: skip

    for side in SIDES:
        planted.edit_all(side, forget, lambda _: True)
    for side in ("tasks/train", "tasks/test"):
        planted.edit_all(side, lambda row: row.update(dict.fromkeys(SPLIT_COLUMNS)), lambda _: True)
    assert check(planted) == {}


# The same for tasks, of which both instances are changed, as a merge with another table would.
TASKS = (
    (lambda r: r.update(target_seen_in_train=not r["target_seen_in_train"]), lambda _: True, "seen_in_train"),
    (lambda r: r.update(start_seen_in_train=not r["start_seen_in_train"]), lambda _: True, "seen_in_train"),
    (lambda r: r.update(pair_seen_in_train=not r["pair_seen_in_train"]), lambda _: True, "seen_in_train"),
    (lambda r: r.update(target_split="train"), lambda r: r["target_split"] == "test", "split_by_objects"),
    (lambda r: r.update(target_split="test"), lambda r: r["target_split"] == "train", "split_by_objects"),
    (lambda r: r.update(target_held_out=False, target_split="train"),
     lambda r: r["target_held_out"] and not r["start_held_out"], "split_by_objects"),
    (lambda r: r.update(start_held_out=not r["start_held_out"]), lambda r: r["target_held_out"], "split_by_objects"),
    (lambda r: r.update(target_held_out=None), lambda _: True, "splits_told"),
)  # fmt: skip


def test_wrong_words_on_the_splits(planted):
    """No training task has a held-out end, and what training has seen is counted again."""
    expected, used = {}, set()
    for side in ("tasks/train", "tasks/test"):
        for change, wanted, found_by in TASKS:
            rows = planted.rows(side)
            nav_id = next(r["nav_id"] for r in rows if r["nav_id"] not in used and wanted(r))
            planted.edit_all(side, change, lambda r, nav_id=nav_id: r["nav_id"] == nav_id)
            used.add(nav_id)
            expected.setdefault(found_by, []).extend(f"task_id={nav_id}-{letter}" for letter in "is")
    assert check(planted) == {name: sorted(keys) for name, keys in expected.items()}
