"""Wrong words on difficulty and on the splits, each found by a check of its own and by no other."""

import numpy as np
from support.handmade import box, instance
from support.planting import PlantedFault, check, of_nav, plant

from aerialdojo_gen.dataset.validate.difficulty import _at_the_end, _edge_on
from aerialdojo_gen.geometry.rays import instance_caster
from aerialdojo_gen.pipeline.stages.work.pair_objects import surface_points
from aerialdojo_gen.store.schemas import SPLIT_COLUMNS

SIDES = ("routes/train", "routes/test")

SEEN_WHOLE = {"target_visible_at_start": 1.0, "visible_view_at_start": "front"}
UNSEEN = {"target_visible_at_start": 0.0, "visible_view_at_start": None}
# What is done to a route, and by which check that is found.
ROUTES = (
    ("plan_detour", lambda r: r.update(plan_detour=r["plan_detour"] + 0.01)),
    ("plan_detour", lambda r: r.update(plan_detour=0.9)),
    ("climb", lambda r: r.update(climb_m=r["climb_m"] + 1.0)),
    ("straight_line", lambda r: r.update(straight_line_free=not r["straight_line_free"])),
    ("start_view", lambda r: r.update(SEEN_WHOLE), lambda r: r["target_visible_at_start"] == 0.0),
    ("start_view", lambda r: r.update(visible_view_at_start=None), lambda r: r["target_visible_at_start"] > 0.3),
    ("start_view", lambda r: r.update(UNSEEN), lambda r: r["target_visible_at_start"] > 0.5),
    ("unknown_word", lambda r: r.update(visible_view_at_start="behind")),
    ("agent_action", lambda r: r.update(agent_action=r["action"]), lambda r: 16 in r["action"]),
    ("agent_action", lambda r: r.update(agent_action=r["agent_action"][:-1])),
    ("agent_action", lambda r: r.update(agent_action=[])),
    ("agent_action", lambda r: r.update(agent_action=[1, 1, *r["agent_action"]])),
    ("difficulty_told", lambda r: r.update(free_length_m=None)),
    ("difficulty_told", lambda r: r.update(agent_action=None)),
    ("free_length",
     lambda r: r.update(free_length_m=r["free_length_m"] * 0.7, plan_detour=r["plan_detour"] / 0.7)),
    ("free_length",
     lambda r: r.update(free_length_m=r["free_length_m"] * 1.3, plan_detour=max(1.0, r["plan_detour"] / 1.3))),
)  # fmt: skip


def test_points_of_a_face_that_is_seen_edge_on_may_count_or_not():
    """Single precision meets such a face anywhere along itself: N_Forest_0 has a table as high as a start."""
    points, normals = surface_points("S", 0, instance("table", box((0, 0, 0), (2, 1, 1))), 60)
    tops = int((normals[:, 2] > 0.9).sum())
    assert tops > 5
    assert [_edge_on(np.array([-10.0, 0.5, z]), points, normals) for z in (1.0, 1.001, 1.2)] == [tops, tops, 0]


def test_points_as_far_behind_a_face_as_rays_end_may_count_or_not():
    """Signs are made of plates, often 5 mm apart: single precision saw 16 points of a stop sign, or not."""
    points = np.array([[0.0, y, z] for y in (0.2, 0.5, 0.8) for z in (0.3, 0.6)])
    for gap_m, count in ((0.005, 6), (0.008, 0), (0.002, 0)):
        plate = instance_caster(instance("plate", box((gap_m - 0.001, 0, 0), (gap_m, 1, 1))))
        assert _at_the_end(np.array([9.0, 0.5, 0.5]), points, (plate.unobstructed,)) == count


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
    *(("seen_in_train", lambda r, what=what: r.update({what: not r[what]}), lambda _: True)
      for what in ("target_seen_in_train", "start_seen_in_train", "pair_seen_in_train")),
    ("split_by_objects", lambda r: r.update(target_split="train"), lambda r: r["target_split"] == "test"),
    ("split_by_objects", lambda r: r.update(target_split="test"), lambda r: r["target_split"] == "train"),
    ("split_by_objects", lambda r: r.update(target_held_out=False, target_split="train"),
     lambda r: r["target_held_out"] and not r["start_held_out"]),
    ("split_by_objects", lambda r: r.update(start_held_out=not r["start_held_out"]), lambda r: r["target_held_out"]),
    ("splits_told", lambda r: r.update(target_held_out=None), lambda _: True),
)  # fmt: skip


def test_wrong_words_on_difficulty_and_on_the_splits(planted):
    """Each in a route of its own: found there, by its check and by no other.

    No training task has a held-out end, and what training has seen is counted again.
    """
    expected = plant(planted, (PlantedFault(name, "routes/train", *change) for name, *change in ROUTES))
    used = {key.removeprefix("nav_id=") for keys in expected.values() for key in keys}
    for side in ("tasks/train", "tasks/test"):
        for found_by, change, wanted in TASKS:
            rows = planted.rows(side)
            nav_id = next(r["nav_id"] for r in rows if r["nav_id"] not in used and wanted(r))
            planted.edit_all(side, change, of_nav(nav_id))
            used.add(nav_id)
            expected.setdefault(found_by, []).extend(f"task_id={nav_id}-{letter}" for letter in "is")
    assert check(planted) == {name: sorted(keys) for name, keys in expected.items()}
