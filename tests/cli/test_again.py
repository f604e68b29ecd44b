"""The command that a message gives to be pasted is the one that was given, with something more."""

import shlex
import sys

import pytest

from aerialdojo_gen.cli.evaluate import rerun_command

GIVEN = ["evaluate", "--agent", "openai", "--data", "my data", "--option", 'extra_body={"a": "it\'s"}', "--restart"]


@pytest.fixture(autouse=True)
def argv(monkeypatch):
    monkeypatch.delenv("AERIALDOJO_DATA", raising=False)
    monkeypatch.setattr(sys, "argv", ["/opt/env/bin/aerialdojo-gen", *GIVEN])


def test_a_shell_reads_back_what_was_given():
    said = rerun_command(["--rerun-failed"], without=["--restart"], data="my data")
    assert shlex.split(said) == ["/opt/env/bin/aerialdojo-gen", *GIVEN[:-1], "--rerun-failed"]


def test_what_is_there_is_not_added(monkeypatch):
    monkeypatch.setattr(sys, "argv", [*sys.argv, "--rerun-failed"])
    assert rerun_command(["--rerun-failed"]).count("--rerun-failed") == 1


def test_a_data_directory_of_the_environment_is_named(monkeypatch):
    monkeypatch.setenv("AERIALDOJO_DATA", "elsewhere")
    monkeypatch.setattr(sys, "argv", [sys.argv[0], "evaluate"])
    assert rerun_command([], data="elsewhere") == "/opt/env/bin/aerialdojo-gen evaluate --data elsewhere"
    for named in (["--data", "here"], ["--data=here"]):
        monkeypatch.setattr(sys, "argv", [sys.argv[0], "evaluate", *named])
        assert shlex.split(rerun_command([], data="here"))[1:] == ["evaluate", *named]


def test_it_is_called_by_its_name_where_the_shell_finds_it(monkeypatch, tmp_path):
    program = tmp_path / "aerialdojo-gen"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", [str(program), "report"])
    assert rerun_command([]) == "aerialdojo-gen report"


def test_keys_are_not_repeated(monkeypatch):
    key = "sk-test-0b7a41dc95e84f2f8c63"
    monkeypatch.setattr(sys, "argv", [sys.argv[0], "evaluate", "--option", f"note={key}"])
    assert key not in rerun_command([])
