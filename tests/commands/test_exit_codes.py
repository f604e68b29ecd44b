"""What a command ends with is one of four numbers, and the same kind of trouble has the same one: docs/errors.md."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
import typer.main

from aerialdojo_gen import cli
from aerialdojo_gen.pipeline.registry import STAGES

_COMMANDS = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
# Of a group its commands: ``"config show"``.
NAMES = sorted(
    f"{name} {inner}".strip() for name, one in _COMMANDS.items() for inner in getattr(one, "commands", None) or [""]
)
SCENE, TASK = "U_Courtyard_0", "U_Courtyard_0-0123456789ab"
# What a command needs to be called at all; {pipeline} is the smoke run's, {project} the checkout.
NEEDED = {
    "run": ["{pipeline}"],
    "add-scene": ["Mine_0", "mesh.glb", "--up", "z"],
    "add-map": ["Mine_0", "map.osm.pbf", "--bbox", "24.9,60.1,24.902,60.101"],
    "add-terrain": ["Mine_0", "hill.npz"],
    "annotate-draft": [SCENE, "--pipeline", "{pipeline}"],
    "annotate": ["--scene", SCENE, "--pipeline", "{pipeline}", "--no-browser"],
    "evaluate": ["--agent", "stop"],
    "show": [TASK],
    "train": ["{project}/pipelines/baselines/imitation.toml"],
    "view": ["--scene", SCENE, "--no-browser"],
    "export": ["--format", "habitat"],
    "push-to-hub": ["me/data"],
    "pull": ["me/data"],
    "config init": ["{file}"],
    "import-benchmark": ["tasks.json", "--format", "openfly", "--frame", "enu"],
}
STAGE_NAMES = [stage.name for stage in STAGES]
# What makes no sense for the command, whatever there is on the disk.
WRONG = {
    **{name: ["--scene", "U_Nowhere_0"] for name in STAGE_NAMES},
    "run": ["--scene", "U_Nowhere_0"],
    "add-scene": ["--scale", "much"],
    "add-map": ["--bbox", "here"],
    "add-terrain": ["--cell", "small"],
    "annotate-draft": ["--objects", "1"],
    "gallery": ["--scene", "U_Nowhere_0"],
    "annotate": ["--port", "70000"],
    "evaluate": ["--split", "nowhere"],
    "train": ["--device", "abacus"],
    "config init": ["--from", "nowhere.toml"],
    "config show": ["nowhere"],
    "stats": ["--pool", "--csv", "figures.csv"],
    "show": ["--frames", "13"],
    "view": ["--port", "70000"],
    "validate": ["--pictures", "some"],
    "export": ["--picture-size", "many"],
    "import-benchmark": ["--format", "nothing"],
    "report": ["--profile", "nothing"],
    "push-to-hub": ["--revision", "a..b"],
    "pull": ["--revision", "a..b"],
}
# What was asked for makes sense, and cannot be done: a file stands where a folder is wanted, or there is no data.
IMPOSSIBLE = {
    **{name: ["--data", "file", "--pipeline", "{pipeline}"] for name in STAGE_NAMES},
    "run": ["--data", "file"],
    "add-scene": ["--project", "file"],
    "add-map": ["--project", "file"],
    "add-terrain": ["--project", "file"],
    "gallery": ["--out", "file"],
    "annotate": ["--data", "file"],
    "import-benchmark": ["--data", "file"],
    "pull": ["--data", "file"],
    "config init": ["--force"],
}  # fmt: skip


@pytest.fixture
def ended(tmp_path, monkeypatch, capsys, project):
    """Call a command in an empty folder with a file in it; return its exit code and what it says on stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("AERIALDOJO_DATA", raising=False)
    Path("file").write_text("no folder\n")
    Path("tasks.json").write_text("[]")
    Path("mesh.glb").write_bytes(b"no mesh")

    def call(*arguments):
        # A command of a group is two words; a file cannot be made below a file.
        arguments = (*arguments[0].split(), *arguments[1:])
        known = {"pipeline": project / "pipelines/smoke.toml", "project": project, "file": "file/mine.toml"}
        given = [argument.format(**known) for argument in arguments]
        monkeypatch.setattr(sys, "argv", ["aerialdojo-gen", *given])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code or 0, capsys.readouterr().err

    return call


def test_every_command_is_here():
    assert set(WRONG) == set(NAMES)
    assert set(NEEDED) | set(IMPOSSIBLE) <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_option_is_2(name, ended):
    code, said = ended(name, *NEEDED.get(name, []), "--no-such-option")
    assert code == 2
    assert said.startswith("error: No such option: --no-such-option")
    assert said.endswith(f"; see aerialdojo-gen {name} --help\n")
    assert said.count("\n") == 1


@pytest.mark.parametrize("name", NAMES)
def test_what_makes_no_sense_is_2(name, ended):
    code, said = ended(name, *NEEDED.get(name, []), *WRONG[name])
    assert code == 2, said
    assert "Traceback" not in said
    assert said.splitlines()[-1].startswith("error: "), said


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("annotate-draft", "config show")])
def test_what_cannot_be_done_is_1(name, ended):
    code, said = ended(name, *NEEDED.get(name, []), *IMPOSSIBLE.get(name, []))
    assert code == 1, said
    lines = said.splitlines()
    assert lines[-1].startswith("error: ")
    assert sum(line.startswith("error: ") for line in lines) == 1


@pytest.mark.parametrize("asked", [("--version",), ("--help",), *((name, "--help") for name in NAMES)], ids=" ".join)
def test_what_was_done_is_0(asked, ended):
    assert ended(*asked)[0] == 0


def test_the_page_names_the_codes(project):
    page = (project / "docs/errors.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| (\d+) \|", page, re.MULTILINE) == ["0", "1", "2", "130", "141"]
