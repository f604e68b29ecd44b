"""Faults planted in meshes, in reference images, and in what the tables say of both."""

import hashlib
import math
import struct
import zlib
from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.planting import PlantedFault, add, changed, check, definitions, named, outcome_of, plant, put, scene_data

from aerialdojo_gen.dataset.validate import ValidationOptions, validate
from aerialdojo_gen.dataset.validate.meshes import thing_hovers

OBJECTS, SCENES, LANDMARKS = "release/objects", "release/scenes", "release/landmarks"
ANCHORS, VIEWPOINTS = "release/anchors", "release/viewpoints"


def test_meshes_that_lie_elsewhere(planted, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    (planted.data / "meshes").rename(elsewhere)
    report = validate(ValidationOptions(planted.release, (planted.scene,), meshes=elsewhere, pictures=0,
                                        pipeline=definitions()))  # fmt: skip
    assert not report.faults
    assert not [o for o in report.outcomes if o.skipped and "mesh" in o.skipped]
    assert next(o.rows for o in report.outcomes if o.check == "oracle_fails") == sum(
        len(planted.rows(f"routes/{subset}")) for subset in ("train", "test")
    )
    assert check(planted, meshes=tmp_path) == {"mesh_missing": [f"scene={planted.scene}"]}
    assert check(planted, use_meshes=False) == {}


def put_a_link_out(path, raw):
    path.rename(path.parents[2] / "outside.glb")
    path.symlink_to(path.parents[2] / "outside.glb")


@pytest.mark.parametrize(
    ("spoil", "found_by"),
    [
        (lambda path, raw: path.unlink(), "mesh_missing"),
        (lambda path, raw: path.write_bytes(raw[:-40] + bytes([raw[-40] ^ 1]) + raw[-39:]), "mesh_digest"),
        (lambda path, raw: path.write_bytes(raw[:-1000]), "mesh_damaged"),
        (put_a_link_out, "mesh_outside"),
        *((path, "mesh_outside") for path in ("../outside.glb", "/etc/hostname", "meshes/../../outside.glb")),
    ],
)
def test_a_mesh_file_at_fault(planted, spoil, found_by):
    path = planted.data / "meshes" / f"{planted.scene}.glb"
    if isinstance(spoil, str):
        planted.edit(SCENES, put("mesh_path", spoil))
    else:
        spoil(path, path.read_bytes())
    if found_by == "mesh_damaged":
        planted.edit(SCENES, put("mesh_sha256", hashlib.sha256(path.read_bytes()).hexdigest()))
    assert check(planted) == {found_by: [f"scene={planted.scene}"]}


@pytest.mark.parametrize(("up_m", "found"), [(0.0, 0), (0.04, 0), (0.3, 1), (30.0, 1)])
def test_a_thing_that_is_lifted_hovers_and_no_other(planted, up_m, found):
    data = scene_data(planted)
    assert not outcome_of(data, "thing_hovers").faults
    scene = data.mesh
    bench = next(i for i in scene.instances if i.category == "bench")
    parts = tuple(replace(p, vertices=p.vertices + np.array([0.0, 0.0, up_m])) for p in bench.parts)
    lifted = tuple(replace(i, parts=parts) if i is bench else i for i in scene.instances)
    data.cache["mesh"] = replace(scene, instances=lifted)
    findings = list(thing_hovers(data, data["scenes"]))
    assert [bench.node in f.found for f in findings] == [True] * found


def other_anchor(row):
    """No selected one, nor one of the objects in which faults are planted; another stands before it."""
    return not row["selected"] and row["object_id"] > 1 and row["anchor_id"] > 0


# A fault of a landmark's node keeps its box from being judged, so that it is planted in another copy.
OF_NODES = (
    PlantedFault("scene_of_mesh", SCENES, changed("n_triangles", lambda v: v + 1)),
    PlantedFault("landmark_node", LANDMARKS, put("mesh_node", "nothing_000")),
    PlantedFault("object_node", OBJECTS, put("mesh_node", "nothing_000")),
    PlantedFault("object_category", OBJECTS, changed("category", lambda v: v + "_")),
    PlantedFault("anchor_surface", ANCHORS, changed("surface_distance_m", lambda v: v + 0.01), other_anchor),
    PlantedFault("anchor_clearance", ANCHORS, changed("clearance_m", lambda v: v - 0.01), other_anchor),
    PlantedFault("anchor_visibility", ANCHORS, changed("visible_fraction", lambda v: v / 10), other_anchor),
)
OF_VALUES = (
    PlantedFault("scene_of_mesh", SCENES, changed("ceiling_m", lambda v: v + 1.0)),
    PlantedFault("landmark_box", LANDMARKS, changed("z_m", lambda v: v + 0.01)),
    PlantedFault("object_box", OBJECTS, changed("size_z_m", lambda v: v + 0.01)),
    PlantedFault("anchor_score", ANCHORS, changed("part_contrast", lambda v: v / 2 + 0.4), other_anchor),
    PlantedFault("anchor_score", ANCHORS, changed("score_geometric", lambda v: v - 0.01), other_anchor),
    PlantedFault("anchor_score", ANCHORS, put("score_vlm", 0.5), other_anchor),
    PlantedFault("anchor_rank", ANCHORS, changed("score", lambda v: v + 1.0), other_anchor),
    PlantedFault("anchor_yaw", ANCHORS, changed("yaw_rad", lambda v: v * 0.5), other_anchor),
)


@pytest.mark.parametrize("faults", [OF_NODES, OF_VALUES])
def test_values_that_the_mesh_contradicts(planted, faults):
    expected = plant(planted, faults)
    if "anchor_rank" in expected:
        # It is not what its parts make of it, either.
        expected["anchor_score"] = sorted(expected["anchor_score"] + expected["anchor_rank"])
        # The routes that start there start with another yaw than its own, turned.
        routes = planted.rows("routes/train") + planted.rows("routes/test")
        start = "object_id={start_object_id} anchor_id={start_anchor_id}"
        starts = [named("routes/train", row) for row in routes if [start.format(**row)] == expected["anchor_yaw"]]
        assert starts
        expected["start_anchor"] = sorted(starts)
    assert check(planted) == expected


def picture(array):
    return cv2.imencode(".png", np.asarray(array, dtype=np.uint8))[1].tobytes()


def shifted(row):
    """A box of the same size a few pixels off, still in the picture."""
    for low, high in (("box_u0_px", "box_u1_px"), ("box_v0_px", "box_v1_px")):
        step = 8 if row[high] <= 312 else -8 if row[low] >= 8 else 0
        if step:
            return {low: row[low] + step, high: row[high] + step}
    raise AssertionError("the object fills its picture")


def with_words(png):
    """The same picture with a text chunk before its end."""
    text = b"Comment\0goal at 3.5, 2.0"
    chunk = struct.pack(">I", len(text)) + b"tEXt" + text + struct.pack(">I", zlib.crc32(b"tEXt" + text))
    return png[:-12] + chunk + png[-12:]


def of_a_front(row):
    return row["selected"] and row["off_front_rad"] is not None and row["no_front_reason"] is None


# Rows of three tables: pictures, what is told of them, and anchors of other objects' fronts.
PICTURED = (
    PlantedFault("image_missing", OBJECTS, put("reference_image", None)),
    PlantedFault("image_damaged", OBJECTS, changed("reference_image", lambda png: png[:-2000])),
    PlantedFault("image_damaged", OBJECTS, put("reference_image", b"\xff\xd8\xff a JPEG")),
    PlantedFault("image_damaged", OBJECTS, changed("reference_image", with_words)),
    PlantedFault("image_blank", OBJECTS, put("reference_image", picture(np.full((320, 320, 3), 130)))),
    PlantedFault("anchor_front", ANCHORS, add("off_front_rad", 0.1), of_a_front),
    PlantedFault("anchor_front", ANCHORS, put("off_front_rad", None), of_a_front),
    PlantedFault("anchor_front", ANCHORS, put("no_front_reason", "in_collision"), of_a_front),
    PlantedFault("anchor_score", ANCHORS, put("part_front", 1.5), of_a_front),
    PlantedFault("anchor_score", ANCHORS, put("part_front", None), of_a_front),
)
BOXED = (
    PlantedFault("image_box", OBJECTS, put("box_u1_px", 321)),
    PlantedFault("image_box", OBJECTS, lambda row: row.update(box_v0_px=row["box_v1_px"])),
    PlantedFault("image_box", OBJECTS, lambda row: row.update(image_fraction=1.0, box_u0_px=row["box_u1_px"] - 1)),
    PlantedFault("image_target", OBJECTS, changed("image_fraction", lambda v: v / 2)),
    PlantedFault("image_target", OBJECTS, lambda row: row.update(shifted(row))),
    PlantedFault("viewpoint_place", VIEWPOINTS, add("x_m", 0.05)),
    PlantedFault("viewpoint_place", VIEWPOINTS, add("yaw_rad", 0.05)),
)


@pytest.mark.parametrize("faults", [PICTURED, BOXED])
def test_reference_images_fronts_and_viewpoints_at_fault(planted, faults):
    targets = {row["target_object_id"] for row in planted.rows("routes/train")}
    assert targets == {row["object_id"] for row in planted.rows(OBJECTS)}
    rows = planted.rows(VIEWPOINTS)
    stranger = rows[-1] | {"object_id": 999}
    planted.write(VIEWPOINTS, [*rows, stranger], sort=False)
    expected = plant(planted, faults)
    assert check(planted) == expected | {"viewpoint_object": [named(VIEWPOINTS, stranger)]}


def has_a_telling_part(row):
    return row["tells_shown"] == 1.0


def missing_a_part_that_is_shown(row):
    row.update(tells_missing="some part", tells_shown=0.0)


TOLD = (
    PlantedFault("image_pose", OBJECTS, add("reference_z_m", 0.2), has_a_telling_part),
    PlantedFault("image_pose", OBJECTS, add("reference_yaw_rad", 0.1), has_a_telling_part),
    PlantedFault("image_pose", OBJECTS, add("step_back_m", 0.5), has_a_telling_part),
    PlantedFault("image_pose", OBJECTS, put("step_back_m", 200.0), has_a_telling_part),
    PlantedFault("image_tells", OBJECTS, put("tells_shown", None), has_a_telling_part),
    PlantedFault("image_tells", OBJECTS, put("tells_shown", 0.1), has_a_telling_part),
    PlantedFault("image_tells", OBJECTS, missing_a_part_that_is_shown, has_a_telling_part),
)


def test_pictures_that_say_what_is_not_so(planted):
    warned = {warning.key for warning in outcome_of(scene_data(planted), "image_tells").warnings}
    assert warned == {named(OBJECTS, row) for row in planted.rows(OBJECTS) if row["tells_missing"] is not None}
    expected = plant(planted, TOLD)
    found = check(planted)
    assert {name: found.pop(name) for name in expected} == expected
    # The anchor says how far its picture steps back, too, and so do the tasks.
    assert set(found) == {"anchor_step", "task_goal"}


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


def test_two_objects_with_one_picture(planted):
    first, second = planted.rows(OBJECTS)[:2]
    shared = put("reference_image_id", first["reference_image_id"])
    for table in (OBJECTS, "tasks/train", "tasks/test"):
        planted.edit_all(table, shared, lambda row: row["reference_image_id"] == second["reference_image_id"])
    assert check(planted, use_meshes=False) == {"image_id_twice": [named(OBJECTS, second)]}


def test_an_object_with_anchors_of_ranks_that_do_not_count_up(planted):
    rows = planted.rows(ANCHORS)
    routes = planted.rows("routes/train") + planted.rows("routes/test")
    starts = {(row["start_object_id"], row["start_anchor_id"]) for row in routes}
    last = max(row["anchor_id"] for row in rows)
    row = next(row for row in rows if row["anchor_id"] == last)
    started = (row["object_id"], last) in starts
    row["anchor_id"] += 1
    planted.write(ANCHORS, rows)
    found = check(planted, use_meshes=False)
    assert found.pop("anchor_rank") == [named(ANCHORS, row)]
    assert set(found) == ({"unknown_start"} if started else set())
