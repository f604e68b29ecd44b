"""What a command ends with is one of four numbers, and the same kind of trouble has the same one: docs/errors.md."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
import typer.main

from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.pipeline.registry import STAGES

_COMMANDS = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
# Of a group its commands: ``"config show"``.
NAMES = sorted(
    f"{name} {inner}".strip() for name, one in _COMMANDS.items() for inner in getattr(one, "commands", None) or [""]
)
SCENE, TASK = "U_Courtyard_0", "U_Courtyard_0-0123456789ab"
BOX = "--bbox 24.9,60.1,24.902,60.101"
# What a command needs to be called at all; {pipeline} is the smoke run's, {project} the checkout.
NEEDED = {
    "run": "{pipeline}", "add-scene": "Mine_0 mesh.glb --up z", "add-map": f"Mine_0 map.osm.pbf {BOX}",
    "add-terrain": "Mine_0 hill.npz", "vary": "U_Park --seeds 1000:1001 --out worlds",
    "annotate-draft": f"{SCENE} --pipeline {{pipeline}}",
    "annotate": f"--scene {SCENE} --pipeline {{pipeline}} --no-browser", "evaluate": "--agent stop",
    "fly": "--name pilot-1 --no-browser", "score": "file", "show": TASK, "view": f"--scene {SCENE} --no-browser",
    "train": "{project}/pipelines/baselines/imitation.toml", "export": "--format habitat", "push-to-hub": "me/data",
    "pull": "me/data", "config init": "{file}", "import-benchmark": "tasks.json --format openfly --frame enu",
}  # fmt: skip
STAGE_NAMES = [stage.name for stage in STAGES]
# What makes no sense for the command, whatever there is on the disk.
WRONG = {
    **dict.fromkeys([*STAGE_NAMES, "run", "status", "gallery"], "--scene U_Nowhere_0"),
    "add-scene": "--scale much", "add-map": "--bbox here", "add-terrain": "--cell small", "vary": "--seeds some",
    "annotate-draft": "--objects 1", "annotate": "--port 70000", "evaluate": "--split nowhere",
    "fly": "--name Pilot-1", "train": "--device abacus", "config init": "--from nowhere.toml",
    "config show": "nowhere", "stats": "--pool --csv figures.csv", "show": "--frames 13", "view": "--port 70000",
    "validate": "--pictures some", "export": "--picture-size many", "import-benchmark": "--format nothing",
    "report": "--profile nothing", "score": "--split nowhere", "leaderboard": "scored more",
    "push-to-hub": "--revision a..b", "pull": "--revision a..b",
}  # fmt: skip
# Further things that make no sense: a name or a value each, of a command that has what else it needs.
NO_SENSE = [
    "add-scene no.name mesh.obj --up z", "add-scene Mine_0 mesh.obj --up z --tiles 1",
    f"add-map no.name map.osm {BOX}", "add-map Mine_0 map.osm --bbox 4,3,2,1",
    f"add-map Mine_0 map.osm {BOX} --drive-on middle", "add-terrain no.name hill.npz",
    *(f"evaluate --agent stop {option} nothing" for option in (
        "--setting", "--modality", "--view", "--renderer", "--tell", "--option", "--preset", "--max-cost")),
    "evaluate --run ../run", "train nothing", "train imitation --renderer nothing",
    *(f"render {option} nothing" for option in (
        "--split", "--profile", "--renderer", "--sampling", "--frames", "--shard", "--budget")),
    "plan --workers 0", "plan --executor nothing", "run nothing", "run mine.toml",
    "build-scenes --watch U_Nil_0.toml", "validate --report faults.txt",
    *(f"report {option} nothing" for option in ("--format", "--group", "--profile", "--table")),
    "export --format nothing",
    *(f"export --format lerobot {option} nothing" for option in ("--split", "--view", "--goal", "--source")),
    "import-benchmark tasks.json --format openfly", "import-benchmark tasks.json --format openfly --frame nothing",
    "config init mine.json", "annotate-draft U_Nowhere_0",
]  # fmt: skip
# What was asked for makes sense, and cannot be done: a file stands where a folder is wanted, or there is no data.
IMPOSSIBLE = {
    **dict.fromkeys(STAGE_NAMES, "--data file --pipeline {pipeline}"),
    **dict.fromkeys(["run", "annotate", "import-benchmark", "pull"], "--data file"),
    **dict.fromkeys(["add-scene", "add-map", "add-terrain"], "--project file"),
    **dict.fromkeys(["vary", "gallery"], "--out file"), "config init": "--force",
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
        # A file cannot be made below a file.
        known = {"pipeline": project / "pipelines/smoke.toml", "project": project, "file": "file/mine.toml"}
        monkeypatch.setattr(sys, "argv", ["aerialdojo-gen", *" ".join(arguments).format(**known).split()])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code or 0, capsys.readouterr().err

    return call


def test_every_command_is_here():
    assert set(WRONG) == set(NAMES) >= set(NEEDED) | set(IMPOSSIBLE)


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_option_is_2(name, ended):
    code, said = ended(name, NEEDED.get(name, ""), "--no-such-option")
    assert code == 2
    assert said.startswith("error: No such option: --no-such-option")
    assert said.endswith(f"; see aerialdojo-gen {name} --help\n")
    assert said.count("\n") == 1


@pytest.mark.parametrize("given", [*(f"{name} {NEEDED.get(name, '')} {WRONG[name]}" for name in NAMES), *NO_SENSE])
def test_what_makes_no_sense_is_2(given, ended):
    Path("mesh.obj").write_text("v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 5\nf 1 2 3\nf 1 3 4\n")
    Path("mine.toml").write_text("recipes = 'nowhere'\n")
    there = set(Path().iterdir())
    code, said = ended(given)
    assert code == 2, said
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert set(Path().iterdir()) == there


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("annotate-draft", "config show", "status")])
def test_what_cannot_be_done_is_1(name, ended):
    code, said = ended(name, NEEDED.get(name, ""), IMPOSSIBLE.get(name, ""))
    assert code == 1, said
    lines = said.splitlines()
    # A run says below its error how to continue.
    assert lines[-1].startswith(("error: ", "finished shards are kept"))
    assert sum(line.startswith("error: ") for line in lines) == 1


def test_what_was_done_is_0(ended):
    assert ended("--version")[0] == 0


def test_the_page_names_the_codes(project):
    page = (project / "docs/errors.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| (\d+) \|", page, re.MULTILINE) == ["0", "1", "2", "130", "141"]
