"""The page of an evaluation: replays of real flights, in a real browser."""

from __future__ import annotations

import base64
import json
import math
import re
from pathlib import Path

import cv2
import numpy as np
import pyarrow.compute as pc
import pytest
from support.browser import chromium, errors

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.metrics import PROFILES, outcomes, summarize
from aerialdojo_gen.benchmark.replay import Replay, choose_tasks, replays
from aerialdojo_gen.benchmark.report import write_report
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import Run, load_runs
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import ACTION_NAMES


@pytest.fixture(scope="module")
def log(smoke: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("log")
    for agent in ("oracle", "random"):
        evaluate(smoke, Evaluation(agent, agent, selection=Selection(limit=4)), out=out)
    return out


@pytest.fixture(scope="module")
def runs(log: Path) -> list[Run]:
    return load_runs(log, ["oracle", "random"])


@pytest.fixture(scope="module")
def shown(smoke: Path, log: Path, runs: list[Run]) -> list[Replay]:
    return list(replays(smoke, log, runs, choose_tasks(runs, 2), frames=True))


def test_the_metrics_judge_a_log_as_the_runner_did(runs: list[Run]) -> None:
    for run in runs:
        judged = outcomes(run.episodes, PROFILES["aerialdojo"])
        assert judged.success.tolist() == run.table["success"].to_pylist()
        assert judged.oracle_success.tolist() == run.table["oracle_success"].to_pylist()
    summary = summarize(runs[0].episodes, PROFILES["aerialdojo"]).overall
    assert (summary.sr, summary.osr, summary.cr) == (1.0, 1.0, 0.0)
    assert summary.spl >= 0.99


def test_tasks_are_chosen_where_flights_ended_differently(runs: list[Run]) -> None:
    chosen = choose_tasks(runs, 3)
    assert chosen == choose_tasks(runs, 3)
    assert len(set(chosen)) == 3
    assert choose_tasks(runs, 2) == chosen[:2]
    assert sorted(choose_tasks(runs, 50)) == sorted(runs[0].table["task_id"].to_pylist())
    assert choose_tasks(runs, 0) == []


def test_a_replay_is_what_was_flown_on_the_route_that_was_to_be_found(
    smoke: Path, log: Path, runs: list[Run], shown: list[Replay]
) -> None:
    for replay in shown:
        scene, nav_id = replay.task["scene"], replay.task["nav_id"]
        routes = [store.read_scene(smoke, f"routes/{side}", scene).to_pylist() for side in ("train", "test")]
        (route,) = (row for row in (*routes[0], *routes[1]) if row["nav_id"] == nav_id)
        assert replay.reference["x_m"] == route["x_m"]
        oracle, random = replay.flights
        assert [oracle.label, random.label] == ["oracle", "random"]
        # The oracle leaves Approach out: its poses are the route's, its last words are Stop.
        n = len(oracle.said) - 1
        assert np.allclose(oracle.x_m[:n], route["x_m"][:n], atol=1e-3)
        assert oracle.said[1:] == [ACTION_NAMES[a] for a in route["action"] if ACTION_NAMES[a] != "Approach"]
        assert oracle.outcome.startswith("success: stopped ")
        for flight, run in zip(replay.flights, runs, strict=True):
            steps = read_run(log, run.name, "steps")
            rows = steps.filter(pc.equal(steps["task_id"], replay.task["task_id"])).to_pylist()
            assert np.allclose(flight.y_m[1:], [row["y_m"] for row in rows], atol=1e-3)
            goal = [route[f"goal_{a}_m"] for a in "xyz"]
            for k in range(len(flight.said)):
                place = (flight.x_m[k], flight.y_m[k], flight.z_m[k])
                assert math.dist(place, goal) == pytest.approx(flight.distance_m[k], abs=0.01)
            low, high = replay.low_m, replay.high_m
            assert all(low[0] < x < high[0] for x in flight.x_m)
            assert all(low[1] < y < high[1] for y in flight.y_m)
            assert set(flight.frames) <= set(range(len(flight.said)))
            assert 0 in flight.frames


def test_the_map_shows_the_scene_north_up(shown: list[Replay]) -> None:
    picture = cv2.imdecode(
        np.frombuffer(base64.b64decode(shown[0].map_url.split(",")[1]), np.uint8), cv2.IMREAD_COLOR
    )
    assert picture.shape == (640, 640, 3)
    assert picture.std() > 10


def test_a_release_that_is_not_the_runs_own_is_refused(log: Path, runs: list[Run], tmp_path: Path) -> None:
    with pytest.raises(AerialDojoError, match="no release in"):
        list(replays(tmp_path, log, runs, choose_tasks(runs, 1)))


@pytest.mark.browser
def test_the_page_works_in_a_browser_and_asks_for_nothing(
    smoke: Path, runs: list[Run], shown: list[Replay], tmp_path: Path
) -> None:
    shown[0].task["target_name"] = "</h3><script>alert(1)</script>"
    shown[0].flights[1].answers[1] = '</script><img src=x onerror="document.title=1">'
    wanted = ReportRequest(smoke, runs, [PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]])
    page = write_report(tmp_path, wanted, shown)[0]
    text = page.read_text()
    assert text.count("</script>") == 1 + len(shown)
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    with chromium("the report page") as driver:
        driver.get(page.as_uri())
        assert errors(driver) == []
        asked = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
        urls = [m["params"]["request"]["url"] for m in asked if m["method"] == "Network.requestWillBeSent"]
        # The browser's own pages are its own affair.
        assert [u for u in urls if not u.startswith(("data:", "chrome"))] == [page.as_uri()]

        articles = driver.find_elements("css selector", ".replay")
        assert len(articles) == len(shown)
        assert articles[0].find_element("css selector", "h3").text.startswith("</h3><script>alert(1)</script>")
        for article, replay in zip(articles, shown, strict=True):
            readouts = article.find_elements("css selector", ".readout")
            drones = article.find_elements("css selector", ".drone")
            slider = article.find_element("css selector", "input")
            assert int(slider.get_attribute("max")) == max(len(f.said) for f in replay.flights) - 1
            assert readouts[0].text.startswith("start; ")
            for step in (1, int(slider.get_attribute("max"))):
                driver.execute_script(
                    "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))", slider, step
                )
                for flight, readout, drone in zip(replay.flights, readouts, drones, strict=True):
                    k = min(step, len(flight.said) - 1)
                    assert flight.said[k] in readout.text
                    assert ("ended" in readout.text) == (step > k)
                    assert f"{flight.distance_m[k]:.1f} m to the goal" in readout.text
                    moved = re.match(r"translate\((\S+) (\S+)\)", drone.get_attribute("transform"))
                    assert (float(moved[1]), -float(moved[2])) == (flight.x_m[k], flight.y_m[k])
        driver.execute_script("document.querySelector('.replay input').value = 1")
        driver.execute_script("document.querySelector('.replay input').dispatchEvent(new Event('input'))")
        assert "onerror" in articles[0].find_elements("css selector", ".readout")[1].text
        assert driver.title.startswith("Evaluation")
        # The figures and the maps are pictures that the browser could read.
        sizes = driver.execute_script("return [...document.images].map(i => i.naturalWidth)")
        assert len(sizes) >= 3 + len(shown)
        assert min(sizes) > 0
        assert errors(driver) == []
