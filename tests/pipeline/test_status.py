"""`status` says what a run would compute, and touches nothing; a finished run is not computed again."""

import json
import shutil

import pandas as pd
import pytest
from support.command_line import called, said

from aerialdojo_gen import pipeline_status, run_pipeline

A, B = "U_Courtyard_0", "U_Courtyard_1"


@pytest.fixture
def data(smoke, tmp_path):
    """A copy of the smoke data without a lock file."""
    copy = shutil.copytree(smoke, tmp_path / "data")
    (copy / ".lock").unlink()
    return copy


def everything(data):
    return {path: (path.lstat().st_mtime_ns, path.lstat().st_ino) for path in [data, *data.rglob("*")]}


def states(data, **given):
    return {one.stage: (one.fresh, one.stale, one.missing) for one in pipeline_status(data=data, **given)}


def test_it_says_what_a_run_would_compute_and_writes_nothing(data, project, capsys, tmp_path):
    assert set(states(data).values()) == {((A, B), (), ())}
    shutil.rmtree(data / "plans" / A)
    pairs = next((data / "pairs" / B).iterdir())
    pairs.write_bytes(pairs.read_bytes()[:-9])
    before = everything(data)
    found = states(data)
    assert everything(data) == before
    assert found["pair-objects"] == ((A,), (B,), ())
    assert found["plan"] == ((), (B,), (A,))
    # Its inputs are damaged or gone.
    assert found["filter"] == ((), (A, B), ())
    assert {found[stage] for stage in ("build-scenes", "anchor-sample", "reference-images")} == {((A, B), (), ())}
    assert states(data, scenes=["*_1"])["plan"] == ((), (B,), ())

    code, out, _ = said(capsys, "status", "--data", data, "--json")
    assert code == 0
    rows = [[one[key] for key in ("stage", "fresh", "stale", "missing")] for one in json.loads(out)]
    assert rows == [[stage, *map(list, scenes)] for stage, scenes in found.items()]
    code, out, _ = said(capsys, "status", "--data", data)
    (row,) = (line.split() for line in out.splitlines() if line.startswith("plan "))
    assert row == ["plan", "0", "1", "1", f"{B},", A]
    assert everything(data) == before

    # Another seed makes all that is drawn stale.
    text = (project / "pipelines" / "smoke.toml").read_text().replace('"../', f'"{project}/')
    (tmp_path / "mine.toml").write_text(text.replace("seed = 7", "seed = 8"))
    assert states(data, pipeline=tmp_path / "mine.toml")["pair-objects"] == ((), (A, B), ())

    computed = {one.stage: one.computed for one in run_pipeline(data=data, stages=["plan"], workers=1)}
    assert computed["pair-objects"] == 1
    assert set(states(data).values()) == {((A, B), (), ())}


def test_nothing_is_there_yet(tmp_path, capsys):
    code, out, _ = said(capsys, "status", "--data", tmp_path / "none", "--pipeline", "smoke", "--json")
    assert code == 0
    assert all(one["missing"] == [A, B] for one in json.loads(out))
    assert not (tmp_path / "none").exists()


def test_render_command_keeps_to_the_pipelines_scenes(smoke, project):
    before = {p: p.stat().st_mtime_ns for p in smoke.rglob("*.parquet")}
    assert pd.read_parquet(smoke / "recordings")["ok"].all()
    done = called("render", "--pipeline", "pipelines/smoke.toml", "--limit", 1, "--data", smoke, cwd=project)
    assert done.returncode == 0, done.stderr
    tasks = pd.read_parquet(smoke / "release/tasks")
    trained = tasks[tasks["subset"] == "train"].groupby(["scene", "setting"]).ngroups
    assert f"render: {trained} rows in, {8 * trained} out" in done.stderr
    assert {p: p.stat().st_mtime_ns for p in smoke.rglob("*.parquet")} == before


def test_a_run_prints_what_stats_prints(smoke, project):
    def printed(*args):
        done = called(*args, "--data", smoke, cwd=project)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert printed("run", "pipelines/smoke.toml", "--stats") == printed("stats")
    assert printed("run", "pipelines/smoke.toml") == ""
