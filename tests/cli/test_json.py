"""``--json``: one document on standard output, with the figures that the tables, the library and the files have."""

import csv
import json
import shutil

import pytest
from support.command_line import said

from aerialdojo_gen import open_release


def document(capsys, *arguments, code=0):
    ended, out, err = said(capsys, *arguments, "--json")
    assert ended == code, err
    return json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


def test_stats_has_the_figures_of_its_csv(smoke, tmp_path, capsys):
    tables = document(capsys, "stats", "--data", smoke, "--csv", tmp_path / "stats.csv")
    found = {}
    for table in tables:
        for row in table["rows"]:
            for column, ours in row.get("ours", {}).items():
                found[table["title"], row["name"], column, table["units"][column]] = ours
    wanted = {}
    for row in csv.DictReader((tmp_path / "stats.csv").open(encoding="utf-8")):
        at = row["table"], row["row"], row["column"], row["unit"]
        if at in found:
            wanted[at] = float(row["ours"]) if row["ours"] else None
    assert {at: None if n is None else float(n) for at, n in found.items()} == wanted
    assert len(found) > 100
    whole = {row["name"]: row["ours"]["figure"] for row in tables[0]["rows"]}
    assert whole["instances"] == open_release(smoke).tasks().num_rows
    assert [row["benchmark"] for row in tables[-1]["rows"]][-1] == "this release"


def test_stats_of_the_pool_counts_the_verdicts(smoke, project, capsys):
    pools = document(capsys, "stats", "--pool", "--data", smoke, "--pipeline", project / "pipelines/smoke.toml")
    assert [pool["scene"] for pool in pools] == ["U_Courtyard_0", "U_Courtyard_1"]
    assert 2 * sum(sum(pool["kept"].values()) for pool in pools) == open_release(smoke).tasks().num_rows


def test_show_has_the_rows_and_draws_nothing(smoke, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    release = open_release(smoke)
    task = release.tasks(split="id_test").to_pylist()[0]
    shown = document(capsys, "show", task["task_id"], "--data", smoke)
    assert shown["route"] == release.task(task["task_id"]).route
    semantic, image = shown["tasks"]
    assert semantic["target_name"] == task["target_name"] == shown["target"]["name"]
    assert (semantic["description"] is None, image["description"] is None) == (False, True)
    assert shown["landmark"]["name"] == semantic["landmark"]
    assert "reference_image" not in shown["target"]
    assert list(tmp_path.iterdir()) == []


def test_estimate_is_of_the_selection(smoke, project, tmp_path, capsys):
    text = (project / "pipelines/smoke.toml").read_text().replace('"../', f'"{project}/')
    # Its last section is that of recordings.
    (tmp_path / "small.toml").write_text(f"{text}width = 64\nheight = 64\n")
    options = ("--pipeline", tmp_path / "small.toml", "--scene", "U_Courtyard_0", "--limit", "1")
    told = document(capsys, "render", "--estimate", "--data", smoke, "--workers", "3", *options)
    assert told["trajectories"] * 8 == told["videos"] > 0
    assert told["poses"] >= told["measured"] > 0
    assert told["wall_s"] == pytest.approx(told["cpu_s"] / 3)
    assert said(capsys, "render", "--json", "--data", smoke)[0] == 2


def test_validate_lists_every_fault_and_ends_as_it_does_without(planted, project, capsys):
    pipeline = project / "pipelines/smoke.toml"
    options = (*f"--no-meshes --workers 1 --scene {planted.scene} --pipeline".split(), pipeline)
    whole = document(capsys, "validate", "--data", planted.data, *options)
    assert whole["faults"] == []
    assert sum(check["judged"] for check in whole["checks"]) > 1000
    tables = planted.data / "release/scenes"
    shutil.copy(next(tables.rglob("*.parquet")), tables / "more.parquet")
    broken = document(capsys, "validate", "--data", planted.data, *options, code=1)
    assert broken["faults"]
    assert sum(check["faults"] for check in broken["checks"]) == len(broken["faults"])
    assert broken["verdict"].split(": ")[1].startswith(f"{len(broken['faults'])} at fault")


def test_report_is_the_format_json(smoke, tmp_path, capsys):
    flown = ("evaluate", "--agent", "oracle", "--limit", "4", "--workers", "1", "--data", smoke, "--out", tmp_path)
    assert said(capsys, *flown)[0] == 0
    arguments = ("report", "--data", smoke, "--log", tmp_path)
    rows = document(capsys, *arguments)
    assert json.loads(said(capsys, *arguments, "--format", "json")[1]) == rows
    overall = [row for row in rows if row["scope"] == "overall" and row["setting"] == row["modality"] == "all"]
    assert [row["sr"] for row in overall] == [1.0] * len(overall)
    assert overall
