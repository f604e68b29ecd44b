"""Faults planted in what a release says of fronts, viewpoints, telling parts and where pictures were taken."""

import math

import pytest
from support.planting import check, definitions

from aerialdojo_gen.dataset.validate import ValidationOptions, validate

OBJECTS, ANCHORS, VIEWPOINTS = "release/objects", "release/anchors", "release/viewpoints"


def first(planted, table, fits):
    return next(row for row in planted.rows(table) if fits(row))


def change(planted, table, chosen, keys, **values):
    """Change one row, found by its keys."""

    def edit(row):
        if all(row[key] == chosen[key] for key in keys):
            row.update(values)

    planted.edit(table, edit)
    return [" ".join(f"{key}={chosen[key]}" for key in keys)]


@pytest.mark.parametrize(
    ("values", "found_by"),
    [
        (lambda row: {"reference_z_m": row["reference_z_m"] + 0.2}, "image_pose"),
        (lambda row: {"reference_yaw_rad": row["reference_yaw_rad"] + 0.1}, "image_pose"),
        (lambda row: {"step_back_m": row["step_back_m"] + 0.5}, "image_pose"),
        (lambda row: {"step_back_m": 200.0}, "image_pose"),
        (lambda row: {"tells_shown": None}, "image_tells"),
        (lambda row: {"tells_shown": 0.1}, "image_tells"),
    ],
)
def test_a_picture_that_says_what_is_not_so(planted, values, found_by):
    row = first(planted, OBJECTS, lambda row: row["tells_shown"] is not None)
    keys = change(planted, OBJECTS, row, ["object_id"], **values(row))
    found = check(planted)
    assert found.pop(found_by) == keys
    # The anchor says how far its picture steps back, too, and so do the tasks.
    assert set(found) <= {"anchor_step", "task_goal"}


def test_a_part_that_is_shown_and_told_as_missing(planted):
    row = first(planted, OBJECTS, lambda row: row["tells_shown"] == 1.0)
    report = validate(ValidationOptions(planted.release, (planted.scene,), pipeline=definitions()))
    warned = {w.key for w in report.warnings if w.check == "image_tells"}
    assert warned == {
        f"object_id={row['object_id']}" for row in planted.rows(OBJECTS) if row["tells_missing"] is not None
    }
    keys = change(planted, OBJECTS, row, ["object_id"], tells_missing="some part", tells_shown=0.0)
    assert check(planted) == {"image_tells": keys}


def test_a_camera_behind_a_wall(planted):
    """The pose agrees with the anchor and the step, and the step goes through something."""
    anchors = {row["object_id"]: row for row in planted.rows(ANCHORS) if row["selected"]}
    far = 14.9
    blocked = []
    for row in planted.rows(OBJECTS):
        a = anchors[row["object_id"]]
        x, y = a["x_m"] - far * math.cos(a["yaw_rad"]), a["y_m"] - far * math.sin(a["yaw_rad"])
        change(planted, OBJECTS, row, ["object_id"], reference_x_m=x, reference_y_m=y, step_back_m=far)
        blocked.append(row["object_id"])
    report = validate(ValidationOptions(planted.release, (planted.scene,), pipeline=definitions()))
    told = [fault for fault in report.faults if fault.check == "image_pose"]
    assert told
    assert all("between the anchor and the camera" in fault.found for fault in told)


@pytest.mark.parametrize(
    ("values", "found_by"),
    [
        (lambda row: {"off_front_rad": row["off_front_rad"] + 0.1}, "anchor_front"),
        (lambda row: {"off_front_rad": None}, "anchor_front"),
        (lambda row: {"no_front_reason": "in_collision"}, "anchor_front"),
        (lambda row: {"part_front": 1.5}, "anchor_score"),
        (lambda row: {"part_front": None}, "anchor_score"),
    ],
)
def test_an_anchor_that_says_of_its_front_what_is_not_so(planted, values, found_by):
    fits = lambda row: row["selected"] and row["off_front_rad"] is not None and row["no_front_reason"] is None  # noqa: E731
    row = first(planted, ANCHORS, fits)
    keys = change(planted, ANCHORS, row, ["object_id", "anchor_id"], **values(row))
    assert check(planted) == {found_by: keys}


def test_a_viewpoint_out_of_place(planted):
    row = planted.rows(VIEWPOINTS)[0]
    keys = ["object_id", "viewpoint_id"]
    named = change(planted, VIEWPOINTS, row, keys, x_m=row["x_m"] + 0.05)
    assert check(planted) == {"viewpoint_place": named}
    change(planted, VIEWPOINTS, row, keys, x_m=row["x_m"], yaw_rad=row["yaw_rad"] + 0.05)
    assert check(planted) == {"viewpoint_place": named}


def test_a_viewpoint_of_no_object(planted):
    last = planted.rows(VIEWPOINTS)[-1]
    planted.write(VIEWPOINTS, [*planted.rows(VIEWPOINTS), last | {"object_id": 999}], sort=False)
    number = f"object_id=999 viewpoint_id={last['viewpoint_id']}"
    assert check(planted) == {"viewpoint_object": [number]}
