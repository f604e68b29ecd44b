"""The command that a message gives to be pasted is the one that was given, with something more."""

import shlex
import sys

import pytest

from aerialdojo_gen.cli.evaluate import rerun_command

PROGRAM, KEY = "/opt/env/bin/aerialdojo-gen", "sk-test-0b7a41dc95e84f2f8c63"
GIVEN = ["evaluate", "--agent", "openai", "--data", "my data", "--option", 'extra_body={"a": "it\'s"}', "--restart"]
AGAIN = ["--rerun-failed"]


@pytest.mark.parametrize(
    ("given", "more", "said"),
    [
        (GIVEN, AGAIN, [*GIVEN[:-1], *AGAIN]),
        ([*GIVEN[:-1], *AGAIN], AGAIN, [*GIVEN[:-1], *AGAIN]),  # what is there is not added
        (["evaluate"], [], ["evaluate", "--data", "elsewhere"]),  # the data directory of the environment
        (["evaluate", "--data=here"], [], ["evaluate", "--data=here"]),
    ],
)
def test_a_shell_reads_back_what_was_given(given, more, said, monkeypatch):
    monkeypatch.setenv("AERIALDOJO_DATA", "elsewhere")
    monkeypatch.setattr(sys, "argv", [PROGRAM, *given])
    assert shlex.split(rerun_command(more, without=["--restart"], data="elsewhere")) == [PROGRAM, *said]


def test_it_is_called_by_its_name_where_the_shell_finds_it_and_keys_are_not_repeated(monkeypatch, tmp_path):
    program = tmp_path / "aerialdojo-gen"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", [str(program), "report", "--option", f"note={KEY}"])
    again = rerun_command([])
    assert again.startswith("aerialdojo-gen report --option ")
    assert KEY not in again
