"""Recording many trajectories: kills, shares, budgets, workers, loose files, and the estimate beforehand."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from support import court
from support.court import ROUTE, SCENE, files_of, run_whole

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

CONFIG = court.CONFIG.model_copy(update={"views": ("front", "left")})
ALL = CONFIG.model_copy(update={"limit": 0, "trajectories_per_part": 2})
FEW = CONFIG.model_copy(update={"limit": 2, "trajectories_per_part": 2})
LOOSE = FEW.model_copy(update={"frames": "png", "views": ("front",), "instances": True})


def write_inputs(data):
    """Seven routes, sound ones alone: a flagged view is rendered twice, and that takes its time."""
    court.write_inputs(data, bad=ROUTE, n_long=5)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What an undisturbed run by one process writes."""
    data = tmp_path_factory.mktemp("whole")
    write_inputs(data)
    (summary,) = run_whole(data, ALL)
    assert (summary.rows_in, summary.rows_out, summary.computed) == (7, 7 * 4, 4)
    return data


@pytest.fixture(scope="module")
def loose(tmp_path_factory):
    """Recordings as loose pictures."""
    data = tmp_path_factory.mktemp("loose")
    write_inputs(data)
    run_whole(data, LOOSE)
    return data


@pytest.fixture
def recorded(monkeypatch):
    """The trajectories that are recorded, one after another."""
    recorded = []
    record = render._Trajectory.record
    monkeypatch.setattr(
        render._Trajectory, "record", lambda self, *args: recorded.append(self.nav_id) or record(self, *args)
    )
    return recorded


# It is killed in the middle of the files of the fourth trajectory, the second of its shard.
RUN = """
import os, signal, sys
from pathlib import Path
from support.court import run_whole
from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.rendering.codecs import VideoWriter
write, written = VideoWriter.write, []
def killed(self, frames):
    write(self, frames)
    written.append(frames)
    if len(written) == 76:
        os.kill(os.getpid(), signal.SIGKILL)
VideoWriter.write = killed
run_whole(Path(sys.argv[1]), RenderConfig.model_validate_json(sys.argv[2]))
"""


@pytest.mark.kill
def test_a_killed_run_goes_on_at_the_trajectory_and_ends_with_the_same_bytes(tmp_path, whole, recorded):
    write_inputs(tmp_path)
    command = [sys.executable, "-c", RUN, tmp_path, ALL.model_dump_json()]
    killed = subprocess.run(command, cwd=Path(__file__).parents[1], check=False)
    assert killed.returncode == -signal.SIGKILL
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "media" / SCENE).glob("nav_*/recording.json")}
    assert len(kept) == 3
    assert list((tmp_path / AREA).rglob("front_depth.mkv")), "it was killed in the middle of a file"

    run_whole(tmp_path, ALL)
    assert len(recorded) == 4
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    assert files_of(tmp_path) == files_of(whole)
    assert not (tmp_path / AREA).exists()


def test_the_shares_of_three_machines_are_what_one_writes(tmp_path, whole):
    together: dict[str, bytes] = {}
    for k in range(3):
        data = tmp_path / str(k)
        write_inputs(data)
        (summary,) = run_whole(data, ALL, limits=RunLimits((k, 3)))
        assert summary.computed in (1, 2)
        written = files_of(data)
        assert not together.keys() & written.keys()
        together |= written
    assert together == files_of(whole)


def test_a_spent_budget_leaves_whole_trajectories_and_the_next_run_goes_on(tmp_path, whole, recorded, monkeypatch):
    write_inputs(tmp_path)
    began = time.time()
    monkeypatch.setattr(time, "time", lambda: began + 10.0 * len(recorded))
    (summary,) = run_whole(tmp_path, ALL, limits=RunLimits(deadline=began + 25.0))
    assert len(recorded) == 3
    assert summary.computed == 1
    assert not list((tmp_path / "media" / SCENE).glob(".*"))
    run_whole(tmp_path, ALL)
    assert len(recorded) == len(set(recorded)) == 7
    assert files_of(tmp_path) == files_of(whole)


def test_more_trajectories_keep_the_finished_ones_and_force_does_not(tmp_path, recorded):
    write_inputs(tmp_path)
    run_whole(tmp_path, CONFIG)
    assert len(recorded) == 3
    run_whole(tmp_path, FEW)
    assert len(recorded) == len(set(recorded)) == 4
    run_whole(tmp_path, FEW, force=["render"])
    assert len(recorded) == 8


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


def test_png_frames_hold_what_the_videos_do_and_instances_name_the_cubes(loose, whole):
    rows = {(r["nav_id"], r["modality"]): r for r in store.read_scene(loose, "recordings", SCENE).to_pylist()}
    assert len(rows) == 4 * 3
    row = rows["nav_a", "depth"]
    assert row["codec"] == "png"
    assert sorted(p.name for p in (loose / row["path"]).glob("*.png")) == [f"{k:06}.png" for k in range(6)]
    pictures = read_recording(str(loose / "media" / SCENE / "nav_a"))
    video = read_recording(whole / "media" / SCENE / "nav_a")
    assert len(pictures) == 6
    assert pictures.cameras["front"] == video.cameras["front"]
    for k in (0, 5):
        assert np.array_equal(pictures.depth_m["front"][k], video.depth_m["front"][k])
        assert np.abs(pictures.rgb["front"][k].astype(int) - video.rgb["front"][k]).mean() < 12
    plain = cv2.imread(str(loose / row["path"] / "000003.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(to_metres(plain), pictures.depth_m["front"][3])
    # Instance 5 of the court (number 6 in the file) is the red cube.
    rgb, ids = pictures.rgb["front"][0].astype(int), pictures.instance["front"][0]
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
    assert "7 trajectories, 42 poses, 28 videos" in str(said)
    assert estimate(whole, [SCENE], ALL.model_copy(update={"layout": "tiled"}), 0, 2).videos == 7
    size = sum(r["bytes"] for r in store.read_scene(whole, "recordings", SCENE).to_pylist())
    assert 0.4 * size < said.size_bytes < 2.5 * size
    assert said.wall_s == pytest.approx(said.cpu_s / 2)
    with pytest.raises(UsageError, match="nothing to record"):
        estimate(whole, [SCENE], ALL.model_copy(update={"split": "ood_train"}), 0, 2)


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


def lose_the_note(folder):
    (folder / "recording.json").write_text("{")
    for part in (folder.parents[2] / "recordings" / SCENE).iterdir():
        part.unlink()


VIDEO_DAMAGE = {
    "a video lost": lambda folder: (folder / "front_depth.mkv").unlink(),
    "a video cut": lambda folder: os.truncate(folder / "left_rgb.mp4", (folder / "left_rgb.mp4").stat().st_size - 7),
    "note and rows lost": lose_the_note,
}
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


def test_what_is_lost_or_cut_is_recorded_again(tmp_path, loose, whole):
    for source, config, damages in ((loose, LOOSE, DAMAGE), (whole, ALL, VIDEO_DAMAGE)):
        data = shutil.copytree(source, tmp_path / config.frames)
        for what, damage in damages.items():
            (summary,) = run_whole(data, config)
            assert summary.computed == 0, what
            damage(data / "media" / SCENE / "nav_b")
            (summary,) = run_whole(data, config)
            assert summary.computed >= 1, what
            assert files_of(data) == files_of(source), what


def test_verify_finds_a_flipped_bit_and_records_that_trajectory_alone_again(tmp_path, loose, whole):
    for source, config, name in ((loose, LOOSE, "front_rgb/000002.png"), (whole, ALL, "left_rgb.mp4")):
        data = shutil.copytree(source, tmp_path / config.frames)
        media = data / "media" / SCENE
        file = media / "nav_b" / name
        raw = bytearray(file.read_bytes())
        raw[len(raw) // 2] ^= 1
        file.write_bytes(raw)
        kept = {p: p.stat().st_mtime_ns for p in media.rglob("*") if p.is_file() and "nav_b" not in p.parts}
        for verify, computed in ((False, 0), (True, 1), (True, 0)):
            (summary,) = run_whole(data, config, limits=RunLimits(verify=verify))
            assert summary.computed == computed
        assert files_of(data) == files_of(source)
        assert {p: p.stat().st_mtime_ns for p in kept} == kept
