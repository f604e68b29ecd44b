"""The exports for training, read back by LeRobot's and WebDataset's readers: the loader's pictures and labels."""

import json
import os
import shutil
import signal
import subprocess
import sys

import cv2
import numpy as np
import pytest
from support import lerobot_reader
from support.command_line import called
from support.releases import files_of

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.exchange import lerobot_writer
from aerialdojo_gen.exchange.folder import PartialExport
from aerialdojo_gen.exchange.learning_export import export_for_learning
from aerialdojo_gen.exchange.samples import ExportOptions
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.learning import Trajectories
from aerialdojo_gen.rendering.codecs import to_stored
from aerialdojo_gen.store import shards as store

VIEWS = ("front", "down")
OPTIONS = {"splits": ("all",), "limit": 1, "sensors": Sensors(VIEWS, width=48, height=32), "goal": ("text", "image")}
# A Python that has LeRobot, which wants other versions of many packages than this project's environment has.
LEROBOT = os.environ.get("LEROBOT_PYTHON", "")


@pytest.fixture(scope="module")
def made(smoke, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports")
    options = ExportOptions(**OPTIONS)
    counts = {
        form: export_for_learning(form, smoke, folder / form, options, workers=1)
        for form in ("lerobot", "webdataset")
    }
    return folder, counts


@pytest.fixture(scope="module")
def lerobot(made):
    return lerobot_reader.load(made[0] / "lerobot")


@pytest.fixture(scope="module")
def seen(smoke, lerobot):
    """The same trajectories by the loader."""
    whole = Trajectories(smoke, split="all", views=VIEWS, size=(48, 32), past=None, goal=("text", "image"))
    number = {nav_id: k for k, nav_id in enumerate(whole.index.nav_id)}
    return [whole[number[nav_id]] for nav_id in lerobot.episodes["nav_id"]]


def test_lerobot_has_the_loaders_labels_and_actions(lerobot, seen):
    assert len(seen) == len(lerobot.episodes) > 3
    assert set(lerobot.episodes["setting"]) >= {"base", "standard"}
    for episode, sample in enumerate(seen):
        own = lerobot.frames[lerobot.frames["episode_index"] == episode]
        assert own["discrete_action"].to_list() == sample["action"].tolist()
        state = np.stack(own["observation.state"].to_list())
        assert (state[:, :4] == sample["odometry"]).all()
        assert (state[:, 4] == sample["remaining_actions"]).all()
        assert own["next.done"].to_list() == [False] * (len(own) - 1) + [True]
        (task,) = lerobot.episodes.loc[episode, "tasks"]
        assert task == sample["text"]
    # Continuous actions fly what the discrete ones do.
    actions, discrete = lerobot.columns("action"), lerobot.columns("discrete_action")
    assert lerobot.info["features"]["action"]["names"] == ["forward_m", "left_m", "up_m", "turn_rad", "stop"]
    for action in np.unique(discrete):
        (motion,) = np.unique(actions[discrete == action], axis=0)
        assert motion[4] == (action == 0)
        flown = replay((0.0, 0.0, 0.0, 0.0), np.array([action], np.int8))[-1]
        assert motion[:4] == pytest.approx(flown, abs=1e-6)
    assert len(np.unique(actions, axis=0)) == len(np.unique(discrete))


def test_lerobots_videos_are_the_loaders_pictures(lerobot, seen):
    for episode, sample in enumerate(seen):
        for v, view in enumerate(VIEWS):
            pictures = lerobot.video(f"observation.images.{view}", episode)
            away = np.abs(pictures.astype(int) - sample["rgb"][:, v])
            assert away.mean() < 6, "H.264 and halved colours of pictures of 48 pixels"
            depth = lerobot.video(f"observation.depth.{view}", episode)
            error = np.abs(depth - sample["depth_m"][:, v])
            assert (error <= 0.0004 * (sample["depth_m"][:, v] + 3.5) + 1e-4).all()
            assert ((depth == 0) == (sample["depth_m"][:, v] == 0)).all()
        goal = lerobot.video("observation.images.goal", episode)
        expected = cv2.resize(np.asarray(sample["image"]), (48, 32), interpolation=cv2.INTER_AREA)
        assert np.abs(goal.astype(int) - expected).mean() < 10


def test_lerobots_statistics_are_those_of_the_pictures_and_columns(lerobot, seen):
    for v, view in enumerate(VIEWS):
        pixels = np.concatenate([s["rgb"][:, v].reshape(-1, 3) for s in seen]) / 255.0
        stats = lerobot.stats[f"observation.images.{view}"]
        for name, expected in (
            ("min", pixels.min(0)), ("max", pixels.max(0)), ("mean", pixels.mean(0)), ("std", pixels.std(0)),
            ("q50", np.quantile(pixels, 0.5, axis=0, method="inverted_cdf")),
            ("q99", np.quantile(pixels, 0.99, axis=0, method="inverted_cdf")),
        ):  # fmt: skip
            assert stats[name].ravel() == pytest.approx(expected, abs=1e-9), name
        depth = np.concatenate([s["depth_m"][:, v].ravel() for s in seen])
        for statistic in ("mean", "std"):
            found = lerobot.stats[f"observation.depth.{view}"][statistic].item()
            assert found == pytest.approx(getattr(depth, statistic)(), abs=0.01)
    for name in ("observation.state", "action", "discrete_action"):
        values = lerobot.columns(name).reshape(len(lerobot.frames), -1).astype(np.float64)
        for statistic in ("mean", "std", "max"):
            assert lerobot.stats[name][statistic] == pytest.approx(getattr(values, statistic)(0))
    row = lerobot.episodes.loc[1]
    own = seen[1]["rgb"][:, 0].reshape(-1, 3) / 255.0
    told = np.array([[[float(x) for x in b] for b in a] for a in row["stats/observation.images.front/mean"]])
    assert told.shape == (3, 1, 1)
    assert told.ravel() == pytest.approx(own.mean(0))


@pytest.mark.slow
def test_lerobots_own_class_reads_it(made, lerobot, project, tmp_path):
    if not LEROBOT:
        pytest.skip("LEROBOT_PYTHON names no Python with LeRobot: a strict reader of the format has read the export")
    out = tmp_path / "read.npz"
    script = project / "tests" / "support" / "read_by_lerobot.py"
    environment = {**os.environ, "HF_HOME": str(tmp_path / "hf"), "PYTHONPATH": ""}
    done = subprocess.run(
        [LEROBOT, str(script), str(made[0] / "lerobot"), str(out)], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr[-3000:]
    read = np.load(out)
    told = json.loads(str(read["told"]))
    assert (told["frames"], told["episodes"], told["fps"]) == (len(lerobot.frames), len(lerobot.episodes), 15)
    assert told["nav_id"] == lerobot.episodes["nav_id"].to_list()
    assert set(told["cameras"]) == {name for name, f in lerobot.info["features"].items() if f["dtype"] == "video"}
    at = read["index"]
    assert len(at) > 20
    assert told["tasks"] == [lerobot.tasks[k] for k in lerobot.frames["task_index"].iloc[at]]
    for name in ("observation.state", "action", "discrete_action", "next.done", "index"):
        assert (read[name] == lerobot.columns(name)[at]).all()
    for view in VIEWS:
        ours = np.concatenate([lerobot.video(f"observation.images.{view}", e) for e in lerobot.episodes.index])
        theirs = np.moveaxis(read[f"observation.images.{view}"], 1, -1) * 255
        assert np.abs(theirs - ours[at]).max() <= 3, "two versions of FFmpeg turn colours back alike"
        if told["depth"]:
            depth = np.concatenate([lerobot.video(f"observation.depth.{view}", e) for e in lerobot.episodes.index])
            assert np.abs(read[f"observation.depth.{view}"][:, 0] - depth[at]).max() < 1e-3
    last = int(lerobot.episodes.loc[0, "length"]) - 1
    assert (read["window_action"][0, 0] == lerobot.columns("action")[last]).all()
    assert read["window_pad"][0].tolist() == [False, True]
    assert told["last_alone"] == lerobot.episodes["length"].iloc[-1]
    assert told["batch"]["observation.images.front"] == [5, 3, 32, 48]
    for key in ("observation.state", "observation.images.front"):
        assert np.array(told["stats"][key]["mean"]).ravel() == pytest.approx(lerobot.stats[key]["mean"].ravel())


def test_webdataset_reads_the_shards_back(made, seen, lerobot):
    webdataset = pytest.importorskip("webdataset", reason="webdataset is not installed: it is of the extra 'dev'")
    folder = made[0] / "webdataset"
    shards = sorted(str(path) for path in folder.glob("shard-*.tar"))
    index = json.loads((folder / "index.json").read_text())
    assert [str(folder / shard["url"]) for shard in index["shardlist"]] == shards
    assert all((folder / s["url"]).stat().st_size == s["filesize"] for s in index["shardlist"])
    samples = list(webdataset.WebDataset(shards, shardshuffle=False, empty_check=False).decode("rgb8"))
    assert len(samples) == sum(s["nsamples"] for s in index["shardlist"]) == len(lerobot.frames)
    at = 0
    for trajectory in seen:
        for step in range(len(trajectory["mask"])):
            sample, told = samples[at], samples[at]["json"]
            at += 1
            assert sample["__key__"].endswith(f"{told['nav_id']}-{step:04d}")
            assert (told["nav_id"], told["step"], told["task"]) == (trajectory["nav_id"], step, trajectory["text"])
            for name in ("action", "previous_action", "remaining_actions"):
                assert told[name] == trajectory[name][step]
            assert told["odometry"] == pytest.approx(trajectory["odometry"][step], abs=1e-7)
            for v, view in enumerate(VIEWS):
                assert (sample[f"{view}.png"] == trajectory["rgb"][step, v]).all(), "PNG loses nothing"
                assert (sample["depth.npz"][view] == to_stored(trajectory["depth_m"][step, v])).all()
            assert sample["goal.png"].shape == (32, 48, 3)
    assert at == len(samples)


def test_the_same_data_in_other_parts(made, smoke, tmp_path, monkeypatch):
    monkeypatch.setattr(lerobot_writer, "frames_a_part", lambda options: 20)
    cut = export_for_learning("lerobot", smoke, tmp_path / "cut", ExportOptions(**OPTIONS), workers=1)
    assert cut.parts > made[1]["lerobot"].parts
    assert not list(tmp_path.glob(".*")), "nothing unfinished is left"
    one, many = lerobot_reader.load(made[0] / "lerobot"), lerobot_reader.load(tmp_path / "cut")
    assert many.frames.equals(one.frames)
    for key, of in one.stats.items():
        for name, value in of.items():
            assert many.stats[key][name] == pytest.approx(value, abs=1e-9)
    last, key = len(one.episodes) - 1, "observation.depth.down"
    assert (many.video(key, last) == one.video(key, last)).all()


@pytest.mark.kill
def test_what_is_killed_goes_on_with_finished_parts(made, smoke, tmp_path):
    out = tmp_path / "export"
    # The process ends itself when its second part has been half written, as a power failure would.
    script = f"""
import os, pathlib, signal, sys
from aerialdojo_gen.exchange import webdataset_writer
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.exchange.learning_export import export_for_learning
from aerialdojo_gen.exchange.samples import ExportOptions
whole, done = webdataset_writer.write_part, []
def write(root, part, wanted, folder):
    whole(root, part, wanted, folder)
    done.append(part)
    if len(done) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
webdataset_writer.write_part = write
export_for_learning("webdataset", sys.argv[1], pathlib.Path(sys.argv[2]), ExportOptions(**{OPTIONS!r}), workers=1)
"""
    done = subprocess.run([sys.executable, "-c", script, str(smoke), str(out)], capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert not out.exists(), "nothing stands under the name before it is whole"
    (unfinished,) = tmp_path.glob(".*.unfinished")
    assert [path.name for path in (unfinished / "parts").iterdir()] == ["000000"]
    first = (unfinished / "parts" / "000000" / "shard.tar").stat().st_ino
    resumed = export_for_learning("webdataset", smoke, out, ExportOptions(**OPTIONS), workers=1)
    assert (resumed.parts_kept, resumed.parts) == (1, 2)
    assert (out / "shard-000000.tar").stat().st_ino == first, "it is the file of the killed run"
    assert files_of(out) == files_of(made[0] / "webdataset")
    assert not unfinished.exists()


def test_parts_of_another_request_are_not_gone_on_with(tmp_path):
    def parts(request):
        unfinished = PartialExport(tmp_path / "export", request)
        with unfinished.locked():
            before = sorted(path.name for path in (unfinished.folder / "parts").iterdir())
            unfinished.part(0).mkdir(exist_ok=True)
            with pytest.raises(UsageError, match="another process is making this export"), unfinished.locked():
                pass
        return before

    assert parts({"size": 1}) == []
    assert parts({"size": 1}) == ["000000"]
    assert parts({"size": 2}) == []


def test_the_command_estimates_says_what_it_made_and_does_not_replace_it_unasked(smoke, tmp_path):
    options = "--limit 1 --width 16 --no-depth --jpeg-quality 80 --workers 1"
    asked = ("export", "--format", "webdataset", "--data", smoke, "--out", tmp_path / "x", *options.split())
    estimated, estimate = called(*asked, "--estimate"), json.loads(called(*asked, "--estimate", "--json").stdout)
    assert not list(tmp_path.iterdir())
    assert "trajectories" in estimated.stdout
    assert min(estimate["cpu_s"], estimate["size_bytes"]) > 0
    done = called(*asked, "--json")
    assert done.returncode == 0, done.stderr
    counts = json.loads(done.stdout)["counts"]
    assert counts["shards"] == 2
    assert (estimate["frames"], estimate["trajectories"]) == (counts["samples"], counts["trajectories"])
    before = files_of(tmp_path / "x")
    again = called(*asked)
    assert again.returncode == 2
    assert "--force replaces it" in again.stderr
    # By two workers the same bytes.
    assert called(*asked[:-1], "2", "--force", "--quiet").stdout == ""
    assert files_of(tmp_path / "x") == before


def test_recordings_are_read_and_a_release_without_them_or_without_meshes_is_named(smoke, planted, tmp_path):
    sensors = Sensors(("front",), depth=False, width=64, height=64)
    options = ExportOptions(("all",), source="recordings", sensors=sensors)
    made = export_for_learning("webdataset", smoke, tmp_path / "recorded", options, workers=1)
    assert 0 < made.counts["trajectories"] < 10, "what is not recorded is left out"
    with pytest.raises(UsageError, match=r"has a recording of the views asked for: run .*render.*--source render"):
        export_for_learning("lerobot", planted.data, tmp_path / "x", ExportOptions(source="recordings"))
    shutil.rmtree(planted.data / "meshes")
    with pytest.raises(StoreError, match=r"the mesh .* is missing: run aerialdojo-gen build-scenes"):
        export_for_learning("lerobot", planted.data, tmp_path / "x", ExportOptions())
    assert not list(tmp_path.glob("x*"))
    assert not list(tmp_path.glob(".x*"))


def test_a_name_that_leads_out_of_the_folder_comes_into_no_tar(planted, tmp_path):
    old = planted.rows("routes/train")[0]["nav_id"]
    for table in ("routes/train", "tasks/train"):
        rows = [row | {"nav_id": "../../outside"} if row["nav_id"] == old else row for row in planted.rows(table)]
        planted.write(table, rows, schema=store.LAYOUT[table].spec.schema)
    with pytest.raises(StoreError, match=r"nav_id '../../outside' cannot name a file"):
        export_for_learning("webdataset", planted.data, tmp_path / "x", ExportOptions(("train",)), workers=1)
    assert not (tmp_path / "x").exists()
