"""Faults planted in the rows of a small real release: each is found by its check and its row, and nothing else is.

Faults that do not touch one another are planted together, each in a navigation task or an object of its own.
"""

import numpy as np
from support.handmade import box, instance
from support.planting import PlantedFault, check, named, of_nav, plant, put

from aerialdojo_gen.dataset.validate.difficulty import _at_the_end, _edge_on
from aerialdojo_gen.geometry.rays import instance_caster
from aerialdojo_gen.pipeline.stages.work.pair_objects import surface_points
from aerialdojo_gen.store.schemas import DIFFICULTY_COLUMNS, SPLIT_COLUMNS

SIDES = ("train", "test")
TRAIN, ROUTES, OBJECTS, ANCHORS = "tasks/train", "routes/train", "release/objects", "release/anchors"


def task_keys(rows):
    return sorted(named(TRAIN, row) for row in rows)


def of_goal(modality):
    return lambda row: row["modality"] == modality


def test_a_clean_release_passes_every_check(planted):
    assert check(planted, whole=True) == {}


OF_OBJECTS = (
    PlantedFault("null_value", OBJECTS, put("name", None), lambda row: row["object_id"] == 3),
    PlantedFault("unknown_landmark", OBJECTS, put("landmark_id", 77)),
    PlantedFault("wrong_part", ANCHORS, put("scene", "U_Other_0"), lambda row: not row["selected"]),
)


def test_values_of_objects_and_anchors_that_are_wrong(planted):
    rows = planted.rows(ANCHORS)
    stranger = rows[0] | {"object_id": 999, "selected": False}
    planted.write(ANCHORS, [*rows, stranger])
    planted.edit(ANCHORS, put("selected", False), lambda row: row["selected"] and row["object_id"] == 5)
    expected = {"unknown_object": [named(ANCHORS, stranger)], "selected_anchor": ["object_id=5"]}
    expected |= plant(planted, OF_OBJECTS)
    item = planted.rows(OBJECTS)[2]
    wrong = put("direction", "north" if item["direction"] != "north" else "south")
    planted.edit(OBJECTS, wrong, lambda row: row["object_id"] == item["object_id"])
    for side in SIDES:
        targets = {r["nav_id"] for r in planted.rows(f"routes/{side}") if r["target_object_id"] == item["object_id"]}
        planted.edit_all(f"tasks/{side}", wrong, lambda row, t=targets: row["nav_id"] in t)
    assert check(planted) == expected | {"landmark_direction": [named(OBJECTS, item)]}


OF_TASKS = (
    PlantedFault("not_finite", ROUTES, put("min_clearance_m", float("nan"))),
    PlantedFault("unknown_target", ROUTES, put("target_object_id", 999)),
    PlantedFault("unknown_start", "routes/test", put("start_anchor_id", 9)),
    PlantedFault("unknown_word", "tasks/test", put("direction", "northish")),
    PlantedFault("task_scene", TRAIN, put("family", "Natural")),
    PlantedFault("task_setting", TRAIN, put("setting", "long_horizon"), lambda row: row["setting"] == "base"),
    PlantedFault("task_budget", TRAIN, put("action_budget", 91)),
    PlantedFault("task_start", TRAIN, put("start_z_m", 2.125)),
    PlantedFault("goal_of_modality", TRAIN, put("description", "a lamp"), of_goal("image")),
    PlantedFault("goal_of_modality", TRAIN, put("reference_image_id", "ref_0123456789ab"), of_goal("semantic")),
    PlantedFault("task_goal", TRAIN, put("target_name", "another thing")),
    PlantedFault("task_goal", TRAIN, put("reference_image_id", "ref_0123456789ab"), of_goal("image")),
    PlantedFault("telling_id", TRAIN, put("task_id", "U_Courtyard_0-3_0__5-s"), of_goal("semantic")),
    PlantedFault("telling_text", TRAIN, put("description", "It stands at 12.5, 3.25."), of_goal("semantic")),
)


def renamed(tasks, route, nav_id):
    """The rows of a navigation task under another name."""
    named_so = [task | {"nav_id": nav_id, "task_id": f"{nav_id}-{task['modality'][0]}"} for task in tasks]
    return named_so, route | {"nav_id": nav_id}


def with_two_names(tasks, route):
    others, again = renamed(tasks, route, f"{route['scene']}-ffffffffffff")
    return {TRAIN: [*tasks, *others], ROUTES: [route, again]}, [named(ROUTES, again)]


def named_after_its_pair(tasks, route):
    pair = f"{route['start_object_id']}_{route['start_anchor_id']}__{route['target_object_id']}"
    others, again = renamed(tasks, route, f"{route['scene']}-{pair}")
    return {TRAIN: others, ROUTES: [again]}, task_keys(others)


def at_the_goals_place(tasks, route):
    there = tasks[0] | {"start_x_m": route["goal_x_m"]}
    return {TRAIN: [there, *tasks[1:]]}, task_keys([there])


def on_both_sides(tasks, _route):
    both = [task | {"subset": "test"} for task in tasks]
    return {TRAIN: tasks, "tasks/test": both}, task_keys(both)


# What finds it, and of a navigation task's instances and route those that stand instead, by part, and who is named.
OF_SEVERAL_ROWS = (
    ("telling_number", at_the_goals_place),
    ("duplicate_key", lambda tasks, _: ({TRAIN: [*tasks, tasks[0]]}, task_keys(tasks[:1]))),
    ("task_instances", lambda tasks, _: ({TRAIN: tasks[1:]}, task_keys(tasks[1:]))),
    ("task_in_both_subsets", on_both_sides),
    ("route_in_both_subsets", lambda _, route: ({ROUTES: [route], "routes/test": [route]}, [named(ROUTES, route)])),
    ("task_without_route", lambda tasks, _: ({ROUTES: []}, task_keys(tasks))),
    ("route_without_task", lambda _, route: ({TRAIN: []}, [named(ROUTES, route)])),
    ("task_without_route", lambda tasks, route: ({ROUTES: [], "routes/test": [route]}, task_keys(tasks))),
    ("duplicate_route", with_two_names),
    ("telling_id", named_after_its_pair),
)


def test_faults_of_tasks_and_routes(planted):
    expected = plant(planted, OF_TASKS)
    untouched = reversed(planted.rows(ROUTES))
    for found_by, change in OF_SEVERAL_ROWS:
        is_own = of_nav((route := next(untouched))["nav_id"])
        parts, keys = change([*filter(is_own, planted.rows(TRAIN))], route)
        for key, rows in parts.items():
            planted.write(key, [*(row for row in planted.rows(key) if not is_own(row)), *rows])
        expected[found_by] = sorted([*expected.get(found_by, ()), *keys])
    assert check(planted) == expected


def test_instances_are_held_against_each_other_where_routes_are_lost(planted):
    planted.path("routes/test").unlink()
    row = planted.edit(TRAIN, put("start_x_m", 1.25), of_goal("semantic"))
    found = check(planted)
    assert found["part_missing"] == ["routes/id_test/part-U_Courtyard_0.parquet"]
    twins = filter(of_nav(row["nav_id"]), planted.rows(TRAIN))
    assert set(found) == {"part_missing", "instances_agree"}
    assert set(found["instances_agree"]) < set(task_keys(twins))


def test_a_landmark_that_is_nearer(planted):
    objects, landmarks = planted.rows(OBJECTS), planted.rows("release/landmarks")
    near = objects[0]
    other = {name: near[name] for name in ("scene", "name", "mesh_node", "x_m", "y_m", "z_m")} | {"landmark_id": 50}
    planted.write("release/landmarks", [*landmarks, other], sort=False)
    place = np.array([[o["x_m"], o["y_m"]] for o in objects])
    own = {mark["landmark_id"]: np.array([mark["x_m"], mark["y_m"]]) for mark in landmarks}
    to_own = np.array([np.linalg.norm(p - own[o["landmark_id"]]) for p, o in zip(place, objects, strict=True)])
    to_other = np.linalg.norm(place - place[0], axis=1)
    nearer = [named(OBJECTS, o) for o, a, b in zip(objects, to_other, to_own, strict=True) if a < b]
    assert check(planted) == {"landmark_nearest": sorted(nearer)}


SEEN_WHOLE = {"target_visible_at_start": 1.0, "visible_view_at_start": "front"}
UNSEEN = {"target_visible_at_start": 0.0, "visible_view_at_start": None}
# What is done to a route, and by which check that is found.
DIFFICULTY = (
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
    for side in SIDES:
        planted.edit_all(f"routes/{side}", lambda row: row.update(dict.fromkeys(DIFFICULTY_COLUMNS)), lambda _: True)
        planted.edit_all(f"tasks/{side}", lambda row: row.update(dict.fromkeys(SPLIT_COLUMNS)), lambda _: True)
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
    expected = plant(planted, (PlantedFault(name, "routes/train", *change) for name, *change in DIFFICULTY))
    used = {key.removeprefix("nav_id=") for keys in expected.values() for key in keys}
    for side in ("tasks/train", "tasks/test"):
        for found_by, change, wanted in TASKS:
            rows = planted.rows(side)
            nav_id = next(r["nav_id"] for r in rows if r["nav_id"] not in used and wanted(r))
            planted.edit_all(side, change, of_nav(nav_id))
            used.add(nav_id)
            expected.setdefault(found_by, []).extend(f"task_id={nav_id}-{letter}" for letter in "is")
    assert check(planted) == {name: sorted(keys) for name, keys in expected.items()}
