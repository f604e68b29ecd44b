"""Recordings for training: one file a trajectory with the views side by side, and depth to a share of itself."""

from __future__ import annotations

import json

import av
import numpy as np
import pytest
from support.court import CONFIG, ROUTE, SCENE, run_whole, write_inputs
from support.doc_blocks import blocks
from support.rendered import courtyard

from aerialdojo_gen.base.config.pipeline import Pipeline, with_overrides
from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.base.errors import ConfigError, RenderError
from aerialdojo_gen.cli.render import profile_keys
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.pipeline.options import RunLimits
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.codecs import VideoWriter
from aerialdojo_gen.rendering.estimate import estimate
from aerialdojo_gen.rendering.placement import TILED
from aerialdojo_gen.rendering.reader import open_view, read_recording
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store

TRAINING = CONFIG.model_copy(update={"layout": "tiled", "depth_step": 0.005, "instances": True, "crf": 10})


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    data = tmp_path_factory.mktemp("training")
    write_inputs(data, bad=ROUTE)
    run_whole(data, TRAINING)
    return data


def test_a_trajectory_is_one_file_and_every_row_says_where_its_view_lies(data):
    rows = [r for r in store.read_scene(data, "recordings", SCENE).to_pylist() if r["nav_id"] == "nav_a"]
    folder = data / "media" / SCENE / "nav_a"
    assert sorted(p.name for p in folder.iterdir()) == ["recording.json", TILED]
    assert len(rows) == 4 * 3
    assert {r["path"] for r in rows} == {f"media/{SCENE}/nav_a/{TILED}"}
    assert {r["bytes"] for r in rows} == {(folder / TILED).stat().st_size}
    assert all(r["ok"] for r in rows)
    assert {(r["view"], r["left_px"], r["top_px"]) for r in rows} == {
        ("front", 0, 0), ("left", 64, 0), ("right", 0, 64), ("down", 64, 64)
    }  # fmt: skip
    assert {(r["modality"], r["stream"], r["depth_step"]) for r in rows} == {
        ("rgb", 0, None), ("depth", 1, 0.005), ("instance", 2, None)
    }  # fmt: skip


def test_every_view_comes_back_as_it_was_drawn(data):
    """In an order that jumps, as training does, and each view by itself."""
    recording = read_recording(data / "media" / SCENE / "nav_a")
    world, camera = scene_renderer(courtyard(), "pybullet"), Camera(64, 64, 90.0)
    assert (len(recording), recording.fps) == (6, 15.0)
    for k, view in [(4, "down"), (1, "front"), (1, "left"), (5, "right"), (0, "front"), (-1, "right"), (3, "left")]:
        p, yaw = [ROUTE[a][k] for a in ("x_m", "y_m", "z_m")], ROUTE["yaw_rad"][k]
        picture = world.render(camera, view_pose(p, yaw, view))
        depth = recording.depth_m[view][k]
        assert np.array_equal(np.isinf(depth), np.isinf(picture.depth_m))
        seen = np.isfinite(depth)
        assert (np.abs(depth[seen] - picture.depth_m[seen]) <= 0.0026 * picture.depth_m[seen] + 5.1e-4).all()
        assert np.abs(recording.rgb[view][k].astype(int) - picture.rgb).mean() < 6
        assert np.array_equal(recording.instance[view][k] == 0, np.isinf(depth))
        assert np.array(recording.cameras[view]["K"]) == pytest.approx(camera.matrix)
    assert np.array_equal(recording.rgb["left"][2:4][1], recording.rgb["left"][3])
    with pytest.raises(RenderError, match="not millimetres"):
        recording.depth_m["front"].millimetres  # noqa: B018


def test_the_block_of_the_page_reads_a_tiled_view(data, project):
    """docs/recordings.md has the block indented, as the smoke data have no tiled recording to run it on."""
    folder = data / "media" / SCENE / "nav_a"
    (text,) = [
        block.text
        for block in blocks(project / "docs/recordings.md")
        if TILED in block.text and "av.open" in block.text
    ]
    names = {"av": av, "np": np, "json": json, "folder": folder}
    exec(text, names)
    left = read_recording(folder).depth_m["left"]
    assert np.allclose(np.stack(names["depth_m"]), np.stack([left[k] for k in range(len(left))]), rtol=1e-6)


def test_the_full_recording_of_the_same_route_agrees(data, tmp_path):
    write_inputs(tmp_path, bad=ROUTE)
    run_whole(tmp_path, CONFIG)
    full = read_recording(tmp_path / "media" / SCENE / "nav_a")
    small = read_recording(data / "media" / SCENE / "nav_a")
    for view in schemas.VIEWS:
        one, other = full.depth_m[view][4], small.depth_m[view][4]
        seen = np.isfinite(one)
        assert (np.abs(one[seen] - other[seen]) <= 0.0026 * one[seen] + 1e-3).all()
        path = tmp_path / "media" / SCENE / "nav_a" / f"{view}_rgb.mp4"
        assert np.array_equal(open_view(path, view, "rgb")[4], full.rgb[view][4])
        tile = open_view(data / "media" / SCENE / "nav_a" / TILED, view, "rgb")
        assert np.array_equal(tile[4], small.rgb[view][4])
    assert full.depth_m["front"].millimetres[0].dtype == np.uint16


def test_what_is_whole_stays_and_a_flipped_bit_is_found(data, tmp_path):
    write_inputs(tmp_path, bad=ROUTE)
    run_whole(tmp_path, TRAINING)
    file = tmp_path / "media" / SCENE / "nav_a" / TILED
    sound = file.read_bytes()
    assert sound == (data / "media" / SCENE / "nav_a" / TILED).read_bytes()
    (summary,) = run_whole(tmp_path, TRAINING, limits=RunLimits(verify=True))
    assert summary.computed == 0
    file.write_bytes(sound[:-200] + bytes([sound[-200] ^ 1]) + sound[-199:])
    (summary,) = run_whole(tmp_path, TRAINING, limits=RunLimits(verify=True))
    assert summary.computed == 1
    assert file.read_bytes() == sound


def test_the_estimate_counts_files(data):
    said = estimate(data, [SCENE], TRAINING, 0, 2)
    assert (said.trajectories, said.poses, said.videos) == (3, 18, 3)


@pytest.mark.parametrize(
    "said",
    [
        {}, {"tiles": {}}, {"tiles": [], "streams": ["rgb", "depth"]},
        {"tiles": {"front": {}}, "streams": ["rgb", "depth"]},
        {"tiles": {"front": {"left_px": 8, "top_px": 0, "width": 16, "height": 16}}, "streams": ["rgb", "depth"]},
        {"tiles": {"front": {"left_px": -1, "top_px": 0, "width": 8, "height": 8}}, "streams": ["rgb", "depth"]},
        {"tiles": {"front": {"left_px": 0, "top_px": 0, "width": 8, "height": 8}}, "streams": ["rgb"]},
        {"tiles": {"front": {"left_px": 0, "top_px": 0, "width": 8, "height": 8}},
         "streams": ["rgb", "depth", "instance"]},
        {"tiles": {"front": {"left_px": 0, "top_px": 0, "width": 8, "height": 8, "depth_step": 7}},
         "streams": ["rgb", "depth"]},
    ],
)  # fmt: skip
def test_a_tiled_file_that_says_what_is_not_so_is_refused_by_name(tmp_path, said):
    with VideoWriter(tmp_path / TILED, ["rgb", "depth"], 16, 16, 15.0, comment=json.dumps(said)) as writer:
        writer.write({"rgb": np.zeros((16, 16, 3), np.uint8), "depth": np.zeros((16, 16), np.uint16)})
    with pytest.raises(RenderError, match=r"views\.mkv"):
        read_recording(tmp_path)


def test_a_profile_sets_what_is_not_said():
    training = RenderConfig(profile="training")
    assert (training.width, training.height, training.layout, training.crf) == (320, 320, "tiled", 28)
    assert RenderConfig(profile="training", width=128).width == 128
    with pytest.raises(ValueError, match='layout = "tiled" is one video'):
        RenderConfig(profile="training", frames="png")


def test_a_profile_on_the_command_line_goes_before_the_pipeline_s_keys():
    pipeline = Pipeline(render=RenderConfig(width=128, crf=30, limit=7))
    training = with_overrides(pipeline, "render", **profile_keys("training")).render
    assert (training.width, training.crf, training.limit) == (320, 28, 7)
    assert with_overrides(Pipeline(render=training), "render", **profile_keys("full")).render == RenderConfig(limit=7)
    assert with_overrides(pipeline, "render", **profile_keys(None)).render == pipeline.render
    with pytest.raises(ConfigError, match="profile"):
        with_overrides(pipeline, "render", **profile_keys("tiny"))
