"""The stages `render` and `reference-images` on a small court: files and all, in full and as profiles have them."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.court import CONFIG, ROUTE, SCENE, run_all, run_whole, write_inputs
from support.doc_blocks import blocks
from support.rendered import courtyard

from aerialdojo_gen.base.config.pipeline import Pipeline, with_overrides
from aerialdojo_gen.base.config.sections import ReferenceImagesConfig, RenderConfig
from aerialdojo_gen.base.errors import ConfigError, RenderError
from aerialdojo_gen.cli.render import profile_keys
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.pipeline.stages.work import reference_images
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.codecs import VideoWriter
from aerialdojo_gen.rendering.placement import TILED
from aerialdojo_gen.rendering.reader import open_view, read_recording
from aerialdojo_gen.rendering.recording import by_time
from aerialdojo_gen.rendering.sample import choose_trajectories
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import from_rows

# One file a trajectory with the views side by side, and depth to a share of itself.
TRAINING = CONFIG.model_copy(update={"layout": "tiled", "depth_step": 0.005, "instances": True, "crf": 10})


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


@pytest.fixture(scope="module")
def tiled(tmp_path_factory):
    data = tmp_path_factory.mktemp("tiled")
    write_inputs(data, bad=ROUTE)
    run_whole(data, TRAINING)
    return data


def test_one_recording_a_setting_view_and_modality_and_a_bad_one_is_kept_with_its_flags(data, recordings, outputs):
    assert len(recordings) == 3 * 4 * 2
    assert len({r["nav_id"] for r in recordings}) == 3
    for row in recordings:
        file = data / row["path"]
        assert file.stat().st_size == row["bytes"]
        assert hashlib.sha256(file.read_bytes()).hexdigest() == row["sha256"]
        assert row["n_frames"] == 6
        assert row["ok"] == (not row["flags"])
        assert row["nav_id"] == "nav_b" or row["ok"]
    bad = {(r["view"], r["modality"]): r["flags"] for r in recordings if r["nav_id"] == "nav_b"}
    assert "camera_inside" in bad["front", "rgb"]
    assert {"camera_inside", "depth_mismatch"} <= set(bad["front", "depth"])
    assert sum(o.counts.get("camera_inside", 0) for o in outputs) >= 2


def test_a_tiled_trajectory_is_one_file_and_every_row_says_where_its_view_lies(tiled):
    rows = [r for r in store.read_scene(tiled, "recordings", SCENE).to_pylist() if r["nav_id"] == "nav_a"]
    folder = tiled / "media" / SCENE / "nav_a"
    assert sorted(p.name for p in folder.iterdir()) == ["recording.json", TILED]
    assert len(rows) == 4 * 3
    assert {(r["path"], r["bytes"]) for r in rows} == {
        (f"media/{SCENE}/nav_a/{TILED}", (folder / TILED).stat().st_size)
    }
    assert all(r["ok"] for r in rows)
    assert {(r["view"], r["left_px"], r["top_px"]) for r in rows} == {
        ("front", 0, 0), ("left", 64, 0), ("right", 0, 64), ("down", 64, 64)
    }  # fmt: skip
    assert {(r["modality"], r["stream"], r["depth_step"]) for r in rows} == {
        ("rgb", 0, None), ("depth", 1, 0.005), ("instance", 2, None)
    }  # fmt: skip


def test_every_view_comes_back_as_it_was_drawn(data, outputs, tiled):
    """In an order that jumps, as training does, and each view by itself."""
    folders = [root / "media" / SCENE / "nav_a" for root in (data, tiled)]
    full, tiles = map(read_recording, folders)
    kinds = ((full, folders[0] / "{}_rgb.mp4", 0.0, 12), (tiles, folders[1] / TILED, 0.0026, 6))
    world, camera = scene_renderer(courtyard(), "pybullet"), Camera(64, 64, 90.0)
    for k, view in [(4, "down"), (1, "front"), (1, "left"), (5, "right"), (0, "front"), (-1, "right"), (3, "left")]:
        p, yaw = [ROUTE[a][k] for a in ("x_m", "y_m", "z_m")], ROUTE["yaw_rad"][k]
        picture = world.render(camera, view_pose(p, yaw, view))
        for recording, file, share, colour in kinds:
            assert (len(recording), recording.fps) == (6, 15.0)
            depth = recording.depth_m[view][k]
            assert np.array_equal(np.isinf(depth), np.isinf(picture.depth_m))
            seen = np.isfinite(depth)
            assert (np.abs(depth[seen] - picture.depth_m[seen]) <= share * picture.depth_m[seen] + 5.1e-4).all()
            assert np.abs(recording.rgb[view][k].astype(int) - picture.rgb).mean() < colour
            own = recording.cameras[view]
            assert np.array(own["K"]) == pytest.approx(camera.matrix)
            assert np.array(own["body_from_camera"]) == pytest.approx(view_pose((0, 0, 0), 0, view))
            assert np.array_equal(open_view(Path(str(file).format(view)), view, "rgb")[k], recording.rgb[view][k])
        assert np.array_equal(tiles.instance[view][k] == 0, np.isinf(tiles.depth_m[view][k]))
    for recording in full, tiles:
        assert np.array_equal(recording.rgb["left"][2:4][1], recording.rgb["left"][3])
    assert full.depth_m["front"].millimetres[0].dtype == np.uint16
    with pytest.raises(RenderError, match="not millimetres"):
        tiles.depth_m["front"].millimetres  # noqa: B018


def test_the_readers_of_the_documentation_read_what_was_drawn(data, outputs, tiled, project):
    """The block on tiled files is indented, as the smoke data have none to run it on."""
    found = blocks(project / "docs/recordings.md")
    fenced = [block.text for block in found if block.language == "python"]
    (on_tiles,) = [block.text for block in found if TILED in block.text and "av.open" in block.text]
    assert len(fenced) == 3
    folder = data / "media" / SCENE / "nav_a"
    own, pyav, opencv = ({"folder": folder} for _ in fenced)
    tiles = {"av": av, "np": np, "json": json, "folder": tiled / "media" / SCENE / "nav_a"}
    for text, names in zip((*fenced, on_tiles), (own, pyav, opencv, tiles), strict=True):
        exec(text, names)
    assert np.array_equal(own["recording"].rgb["front"][3], pyav["rgb"][3])
    depth = np.stack(list(read_recording(folder).depth_m["front"]))
    depth[np.isinf(depth)] = 0.0
    for names in (pyav, opencv):
        assert np.array_equal(np.stack(names["depth_m"]), depth)
    left = np.stack(list(read_recording(tiles["folder"]).depth_m["left"]))
    assert np.allclose(np.stack(tiles["depth_m"]), left, rtol=1e-6)


TILE = {"left_px": 0, "top_px": 0, "width": 8, "height": 8}


@pytest.mark.parametrize(
    ("streams", "tiles"),
    [
        (["rgb", "depth"], None), (["rgb", "depth"], []), (["rgb", "depth"], {"front": {}}),
        (["rgb", "depth"], {"front": TILE | {"left_px": 8, "width": 16, "height": 16}}),
        (["rgb", "depth"], {"front": TILE | {"left_px": -1}}), (["rgb"], {"front": TILE}), (None, {}),
        (["rgb", "depth"], {"front": TILE | {"depth_step": 7}}), (["rgb", "depth", "instance"], {"front": TILE}),
    ],
)  # fmt: skip
def test_a_tiled_file_that_says_what_is_not_so_is_refused_by_name(tmp_path, streams, tiles):
    comment = json.dumps({"streams": streams, "tiles": tiles})
    with VideoWriter(tmp_path / TILED, ["rgb", "depth"], 16, 16, 15.0, comment=comment) as writer:
        writer.write({"rgb": np.zeros((16, 16, 3), np.uint8), "depth": np.zeros((16, 16), np.uint16)})
    with pytest.raises(RenderError, match=r"views\.mkv"):
        read_recording(tmp_path)


def test_a_profile_sets_what_is_not_said_and_goes_before_the_pipeline_s_keys_on_the_command_line():
    training = RenderConfig(profile="training")
    assert (training.width, training.height, training.layout, training.crf) == (320, 320, "tiled", 28)
    assert RenderConfig(profile="training", width=128).width == 128
    with pytest.raises(ValueError, match='layout = "tiled" is one video'):
        RenderConfig(profile="training", frames="png")
    pipeline = Pipeline(render=RenderConfig(width=128, crf=30, limit=7))
    training = with_overrides(pipeline, "render", **profile_keys("training")).render
    assert (training.width, training.crf, training.limit) == (320, 28, 7)
    assert with_overrides(Pipeline(render=training), "render", **profile_keys("full")).render == RenderConfig(limit=7)
    assert with_overrides(pipeline, "render", **profile_keys(None)).render == pipeline.render
    with pytest.raises(ConfigError, match="profile"):
        with_overrides(pipeline, "render", **profile_keys("tiny"))


def test_frames_line_up_with_the_trajectory(outputs):
    frames = [r for o in outputs for r in o.tables["frames"].to_pylist() if r["nav_id"] == "nav_a"]
    assert [f["step"] for f in frames] == [f["frame"] for f in frames] == list(range(6))
    assert [f["time_s"] for f in frames] == pytest.approx([k / 15 for k in range(6)])
    for name, values in ROUTE.items():
        assert [f[name] for f in frames] == values


def test_sampling_by_time_renders_frames_between_poses(tmp_path):
    write_inputs(tmp_path, bad=ROUTE, n_long=0)
    outputs = run_all(tmp_path, CONFIG.model_copy(update={"sampling": "time", "views": ("down",)}))
    frames = [r for o in outputs for r in o.tables["frames"].to_pylist() if r["nav_id"] == "nav_a"]
    # 3 m, 1 m, 15°, 1 m and 0.39 m at 3 m/s and 90°/s are 1.96 s.
    assert len(frames) == 31
    assert len(read_recording(tmp_path / "media" / SCENE / "nav_a")) == 31
    assert (frames[-1]["x_m"], frames[-1]["action"], frames[-1]["step"]) == (-0.5, 0, 5)


def test_a_subset_without_routes_gives_empty_tables(data):
    (output,) = run_all(data, CONFIG.model_copy(update={"split": "test"}))
    assert [t.num_rows for t in output.tables.values()] == [0, 0]


@settings(max_examples=40)
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


@settings(max_examples=40)
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


def test_a_box_holds_every_pixel_and_no_row_or_column_without_one():
    mask = np.zeros((6, 8), dtype=bool)
    mask[2, 3] = mask[4, 1] = True
    assert reference_images.box_of(mask) == (1, 2, 4, 5)
    assert reference_images.box_of(np.ones((6, 8), dtype=bool)) == (0, 0, 8, 6)


def red_box(place):
    """Where the red cube is in a picture from a pose, by projection."""
    uv, _ = project(Camera(160, 160, 90.0), view_pose(place[:3], place[3], "front"), courtyard()["red_cube"].vertices)
    return pytest.approx([*uv.min(axis=0), *uv.max(axis=0)], abs=1.01)


BOX = ("box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px")


def test_reference_images_show_their_objects_where_the_box_says(data):
    config = ReferenceImagesConfig(width=160, height=160)
    (output,) = run_all(data, config, reference_images, "reference-images")
    red, blue, west = output.tables["references"].to_pylist()
    assert red["reference_image"][:4] == b"\x89PNG"
    image = cv2.imdecode(np.frombuffer(red["reference_image"], dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert image.shape == (160, 160, 3)
    left, top, right, bottom = box = [red[name] for name in BOX]
    assert box == red_box((4.0, 1.5, 1.5, 0.0))
    reddish = image[..., 0] > 2 * image[..., 1:].max(axis=-1).astype(int)
    assert red["image_fraction"] == pytest.approx(reddish.mean(), abs=0.01)
    assert reddish[top:bottom, left:right].mean() > 0.95

    assert blue["reference_image"] is not None
    assert (blue["image_fraction"], blue["box_u0_px"]) == (0.0, None)
    assert (west["reference_image"], west["image_fraction"]) == (None, None)
    assert output.counts == {"no_anchor": 1, "not_in_view": 1}


@pytest.mark.parametrize(("most_m", "back_m"), [(15.0, 2.0), (1.25, 1.25), (0.0, 0.0)])
def test_a_picture_steps_back_as_far_as_its_anchor_and_the_pipeline_say(data, tmp_path, most_m, back_m):
    shutil.copytree(data, tmp_path / "data", ignore=shutil.ignore_patterns("media"))
    rows = [row | {"step_back_m": 2.0} for row in store.read_scene(data, "anchors", SCENE).to_pylist()]
    store.write_shard(tmp_path / "data", "anchors", SCENE, 0, from_rows(schemas.ANCHORS, rows))
    config = ReferenceImagesConfig(width=160, height=160, step_back_m=most_m)
    (output,) = run_all(tmp_path / "data", config, reference_images, "reference-images")
    red = output.tables["references"].to_pylist()[0]
    # The anchor stands at (4, 1.5, 1.5) and looks east.
    place = [red[f"reference_{name}"] for name in ("x_m", "y_m", "z_m", "yaw_rad")]
    assert place == pytest.approx([4.0 - back_m, 1.5, 1.5, 0.0])
    assert red["step_back_m"] == back_m
    assert [red[name] for name in BOX] == red_box(place)
