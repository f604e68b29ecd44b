"""Faults planted in the rows of a small real release: each is found by its check and its row, and nothing else is."""

import numpy as np
import pytest
from support.planting import check

SIDE = {"train": "id_train", "test": "id_test"}


def task_keys(rows):
    return sorted(f"task_id={row['task_id']}" for row in rows)


def of_nav(nav_id):
    return lambda row: row["nav_id"] == nav_id


def set_to(name, value):
    def change(row):
        row[name] = value

    return change


def modality(name):
    return lambda row: row["modality"] == name


def test_a_clean_release_passes_every_check(planted):
    assert check(planted, whole=True) == {}


@pytest.mark.parametrize(
    ("found_by", "key", "name", "value", "wanted"),
    [
        ("null_value", "release/objects", "name", None, lambda row: row["object_id"] == 3),
        ("not_finite", "routes/train", "min_clearance_m", float("nan"), lambda _: True),
        ("unknown_word", "tasks/test", "direction", "northish", lambda _: True),
        ("wrong_part", "release/anchors", "scene", "U_Other_0", lambda row: not row["selected"]),
        ("unknown_landmark", "release/objects", "landmark_id", 77, lambda _: True),
        ("unknown_target", "routes/train", "target_object_id", 999, lambda _: True),
        ("unknown_start", "routes/test", "start_anchor_id", 9, lambda _: True),
        ("selected_anchor", "release/anchors", "selected", False, lambda row: row["selected"]),
        ("task_scene", "tasks/train", "family", "Natural", lambda _: True),
        ("task_setting", "tasks/train", "setting", "long_horizon", lambda row: row["setting"] == "base"),
        ("task_budget", "tasks/train", "action_budget", 91, lambda _: True),
        ("task_start", "tasks/train", "start_z_m", 2.125, lambda _: True),
        ("goal_of_modality", "tasks/train", "description", "a lamp", modality("image")),
        ("goal_of_modality", "tasks/train", "reference_image_id", "ref_0123456789ab", modality("semantic")),
        ("task_goal", "tasks/train", "target_name", "another thing", lambda _: True),
        ("task_goal", "tasks/train", "reference_image_id", "ref_0123456789ab", modality("image")),
        ("telling_id", "tasks/train", "task_id", "U_Courtyard_0-3_0__5-s", modality("semantic")),
        ("telling_text", "tasks/train", "description", "It stands at 12.5, 3.25.", modality("semantic")),
    ],
)
def test_a_value_that_is_wrong(planted, found_by, key, name, value, wanted):
    row = planted.edit(key, set_to(name, value), wanted)
    columns = {"tasks": ["task_id"], "routes": ["nav_id"], "anchors": ["object_id", "anchor_id"]}
    named = " ".join(f"{c}={row[c]}" for c in columns.get(planted.path(key).parts[-3], []))
    if not named:
        named = " ".join(f"{c}={row[c]}" for c in columns.get(key.removeprefix("release/"), ["object_id"]))
    if found_by == "selected_anchor":
        named = f"object_id={row['object_id']}"
    assert check(planted) == {found_by: [named]}


def test_a_task_that_tells_the_goals_place(planted):
    route = planted.rows("routes/train")[0]
    row = planted.edit("tasks/train", set_to("start_x_m", route["goal_x_m"]), of_nav(route["nav_id"]))
    assert check(planted) == {"telling_number": [f"task_id={row['task_id']}"]}


def test_a_task_that_stands_twice(planted):
    rows = planted.rows("tasks/train")
    planted.write("tasks/train", [*rows, rows[4]])
    assert check(planted) == {"duplicate_key": [f"task_id={rows[4]['task_id']}"]}


def test_rows_out_of_order(planted):
    rows = planted.rows("routes/train")
    rows[2], rows[3] = rows[3], rows[2]
    planted.write("routes/train", rows, sort=False)
    assert check(planted) == {"unsorted_rows": [f"nav_id={rows[3]['nav_id']}"]}


def test_a_task_that_trains_and_tests(planted):
    nav_id = planted.rows("routes/train")[0]["nav_id"]
    both = [row | {"subset": "test"} for row in planted.rows("tasks/train") if row["nav_id"] == nav_id]
    planted.write("tasks/test", [*planted.rows("tasks/test"), *both])
    assert check(planted) == {"task_in_both_subsets": task_keys(both)}


def test_a_route_that_trains_and_tests(planted):
    route = planted.rows("routes/train")[0]
    planted.write("routes/test", [*planted.rows("routes/test"), route])
    assert check(planted) == {"route_in_both_subsets": [f"nav_id={route['nav_id']}"]}


def test_a_task_without_its_route_and_a_route_without_its_tasks(planted):
    routes = planted.rows("routes/test")
    lost, bare = routes[0], routes[1]
    planted.write("routes/test", routes[1:])
    tasks = planted.rows("tasks/test")
    planted.write("tasks/test", [row for row in tasks if row["nav_id"] != bare["nav_id"]])
    orphans = [row for row in tasks if row["nav_id"] == lost["nav_id"]]
    assert len(orphans) == 2
    assert check(planted) == {
        "task_without_route": task_keys(orphans),
        "route_without_task": [f"nav_id={bare['nav_id']}"],
    }


def test_a_route_on_the_other_side_than_its_tasks(planted):
    routes = planted.rows("routes/train")
    planted.write("routes/train", routes[1:])
    planted.write("routes/test", [*planted.rows("routes/test"), routes[0]])
    tasks = [row for row in planted.rows("tasks/train") if row["nav_id"] == routes[0]["nav_id"]]
    assert check(planted) == {"task_without_route": task_keys(tasks)}


def test_an_instance_that_is_missing(planted):
    tasks = planted.rows("tasks/train")
    planted.write("tasks/train", tasks[:5] + tasks[6:])
    twin = next(row for row in tasks if row["nav_id"] == tasks[5]["nav_id"] and row is not tasks[5])
    assert check(planted) == {"task_instances": task_keys([twin])}


def test_instances_are_held_against_each_other_where_routes_are_lost(planted):
    planted.path("routes/test").unlink()
    row = planted.edit("tasks/train", set_to("start_x_m", 1.25), modality("semantic"))
    found = check(planted)
    assert found["part_missing"] == ["routes/id_test/part-U_Courtyard_0.parquet"]
    twins = [r for r in planted.rows("tasks/train") if r["nav_id"] == row["nav_id"]]
    assert set(found) == {"part_missing", "instances_agree"}
    assert set(found["instances_agree"]) < set(task_keys(twins))


def test_the_same_task_under_two_names(planted):
    route = planted.rows("routes/train")[0]
    again = f"{planted.scene}-ffffffffffff"
    planted.write("routes/train", [*planted.rows("routes/train"), route | {"nav_id": again}])
    copies = [
        row | {"nav_id": again, "task_id": f"{again}-{row['modality'][0]}"}
        for row in planted.rows("tasks/train")
        if row["nav_id"] == route["nav_id"]
    ]
    planted.write("tasks/train", [*planted.rows("tasks/train"), *copies])
    assert check(planted) == {"duplicate_route": [f"nav_id={again}"]}


def test_an_id_that_tells_the_pair(planted):
    route = planted.rows("routes/train")[0]
    pair = f"{route['start_object_id']}_{route['start_anchor_id']}__{route['target_object_id']}"
    telling = f"{planted.scene}-{pair}"
    planted.edit("routes/train", set_to("nav_id", telling), of_nav(route["nav_id"]))

    def rename(row):
        row["nav_id"], row["task_id"] = telling, f"{telling}-{row['modality'][0]}"

    rows = planted.edit_all("tasks/train", rename, of_nav(route["nav_id"]))
    assert check(planted) == {"telling_id": task_keys(rows)}


def test_an_anchor_of_no_object(planted):
    rows = planted.rows("release/anchors")
    lost = rows[0] | {"object_id": 999, "selected": False}
    planted.write("release/anchors", [*rows, lost], sort=False)
    assert check(planted) == {"unknown_object": [f"object_id=999 anchor_id={lost['anchor_id']}"]}


def test_a_direction_that_is_another_one(planted):
    item = planted.rows("release/objects")[2]
    wrong = "north" if item["direction"] != "north" else "south"
    planted.edit("release/objects", set_to("direction", wrong), lambda row: row["object_id"] == item["object_id"])
    for side in SIDE:
        targets = {r["nav_id"] for r in planted.rows(f"routes/{side}") if r["target_object_id"] == item["object_id"]}
        planted.edit_all(f"tasks/{side}", set_to("direction", wrong), lambda row, t=targets: row["nav_id"] in t)
    assert check(planted) == {"landmark_direction": [f"object_id={item['object_id']}"]}


def test_a_landmark_that_is_nearer(planted):
    objects, landmarks = planted.rows("release/objects"), planted.rows("release/landmarks")
    near = objects[0]
    other = {name: near[name] for name in ("scene", "name", "mesh_node", "x_m", "y_m", "z_m")} | {"landmark_id": 50}
    planted.write("release/landmarks", [*landmarks, other], sort=False)
    place = np.array([[o["x_m"], o["y_m"]] for o in objects])
    own = {mark["landmark_id"]: np.array([mark["x_m"], mark["y_m"]]) for mark in landmarks}
    to_own = np.array([np.linalg.norm(p - own[o["landmark_id"]]) for p, o in zip(place, objects, strict=True)])
    to_other = np.linalg.norm(place - place[0], axis=1)
    nearer = [f"object_id={o['object_id']}" for o, a, b in zip(objects, to_other, to_own, strict=True) if a < b]
    assert check(planted) == {"landmark_nearest": sorted(nearer)}
