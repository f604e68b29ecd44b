"""Faults planted in the rows of a small real release: each is found by its check and its row, and nothing else is.

Faults that do not touch one another are planted together, each in a navigation task or an object of its own.
"""

import numpy as np
from support.planting import PlantedFault, check, named, of_nav, plant, put

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


def tells_the_goals_place(planted, nav_id):
    route = next(filter(of_nav(nav_id), planted.rows(ROUTES)))
    return {"telling_number": task_keys([planted.edit(TRAIN, put("start_x_m", route["goal_x_m"]), of_nav(nav_id))])}


def stands_twice(planted, nav_id):
    rows = planted.rows(TRAIN)
    again = next(filter(of_nav(nav_id), rows))
    planted.write(TRAIN, [*rows, again])
    return {"duplicate_key": task_keys([again])}


def lacks_an_instance(planted, nav_id):
    rows = planted.rows(TRAIN)
    lost, left = filter(of_nav(nav_id), rows)
    planted.write(TRAIN, [row for row in rows if row != lost])
    return {"task_instances": task_keys([left])}


def trains_and_tests(planted, nav_id):
    both = [row | {"subset": "test"} for row in filter(of_nav(nav_id), planted.rows(TRAIN))]
    planted.write("tasks/test", [*planted.rows("tasks/test"), *both])
    return {"task_in_both_subsets": task_keys(both)}


def has_a_route_that_trains_and_tests(planted, nav_id):
    route = next(filter(of_nav(nav_id), planted.rows(ROUTES)))
    planted.write("routes/test", [*planted.rows("routes/test"), route])
    return {"route_in_both_subsets": [named(ROUTES, route)]}


def has_no_route(planted, nav_id):
    planted.write(ROUTES, [row for row in planted.rows(ROUTES) if row["nav_id"] != nav_id])
    return {"task_without_route": task_keys(filter(of_nav(nav_id), planted.rows(TRAIN)))}


def is_a_route_alone(planted, nav_id):
    planted.write(TRAIN, [row for row in planted.rows(TRAIN) if row["nav_id"] != nav_id])
    return {"route_without_task": [f"nav_id={nav_id}"]}


def has_its_route_on_the_other_side(planted, nav_id):
    routes = planted.rows(ROUTES)
    planted.write("routes/test", [*planted.rows("routes/test"), *filter(of_nav(nav_id), routes)])
    planted.write(ROUTES, [row for row in routes if row["nav_id"] != nav_id])
    return {"task_without_route": task_keys(filter(of_nav(nav_id), planted.rows(TRAIN)))}


def has_two_names(planted, nav_id):
    again = f"{planted.scene}-ffffffffffff"
    for key in (ROUTES, TRAIN):
        rows = planted.rows(key)
        copies = [row | {"nav_id": again} for row in filter(of_nav(nav_id), rows)]
        for row in copies if key == TRAIN else ():
            row["task_id"] = f"{again}-{row['modality'][0]}"
        planted.write(key, [*rows, *copies])
    return {"duplicate_route": [f"nav_id={again}"]}


def tells_the_pair_by_its_id(planted, nav_id):
    row = next(filter(of_nav(nav_id), planted.rows(ROUTES)))
    telling = f"{planted.scene}-{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}"
    planted.edit(ROUTES, put("nav_id", telling), of_nav(nav_id))

    def rename(task):
        task.update(nav_id=telling, task_id=f"{telling}-{task['modality'][0]}")

    return {"telling_id": task_keys(planted.edit_all(TRAIN, rename, of_nav(nav_id)))}


OF_SEVERAL_ROWS = (
    tells_the_goals_place, stands_twice, lacks_an_instance, trains_and_tests, has_a_route_that_trains_and_tests,
    has_no_route, is_a_route_alone, has_its_route_on_the_other_side, has_two_names, tells_the_pair_by_its_id,
)  # fmt: skip


def test_faults_of_tasks_and_routes(planted):
    expected = plant(planted, OF_TASKS)
    untouched = reversed([row["nav_id"] for row in planted.rows(ROUTES)])
    for fault in OF_SEVERAL_ROWS:
        for found_by, keys in fault(planted, next(untouched)).items():
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
