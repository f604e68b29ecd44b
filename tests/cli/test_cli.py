"""The command line: quick help, one line and an exit code for what a user can get wrong."""

import re
import subprocess
import sys

import pytest
import typer.main
from support.command_line import called

from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.pipeline.registry import STAGES, upstream

HEAVY = ("numpy", "pyarrow", "numba", "fcl", "pybullet", "trimesh", "cv2", "scipy", "av")


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom aerialdojo_gen.cli import app as cli\n"
        "for args in ['--help'], ['plan', '--help'], ['render', '--help']:\n"
        "    try:\n        cli.app(args)\n    except SystemExit: pass\n"
        f"    print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.count("Usage") == out.count("\n[]\n") == 3


def test_every_stage_has_a_command_with_the_common_options_and_its_own_help():
    listed = " ".join(called("--help", COLUMNS="200").stdout.split())
    for one in STAGES:
        assert f"{one.name} {one.help}" in listed
        text = called(one.name, "--help").stdout
        assert one.help.split()[0] in text
        for option in ("--data", "--scene", "--pipeline", "--workers", "--force", "--quiet"):
            assert option in text, (one.name, option)


def test_the_commands_are_listed_by_purpose():
    text = called("--help", COLUMNS="80").stdout
    sections = dict(re.findall(r"^(\w[\w ]+):\n((?:  .*\n)+)", text, re.MULTILINE))
    assert list(sections)[1:] == [
        "Make a dataset", "Look at a dataset", "Evaluate and train agents", "Add your own scenes",
        "Exchange and share",
    ]  # fmt: skip
    listed = {heading: re.findall(r"^  ([a-z][a-z-]*)  ", body, re.MULTILINE) for heading, body in sections.items()}
    every = [name for names in listed.values() for name in names]
    assert sorted(every) == sorted(typer.main.get_command(cli.app).commands)
    # What is in no other section is there to make a dataset.
    assert set(listed["Make a dataset"]) == {*(one.name for one in STAGES), "run", "status", "config"}


def test_the_help_of_run_names_every_pipeline(project):
    text = " ".join(called("run", "--help").stdout.split())
    for file in (project / "pipelines").glob("*.toml"):
        assert file.stem in text


@pytest.mark.parametrize(
    ("command", "words"),
    [("plan --scene U_Mal_0", ["no scene 'U_Mal_0'", "U_Mall_0"]), ("run mine.toml", ["nowhere", "set recipes"])],
)
def test_what_a_user_gets_wrong_is_one_line_and_leaves_nothing(tmp_path, command, words):
    (tmp_path / "mine.toml").write_text("recipes = 'nowhere'\n")
    result = called(*command.split(), cwd=tmp_path)
    assert result.returncode == 2
    assert re.fullmatch(r"error: [^\n]+\n", result.stderr)
    assert all(word in result.stderr for word in words), result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_upstream_of_each_stage_is_all_it_reads():
    for one in STAGES:
        chain = list(upstream(one.name))
        assert chain[-1] is one
        written = set()
        for s in chain:
            assert set(s.reads) <= written, (one.name, s.name)
            written |= set(s.writes)


def test_upstream_leaves_out_what_is_not_needed():
    assert [s.name for s in upstream("plan")] == [
        "build-scenes", "annotate-import", "anchor-sample", "pair-objects", "plan"
    ]  # fmt: skip
