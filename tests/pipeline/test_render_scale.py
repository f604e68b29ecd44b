"""Recording many trajectories: kills, shares, budgets, workers, loose files, and the estimate beforehand."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.court import CONFIG, ROUTE, SCENE, files_of, run_whole
from support.court import write_inputs as write_some

from aerialdojo_gen.base.errors import RenderError, UsageError
from aerialdojo_gen.cli.render import duration_s, share_of
from aerialdojo_gen.pipeline.options import RunLimits
from aerialdojo_gen.pipeline.stages.work import render
from aerialdojo_gen.rendering import backend, recording
from aerialdojo_gen.rendering.codecs import to_metres
from aerialdojo_gen.rendering.estimate import estimate
from aerialdojo_gen.rendering.reader import read_recording
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.staging import AREA

pytestmark = pytest.mark.slow

ALL = CONFIG.model_copy(update={"limit": 0, "trajectories_per_part": 3})
FEW = CONFIG.model_copy(update={"limit": 2, "trajectories_per_part": 2})


def write_inputs(data):
    """Sound routes alone: a flagged view is rendered twice, and that takes its time."""
    write_some(data, bad=ROUTE)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What an undisturbed run by one process writes."""
    data = tmp_path_factory.mktemp("whole")
    write_inputs(data)
    (summary,) = run_whole(data, ALL)
    assert (summary.rows_in, summary.rows_out, summary.computed) == (12, 12 * 8, 4)
    return data


@pytest.mark.kill
def test_a_killed_run_goes_on_at_the_trajectory_and_ends_with_the_same_bytes(tmp_path, whole):
    write_inputs(tmp_path)
    code = f"from support.court import *; from pathlib import Path; run_whole(Path({str(tmp_path)!r}), CONFIG.model_copy(update={{'limit': 0, 'trajectories_per_part': 3}}))"  # noqa: E501
    process = subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parents[1])
    media = tmp_path / "media" / SCENE
    limit = time.monotonic() + 120
    while len(list(media.glob("nav_*/recording.json"))) < 4 and time.monotonic() < limit:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = {p: p.stat().st_mtime_ns for p in media.glob("nav_*/recording.json")}
    assert 4 <= len(kept) < 12
    # As if it had been killed in the middle of a file, whenever it was.
    half = tmp_path / AREA / "dead"
    (half / "new").mkdir(parents=True)
    (half / "new" / "front_rgb.mp4").write_bytes(b"half")
    (half / "lease").write_text(f"media/{SCENE}/nav_05")

    run_whole(tmp_path, ALL)
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    assert files_of(tmp_path) == files_of(whole)
    assert not (tmp_path / AREA).exists()


def test_the_shares_of_three_machines_are_what_one_writes(tmp_path, whole):
    machines = [tmp_path / str(k) for k in range(3)]
    together: dict[str, bytes] = {}
    for k, data in enumerate(machines):
        write_inputs(data)
        (summary,) = run_whole(data, ALL, limits=RunLimits((k, 3)))
        assert summary.computed in (1, 2)
        written = files_of(data)
        assert not together.keys() & written.keys()
        together |= written
    assert together == files_of(whole)


def test_two_workers_write_what_one_does(tmp_path, whole):
    write_inputs(tmp_path)
    run_whole(tmp_path, ALL, workers=2)
    assert files_of(tmp_path) == files_of(whole)


def test_a_spent_budget_leaves_whole_trajectories_and_the_next_run_goes_on(tmp_path, whole, monkeypatch):
    write_inputs(tmp_path)
    recorded = []
    record = render._Trajectory.record

    def slow(self, *args):
        recorded.append(self.nav_id)
        clock[0] += 10.0
        return record(self, *args)

    clock = [time.time()]
    monkeypatch.setattr(render._Trajectory, "record", slow)
    monkeypatch.setattr(time, "time", lambda: clock[0])
    (summary,) = run_whole(tmp_path, ALL, limits=RunLimits(deadline=clock[0] + 45.0))
    assert len(recorded) == 5
    assert summary.computed == 1
    assert not list((tmp_path / "media" / SCENE).glob(".*"))
    run_whole(tmp_path, ALL)
    assert len(recorded) == len(set(recorded)) == 12
    assert files_of(tmp_path) == files_of(whole)


def test_more_trajectories_keep_the_finished_ones_and_force_does_not(tmp_path, monkeypatch):
    write_inputs(tmp_path)
    recorded = []
    record = render._Trajectory.record
    monkeypatch.setattr(
        render._Trajectory, "record", lambda self, *args: recorded.append(self.nav_id) or record(self, *args)
    )
    run_whole(tmp_path, CONFIG)
    assert len(recorded) == 3
    run_whole(tmp_path, FEW)
    assert len(recorded) == len(set(recorded)) == 4
    run_whole(tmp_path, FEW, force=["render"])
    assert len(recorded) == 8


def lose_the_note(data):
    (data / "media" / SCENE / "nav_a" / "recording.json").write_text("{")
    for part in (data / "recordings" / SCENE).iterdir():
        part.unlink()


def test_a_damaged_recording_is_made_again(tmp_path, whole):
    data = shutil.copytree(whole, tmp_path / "data")
    folder = data / "media" / SCENE / "nav_a"
    for damage in (
        lambda: (folder / "down_depth.mkv").unlink(),
        lambda: (folder / "left_rgb.mp4").write_bytes((folder / "left_rgb.mp4").read_bytes()[:-7]),
        lambda: lose_the_note(data),
    ):
        damage()
        run_whole(data, ALL)
        assert files_of(data) == files_of(whole)


def test_a_flagged_view_is_rendered_once_again_and_a_fault_that_passes_leaves_no_flag(tmp_path, monkeypatch):
    write_inputs(tmp_path)
    calls = []
    record = recording.record_views

    def faulty(renderer, solid, views, poses, config, folder):
        flags = record(renderer, solid, views, poses, config, folder)
        calls.extend(views)
        return {view: own | {"frozen"} if calls.count(view) <= faults else own for view, own in flags.items()}

    monkeypatch.setattr(render, "record_views", faulty)
    monkeypatch.setattr(render, "choose_trajectories", lambda *_: ["nav_a"])
    only = CONFIG.model_copy(update={"views": ("front",)})
    for times, expected in ((1, 0), (10**6, 1)):
        faults = times
        calls.clear()
        (summary,) = run_whole(tmp_path, only, force=["render"])
        assert summary.counts["frozen"] == expected
    assert len(calls) == 2
    rows = store.read_scene(tmp_path, "recordings", SCENE).to_pylist()
    assert {r["modality"] for r in rows if "frozen" in r["flags"]} == {"rgb"}


def test_a_video_that_lacks_a_frame_is_flagged_missing(tmp_path, monkeypatch):
    write_inputs(tmp_path)
    write = recording.VideoWriter.write
    n = []

    def forgetful(self, frames):
        n.append(0)
        if len(n) % 5:
            write(self, frames)

    monkeypatch.setattr(recording.VideoWriter, "write", forgetful)
    monkeypatch.setattr(render, "choose_trajectories", lambda *_: ["nav_a"])
    (summary,) = run_whole(tmp_path, CONFIG.model_copy(update={"views": ("front",)}))
    assert summary.counts["missing"] == 2


def test_png_frames_hold_what_the_videos_do_and_instances_name_the_cubes(tmp_path, whole):
    write_inputs(tmp_path)
    config = CONFIG.model_copy(update={"frames": "png", "instances": True})
    run_whole(tmp_path, config)
    rows = {
        (r["nav_id"], r["view"], r["modality"]): r
        for r in store.read_scene(tmp_path, "recordings", SCENE).to_pylist()
    }
    assert len(rows) == 3 * 4 * 3
    row = rows["nav_a", "front", "depth"]
    assert row["codec"] == "png"
    assert sorted(p.name for p in (tmp_path / row["path"]).glob("*.png")) == [f"{k:06}.png" for k in range(6)]
    loose = read_recording(str(tmp_path / "media" / SCENE / "nav_a"))
    video = read_recording(whole / "media" / SCENE / "nav_a")
    assert len(loose) == 6
    for view in ("front", "left", "right", "down"):
        assert loose.cameras[view] == video.cameras[view]
        for k in (0, 5):
            assert np.array_equal(loose.depth_m[view][k], video.depth_m[view][k])
            assert np.abs(loose.rgb[view][k].astype(int) - video.rgb[view][k]).mean() < 12
    plain = cv2.imread(str(tmp_path / row["path"] / "000003.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(to_metres(plain), loose.depth_m["front"][3])
    # Instance 5 of the court (number 6 in the file) is the red cube.
    rgb, ids = loose.rgb["front"][0].astype(int), loose.instance["front"][0]
    assert (ids == 6).any()
    assert (rgb[ids == 6][:, 0] > 2 * rgb[ids == 6][:, 1:].max(axis=1)).all()


def test_a_camera_s_offset_is_in_the_pictures_and_in_the_metadata(tmp_path):
    write_inputs(tmp_path)
    config = CONFIG.model_copy(update={"offsets_m": {"front": (0.1, 0.0, -0.5)}, "views": ("front", "left")})
    run_whole(tmp_path, config)
    moved = read_recording(tmp_path / "media" / SCENE / "nav_a")
    assert np.array(moved.cameras["front"]["body_from_camera"])[:3, 3] == pytest.approx([0.1, 0.0, -0.5])
    assert np.array(moved.cameras["left"]["body_from_camera"])[:3, 3] == pytest.approx([0.0, 0.0, 0.0])
    # At (-3, 0, 2), facing east: the east wall is at x = 8, and seen 0.1 m from nearer.
    assert moved.depth_m["front"][0][32, 20] == pytest.approx(10.9, abs=1e-3)


def test_the_estimate_is_of_the_selection_and_near_the_truth(whole):
    said = estimate(whole, [SCENE], ALL, 0, 2)
    assert "with 2 workers on idle cores" in str(said)
    assert "with 1 worker on idle cores" in str(dataclasses.replace(said, workers=1))
    assert (said.trajectories, said.poses, said.videos) == (12, 72, 96)
    size = sum(r["bytes"] for r in store.read_scene(whole, "recordings", SCENE).to_pylist())
    assert 0.4 * size < said.size_bytes < 2.5 * size
    assert said.wall_s == pytest.approx(said.cpu_s / 2)
    assert "12 trajectories, 72 poses, 96 videos" in str(said)
    with pytest.raises(UsageError, match="nothing to record"):
        estimate(whole, [SCENE], ALL.model_copy(update={"split": "ood_train"}), 0, 2)


def test_the_readers_of_the_documentation_read_what_was_drawn(whole, project):
    folder = whole / "media" / SCENE / "nav_a"
    depth = np.stack(list(read_recording(folder).depth_m["front"]))
    depth[np.isinf(depth)] = 0.0
    blocks = re.findall(r"```python\n(.*?)```", (project / "docs" / "recordings.md").read_text(), re.DOTALL)
    assert len(blocks) == 3
    own, pyav, opencv = ({"folder": folder} for _ in blocks)
    for block, names in zip(blocks, (own, pyav, opencv), strict=True):
        exec(block, names)
    assert np.array_equal(own["recording"].rgb["front"][3], pyav["rgb"][3])
    for names in (pyav, opencv):
        assert np.array_equal(np.stack(names["depth_m"]), depth)


def test_shares_and_durations_are_read_or_refused():
    assert share_of("2/8") == (1, 8)
    assert [duration_s(t) for t in ("45s", "90m", "2h", "1h30m", "0.5d")] == [45, 5400, 7200, 5400, 43200]
    for text in ("0/8", "9/8", "8", "a/b"):
        with pytest.raises(UsageError, match=r"--shard .*: write I/N"):
            share_of(text)
    for text in ("2", "h", "2 h", "-1h"):
        with pytest.raises(UsageError, match=r"--budget .*: write a duration"):
            duration_s(text)


def test_auto_chooses_only_where_something_is_to_be_drawn(tmp_path, whole, monkeypatch):
    data, auto = shutil.copytree(whole, tmp_path / "data"), ALL.model_copy(update={"renderer": "auto"})

    def choose(_name):
        raise RenderError("asked")

    monkeypatch.setattr(backend, "choose_renderer", choose)
    # What one of the renderers drew is fresh, whichever it is.
    (summary,) = run_whole(data, auto)
    assert (summary.computed, summary.shards) == (0, len(list((data / "recordings").rglob("*.parquet"))))
    assert files_of(data) == files_of(whole)
    # Something is missing, or asked for anew: now it matters which.
    with pytest.raises(RenderError, match="asked"):
        run_whole(data, auto, force=["render"])
    next((data / "recordings").rglob("*.parquet")).unlink()
    with pytest.raises(RenderError, match="asked"):
        run_whole(data, auto)


def test_the_row_says_what_drew_it(whole):
    rows = store.read_scene(whole, "recordings", SCENE).to_pylist()
    assert {(r["renderer"], r["device"]) for r in rows} == {("pybullet", "TinyRenderer")}
    note = json.loads((whole / rows[0]["path"]).with_name("recording.json").read_text())
    key = ("view", "modality", "path", "sha256")
    assert {tuple(r[k] for k in key) for r in note["recordings"]} == {
        tuple(r[k] for k in key) for r in rows if r["nav_id"] == rows[0]["nav_id"]
    }


@pytest.fixture(scope="module")
def loose(tmp_path_factory):
    """Recordings as loose pictures."""
    data = tmp_path_factory.mktemp("loose")
    write_inputs(data)
    run_whole(data, LOOSE)
    return data


LOOSE = CONFIG.model_copy(update={"frames": "png", "views": ("front",), "limit": 2, "trajectories_per_part": 2})


def damage_picture(folder):
    raw = bytearray((folder / "front_rgb" / "000002.png").read_bytes())
    raw[len(raw) // 2] ^= 1
    (folder / "front_rgb" / "000002.png").write_bytes(raw)


DAMAGE = {
    "a picture lost": lambda folder: (folder / "front_depth" / "000003.png").unlink(),
    "a picture cut": lambda folder: os.truncate(folder / "front_rgb" / "000001.png", 100),
    "the camera lost": lambda folder: (folder / "front_rgb" / "camera.json").unlink(),
    "the note lost": lambda folder: (folder / "recording.json").unlink(),
    "a folder lost": lambda folder: shutil.rmtree(folder / "front_rgb"),
    "all lost": lambda folder: shutil.rmtree(folder.parents[1]),
    "a file in a folder's place": lambda folder: (
        shutil.rmtree(folder / "front_rgb"), (folder / "front_rgb").write_text("x")
    ),
}  # fmt: skip


def test_loose_pictures_that_are_lost_or_cut_are_recorded_again(tmp_path, loose):
    data = shutil.copytree(loose, tmp_path / "data")
    for what, damage in DAMAGE.items():
        (summary,) = run_whole(data, LOOSE)
        assert summary.computed == 0, what
        damage(data / "media" / SCENE / "nav_b")
        (summary,) = run_whole(data, LOOSE)
        assert summary.computed >= 1, what
        assert files_of(data) == files_of(loose), what


def test_verify_finds_a_flipped_bit_and_records_that_trajectory_alone_again(tmp_path, loose, whole):
    for source, config in ((loose, LOOSE), (whole, ALL)):
        data = shutil.copytree(source, tmp_path / config.frames)
        media = data / "media" / SCENE
        if config.frames == "png":
            damage_picture(media / "nav_b")
        else:
            raw = bytearray((media / "nav_b" / "left_rgb.mp4").read_bytes())
            raw[-200] ^= 1
            (media / "nav_b" / "left_rgb.mp4").write_bytes(raw)
        kept = {p: p.stat().st_mtime_ns for p in media.rglob("*") if p.is_file() and "nav_b" not in p.parts}
        (summary,) = run_whole(data, config)
        assert summary.computed == 0
        (summary,) = run_whole(data, config, limits=RunLimits(verify=True))
        assert summary.computed == 1
        assert files_of(data) == files_of(source)
        assert {p: p.stat().st_mtime_ns for p in kept} == kept
        (summary,) = run_whole(data, config, limits=RunLimits(verify=True))
        assert summary.computed == 0
