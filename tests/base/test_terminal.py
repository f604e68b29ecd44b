"""What commands print: text from outside controls no terminal, and output that cannot be written ends in a line."""

import json
import os
import subprocess
import sys
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.command_line import called

from aerialdojo_gen.base.terminal import CLOSED_PIPE, shown

COMMAND = [sys.executable, "-m", "aerialdojo_gen.cli"]
HOSTILE = "a\x1b]0;owned\x07\x1b[2J\x9b2J\u202eb\u2066\rc"
VISIBLE = "a\\u001b]0;owned\\u0007\\u001b[2J\\u009b2J\\u202eb\\u2066\\u000dc"
BIDI = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
FULL = "error: cannot write standard output: no space left on the disk\n"


def call(*arguments, cwd=None, env=None, **streams):
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.run(command, text=True, check=False, cwd=cwd, env=os.environ | (env or {}), **given)


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
