"""``ulimit -v``: a command that would not fit is refused before it begins, and runs with what it says it needs."""

import resource
import shutil
import subprocess
import sys

import pyarrow.parquet as pq
import pytest

from aerialdojo_gen.base.environment_errors import memory_mb

OBJ = "v 0 0 0\nv 30 0 0\nv 30 20 0\nv 0 20 0\nv 9 9 8\nf 1 2 3\nf 3 4 1\nf 1 2 5\nf 2 3 5\n"


def arguments(verb, data, tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    task = pq.read_table(next((data / "release/tasks").rglob("*.parquet")), columns=["task_id"])[0][0].as_py()
    pipeline = ["--pipeline", "pipelines/smoke.toml", "--data", data, "--workers", "1", "--quiet"]
    return {
        "--help": ["--help"],
        "show": ["show", task, "--data", data, "--out", tmp_path / "out.png"],
        "evaluate": ["evaluate", "--agent", "stop", "--limit", "1", "--data", data, "--workers", "1", "--quiet"],
        "export": ["export", "--format", "habitat", "--data", data, "--out", tmp_path / "out"],
        "validate": ["validate", "--data", data, "--workers", "1", "--quiet"],
        "add-scene": ["add-scene", "A", tmp_path / "a.obj", "--up", "z", "--project", tmp_path / "out"],
        "build-scenes": ["build-scenes", *pipeline, "--force", "--scene", "U_Courtyard_0"],
        "plan": ["plan", *pipeline, "--force", "--scene", "U_Courtyard_0"],
    }[verb]


def run(verb, data, tmp_path, mb):
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *map(str, arguments(verb, data, tmp_path))]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=600, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (mb << 20, mb << 20)),
    )  # fmt: skip


@pytest.mark.parametrize("verb", ["show", "plan"])
def test_what_does_not_fit_is_refused_in_one_line(smoke, tmp_path, verb):
    mb = memory_mb(verb) - 1
    done = run(verb, smoke, tmp_path, mb)
    assert done.returncode == 1
    limit = f"not enough memory (ulimit -v is {mb << 10} kB, {mb} MB)"
    assert done.stderr == f"error: {limit}: {verb} needs {mb + 1:,} MB\n"
    assert done.stdout == ""
    assert not [p for p in tmp_path.iterdir() if p.name.startswith("out")]


def test_help_needs_little(smoke, tmp_path):
    assert run("--help", smoke, tmp_path, 512).returncode == 0


# Whose figure is the closest to what it takes; the others' are measured at night.
@pytest.mark.slow
@pytest.mark.parametrize(
    "verb",
    ["plan", *(pytest.param(verb, marks=pytest.mark.nightly) for verb in (
        "show", "evaluate", "export", "validate", "add-scene", "build-scenes"))],
)  # fmt: skip
def test_what_fits_by_its_figure_runs(smoke, tmp_path, verb):
    data = shutil.copytree(smoke, tmp_path / "data")
    done = run(verb, data, tmp_path, memory_mb(verb))
    assert done.returncode == 0, done.stderr
