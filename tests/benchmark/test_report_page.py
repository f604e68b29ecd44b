"""The page of an evaluation: replays of real flights, in a real browser."""

import base64
import json
import re

import cv2
import numpy as np
import pyarrow.compute as pc
import pytest
from support.browser import errors

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.figures import encode_figure, radius_curve
from aerialdojo_gen.benchmark.metrics import PROFILES, outcomes, summarize
from aerialdojo_gen.benchmark.registry import named_tables
from aerialdojo_gen.benchmark.replay import choose_tasks, replays
from aerialdojo_gen.benchmark.report import html
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import ACTION_NAMES

AT_3 = PROFILES["aerialdojo"]


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
