"""Faults planted in meshes, in what the tables say of them, and in reference images."""

import hashlib
import os
import struct
import zlib

import cv2
import numpy as np
import pytest
from support.planting import PlantedFault, changed, check, definitions, named, plant, put

from aerialdojo_gen.dataset.validate import ValidationOptions, validate

OBJECTS, SCENES, LANDMARKS, ANCHORS = (f"release/{name}" for name in ("objects", "scenes", "landmarks", "anchors"))


def mesh(planted):
    return planted.data / "meshes" / f"{planted.scene}.glb"


def scene_key(planted):
    return [f"scene={planted.scene}"]


def test_a_mesh_that_is_not_there(planted):
    mesh(planted).unlink()
    assert check(planted) == {"mesh_missing": scene_key(planted)}
    assert check(planted, use_meshes=False) == {}


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
    assert check(planted, meshes=tmp_path) == {"mesh_missing": scene_key(planted)}


def test_a_mesh_with_one_vertex_moved(planted):
    raw = bytearray(mesh(planted).read_bytes())
    raw[-40] ^= 1
    mesh(planted).write_bytes(raw)
    assert check(planted) == {"mesh_digest": scene_key(planted)}


def test_a_mesh_that_is_cut_short(planted):
    raw = mesh(planted).read_bytes()[:-1000]
    mesh(planted).write_bytes(raw)
    digest = hashlib.sha256(raw).hexdigest()
    planted.edit(SCENES, put("mesh_sha256", digest))
    assert check(planted) == {"mesh_damaged": scene_key(planted)}


@pytest.mark.parametrize("path", ["../outside.glb", "/etc/hostname", "meshes/../../outside.glb"])
def test_a_mesh_path_that_leads_out(planted, path):
    planted.edit(SCENES, put("mesh_path", path))
    assert check(planted) == {"mesh_outside": scene_key(planted)}


def test_a_mesh_that_is_a_link_out(planted, tmp_path):
    mesh(planted).rename(tmp_path / "outside.glb")
    os.symlink(tmp_path / "outside.glb", mesh(planted))
    assert check(planted) == {"mesh_outside": scene_key(planted)}


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
        starts = [
            named(f"routes/{side}", route)
            for side in ("train", "test")
            for route in planted.rows(f"routes/{side}")
            if [f"object_id={route['start_object_id']} anchor_id={route['start_anchor_id']}"]
            == expected["anchor_yaw"]
        ]
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


OF_PICTURES = (
    PlantedFault("image_missing", OBJECTS, put("reference_image", None)),
    PlantedFault("image_damaged", OBJECTS, changed("reference_image", lambda png: png[:-2000])),
    PlantedFault("image_damaged", OBJECTS, put("reference_image", b"\xff\xd8\xff a JPEG")),
    PlantedFault("image_damaged", OBJECTS, changed("reference_image", with_words)),
    PlantedFault("image_blank", OBJECTS, put("reference_image", picture(np.full((320, 320, 3), 130)))),
)
OF_BOXES = (
    PlantedFault("image_box", OBJECTS, put("box_u1_px", 321)),
    PlantedFault("image_box", OBJECTS, lambda row: row.update(box_v0_px=row["box_v1_px"])),
    PlantedFault("image_box", OBJECTS, lambda row: row.update(image_fraction=1.0, box_u0_px=row["box_u1_px"] - 1)),
    PlantedFault("image_target", OBJECTS, changed("image_fraction", lambda v: v / 2)),
    PlantedFault("image_target", OBJECTS, lambda row: row.update(shifted(row))),
)


@pytest.mark.parametrize("faults", [OF_PICTURES, OF_BOXES])
def test_reference_images_at_fault(planted, faults):
    targets = {row["target_object_id"] for row in planted.rows("routes/train")}
    assert targets == {row["object_id"] for row in planted.rows(OBJECTS)}
    expected = plant(planted, faults)
    assert check(planted) == expected


def test_two_objects_with_one_picture(planted):
    first, second = planted.rows(OBJECTS)[:2]
    shared = first["reference_image_id"]
    planted.edit(OBJECTS, put("reference_image_id", shared), lambda row: row["object_id"] == second["object_id"])
    for side in ("train", "test"):
        planted.edit_all(
            f"tasks/{side}",
            put("reference_image_id", shared),
            lambda row: row["reference_image_id"] == second["reference_image_id"],
        )
    assert check(planted, use_meshes=False) == {"image_id_twice": [named(OBJECTS, second)]}


def test_an_object_with_anchors_of_ranks_that_do_not_count_up(planted):
    rows = planted.rows("release/anchors")
    starts = {
        (row["start_object_id"], row["start_anchor_id"])
        for side in ("train", "test")
        for row in planted.rows(f"routes/{side}")
    }
    last = max(row["anchor_id"] for row in rows)
    changed = next(row for row in rows if row["anchor_id"] == last)
    old = (changed["object_id"], changed["anchor_id"])
    changed["anchor_id"] += 1
    planted.write("release/anchors", rows)
    found = check(planted, use_meshes=False)
    assert found.pop("anchor_rank") == [named(ANCHORS, changed)]
    assert set(found) == ({"unknown_start"} if old in starts else set())
