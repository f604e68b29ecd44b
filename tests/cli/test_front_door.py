"""What a newcomer types first: names of pipelines and scenes, a tab, what a second run says, what is typed again."""

import io
import shlex
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
import typer.main
from support.command_line import called, said

from aerialdojo_gen.base.errors import ConfigError, UsageError
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.cli.evaluate import rerun_command
from aerialdojo_gen.cli.sources import named_scene, pick_scene
from aerialdojo_gen.learning.recipe import load_recipe
from aerialdojo_gen.pipeline.registry import STAGES, upstream
from aerialdojo_gen.store import shards

STAGE_NAMES = [stage.name for stage in STAGES]
NEEDED = {
    "run": ["smoke"], "export": ["--format", "habitat"], "evaluate": ["--agent", "stop"], "fly": ["--name", "x"],
}  # fmt: skip
OF_A_RELEASE = ["evaluate", "fly", "export", "stats", "view", "validate"]


@pytest.fixture
def call(capsys):
    """Call a command; returns the exit code, standard output and standard error."""
    return partial(said, capsys)


@pytest.mark.parametrize("name", [*STAGE_NAMES, "run", "gallery", "annotate", "annotate-draft", *OF_A_RELEASE])
def test_scenes_are_named_by_position_and_by_option(name, smoke, call):
    data = ["--data", smoke] if name in OF_A_RELEASE else []
    for scene in ["U_Nowhere_0"], ["--scene", "U_Nowhere_0"]:
        code, _, said = call(name, *NEEDED.get(name, []), *scene, *data)
        assert code == 2
        assert "no scene 'U_Nowhere_0'" in said


def test_names_by_position_and_by_option_are_joined(smoke, call):
    both = ("U_Courtyard_0", "--scene", "*_1")
    code, out, _ = call("stats", *both, "--data", smoke, "--json")
    assert code == 0
    assert out == call("stats", "--data", smoke, "--json")[1]
    assert out != call("stats", "U_Courtyard_0", "--data", smoke, "--json")[1]


def test_pipelines_that_are_shipped_go_by_name_anywhere(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, by_name, _ = call("config", "show", "--pipeline", "smoke")
    assert code == 0
    assert by_name == call("config", "show", "--pipeline", home() / "pipelines" / "smoke.toml")[1]
    assert by_name == call("config", "show", "--pipeline", "smoke.toml")[1]
    assert call("config", "init", "smoke.toml", "--from", "smoke")[0] == 0
    (tmp_path / "smoke.toml").write_text("seed = 77\n")
    assert "seed = 77" in call("config", "show", "--pipeline", "smoke.toml")[1], "what lies here goes before"
    (tmp_path / "smoke.toml").write_text("recipes = 'nowhere'\n")
    said = f"error: no folder {tmp_path / 'nowhere'}: set recipes in the pipeline file\n"
    assert call("run", "smoke.toml")[2] == said
    for wanted in ("smok", "nowhere/smoke.toml", "pipelines/smoke.toml"):
        code, _, said = call("run", wanted)
        assert code == 2
        assert said.count("\n") == 1
        assert said.endswith("aerialdojo-200k, aerialdojo-hard, smoke\n"), said


def test_recipes_that_are_shipped_go_by_name_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shipped = load_recipe(home() / "pipelines" / "baselines" / "imitation.toml")
    assert load_recipe("imitation") == load_recipe("imitation.toml") == shipped
    Path("imitation").write_text('name = "mine"\n')
    assert load_recipe("imitation").name == "mine", "what lies here goes before"
    known = "by name, as in aerialdojo-gen train imitation: adapt, adapt-mall, blind, imitation"
    with pytest.raises(ConfigError, match=f"no recipe imitatoin; {known}"):
        load_recipe("imitatoin")


def test_one_of_several_scenes_is_picked_by_number_or_name():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    known = [f"U_Mall_{k}" for k in range(7)]
    told = Terminal()
    assert pick_scene("*", known, Terminal("0\n99\nzzz\n6\n"), told) == "U_Mall_5"
    assert told.getvalue().count("scene (1 to 7, or a name): ") == 4
    assert "  1 U_Mall_0   4 U_Mall_3   7 U_Mall_6\n  2 U_Mall_1   5 U_Mall_4\n" in told.getvalue()
    assert pick_scene(None, known, Terminal("u_mall_4\n"), Terminal()) == "U_Mall_4"
    assert pick_scene("*_3", known, io.StringIO(), io.StringIO()) == "U_Mall_3", "nobody needs to be asked"
    with pytest.raises(UsageError, match=r"7 scenes fit '\*': name one: U_Mall_0, .*…"):
        pick_scene("*", known, io.StringIO("1\n"), io.StringIO())
    with pytest.raises(UsageError, match="no scene was picked"):
        pick_scene("*", known, Terminal(""), Terminal())
    with pytest.raises(UsageError, match="two scenes, U_A_0 and --scene U_B_0"):
        named_scene("U_A_0", "U_B_0")
    assert named_scene("U_A_0", "U_A_0") == "U_A_0"


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("rep", {"report"}),
        ("plan U_Mal", {"U_Mall_0", "U_Mall_1"}),
        ("plan --scene U_Mal", {"U_Mall_0", "U_Mall_1"}),
        ("plan --pipeline smoke --scene ", {"U_Courtyard_0", "U_Courtyard_1"}),
        ("run sm", {"smoke"}),
        ("evaluate --agent or", {"oracle"}),
        ("stats --mark", {"--markdown"}),
    ],
)
def test_a_tab_completes(typed, offered, tmp_path):
    words = f"aerialdojo-gen {typed}"
    at = str(len(words.split(" ")) - 1)
    shell = {"_AERIALDOJO_GEN_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": at}
    done = called(cwd=tmp_path, **shell)
    assert set(done.stdout.split()) == offered, done.stderr


def test_a_run_with_nothing_to_do_says_so_in_a_line(smoke, call, monkeypatch, project):
    monkeypatch.chdir(project)
    asked = ("filter", "--pipeline", "smoke", "--data", smoke, "--workers", 1)
    code, _, said = call(*asked)
    assert code == 0
    lines = said.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["filter", "nothing to do"]
    n = len(list(upstream("filter")))
    assert n > 4
    assert lines[1].startswith(f"nothing to do: all {n} stages are up to date")
    _, _, said = call(*asked, "--verbose")
    assert said.count("; nothing to do; ") == n
    assert call(*asked, "-q") == (0, "", "")


def test_an_image_goal_is_told_in_words_where_no_picture_is(smoke, call, tmp_path):
    rows = shards.read_scene(smoke, "tasks/train", "U_Courtyard_0").to_pylist()
    image = next(row for row in rows if row["modality"] == "image")
    twin = next(row for row in rows if row["nav_id"] == image["nav_id"] and row["modality"] == "semantic")
    code, out, _ = call("show", image["task_id"], "--data", smoke, "--frames", 0, "--out", tmp_path / "task.png")
    assert code == 0
    assert f"reference image {image['reference_image_id']}, 320 x 320 pixels" in out
    assert f"In words, which {twin['task_id']} gives in its place: {twin['description']}" in out
    assert ":\n" not in out.partition("length L")[0], "no sentence that ends in the air"


def test_what_is_printed_fits_80_columns(smoke, call, monkeypatch, project):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(project)
    asked = [
        ("stats", "--data", smoke), ("config", "show"), ("stats", "--pool", "--data", smoke, "--pipeline", "smoke"),
    ]  # fmt: skip
    commands = typer.main.get_command(cli.app).commands
    for arguments in [*asked, ("--help",), *((name, "--help") for name in commands)]:
        code, out, said = call(*arguments)
        assert code == 0, said
        assert max(map(len, out.splitlines())) <= 80, (arguments, max(out.splitlines(), key=len))


def test_an_agent_whose_packages_are_an_extra_names_it():
    # As where it is not installed.
    code = "import sys; sys.modules['tenacity'] = None; from aerialdojo_gen.benchmark.agents import load_agent; "
    done = subprocess.run([sys.executable, "-c", f"{code}load_agent('openai')"], capture_output=True, text=True)
    told = "MissingPackage: agent 'openai' lacks the package tenacity: pip install 'aerialdojo-gen[llm]'\n"
    assert done.stderr.endswith(told)


# The command that a message gives to be pasted is the one that was given, with something more.
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
