"""Commands that messages advise: they exist, take what is given to them, and can be pasted."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

import aerialdojo_gen
from aerialdojo_gen.base import cli_context
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.store.shards import LAYOUT

PACKAGE = Path(aerialdojo_gen.__file__).parent
COMMANDS = get_command(cli.app).commands


@pytest.fixture(scope="module")
def sources() -> dict[str, list[ast.AST]]:
    """All nodes of every file of the package."""
    return {
        path.relative_to(PACKAGE).as_posix(): [*ast.walk(ast.parse(path.read_text()))]
        for path in PACKAGE.rglob("*.py")
    }


def options(verb: str) -> set[str]:
    return {name for param in COMMANDS[verb].params for name in param.opts if name.startswith("--")}


def test_every_advised_command_is_one_of_ours_and_has_the_options_and_is_given_what_it_takes(sources):
    calls = [
        (file, node)
        for file, nodes in sources.items()
        for node in nodes
        if isinstance(node, ast.Call) and re.fullmatch(r"(cli_context\.)?command", ast.unparse(node.func))
    ]
    assert len(calls) > 20
    for file, call in calls:
        if isinstance(call.args[0], ast.Constant):
            verb = str(call.args[0].value)
            unknown = {f"--{key.arg.replace('_', '-')}" for key in call.keywords if key.arg} - options(verb)
            assert not unknown, (file, ast.unparse(call))
    assert {spot.command for spot in LAYOUT.values()} <= set(COMMANDS)
    with cli_context.use_context(cli_context.CliContext("mine/pipeline.toml", "mine/data")):
        for verb in COMMANDS:
            words = shlex.split(cli_context.command(verb))
            assert {word for word in words if word.startswith("--")} == options(verb) & {"--pipeline", "--data"}, verb


def test_no_message_names_a_command_but_by_the_helper(sources):
    verbs = "|".join(map(re.escape, sorted(COMMANDS)))
    docstrings = {
        id(node.body[0].value)
        for nodes in sources.values()
        for node in nodes
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        and node.body and isinstance(node.body[0], ast.Expr)
    }  # fmt: skip
    found = [
        f"{file}: {node.value}"
        for file, nodes in sources.items()
        for node in nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings
        and re.search(rf"aerialdojo-gen ({verbs})\b|\brun ({verbs}) (again|first)", node.value)
    ]  # fmt: skip
    # The title of a page is no advice.
    pages = ("studio/view/server.py", "studio/view/plan_page.py", "studio/fly/server.py")
    assert [line for line in found if not line.startswith(pages)] == []


def test_what_is_advised_is_quoted_and_repeats_what_was_given():
    with cli_context.use_context(cli_context.CliContext("our scenes/$x.toml", "")):
        text = cli_context.command("annotate", scene="A'b", port=8000, browser=None, coco=False)
        assert shlex.split(text) == [
            "aerialdojo-gen", "annotate", "--scene", "A'b", "--port", "8000", "--pipeline", "our scenes/$x.toml",
        ]  # fmt: skip
        assert cli_context.command("plan", force=True, pipeline="other.toml").endswith(
            "plan --force --pipeline other.toml"
        )
    assert cli_context.current_context().pipeline == ""


def test_only_what_is_written_is_repeated(monkeypatch, capsys):
    monkeypatch.setenv("AERIALDOJO_DATA", "elsewhere")
    for arguments, kept in (
        (["plan", "--pipeline", "no such.toml"], ("no such.toml", "")),
        (["plan", "--data", "here", "--pipeline", "gone.toml"], ("gone.toml", "here")),
        (["run", "gone.toml"], ("gone.toml", "")),
    ):
        monkeypatch.setattr("sys.argv", ["aerialdojo-gen", *arguments])
        with pytest.raises(SystemExit):
            cli.main()
        assert (cli_context.current_context().pipeline, cli_context.current_context().data) == kept
    capsys.readouterr()
    cli_context.reset_context()


def test_the_program_is_called_as_it_was(monkeypatch, tmp_path):
    tool = tmp_path / ".venv" / "bin" / "aerialdojo-gen"
    tool.parent.mkdir(parents=True)
    tool.write_text("#!/bin/sh\n")
    tool.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    for path, called_as, said in (
        ("/nowhere", str(tool), ".venv/bin/aerialdojo-gen"),
        (str(tool.parent), str(tool), "aerialdojo-gen"),
        (str(tool.parent), "pytest", "aerialdojo-gen"),
    ):
        monkeypatch.setenv("PATH", path)
        cli_context.reset_context(called_as)
        assert cli_context.command("stats") == f"{said} stats"
