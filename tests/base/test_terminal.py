"""What commands print, and what the machine can refuse them: one line, no traceback, nothing lost."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.command_line import called
from support.preload import library, unshared

from aerialdojo_gen.base.terminal import CLOSED_PIPE, shown

COMMAND = [sys.executable, "-m", "aerialdojo_gen.cli"]
HOSTILE = "a\x1b]0;owned\x07\x1b[2J\x9b2J\u202eb\u2066\rc"
VISIBLE = "a\\u001b]0;owned\\u0007\\u001b[2J\\u009b2J\\u202eb\\u2066\\u000dc"
BIDI = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
FULL = "error: cannot write standard output: no space left on the disk\n"


def call(*arguments, cwd=None, env=None, files=None, **streams):
    """Run a command in a process of its own, which may open so many files."""
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], text=True, timeout=300, check=False, cwd=cwd, env=os.environ | (env or {}),
        preexec_fn=lambda: files and resource.setrlimit(resource.RLIMIT_NOFILE, (files, files)), **given,
    )  # fmt: skip


def controls(text):
    """What a terminal obeys, or shows in another order."""
    return {c for c in text if c not in "\n\t" and (unicodedata.category(c) in ("Cc", "Zl", "Zp") or c in BIDI)}


@given(st.text(st.sampled_from(HOSTILE + BIDI + '\u2028\u2029\n\t"\\') | st.characters()))
def test_nothing_is_left_that_a_terminal_obeys_and_json_stays_json(text):
    assert not controls(shown(text))
    assert json.loads(shown(json.dumps(text, ensure_ascii=False))) == text


def test_names_of_files_and_values_of_pipelines_are_shown(tmp_path):
    done = called("stats", "--data", tmp_path / HOSTILE)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: there is no release in {tmp_path}/{VISIBLE}: ")
    assert done.stderr.count("\n") == 1
    pipeline = tmp_path / f"{HOSTILE}.toml"
    pipeline.write_text(f"scenes = [{json.dumps(HOSTILE)}]\nannotations = {json.dumps(HOSTILE)}\n")
    for style in ([], ["--json"]):
        done = called("config", "show", "--pipeline", pipeline, *style)
        assert done.returncode == 0, done.stderr
        assert not controls(done.stdout)
    values = {key["key"]: key["value"] for key in json.loads(done.stdout)}
    assert values["scenes"] == [HOSTILE]
    done = called("config", "init", pipeline)
    assert done.returncode == 2
    assert "\\u202e" in done.stderr
    assert not controls(done.stderr)


@pytest.mark.parametrize("arguments", [["--help"], ["config", "show"]], ids=" ".join)
def test_output_that_cannot_be_written(arguments):
    with open("/dev/full", "w") as full:
        done = call(*arguments, stdout=full)
    assert (done.returncode, done.stderr) == (1, FULL)
    ours, theirs = os.pipe()
    os.close(ours)
    done = call(*arguments, stdout=theirs)
    os.close(theirs)
    assert (done.returncode, done.stderr) == (CLOSED_PIPE, "")


def test_errors_that_cannot_be_written_keep_their_exit_code():
    with open("/dev/full", "w") as full:
        assert call("config", "show", "nowhere", stderr=full).returncode == 2
    closed = ["sh", "-c", '"$@" >&- 2>&-', "sh", *COMMAND, "config", "show"]
    assert subprocess.run(closed, check=False).returncode == 0


def test_a_path_is_utf8_in_any_locale(tmp_path):
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    folder = tmp_path / "Müll → ü"
    folder.mkdir()
    done = call("stats", "--data", folder, env=locale)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: there is no release in {folder}: ")
    written = call("config", "init", folder / "my.toml", cwd=folder, env=locale)
    assert written.returncode == 0, written.stderr
    assert (folder / "my.toml").is_file()


KEPT = "finished shards are kept, the same command continues from where it stopped"


def assert_one_line(done, code, *words, run=False):
    """`run`: the line of a run that had begun, and below it what the same command does."""
    assert done.returncode == code, done.stderr
    assert done.stderr.partition("\n")[2] == (f"{KEPT}\n" if run else ""), done.stderr
    assert done.stderr.startswith("error: ")
    for word in words:
        assert word in done.stderr, done.stderr


@pytest.mark.parametrize(("verb", "number"), [("split", 95), ("evaluate", 37)])
def test_a_file_system_without_locks(smoke, tmp_path, verb, number):
    data = shutil.copytree(smoke, tmp_path / "data")
    options = {"split": ["--pipeline", "pipelines/smoke.toml"], "evaluate": ["--agent", "stop", "--limit", "1"]}[verb]
    env = {"LD_PRELOAD": str(library()), "PRELOAD_FLOCK_ERRNO": str(number)}
    done = call(verb, *options, "--data", data, "--quiet", env=env)
    assert_one_line(
        done, 1, "cannot write", ".lock: the file system", "no locks", "a local disk", run=verb != "evaluate"
    )


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["split", "--data", ""], "--data is empty: give a value, or leave it out"),
        (["split", "--data="], "--data is empty"),
        (["export", "--format", "habitat", "--out", ""], "--out is empty"),
        (["gallery", "--out", "", "--no-props"], "--out is empty"),
        (["validate", ""], "an argument is empty"),
    ],
)
def test_what_is_empty_is_refused_and_is_not_the_working_directory(tmp_path, args, words):
    assert_one_line(called(*args, cwd=tmp_path), 2, words)
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_utf_8_is_refused(tmp_path):
    strange = os.fsdecode(os.fsencode(tmp_path) + b"/d\xff\xfe")
    assert_one_line(called("split", "--data", strange), 2, r"--data", r"d\xff\xfe is not UTF-8")
    assert_one_line(called("stats", "--data=" + strange), 2, r"d\xff\xfe is not UTF-8")
    assert_one_line(called("stats", AERIALDOJO_DATA=strange), 2, r"AERIALDOJO_DATA", "is not UTF-8")
    os.mkdir(strange)
    assert_one_line(called("split", cwd=Path(strange)), 2, "the working directory", r"d\xff\xfe is not UTF-8")


def test_too_few_file_descriptors(tmp_path):
    done = call("build-scenes", "--data", tmp_path / "d", files=40)
    assert_one_line(done, 1, "too few file descriptors: ulimit -n is 40, at least 64 are needed")


def test_a_low_number_of_file_descriptors_is_raised_where_it_may_be():
    code = "from resource import *; from aerialdojo_gen.base.environment_errors import check_limits; check_limits([])"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; print(getrlimit(RLIMIT_NOFILE)[0])"], capture_output=True, check=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (32, 1024)),
    )  # fmt: skip
    assert int(done.stdout) == 1024


def test_file_descriptors_that_run_out_half_way_are_one_line(tmp_path):
    # Every worker takes some: forty of them do not fit into 64.
    done = call("build-scenes", "--data", tmp_path / "d", "--workers", "40", "--quiet", files=64)
    assert_one_line(done, 1, "too few file descriptors: ulimit -n is 64; raise it, or use fewer --workers",
                    run=True)  # fmt: skip


@pytest.mark.slow
def test_a_run_that_ends_in_an_error_says_that_the_same_command_continues(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    (data / "scenes").write_text("in the way")
    command = ["build-scenes", "U_Courtyard_0", "--pipeline", "smoke", "--data", str(data), "--workers", "1", "-q"]
    assert_one_line(called(*command), 1, str(data / "scenes"), "not a folder", run=True)
    assert "--force computes them again" in called(*command, "--force").stderr.splitlines()[-1]
    (data / "scenes").unlink()
    assert called(*command).returncode == 0


def test_targets_that_cannot_be_written(smoke, tmp_path):
    """As somebody who may not write there, be it that the tests run as root: a file is where a folder is to be."""
    file = tmp_path / "file"
    file.write_text("mine")
    (tmp_path / "box.obj").write_text(
        "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nv 4 4 5\nf 1 2 3\nf 3 4 1\nf 1 2 5\nf 2 3 5\n"
    )
    add = ["add-scene", "Box", str(tmp_path / "box.obj"), "--up", "z", "--project"]
    release = ["export", "--format", "habitat", "--data", str(smoke), "--out"]
    sheet = ["--pipeline", "pipelines/smoke.toml", "--scene", "U_Courtyard_0", "--no-props", "--small"]
    for target, args in (
        (file / "out", add),
        (file / "out", release),
        ("/proc/out", release),
        (file / "out", ["gallery", *sheet, "--out"]),
    ):
        done = called(*args, target)
        assert_one_line(done, 1, "cannot write", str(target))
    assert file.read_text() == "mine"


def test_a_disk_that_is_read_only(smoke, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    script = f'mount --bind {disk} {disk} && mount -o remount,bind,ro {disk} && exec "$@"'
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "export", "--format", "habitat", "--data", str(smoke)]
    done = subprocess.run(
        [*unshared("--mount"), "sh", "-c", script, "sh", *command, "--out", str(disk / "out")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert_one_line(done, 1, f"cannot write {disk / 'out'}: the disk is read-only")
