"""The command line: quick help, one line and an exit code for what a user can get wrong."""

import re
import subprocess
import sys

import typer.main
from support.command_line import called

from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.pipeline.registry import STAGES, upstream

HEAVY = {"av", "cv2", "fcl", "gymnasium", "moderngl", "numba", "numpy", "pyarrow", "pybullet", "scipy", "trimesh"}


def test_importing_the_package_and_asking_for_help_loads_nothing_heavy():
    code = (
        "import sys\nimport aerialdojo_gen\nfrom aerialdojo_gen.cli import app as cli\nprint(*sys.modules)\n"
        "for args in ['--help'], ['plan', '--help'], ['render', '--help']:\n"
        "    try:\n        cli.app(args)\n    except SystemExit: pass\n"
        "print(*sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.count("Usage") == 3
    first, *_, last = ({name.partition(".")[0] for name in line.split()} for line in out.splitlines())
    assert not first & (HEAVY | {"pydantic"})
    assert not last & HEAVY


def test_every_stage_has_a_command_with_the_common_options_and_its_own_help():
    commands = typer.main.get_command(cli.app).commands
    common = {"--data", "--scene", "--pipeline", "--workers", "--force", "--quiet", "--executor"}
    for one in STAGES:
        command = commands[one.name]
        assert command.help == one.help
        assert common <= {text for option in command.params for text in option.opts}, one.name


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
