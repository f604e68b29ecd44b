"""What a report takes from the release: difficulty, what training shows, the sample of the paper's protocol."""

import csv
import io
import json
import shutil
import statistics

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.planting import set_difficulty
from typer.testing import CliRunner

from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.registry import missing_note, report_tables
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.score_rows import as_csv
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.dataset.protocol import read_sample
from aerialdojo_gen.store.root import open_root

AT_3 = PROFILES["aerialdojo"]
COLUMNS = ("plan_detour", "target_visible_at_start", "straight_line_free", "climb_m")
SEEN = (
    "target_seen_in_train", "start_seen_in_train", "pair_seen_in_train", "shape_seen_in_train", "target_split",
    "target_held_out and start_held_out",
)  # fmt: skip


def flown_at_random(data):
    evaluate(data, Evaluation("random", "random", selection=Selection(scenes=("U_Courtyard_0",), limit=200)))
    return load_runs(data)


def facts(planted, run):
    """A run's episodes with what the release says of their tasks, joined by pandas."""
    routes, tasks = (
        pd.concat([pd.DataFrame(planted.rows(f"{table}/{side}")) for side in ("train", "test")]).set_index(key)
        for table, key in (("routes", "nav_id"), ("tasks", "task_id"))
    )
    shown = [name for name in tasks if "seen" in name or "held_out" in name or name == "target_split"]
    return run.table.to_pandas().join(routes[list(COLUMNS)], on="nav_id").join(tasks[shown], on="task_id")


def test_every_part_is_the_one_that_a_join_finds(planted):
    set_difficulty(planted)
    (run,) = runs = flown_at_random(planted.data)
    rows = facts(planted, run)
    request = ReportRequest(open_root(planted.data), runs, [AT_3])
    assert request.breakdowns.missing == ()
    assert request.breakdowns.missing_note == ""
    expected = {
        "plan_detour": pd.cut(rows.plan_detour, [-np.inf, 1.05, 1.2, 1.5, np.inf], right=False,
                              labels=["1 to 1.05", "1.05 to 1.2", "1.2 to 1.5", "1.5 and more"]),
        "climb_m": pd.cut(rows.climb_m, [-np.inf, 1, 3, 6, np.inf], right=False,
                          labels=["0 to 1", "1 to 3", "3 to 6", "6 and more"]),
        "target_visible_at_start": (rows.target_visible_at_start > 0).map({True: "in view", False: "out of view"}),
        "straight_line_free": rows.straight_line_free.map({True: "free", False: "blocked"}),
        **{name: rows[name].map({True: "seen in training", False: "unseen"}) for name in SEEN[:4]},
        "target_split": rows.target_split,
        "target_held_out and start_held_out": (2 * rows.target_held_out + rows.start_held_out).map(
            {0: "neither", 1: "start alone", 2: "target alone", 3: "target and start"}
        ),
    }  # fmt: skip
    found = {breakdown.name: breakdown for breakdown in request.breakdowns.found}
    assert found.keys() == {*expected, "detour_ratio"}
    for name, wanted in expected.items():
        assert set(found[name].parts) == set(wanted.unique()), name
        assert found[name].labels[0].tolist() == wanted.tolist(), name
    tables = report_tables(request, ["difficulty", "seen"])
    assert len(tables) == 11
    one = next(table for table in tables if table.title.startswith("Targets that training shows"))
    seen = rows[rows.target_seen_in_train]
    assert one.rows[0][1][0] == f"{100 * seen.success.mean():.2f}"
    assert one.notes[-1] == f"Episodes – seen in training: {len(seen):,}; unseen: {len(rows) - len(seen):,}."
    lines = csv.DictReader(io.StringIO(as_csv(request)))
    blocked = rows[~rows.straight_line_free.astype(bool)]
    (row,) = [line for line in lines if (line["scope"], line["name"]) == ("straight_line_free", "blocked")]
    assert (int(row["episodes"]), float(row["sr"])) == (len(blocked), pytest.approx(blocked.success.mean()))


def test_a_release_without_the_columns_leaves_them_out_and_says_why(planted):
    for side in ("train", "test"):
        for table, gone in (("routes", COLUMNS), ("tasks", ("seen", "held_out", "target_split"))):
            whole = pq.read_table(planted.path(f"{table}/{side}"), partitioning=None)
            kept = [name for name in whole.column_names if not any(word in name for word in gone)]
            planted.write_table(f"{table}/{side}", whole.select(kept))
    runs = flown_at_random(planted.data)
    wanted = ReportRequest(open_root(planted.data), runs, [AT_3])
    # Which targets training shows can be counted without the column.
    missing = [*COLUMNS, *SEEN[1:]]
    assert missing_note(wanted, ["all"]) == (
        f"no breakdown by {', '.join(missing)}: neither the release in --data nor the log has them "
        "(a release of this version has)"
    )
    assert missing_note(wanted, ["overall"]) == ""
    command = ["report", "--data", str(planted.data), "--table"]
    done = CliRunner().invoke(cli.app, [*command, "difficulty", "--table", "seen"])
    assert done.exit_code == 0
    assert done.stderr.strip() == missing_note(wanted, ["all"])
    assert "κ" in done.stdout
    assert CliRunner().invoke(cli.app, [*command, "overall"]).stderr == ""


def told(*args):
    return CliRunner().invoke(cli.app, [str(arg) for arg in args])


@pytest.fixture(scope="module")
def flown(smoke, tmp_path_factory):
    """The sample flown by one agent, more by another, and none of it by a third."""
    out = tmp_path_factory.mktemp("protocol")
    common = ("--data", smoke, "--out", out, "--workers", 1)
    done = told("evaluate", "--agent", "constant", "--protocol", "paper", *common)
    assert done.exit_code == 0, done.output
    assert "--protocol paper: smaller than the paper's sample: 2 of 8 maps, none of Natural, Infra" in done.output
    assert f"report constant --log {out} --protocol paper" in done.output
    for agent, more in (("stop", ("--split", "test")), ("random", ("--split", "train", "--limit", 2))):
        assert told("evaluate", "--agent", agent, *more, *common).exit_code == 0
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
    said = "run 'random' has no finished episode of the paper's sample: run aerialdojo-gen eval"
    assert said in str(refused.exception)


def test_a_release_without_its_file_and_a_run_of_part_of_it(smoke, flown, tmp_path):
    shutil.copytree(smoke / "release", tmp_path / "release")
    (tmp_path / "release" / "protocol.json").unlink()
    part = ("--setting", "base", "--limit", 6, "--data", smoke, "--out", tmp_path, "--workers", 1)
    assert told("evaluate", "--agent", "stop", "--protocol", "paper", *part).exit_code == 0
    shown = told("report", "--protocol", "paper", "--data", tmp_path)
    assert shown.exit_code == 0, shown.output
    assert "stop: 6 of the sample's 100 tasks." in " ".join(shown.output.split())
