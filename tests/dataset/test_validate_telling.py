"""Faults planted in what a release says of fronts, viewpoints, telling parts and where pictures were taken."""

import math

from support.planting import PlantedFault, add, check, named, outcome_of, plant, put, scene_data

OBJECTS, ANCHORS, VIEWPOINTS = "release/objects", "release/anchors", "release/viewpoints"


def has_a_telling_part(row):
    return row["tells_shown"] == 1.0


OF_PICTURES = (
    PlantedFault("image_pose", OBJECTS, add("reference_z_m", 0.2), has_a_telling_part),
    PlantedFault("image_pose", OBJECTS, add("reference_yaw_rad", 0.1), has_a_telling_part),
    PlantedFault("image_pose", OBJECTS, add("step_back_m", 0.5), has_a_telling_part),
    PlantedFault("image_pose", OBJECTS, put("step_back_m", 200.0), has_a_telling_part),
    PlantedFault("image_tells", OBJECTS, put("tells_shown", None), has_a_telling_part),
    PlantedFault("image_tells", OBJECTS, put("tells_shown", 0.1), has_a_telling_part),
)


def test_pictures_that_say_what_is_not_so(planted):
    expected = plant(planted, OF_PICTURES)
    found = check(planted)
    assert {name: found.pop(name) for name in expected} == expected
    # The anchor says how far its picture steps back, too, and so do the tasks.
    assert set(found) == {"anchor_step", "task_goal"}


def test_a_part_that_is_shown_and_told_as_missing(planted):
    warned = {warning.key for warning in outcome_of(scene_data(planted), "image_tells").warnings}
    assert warned == {named(OBJECTS, row) for row in planted.rows(OBJECTS) if row["tells_missing"] is not None}
    said = {"tells_missing": "some part", "tells_shown": 0.0}
    row = planted.edit(OBJECTS, lambda row: row.update(said), lambda row: row["tells_shown"] == 1.0)
    assert check(planted) == {"image_tells": [named(OBJECTS, row)]}


def test_a_camera_behind_a_wall(planted):
    """The pose agrees with the anchor and the step, and the step goes through something."""
    anchors = {row["object_id"]: row for row in planted.rows(ANCHORS) if row["selected"]}
    far = 14.9

    def step_back(row):
        a = anchors[row["object_id"]]
        x, y = a["x_m"] - far * math.cos(a["yaw_rad"]), a["y_m"] - far * math.sin(a["yaw_rad"])
        row.update(reference_x_m=x, reference_y_m=y, step_back_m=far)

    planted.edit_all(OBJECTS, step_back, lambda _: True)
    told = outcome_of(scene_data(planted), "image_pose").faults
    assert told
    assert all("between the anchor and the camera" in fault.found for fault in told)


def of_a_front(row):
    return row["selected"] and row["off_front_rad"] is not None and row["no_front_reason"] is None


OF_FRONTS = (
    PlantedFault("anchor_front", ANCHORS, add("off_front_rad", 0.1), of_a_front),
    PlantedFault("anchor_front", ANCHORS, put("off_front_rad", None), of_a_front),
    PlantedFault("anchor_front", ANCHORS, put("no_front_reason", "in_collision"), of_a_front),
    PlantedFault("anchor_score", ANCHORS, put("part_front", 1.5), of_a_front),
    PlantedFault("anchor_score", ANCHORS, put("part_front", None), of_a_front),
)


def test_anchors_that_say_of_their_fronts_what_is_not_so(planted):
    expected = plant(planted, OF_FRONTS)
    assert check(planted) == expected


def test_viewpoints_out_of_place_and_of_no_object(planted):
    expected = plant(planted, [PlantedFault("viewpoint_place", VIEWPOINTS, add(n, 0.05)) for n in ("x_m", "yaw_rad")])
    rows = planted.rows(VIEWPOINTS)
    stranger = rows[-1] | {"object_id": 999}
    planted.write(VIEWPOINTS, [*rows, stranger], sort=False)
    expected["viewpoint_object"] = [named(VIEWPOINTS, stranger)]
    assert check(planted) == expected
