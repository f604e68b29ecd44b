"""The stages `render` and `reference-images` on a small court, files and all."""

from __future__ import annotations

import hashlib
import io
import math
import shutil

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.court import CONFIG, ROUTE, SCENE, run_all, write_inputs
from support.rendered import courtyard

from aerialdojo_gen.base.config.sections import ReferenceImagesConfig
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.pipeline.stages.work import reference_images
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.reader import read_recording
from aerialdojo_gen.rendering.sample import choose_trajectories
from aerialdojo_gen.rendering.trajectory import by_steps, by_time
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import from_rows


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    write_inputs(folder)
    return folder


@pytest.fixture(scope="module")
def outputs(data):
    return run_all(data, CONFIG)


@pytest.fixture(scope="module")
def recordings(outputs):
    return [row for output in outputs for row in output.tables["recordings"].to_pylist()]


def test_one_recording_a_setting_view_and_modality(data, recordings):
    assert len(recordings) == 3 * 4 * 2
    assert len({r["nav_id"] for r in recordings}) == 3
    for row in recordings:
        file = data / row["path"]
        assert file.stat().st_size == row["bytes"]
        assert hashlib.sha256(file.read_bytes()).hexdigest() == row["sha256"]
        assert row["n_frames"] == 6


def test_sound_recordings_have_no_flags_and_a_bad_one_is_kept_with_its_own(recordings, outputs):
    for row in recordings:
        assert row["ok"] == (not row["flags"])
        if row["nav_id"] != "nav_b":
            assert row["flags"] == []
    bad = {(r["view"], r["modality"]): r["flags"] for r in recordings if r["nav_id"] == "nav_b"}
    assert "camera_inside" in bad["front", "rgb"]
    assert {"camera_inside", "depth_mismatch"} <= set(bad["front", "depth"])
    assert sum(o.counts.get("camera_inside", 0) for o in outputs) >= 2


def test_frames_line_up_with_the_trajectory_and_the_videos(data, outputs):
    frames = [r for o in outputs for r in o.tables["frames"].to_pylist() if r["nav_id"] == "nav_a"]
    assert [f["step"] for f in frames] == list(range(6))
    assert [f["action"] for f in frames] == ROUTE["action"]
    recording = read_recording(data / "media" / SCENE / "nav_a")
    camera = Camera(64, 64, 90.0)
    assert len(recording) == 6
    world = scene_renderer(courtyard(), "pybullet")
    for f in (frames[4], frames[1]):
        for view in schemas.VIEWS:
            picture = world.render(camera, view_pose((f["x_m"], f["y_m"], f["z_m"]), f["yaw_rad"], view))
            depth = recording.depth_m[view][f["frame"]]
            assert np.array_equal(np.isinf(depth), np.isinf(picture.depth_m))
            seen = np.isfinite(depth)
            assert depth[seen] == pytest.approx(picture.depth_m[seen], abs=5.1e-4)
            assert np.array(recording.cameras[view]["K"]) == pytest.approx(camera.matrix)
            body = np.array(recording.cameras[view]["body_from_camera"])
            assert body == pytest.approx(view_pose((0, 0, 0), 0, view))


def test_rendering_again_gives_the_same_rows_and_bytes(tmp_path, recordings):
    write_inputs(tmp_path)
    again = [row for output in run_all(tmp_path, CONFIG) for row in output.tables["recordings"].to_pylist()]
    assert again == recordings


def test_sampling_by_time_renders_frames_between_poses(tmp_path):
    write_inputs(tmp_path)
    outputs = run_all(tmp_path, CONFIG.model_copy(update={"sampling": "time", "views": ("down",)}))
    frames = [r for o in outputs for r in o.tables["frames"].to_pylist() if r["nav_id"] == "nav_a"]
    # 3 m, 1 m, 15°, 1 m and 0.39 m at 3 m/s and 90°/s are 1.96 s.
    assert len(frames) == 31
    assert len(read_recording(tmp_path / "media" / SCENE / "nav_a")) == 31
    assert (frames[-1]["x_m"], frames[-1]["action"], frames[-1]["step"]) == (-0.5, 0, 5)


def test_a_subset_without_routes_gives_empty_tables(data):
    (output,) = run_all(data, CONFIG.model_copy(update={"split": "test"}))
    assert [t.num_rows for t in output.tables.values()] == [0, 0]


@given(st.lists(st.sampled_from(schemas.SETTINGS), max_size=40), st.integers(1, 10), st.integers(0, 3))
def test_a_larger_limit_only_adds(settings, limit, seed):
    rows = [{"nav_id": f"n{k}", "setting": s} for k, s in enumerate(settings)]
    some, more = choose_trajectories(rows, limit, seed), choose_trajectories(rows, limit + 1, seed)
    assert set(some) <= set(more)
    assert len(some) == sum(min(limit, settings.count(s)) for s in schemas.SETTINGS)
    assert choose_trajectories(rows[::-1], limit, seed) == some


poses = st.lists(
    st.tuples(*[st.floats(-20, 20)] * 3, st.floats(-math.pi, math.pi), st.integers(0, 16)), min_size=1, max_size=12
)


@given(poses)
def test_frames_by_time_follow_the_path_at_no_more_than_cruise_speed(rows):
    table = np.array(rows)
    position, yaw, action = table[:, :3], table[:, 3], table[:, 4]
    frames = by_time(position, yaw, action, 15.0, 3.0, 90.0)
    assert frames.position[0] == pytest.approx(position[0], abs=1e-9)
    assert np.array_equal(frames.position[-1], position[-1])
    assert frames.yaw_rad[-1] == yaw[-1]
    assert frames.step[-1] == len(position) - 1
    assert (np.diff(frames.step) >= 0).all()
    assert np.array_equal(frames.action, action[frames.step])
    assert frames.time_s == pytest.approx(np.arange(len(frames.time_s)) / 15.0)
    assert (np.linalg.norm(np.diff(frames.position, axis=0), axis=1) <= 3.0 / 15.0 + 1e-6).all()
    turn = np.abs(np.angle(np.exp(1j * np.diff(frames.yaw_rad))))
    assert (np.degrees(turn) <= 90.0 / 15.0 + 1e-6).all()


def test_frames_by_steps_are_the_poses():
    frames = by_steps(np.eye(3), [0.1, 0.2, 0.3], [1, 2, 0], 15.0)
    assert np.array_equal(frames.position, np.eye(3))
    assert frames.step.tolist() == [0, 1, 2]
    assert frames.time_s == pytest.approx([0, 1 / 15, 2 / 15])


def test_a_box_holds_every_pixel_and_no_row_or_column_without_one():
    mask = np.zeros((6, 8), dtype=bool)
    mask[2, 3] = True
    assert reference_images.box_of(mask) == (3, 2, 4, 3)
    mask[4, 1] = True
    assert reference_images.box_of(mask) == (1, 2, 4, 5)
    assert reference_images.box_of(np.ones((6, 8), dtype=bool)) == (0, 0, 8, 6)


def test_reference_images_show_their_objects_where_the_box_says(data):
    config = ReferenceImagesConfig(width=160, height=160)
    (output,) = run_all(data, config, reference_images, "reference-images")
    red, blue, west = output.tables["references"].to_pylist()
    image = cv2.imdecode(np.frombuffer(red["reference_image"], dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(
        int
    )
    assert image.shape == (160, 160, 3)
    pose = view_pose((4.0, 1.5, 1.5), 0.0, "front")
    uv, _ = project(Camera(160, 160, 90.0), pose, courtyard()["red_cube"].vertices)
    expected = [*uv.min(axis=0), *uv.max(axis=0)]
    assert [red[f"box_{e}_px"] for e in ("u0", "v0", "u1", "v1")] == pytest.approx(expected, abs=1.01)
    reddish = (image[..., 0] > 2 * image[..., 1]) & (image[..., 0] > 2 * image[..., 2])
    assert red["image_fraction"] == pytest.approx(reddish.mean(), abs=0.01)
    assert reddish[red["box_v0_px"] : red["box_v1_px"], red["box_u0_px"] : red["box_u1_px"]].mean() > 0.95

    assert blue["reference_image"] is not None
    assert (blue["image_fraction"], blue["box_u0_px"]) == (0.0, None)
    assert (west["reference_image"], west["image_fraction"]) == (None, None)
    assert output.counts == {"no_anchor": 1, "not_in_view": 1}
    assert io.BytesIO(red["reference_image"]).read(4) == b"\x89PNG"


@pytest.mark.parametrize(("most_m", "back_m"), [(15.0, 2.0), (1.25, 1.25), (0.0, 0.0)])
def test_a_picture_steps_back_as_far_as_its_anchor_and_the_pipeline_say(data, tmp_path, most_m, back_m):
    folder = tmp_path / "data"
    shutil.copytree(data, folder)
    rows = [row | {"step_back_m": 2.0} for row in store.read_scene(data, "anchors", SCENE).to_pylist()]
    store.write_shard(folder, "anchors", SCENE, 0, from_rows(schemas.ANCHORS, rows))
    config = ReferenceImagesConfig(width=160, height=160, step_back_m=most_m)
    (output,) = run_all(folder, config, reference_images, "reference-images")
    red = output.tables["references"].to_pylist()[0]
    # The anchor stands at (4, 1.5, 1.5) and looks east.
    place = [red[f"reference_{name}"] for name in ("x_m", "y_m", "z_m", "yaw_rad")]
    assert place == pytest.approx([4.0 - back_m, 1.5, 1.5, 0.0])
    assert red["step_back_m"] == back_m
    uv, _ = project(Camera(160, 160, 90.0), view_pose(place[:3], 0.0, "front"), courtyard()["red_cube"].vertices)
    expected = [*uv.min(axis=0), *uv.max(axis=0)]
    assert [red[f"box_{e}_px"] for e in ("u0", "v0", "u1", "v1")] == pytest.approx(expected, abs=1.01)
