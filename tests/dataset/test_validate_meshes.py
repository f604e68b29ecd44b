"""Faults planted in meshes, in what the tables say of them, and in reference images."""

import hashlib
import os
import struct
import zlib

import cv2
import numpy as np
import pytest
from support.planting import check, definitions

from aerialdojo_gen.dataset.validate import ValidationOptions, validate

OBJECTS, SCENES = "release/objects", "release/scenes"


def mesh(planted):
    return planted.data / "meshes" / f"{planted.scene}.glb"


def scene_key(planted):
    return [f"scene={planted.scene}"]


def object_of(row):
    return [f"object_id={row['object_id']}"]


def test_a_mesh_that_is_not_there(planted):
    mesh(planted).unlink()
    assert check(planted) == {"mesh_missing": scene_key(planted)}
    assert check(planted, use_meshes=False) == {}


def test_meshes_that_lie_elsewhere(planted, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    (planted.data / "meshes").rename(elsewhere)
    report = validate(ValidationOptions(planted.release, (planted.scene,), meshes=elsewhere, pipeline=definitions()))
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
    planted.edit(SCENES, lambda row: row.update(mesh_sha256=digest))
    assert check(planted) == {"mesh_damaged": scene_key(planted)}


@pytest.mark.parametrize("path", ["../outside.glb", "/etc/hostname", "meshes/../../outside.glb"])
def test_a_mesh_path_that_leads_out(planted, path):
    planted.edit(SCENES, lambda row: row.update(mesh_path=path))
    assert check(planted) == {"mesh_outside": scene_key(planted)}


def test_a_mesh_that_is_a_link_out(planted, tmp_path):
    mesh(planted).rename(tmp_path / "outside.glb")
    os.symlink(tmp_path / "outside.glb", mesh(planted))
    assert check(planted) == {"mesh_outside": scene_key(planted)}


@pytest.mark.parametrize(
    ("found_by", "table", "name", "value"),
    [
        ("scene_of_mesh", SCENES, "n_triangles", lambda v: v + 1),
        ("scene_of_mesh", SCENES, "ceiling_m", lambda v: v + 1.0),
        ("object_node", OBJECTS, "mesh_node", lambda _: "nothing_000"),
        ("landmark_node", "release/landmarks", "mesh_node", lambda _: "nothing_000"),
        ("object_box", OBJECTS, "size_z_m", lambda v: v + 0.01),
        ("landmark_box", "release/landmarks", "z_m", lambda v: v + 0.01),
        ("anchor_surface", "release/anchors", "surface_distance_m", lambda v: v + 0.01),
        ("anchor_clearance", "release/anchors", "clearance_m", lambda v: v - 0.01),
        ("anchor_yaw", "release/anchors", "yaw_rad", lambda v: v * 0.5),
        ("anchor_rank", "release/anchors", "score", lambda v: v + 1.0),
        ("anchor_visibility", "release/anchors", "visible_fraction", lambda v: v / 10),
        ("anchor_score", "release/anchors", "part_contrast", lambda v: v / 2 + 0.4),
        ("anchor_score", "release/anchors", "score_geometric", lambda v: v - 0.01),
        ("anchor_score", "release/anchors", "score_vlm", lambda _: 0.5),
        ("object_category", OBJECTS, "category", lambda v: v + "_"),
    ],
)
def test_a_value_that_the_mesh_contradicts(planted, found_by, table, name, value):
    row = planted.edit(table, lambda row: row.update({name: value(row[name])}), lambda row: not row.get("selected"))
    key = {OBJECTS: ["object_id"], "release/anchors": ["object_id", "anchor_id"], SCENES: ["scene"]}
    expected = {found_by: [" ".join(f"{c}={row[c]}" for c in key.get(table, ["landmark_id"]))]}
    if (found_by, name) == ("anchor_rank", "score"):
        expected["anchor_score"] = expected["anchor_rank"]
    if found_by == "anchor_yaw":
        # The routes that start there start with another yaw than its own, turned.
        expected["start_anchor"] = sorted(
            f"nav_id={route['nav_id']}"
            for side in ("train", "test")
            for route in planted.rows(f"routes/{side}")
            if (route["start_object_id"], route["start_anchor_id"]) == (row["object_id"], row["anchor_id"])
        )
    assert check(planted) == {check_name: keys for check_name, keys in expected.items() if keys}


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


@pytest.mark.parametrize(
    ("found_by", "change"),
    [
        ("image_missing", lambda row: row.update(reference_image=None)),
        ("image_damaged", lambda row: row.update(reference_image=row["reference_image"][:-2000])),
        ("image_damaged", lambda row: row.update(reference_image=b"\xff\xd8\xff a JPEG")),
        ("image_damaged", lambda row: row.update(reference_image=with_words(row["reference_image"]))),
        ("image_blank", lambda row: row.update(reference_image=picture(np.full((320, 320, 3), 130)))),
        ("image_box", lambda row: row.update(box_u1_px=321)),
        ("image_box", lambda row: row.update(box_v0_px=row["box_v1_px"])),
        ("image_box", lambda row: row.update(image_fraction=1.0, box_u0_px=row["box_u1_px"] - 1)),
        ("image_target", lambda row: row.update(image_fraction=row["image_fraction"] / 2)),
        ("image_target", lambda row: row.update(shifted(row))),
    ],
)
def test_a_reference_image_at_fault(planted, found_by, change):
    targets = {row["target_object_id"] for row in planted.rows("routes/train")}
    row = planted.edit(OBJECTS, change, lambda row: row["object_id"] in targets)
    assert check(planted) == {found_by: object_of(row)}


def test_two_objects_with_one_picture(planted):
    first, second = planted.rows(OBJECTS)[:2]
    shared = first["reference_image_id"]
    planted.edit(
        OBJECTS, lambda r: r.update(reference_image_id=shared), lambda r: r["object_id"] == second["object_id"]
    )
    for side in ("train", "test"):
        planted.edit_all(
            f"tasks/{side}",
            lambda row: row.update(reference_image_id=shared),
            lambda row: row["reference_image_id"] == second["reference_image_id"],
        )
    assert check(planted) == {"image_id_twice": object_of(second)}


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
    found = check(planted)
    assert found.pop("anchor_rank") == [f"object_id={changed['object_id']} anchor_id={last + 1}"]
    assert set(found) == ({"unknown_start"} if old in starts else set())
