"""Runs and readers say the same in a bucket as in a directory; what they write there is there whole."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import command_line
from support.command_line import called
from support.s3_server import upload
from support.task_files import uav_on, write

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.benchmark import episodes
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.runner import evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.dataset.contents import existing_scenes
from aerialdojo_gen.dataset.lookup import ReleasedScene
from aerialdojo_gen.pipeline.registry import STAGES, upstream
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root

_BLIND = Sensors(views=())


def said(capsys, *arguments) -> tuple[int, str]:
    """What a command prints, and its exit code."""
    code, out, err = command_line.said(capsys, *arguments)
    return code, out + err


AERIALDOJO = ["export", "--format", "aerialdojo", "--picture-size", "0", "--out", "{out}/e"]


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (["stats", "--csv", "{out}/s.csv", "--markdown", "{out}/s.md"], "s.md"),
        (["stats", "--pool", "--scene", "U_Courtyard_0"], ""),
        (["show", "{task}", "--json"], ""),
        (["export", "--format", "habitat", "--out", "{out}/e"], "e/export.json"),
        pytest.param(["show", "{task}", "--out", "{out}/t.png"], "t.png", marks=pytest.mark.nightly),
        pytest.param(AERIALDOJO, "e/export.json", marks=pytest.mark.nightly),
    ],
    ids=lambda value: "-".join(value[:3]) if isinstance(value, list) else "",
)
def test_a_reader_gives_the_same(capsys, smoke, uploaded, tmp_path, arguments, file):
    task = str(min(ReleasedScene(smoke, "U_Courtyard_0").routes["nav_id"].to_pylist()))
    made = []
    for kind, data in (("directory", str(smoke)), ("bucket", uploaded)):
        out = tmp_path / kind
        out.mkdir()
        code, text = said(capsys, *(a.format(out=out, task=task) for a in arguments), "--data", data)
        assert code == 0, text
        files = {p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()}
        made.append(files | {"": text.replace(str(out), "OUT").replace(data, "DATA").encode()})
    assert made[1] == made[0]
    assert made[0][file]


def test_validate_finds_the_same(capsys, planted, uploaded, tmp_path):
    """Also where the bucket's release is named, and not what it lies in."""
    arguments = ["validate", "--sample", 0, "--pictures", 0, "--scene", "U_Courtyard_0", "--workers", 1]
    root, found = open_root(uploaded), {}
    for one in (root, open_root(planted.data)):
        with one.commit("release/stray.txt") as path:
            path.write_text("no part of a release")
    for kind, where in (("directory", planted.data), ("bucket", f"{uploaded}/release")):
        report = tmp_path / f"{kind}.csv"
        code, text = said(capsys, *arguments, "--report", report, "--quiet", "--data", where)
        found[kind] = code, text, report.read_bytes()
    root.delete("release/stray.txt")
    assert found["bucket"] == found["directory"]
    assert found["bucket"][0] == 1
    assert b"foreign_file" in found["bucket"][2]
    assert b"stray.txt" in found["bucket"][2]
    assert found["bucket"][2].count(b"\n") == 2


def test_episodes_are_the_same_rows_and_lie_in_the_bucket(capsys, smoke, uploaded, tmp_path):
    job = Evaluation("r", "random", {}, Selection(limit=4), _BLIND)
    here = evaluate(smoke, job, out=tmp_path / "log")
    there = evaluate(uploaded, job)
    assert (there.finished, there.flown) == (here.finished, here.flown) == (4, 4)
    for table in ("episodes", "steps"):
        assert episodes.read_run(uploaded, "r", table).equals(episodes.read_run(tmp_path / "log", "r", table))
    assert evaluate(uploaded, job).flown == 0
    assert not episodes.Journals(open_root(uploaded), "r")
    told = [said(capsys, "report", "--data", d, "--log", log, "--format", "csv") for d, log in
            ((smoke, tmp_path / "log"), (uploaded, uploaded))]  # fmt: skip
    assert told[0] == told[1]
    assert evaluate(uploaded, Evaluation("r", "stop", {}, Selection(limit=2), _BLIND), restart=True).finished == 2
    assert len(episodes.read_run(uploaded, "r")) == 2


def test_another_machine_goes_on_from_the_last_checkpoint(uploaded, tmp_path, monkeypatch):
    """A killed run's journals of this machine are gone: what was committed is not flown again."""
    program = f"""
from aerialdojo_gen.benchmark import episodes, worker
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.runner import evaluate
from aerialdojo_gen.benchmark.tasks import Selection
import os, signal
episodes.CHECKPOINT_S = 0.0
fly, flown = worker.Worker._episode, []
def killed(self, task):
    flown.append(task)
    if len(flown) == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return fly(self, task)
worker.Worker._episode = killed
evaluate({uploaded!r}, Evaluation("k", "random", {{}}, Selection(limit=4), Sensors(views=())))
"""
    first = dict(os.environ, AERIALDOJO_CACHE=str(tmp_path / "first"), AERIALDOJO_LEASE_S="1")
    done = subprocess.run([sys.executable, "-c", program], env=first, capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert list((tmp_path / "first" / "journals").rglob("*.jsonl"))
    monkeypatch.setenv("AERIALDOJO_LEASE_S", "1")
    open_root(uploaded).refresh()
    job = Evaluation("k", "random", {}, Selection(limit=4), _BLIND)
    for _ in range(60):
        try:
            outcome = evaluate(uploaded, job)
            break
        except StoreError as error:
            held = str(error)
            time.sleep(0.5)
    else:
        pytest.fail(held)
    assert (outcome.finished, outcome.flown) == (4, 2)
    whole = evaluate(uploaded, Evaluation("w", "random", {}, Selection(limit=4), _BLIND))
    assert whole.flown == 4
    for table in ("episodes", "steps"):
        rows = [episodes.read_run(uploaded, run, table).drop_columns("run_id") for run in ("k", "w")]
        assert rows[0].equals(rows[1])


def test_a_bucket_without_a_release_is_one_line(capsys, cloud):
    told = "it has no folder release; name its folder with --data, or make one with make dataset\n"
    for command in (["stats"], ["show", "U_Courtyard_0-0123456789ab"], ["evaluate", "--agent", "stop"]):
        assert said(capsys, *command, "--data", cloud) == (1, f"error: there is no release in {cloud}: {told}")
    told = "error: an export is a folder of this machine: name it with --out\n"
    assert said(capsys, "export", "--format", "habitat", "--data", cloud) == (2, told)


def test_an_import_lies_in_the_bucket_whole(capsys, cloud, tmp_path):
    path = write(tmp_path / "tasks.json", uav_on())
    code, text = said(capsys, "import-benchmark", path, "--format", "uav-on", "--data", cloud)
    assert code == 0, text
    assert text.startswith(f"{cloud}/imported/uav-on\n")
    code, text = said(capsys, "import-benchmark", path, "--format", "uav-on", "--data", cloud)
    assert (code, text) == (2, f"error: {cloud}/imported/uav-on exists: --force replaces it\n")
    root = open_root(cloud)
    root.refresh()
    assert root.exists("imported/uav-on/import.json")
    assert root.list("imported/uav-on/tasks", "part-*.parquet")


BOTH = ["U_Courtyard_0", "U_Courtyard_1"]


ANCHORED = ("meshes", "scenes", "landmarks", "objects", "chosen_anchors", "anchors", "viewpoints")


@pytest.mark.parametrize(
    ("command", "scenes", "given", "begun"),
    [
        (["plan", "--pipeline", "smoke"], BOTH[:1], ANCHORED, "pairs"),
        pytest.param(["run", "smoke"], BOTH, (), "objects", marks=pytest.mark.nightly),
    ],
    ids=["plans of one", "all of both"],
)
def test_a_killed_run_goes_on_and_gives_what_a_local_one_gives(
    cloud: str, smoke: Path, project: Path, command: list[str], scenes: list[str], given: tuple[str, ...], begun: str
) -> None:
    arguments, lease = [*command, *scenes, "--data", cloud], {"AERIALDOJO_LEASE_S": "3"}
    stages = [stage.name for stage in (STAGES if command[0] == "run" else upstream(command[0]))]
    root, local = open_root(cloud), open_root(smoke)
    upload(root, smoke, given)
    program = [sys.executable, "-m", "aerialdojo_gen.cli", *arguments, "--workers", str(len(scenes))]
    killed = subprocess.Popen(program, cwd=project, env=os.environ | lease, stderr=subprocess.DEVNULL)
    try:
        while not root.list(begun, "*/*"):
            assert killed.poll() is None, "it ended by itself"
            root.refresh()
            time.sleep(0.1)
    finally:
        killed.kill()
        killed.wait()
    done = called(*arguments, "--workers", "1", cwd=project, **lease)
    assert done.returncode == 0, done.stderr
    root.refresh()
    assert existing_scenes(root) == (scenes if "split" in stages else [])
    for table, place in store.LAYOUT.items():
        for scene in scenes if place.command in stages else []:
            assert store.content(root, table, scene) == store.content(local, table, scene), (table, scene)
    for scene in scenes:
        assert root.digest(f"meshes/{scene}.glb", reread=True) == local.digest(f"meshes/{scene}.glb")
        for row in store.read_scene(root, "recordings", scene).to_pylist() if "render" in stages else []:
            assert root.is_whole(row["path"], row["bytes"], row["sha256"], reread=True)
    again = called(*arguments, "--workers", "1", cwd=project, **lease)
    assert again.returncode == 0, again.stderr
    assert f"nothing to do: all {len(stages)} stages are up to date" in again.stderr, again.stderr
