"""What a report takes from the release, and its page: difficulty, the paper's sample, replays in a real browser."""

import base64
import csv
import io
import json
import re
import shutil
import statistics

import cv2
import numpy as np
import pandas as pd
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from support.browser import errors
from support.command_line import called
from support.planting import set_difficulty

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.figures import encode_figure, radius_curve
from aerialdojo_gen.benchmark.metrics import PROFILES, outcomes, summarize
from aerialdojo_gen.benchmark.registry import missing_note, named_tables, report_tables
from aerialdojo_gen.benchmark.replay import choose_tasks, replays
from aerialdojo_gen.benchmark.report import html
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.tables import ReportRequest, as_csv
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.dataset.protocol import read_sample
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.schemas import ACTION_NAMES

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
    assert request.breakdowns.missing == []
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
    found = request.breakdowns.found
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
    missing = [*COLUMNS, *SEEN]
    assert missing_note(wanted, ["all"]) == (
        f"no breakdown by {', '.join(missing)}: neither the release in --data nor the log has them "
        "(a release of this version has)"
    )
    assert missing_note(wanted, ["overall"]) == ""
    command = ["report", "--data", planted.data, "--table"]
    done = called(*command, "difficulty", "--table", "seen")
    assert done.returncode == 0
    assert done.stderr.strip() == missing_note(wanted, ["all"])
    assert "κ" in done.stdout
    assert called(*command, "overall").stderr == ""


@pytest.fixture(scope="module")
def flown(smoke, tmp_path_factory):
    """The sample flown by one agent, more by another, and none of it by a third."""
    out = tmp_path_factory.mktemp("protocol")
    common = ("--data", smoke, "--out", out, "--workers", 1)
    done = called("evaluate", "--agent", "constant", "--protocol", "paper", *common)
    assert done.returncode == 0, done.stderr
    assert "--protocol paper: smaller than the paper's sample: 2 of 8 maps, none of Natural, Infra" in done.stderr
    assert f"report constant --log {out} --protocol paper" in done.stderr
    for agent, more in (("stop", ("--split", "test")), ("random", ("--split", "train", "--limit", 2))):
        assert called("evaluate", "--agent", agent, *more, *common).returncode == 0
    return out


def test_the_sample_is_flown_and_reported_alone(smoke, flown):
    ids = read_sample(smoke).ids()
    assert set(read_run(flown, "constant")["task_id"].to_pylist()) == ids
    assert read_run(flown, "stop").num_rows > len(ids)
    shown = called("report", "--protocol", "paper", "--data", smoke, "--log", flown, "--json")
    assert shown.returncode == 0, shown.stderr
    rows = [row for row in json.loads(shown.stdout) if (row["profile"], row["modality"]) == ("aerialdojo", "all")]
    # The run that flew none of it is left out.
    assert {row["run"] for row in rows} == {"constant", "stop"}
    for run in ("constant", "stop"):
        base = {row["name"]: row for row in rows if row["run"] == run and row["setting"] == "base"}
        assert base["overall"]["episodes"] == 100
        maps = [base[f"U_Courtyard_{k}"]["dts_m"] for k in (0, 1)]
        assert base["overall"]["dts_m_sd"] == pytest.approx(statistics.stdev(maps))


def test_the_tables_say_what_was_flown_of_the_sample(smoke, flown):
    shown = called("report", "constant", "--protocol", "paper", "--data", smoke, "--log", flown)
    words = " ".join(shown.stdout.split())
    assert "protocol alone, on U_Courtyard_0, U_Courtyard_1; ± is the sample standard deviation over these" in words
    assert "of the sample's" not in shown.stdout
    refused = called("report", "random", "--protocol", "paper", "--data", smoke, "--log", flown)
    assert refused.returncode == 1
    assert "run 'random' has no finished episode of the paper's sample: run aerialdojo-gen eval" in refused.stderr


def test_a_release_without_its_file_and_a_run_of_part_of_it(smoke, flown, tmp_path):
    shutil.copytree(smoke / "release", tmp_path / "release")
    (tmp_path / "release" / "protocol.json").unlink()
    part = ("--setting", "base", "--limit", 6, "--data", smoke, "--out", tmp_path, "--workers", 1)
    assert called("evaluate", "--agent", "stop", "--protocol", "paper", *part).returncode == 0
    shown = called("report", "--protocol", "paper", "--data", tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert "stop: 6 of the sample's 100 tasks." in " ".join(shown.stdout.split())


@pytest.fixture(scope="module")
def log(smoke, tmp_path_factory):
    out = tmp_path_factory.mktemp("log")
    for agent in ("oracle", "random"):
        evaluate(smoke, Evaluation(agent, agent, selection=Selection(limit=4)), out=out)
    return out


@pytest.fixture(scope="module")
def runs(log):
    return load_runs(log, ["oracle", "random"])


@pytest.fixture(scope="module")
def shown(smoke, log, runs):
    return list(replays(smoke, log, runs, choose_tasks(runs, 2), frames=True))


def test_the_metrics_judge_a_log_as_the_runner_did(runs):
    for run in runs:
        judged = outcomes(run.episodes, AT_3)
        assert judged.sr.tolist() == run.table["success"].to_pylist()
        assert judged.osr.tolist() == run.table["oracle_success"].to_pylist()
    summary = summarize(runs[0].episodes, AT_3).overall
    assert (summary.sr, summary.osr, summary.cr) == (1.0, 1.0, 0.0)
    assert summary.spl >= 0.99


def test_tasks_are_chosen_where_flights_ended_differently(runs):
    chosen = choose_tasks(runs, 3)
    assert chosen == choose_tasks(runs, 3)
    assert len(set(chosen)) == 3
    assert choose_tasks(runs, 2) == chosen[:2]
    assert sorted(choose_tasks(runs, 50)) == sorted(runs[0].table["task_id"].to_pylist())
    assert choose_tasks(runs, 0) == []


def test_a_replay_is_what_was_flown_on_the_route_that_was_to_be_found(smoke, log, runs, shown, tmp_path):
    for replay in shown:
        scene, nav_id = replay.task["scene"], replay.task["nav_id"]
        routes = [row for s in ("train", "test") for row in store.read_scene(smoke, f"routes/{s}", scene).to_pylist()]
        (route,) = (row for row in routes if row["nav_id"] == nav_id)
        assert replay.reference["x_m"] == route["x_m"]
        oracle, _ = replay.flights
        assert [flight.label for flight in replay.flights] == ["oracle", "random"]
        # The oracle leaves Approach out: its poses are the route's, its last words are Stop.
        n = len(oracle.said) - 1
        assert np.allclose(oracle.x_m[:n], route["x_m"][:n], atol=1e-3)
        assert oracle.said[1:] == [ACTION_NAMES[a] for a in route["action"] if ACTION_NAMES[a] != "Approach"]
        assert oracle.outcome.startswith("success: stopped ")
        goal = [route[f"goal_{a}_m"] for a in "xyz"]
        for flight, run in zip(replay.flights, runs, strict=True):
            steps = read_run(log, run.name, "steps")
            rows = steps.filter(pc.equal(steps["task_id"], replay.task["task_id"]))
            assert np.allclose(flight.y_m[1:], rows["y_m"].to_numpy(), atol=1e-3)
            places = np.column_stack([flight.x_m, flight.y_m, flight.z_m])
            assert np.linalg.norm(places - goal, axis=1) == pytest.approx(flight.distance_m, abs=0.01)
            assert ((replay.low_m < places[:, :2]) & (places[:, :2] < replay.high_m)).all()
            assert 0 in flight.frames
            assert set(flight.frames) <= set(range(len(flight.said)))
    jpeg = base64.b64decode(shown[0].map_url.split(",")[1])
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (640, 640, 3)
    assert picture.std() > 10
    with pytest.raises(AerialDojoError, match="no release in"):
        list(replays(tmp_path, log, runs, choose_tasks(runs, 1)))


MOVE = "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))"


def test_the_page_works_in_a_browser_and_asks_for_nothing(smoke, runs, shown, tmp_path, browser):
    shown[0].task["target_name"] = "</h3><script>alert(1)</script>"
    shown[0].flights[1].answers[1] = '</script><img src=x onerror="document.title=1">'
    wanted = ReportRequest(smoke, runs, [AT_3])
    curve = encode_figure(radius_curve(runs, AT_3), "svg")
    figures = dict.fromkeys(("families", "radar", "radius"), curve)
    text = html(wanted, shown, figures, named_tables(wanted, ["overall"]))
    page = tmp_path / "report.html"
    page.write_text(text)
    assert text.count("</script>") == 1 + len(shown)
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    browser.get(page.as_uri())
    assert errors(browser) == []
    asked = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in asked if m["method"] == "Network.requestWillBeSent"]
    # The browser's own pages are its own affair.
    assert [u for u in urls if not u.startswith(("data:", "chrome"))] == [page.as_uri()]

    articles = browser.find_elements("css selector", ".replay")
    assert len(articles) == len(shown)
    assert articles[0].find_element("css selector", "h3").text.startswith("</h3><script>alert(1)</script>")
    for article, replay in zip(articles, shown, strict=True):
        readouts = article.find_elements("css selector", ".readout")
        drones = article.find_elements("css selector", ".drone")
        slider = article.find_element("css selector", "input")
        assert int(slider.get_attribute("max")) == max(len(f.said) for f in replay.flights) - 1
        assert readouts[0].text.startswith("start; ")
        for step in (int(slider.get_attribute("max")), 1):
            browser.execute_script(MOVE, slider, step)
            for flight, readout, drone in zip(replay.flights, readouts, drones, strict=True):
                k = min(step, len(flight.said) - 1)
                assert flight.said[k] in readout.text
                assert ("ended" in readout.text) == (step > k)
                assert f"{flight.distance_m[k]:.1f} m to the goal" in readout.text
                moved = re.match(r"translate\((\S+) (\S+)\)", drone.get_attribute("transform"))
                assert (float(moved[1]), -float(moved[2])) == (flight.x_m[k], flight.y_m[k])
    assert "onerror" in articles[0].find_elements("css selector", ".readout")[1].text
    assert browser.title.startswith("Evaluation")
    # The figures and the maps are pictures that the browser could read.
    sizes = browser.execute_script("return [...document.images].map(i => i.naturalWidth)")
    assert len(sizes) >= 3 + len(shown)
    assert min(sizes) > 0
    assert errors(browser) == []
