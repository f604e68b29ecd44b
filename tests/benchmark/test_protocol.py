"""The paper's protocol end to end: flown and scored by the commands, on what a release has of it."""

import json
import shutil
import statistics

import pytest
from typer.testing import CliRunner

from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.dataset.protocol import read_sample


def told(*args):
    return CliRunner().invoke(cli.app, [str(arg) for arg in args])


@pytest.fixture(scope="module")
def flown(smoke, tmp_path_factory):
    """The sample flown by one agent, everything by another, and none of it by a third."""
    out = tmp_path_factory.mktemp("protocol")
    common = ("--data", smoke, "--out", out, "--workers", 1)
    done = told("evaluate", "--agent", "constant", "--protocol", "paper", *common)
    assert done.exit_code == 0, done.output
    assert "--protocol paper: smaller than the paper's sample: 2 of 8 maps, none of Natural, Infra" in done.output
    assert f"report constant --log {out} --protocol paper" in done.output
    assert told("evaluate", "--agent", "stop", *common).exit_code == 0
    assert told("evaluate", "--agent", "random", "--split", "train", "--limit", 2, *common).exit_code == 0
    return out


def test_the_sample_is_flown_and_reported_alone(smoke, flown):
    ids = read_sample(smoke).ids()
    assert set(read_run(flown, "constant")["task_id"].to_pylist()) == ids
    assert read_run(flown, "stop").num_rows > len(ids)
    shown = told("report", "--protocol", "paper", "--data", smoke, "--log", flown, "--json")
    assert shown.exit_code == 0, shown.output
    rows = [row for row in json.loads(shown.stdout) if (row["profile"], row["modality"]) == ("aerialdojo", "all")]
    # The run that flew none of it is left out.
    assert {row["run"] for row in rows} == {"constant", "stop"}
    for run in ("constant", "stop"):
        base = {row["name"]: row for row in rows if row["run"] == run and row["setting"] == "base"}
        assert base["overall"]["episodes"] == 100
        maps = [base[f"U_Courtyard_{k}"]["dts_m"] for k in (0, 1)]
        assert base["overall"]["dts_m_sd"] == pytest.approx(statistics.stdev(maps))


def test_the_tables_say_what_was_flown_of_the_sample(smoke, flown):
    shown = told("report", "constant", "--protocol", "paper", "--data", smoke, "--log", flown)
    words = " ".join(shown.output.split())
    assert "protocol alone, on U_Courtyard_0, U_Courtyard_1; ± is the sample standard deviation over these" in words
    assert "of the sample's" not in shown.output
    refused = told("report", "random", "--protocol", "paper", "--data", smoke, "--log", flown)
    assert refused.exit_code == 1
    assert "run 'random' has no finished episode of the paper's sample: run aerialdojo-gen eval" in str(
        refused.exception
    )


def test_a_release_without_its_file_and_a_run_of_part_of_it(smoke, flown, tmp_path):
    shutil.copytree(smoke / "release", tmp_path / "release")
    (tmp_path / "release" / "protocol.json").unlink()
    part = ("--protocol", "paper", "--setting", "base", "--limit", 6, "--data", smoke, "--out", tmp_path)
    assert told("evaluate", "--agent", "stop", "--workers", 1, *part).exit_code == 0
    shown = told("report", "--protocol", "paper", "--data", tmp_path, "--out", tmp_path / "report", "--replays", 0)
    assert shown.exit_code == 0, shown.output
    assert "stop: 6 of the sample's 100 tasks." in " ".join(shown.output.split())
    assert "the axes of the paper&#39;s Fig. 5" in (tmp_path / "report" / "report.html").read_text()
