"""A Ray cluster of two nodes with a core each: the same bytes, whatever node or driver is lost on the way.

By day test_executors loses a process of a cluster of its own.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest
from support.chores import until

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.runner import evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.imports.worlds import VaryOptions, vary
from aerialdojo_gen.pipeline.executors import ray_worker
from aerialdojo_gen.pipeline.registry import STAGES
from aerialdojo_gen.store.staging import AREA

# All of it on the loopback interface, as a cluster that a command starts for itself.
os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
HEAD = {"num_cpus": 1, "include_dashboard": False}


def twice(start):
    """A machine that has much else to do may not start a node within Ray's half a minute, but in the next."""
    try:
        return start()
    except Exception:
        return start()


class Nodes:
    """The cluster: a head with a core, and a second node that can be lost."""

    def __init__(self):
        from ray.cluster_utils import Cluster

        self._cluster = twice(lambda: Cluster(initialize_head=True, head_node_args=HEAD))
        self.address, self.end = self._cluster.address, self._cluster.shutdown
        self.add()

    def lose(self):
        self._cluster.remove_node(self._second, allow_graceful=False)

    def add(self):
        self._second = twice(lambda: self._cluster.add_node(num_cpus=1))


@pytest.fixture(scope="module")
def nodes():
    nodes = Nodes()
    yield nodes
    nodes.end()


def start(project, nodes, data, verb="run", *args):
    where = ["pipelines/smoke.toml"] if verb == "run" else ["--pipeline", "pipelines/smoke.toml"]
    command = [sys.executable, "-m", "aerialdojo_gen.cli", verb, *where, "--data", str(data), *args]
    return subprocess.Popen(
        [*command, "--executor", "ray", "--address", nodes.address], cwd=project, stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL, text=True, start_new_session=True,
    )  # fmt: skip


def finish(process):
    _, err = process.communicate(timeout=400)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    assert not re.search(r"\braylet|\bray::|\(pid=|INFO|WARN|gcs", err), "Ray itself says nothing"
    return err


def snapshot(data):
    files = (p for p in data.rglob("*") if p.is_file() and p.name != ".lock")
    return {str(p.relative_to(data)): p.read_bytes() for p in files}


def shards(data, table):
    return len(list(data.glob(f"{table}/*/part-*.parquet")))


def workers_alive():
    found = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            found += path.read_bytes().startswith(b"ray::Worker")
    return found


@pytest.mark.ray
@pytest.mark.nightly
def test_a_driver_that_is_killed_and_started_again_goes_on_to_the_same_bytes(project, smoke, nodes, tmp_path):
    data = tmp_path / "data"
    process = start(project, nodes, data)
    # A scene may be planned while the other one's anchors are still to come: only a finished stage stays.
    done = {"anchors": len(list(smoke.glob("anchors/*"))), "plans": 1}
    until(lambda: all(shards(data, t) >= n for t, n in done.items()) or process.poll() is not None, 400)
    assert process.poll() is None, process.stderr.read()
    process.send_signal(signal.SIGKILL)
    process.communicate()
    until(lambda: not workers_alive())
    before = {p: p.stat().st_mtime_ns for p in data.glob("anchors/*/*.parquet")}
    assert before
    err = finish(start(project, nodes, data))
    assert "stages had nothing to do" in err
    assert {p: p.stat().st_mtime_ns for p in data.glob("anchors/*/*.parquet")} == before
    assert snapshot(data) == snapshot(smoke)
    until(lambda: not workers_alive())
    assert not list(data.rglob(f"{AREA}*"))


@pytest.mark.ray
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("tables", "begun"),
    [(["plans"], "plans/*/part-*.parquet"), (["recordings", "frames", "media"], f"{AREA}/*/new*")],
)
def test_a_node_that_is_lost_in_the_middle_costs_nothing_but_time(project, smoke, nodes, tmp_path, tables, begun):
    data = shutil.copytree(smoke, tmp_path / "data")
    for table in tables:
        shutil.rmtree(data / table)
    process = start(project, nodes, data)
    until(lambda: (list(data.glob(begun)) and workers_alive() >= 2) or process.poll() is not None, 400)
    assert process.poll() is None, process.stderr.read()
    nodes.lose()
    try:
        finish(process)
    finally:
        nodes.add()
    assert snapshot(data) == snapshot(smoke)


@pytest.mark.ray
@pytest.mark.nightly
def test_evaluate_and_validate_say_on_a_cluster_what_they_say_here(project, smoke, nodes, tmp_path):
    settings = ["--agent", "random", "--limit", "12", "--run", "r", "--quiet"]
    here, there = tmp_path / "here", tmp_path / "there"
    finish(start(project, nodes, smoke, "evaluate", *settings, "--out", str(there)))
    evaluate(smoke, Evaluation(run="r", agent="random", selection=Selection(limit=12)), out=here)
    tables = {name: content for name, content in snapshot(here).items() if name.startswith("episodes")}
    assert tables
    assert {name: content for name, content in snapshot(there).items() if name in tables} == tables
    report = tmp_path / "faults.jsonl"
    finish(start(project, nodes, smoke, "validate", "--sample", "1", "--pictures", "1", "--report", str(report)))
    assert report.read_text() == "", "no fault"


@pytest.mark.ray
@pytest.mark.nightly
def test_worlds_are_made_on_a_cluster_as_they_are_here(nodes, tmp_path):
    asked = ["U_Alley"], range(1003, 1005)
    here, there = (tmp_path / name / "worlds" for name in ("here", "there"))
    for folder, where in ((here, {}), (there, {"executor": "ray", "address": nodes.address, "workers": None})):
        made = vary(*asked, folder, VaryOptions({}, n_objects=4), **where)
        assert [one.made for one in made] == [True, True]
    assert len(snapshot(here)) == 10  # plan, annotations, mesh and its row of each; pipeline and draws
    assert snapshot(there) == snapshot(here)


def test_a_machine_that_cannot_work_says_why(tmp_path):
    worker = ray_worker.Worker(None)
    right = ray_worker.Expected({str(tmp_path): ray_worker.listing(tmp_path)}, {}, {"numpy": version("numpy")}, {})
    assert worker.hello(right) == ""
    marker = tmp_path / "data" / AREA / "1" / "marker"
    hidden = replace(right, marked={str(marker): "x"})
    assert re.search(rf"^node \S+ does not see {tmp_path}/data: all nodes must mount", worker.hello(hidden))
    (tmp_path / "more").touch()
    assert "or another one of that name" in worker.hello(right)
    older = replace(right, seen={}, versions={"numpy": "1.0"})
    assert re.search(r"has numpy \d\S+, not 1\.0: install what constraints.txt pins", worker.hello(older))


def test_a_secret_is_in_no_text():
    assert "hunter2" not in repr(ray_worker.Expected({}, {}, {}, {"AWS_SECRET_ACCESS_KEY": "hunter2"}))


def test_what_travels_is_the_same_bytes_and_comes_to_its_place(tmp_path, project):
    pack = tmp_path / "a.zip"
    folders = [project / "scene_assets", project / "annotations" / "smoke"]
    ray_worker.pack(pack, folders)
    ray_worker.pack(tmp_path / "b.zip", folders)
    assert pack.read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(pack) as archive:
        archive.extractall(tmp_path / "there")
    unpacked = ray_worker.Unpacked(tmp_path / "there")
    for folder in (*folders, project / "scene_assets" / "smoke"):
        names = {p.relative_to(folder) for p in folder.rglob("*") if p.is_file()}
        there = unpacked.place(folder)
        assert there.is_relative_to(tmp_path)
        assert {p.relative_to(there) for p in there.rglob("*") if p.is_file()} == names
    assert unpacked.place(Path("/elsewhere")) == Path("/elsewhere")


def test_what_is_too_large_to_travel_is_one_line(tmp_path):
    with (tmp_path / "large.glb").open("wb") as file:
        file.truncate(ray_worker.MAX_BYTES + 1)
    with pytest.raises(UsageError, match=r"have 2\d\d MB: no more than 200 MB are sent"):
        ray_worker.pack(tmp_path.parent / "never.zip", [tmp_path])


@pytest.mark.nightly
def test_the_largest_scene_takes_no_more_memory_than_its_stages_declare(tmp_path):
    """One process makes U_Mall_0 up to `plan`, as a worker does that a cluster gives the largest declared memory."""
    declared_mb = max(stage.memory_mb for stage in STAGES)
    command = ["plan", "--scene", "U_Mall_0", "--pipeline", "pipelines/aerialdojo-200k.toml", "--workers", "1"]
    process = subprocess.Popen([sys.executable, "-m", "aerialdojo_gen.cli", *command, "--data", str(tmp_path)])
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0
    assert 300 < usage.ru_maxrss / 1024 <= declared_mb
