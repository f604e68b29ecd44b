"""Scores by difficulty and by what training shows: the release's columns, counted by hand."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.extended import set_difficulty
from support.planting import Planted
from typer.testing import CliRunner

from aerialdojo_gen.benchmark.difficulty import find_breakdowns
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.registry import missing_note, report_tables
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import Run, load_runs
from aerialdojo_gen.benchmark.score_rows import as_csv
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.store.root import open_root

AT_3 = PROFILES["aerialdojo"]
COLUMNS = ("plan_detour", "target_visible_at_start", "straight_line_free", "climb_m")
SEEN = (
    "target_seen_in_train", "start_seen_in_train", "pair_seen_in_train", "shape_seen_in_train", "target_split",
    "target_held_out and start_held_out",
)  # fmt: skip


def flown(data: Path) -> list[Run]:
    job = Evaluation("random", "random", selection=Selection(scenes=("U_Courtyard_0",), limit=200))
    evaluate(data, job)
    return load_runs(data)


def facts(planted: Planted, run: Run) -> pd.DataFrame:
    """A run's episodes with what the release says of their tasks, joined by pandas."""
    sides = ("train", "test")
    routes = pd.concat([pd.DataFrame(planted.rows(f"routes/{side}")) for side in sides]).set_index("nav_id")
    tasks = pd.concat([pd.DataFrame(planted.rows(f"tasks/{side}")) for side in sides]).set_index("task_id")
    rows = run.table.to_pandas()
    rows = rows.join(routes[list(COLUMNS)], on="nav_id")
    return rows.join(tasks[[c for c in tasks if "seen" in c or "held_out" in c or c == "target_split"]], on="task_id")


def test_every_part_is_the_one_that_a_join_finds(planted: Planted) -> None:
    set_difficulty(planted)
    (run,) = runs = flown(planted.data)
    rows = facts(planted, run)
    breakdowns = find_breakdowns(open_root(planted.data), runs)
    assert breakdowns.missing == ()
    assert breakdowns.missing_note == ""
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
    found = {breakdown.name: breakdown for breakdown in breakdowns.found}
    assert found.keys() == {*expected, "detour_ratio"}
    for name, wanted in expected.items():
        assert set(found[name].parts) == set(wanted.unique()), name
        assert found[name].labels[0].tolist() == wanted.tolist(), name
    request = ReportRequest(open_root(planted.data), runs, [AT_3])
    tables = report_tables(request, ["difficulty", "seen"])
    assert len(tables) == 11
    heads = {table.title.split(",")[0]: table for table in tables}
    one = heads["Targets that training shows"]
    seen = rows[rows.target_seen_in_train]
    assert one.rows[0][1][0] == f"{100 * seen.success.mean():.2f}"
    assert one.notes[-1] == f"Episodes – seen in training: {len(seen):,}; unseen: {len(rows) - len(seen):,}."
    lines = list(csv.DictReader(io.StringIO(as_csv(request))))
    blocked = rows[~rows.straight_line_free.astype(bool)]
    (row,) = [line for line in lines if (line["scope"], line["name"]) == ("straight_line_free", "blocked")]
    assert int(row["episodes"]) == len(blocked)
    assert float(row["sr"]) == pytest.approx(blocked.success.mean())


def test_a_release_without_the_columns_leaves_them_out_and_says_why(planted: Planted) -> None:
    for side in ("train", "test"):
        for table, gone in (("routes", COLUMNS), ("tasks", ("seen", "held_out", "target_split"))):
            whole = pq.read_table(planted.path(f"{table}/{side}"), partitioning=None)
            drop = [name for name in whole.column_names if any(word in name for word in gone)]
            planted.write_table(f"{table}/{side}", whole.drop_columns(drop))
    runs = flown(planted.data)
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
