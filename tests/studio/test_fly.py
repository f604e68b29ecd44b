"""`fly`: a person is an agent of the evaluator's own loop, and the page does what its keys say."""

import io
import re
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image
from starlette.testclient import TestClient
from support.browser import errors, until
from support.command_line import called
from support.pages import serving

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents import Sensors
from aerialdojo_gen.benchmark.episodes import read_run, runs
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection, reference_actions, select
from aerialdojo_gen.exchange.learning_export import export_for_learning
from aerialdojo_gen.exchange.samples import ExportOptions
from aerialdojo_gen.learning import Trajectories
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.studio.fly.server import fly_app
from aerialdojo_gen.studio.fly.session import Session, agent_name

TWO = Selection(modalities=("semantic",), limit=2)
TOLD = ("target_name", "landmark", "direction", "description")
OWN = ["run_id", "agent", "agent_options"]
STOP, UP_2, DOWN_1, DOWN_2 = 0, 11, 12, 13


def evaluation(selection=TWO, **changes):
    sensors = Sensors(width=64, height=48)
    return Evaluation("human-ann", agent_name("ann"), selection=selection, sensors=sensors, **changes)


@contextmanager
def flying(data, out, selection=TWO):
    """Run a session with its page's app; gives a client and what the page shows first."""
    session = Session(data, evaluation(selection), out)
    with session.running():
        client = TestClient(fly_app(session), base_url="http://127.0.0.1")
        yield client, until("the loop waits", lambda: waits(client.get("/api/state").json()))
    assert session.error is None


def waits(state):
    return state if state["phase"] != "busy" else None


def post(client, what, state, **more):
    answer = client.post(f"/api/{what}", json={"version": state["version"], **more})
    assert answer.status_code == 200, answer.text
    state = answer.json()
    return state if waits(state) else until("the loop waits", lambda: waits(client.get("/api/state").json()))


def reference(data, rows, state):
    """The task that is shown, and its reference's actions."""
    (row,) = [row for row in rows if all(row[name] == state["goal"][name] for name in TOLD)]
    routes = reference_actions(open_root(data), row["scene"], (row["subset"],), "agent_action")
    return row["task_id"], routes[row["nav_id"]]


def fly(client, state, actions):
    for action in actions:
        assert state["phase"] == "flying"
        state = post(client, "act", state, action=action)
    return state


def test_flights_are_logged_as_the_oracles_are_and_no_task_is_offered_twice(smoke, tmp_path):
    rows = select(smoke, TWO).to_pylist()
    with flying(smoke, tmp_path) as (client, state):
        assert (state["phase"], state["selected"], state["flown"]) == ("consent", 2, 0)
        state = post(client, "agree", state)
        first, actions = reference(smoke, rows, state)
        assert state["remaining_actions"] == state["goal"]["action_budget"] > len(actions)
        state = fly(client, state, actions)
        assert (state["phase"], state["flown"], state["successes"]) == ("ended", 1, 1)
        assert (state["result"]["termination"], state["result"]["success"]) == ("stop", True)
        state = post(client, "next", state)
        second, actions = reference(smoke, rows, state)
        fly(client, state, actions[:3])
    assert read_run(tmp_path, "human-ann")["task_id"].to_pylist() == [first]
    with flying(smoke, tmp_path) as (client, state):
        state = post(client, "agree", state)
        assert (reference(smoke, rows, state), state["step"]) == ((second, actions), 0)
        state = fly(client, state, actions)
        assert (state["phase"], state["flown"], state["successes"]) == ("done", 2, 2)
    with flying(smoke, tmp_path) as (_, state):
        assert (state["phase"], state["flown"]) == ("done", 2)
    evaluate(smoke, Evaluation("o", "oracle", {"actions": "agent_action"}, TWO), out=tmp_path)
    for table in ("episodes", "steps"):
        own, oracles = (read_run(tmp_path, run, table).to_pandas() for run in ("human-ann", "o"))
        kept = [name for name in own.columns if name not in OWN]
        assert own[kept].equals(oracles[kept])
    assert set(read_run(tmp_path, "human-ann")["agent"].to_pylist()) == {"human:ann"}
    assert (read_run(tmp_path, "human-ann", "timings").to_pandas().agent_s > 0).all()


def test_what_is_refused_and_how_deep_it_is(smoke, tmp_path):
    one = Selection(scenes=("U_Courtyard_1",), modalities=("semantic",), limit=1)
    with flying(smoke, tmp_path, one) as (client, state):

        def depth(view, x, y):
            return client.get(f"/api/depth/{view}/at?x={x}&y={y}").json()["depth_m"]

        state = fly(client, post(client, "agree", state), [UP_2])
        before = depth("down", 0.5, 0.5)
        state = fly(client, state, [DOWN_1])
        assert depth("down", 0.5, 0.5) == pytest.approx(before - 1, abs=0.011)
        for kind in ("pictures", "depth"):
            picture = Image.open(io.BytesIO(client.get(f"/api/{kind}/front").content))
            assert (picture.format, picture.size) == ("JPEG", (64, 48))
            assert np.ptp(np.asarray(picture)) > 50
        n = state["remaining_actions"]
        while not state["refused"]:
            state = fly(client, state, [UP_2])
            n -= 1
            assert (state["remaining_actions"], state["last"]) == (n, UP_2)
        # The sky is out of range, the ground is not: x runs along the picture's width.
        assert depth("front", 0.99, 0.01) is None
        assert 0 < depth("front", 0.99, 0.99) < 40
        state = fly(client, state, [STOP])
        assert (state["result"]["termination"], state["result"]["success"]) == ("stop", False)
    (missed,) = read_run(tmp_path, "human-ann").to_pylist()
    assert (missed["termination"], missed["n_refused"], missed["stop_called"]) == ("stop", 1, True)


def test_only_the_shown_states_own_answer_counts_of_one_page_one_pilot_and_one_selection(smoke, tmp_path):
    with flying(smoke, tmp_path) as (client, consent):
        assert client.get("/api/pictures/front").status_code == 404
        assert client.post("/api/act", json={"version": consent["version"], "action": 1}).status_code == 409
        state = post(client, "agree", consent)
        version = state["version"]
        late = {"version": version - 1, "action": 0}
        for what, body in (("act", late), ("agree", {"version": consent["version"]}), ("next", {"version": version})):
            answer = client.post(f"/api/{what}", json=body)
            assert (answer.status_code, answer.json()["state"]) == (409, state)
        assert client.post("/api/act", json={"version": version, "action": 16}).status_code == 422
        foreign = {"Origin": "http://example.org"}
        assert client.post("/api/act", json={"version": version, "action": 0}, headers=foreign).status_code == 403
        assert client.get("/api/depth/front/at?x=1&y=0").status_code == 422
        assert client.get("/api/depth/behind/at?x=0&y=0").status_code == 404
        assert client.get("/api/pictures/goal").status_code == 404
        assert client.get("/api/state").json() == state
        with pytest.raises(StoreError, match="another run is writing"), flying(smoke, tmp_path):
            pass
        fly(client, state, [STOP])
    with pytest.raises(UsageError, match="was begun with limit = 2, not 3"):
        flying(smoke, tmp_path, Selection(modalities=("semantic",), limit=3)).__enter__()
    with Session(smoke, evaluation(), tmp_path).running(restart=True):
        assert runs(tmp_path) == []
    for name in ("Ann", "a b", "../x", "", "ä", "a" * 41, "-a"):
        with pytest.raises(UsageError, match="small letters"):
            agent_name(name)


def test_successful_flights_are_demonstrations(planted, tmp_path):
    data, one = planted.data, Selection(scenes=("U_Courtyard_1",), modalities=("semantic",), limit=2)
    rows = select(data, one).to_pylist()
    with flying(data, data, one) as (client, state):
        state = post(client, "agree", state)
        shown, actions = reference(data, rows, state)
        ups = 0
        while not state["refused"]:
            state = fly(client, state, [UP_2])
            ups += not state["refused"]
        way = [*[UP_2] * ups, *[DOWN_2] * ups, *actions]
        state = fly(client, state, way[ups:])
        assert state["result"]["success"]
        state = fly(client, post(client, "next", state), [STOP])
        assert not state["result"]["success"]
    (row,) = [row for row in rows if row["task_id"] == shown]
    own = Trajectories(
        data, split=row["split"], run="human-ann", past=None, privileged="pose", views=("down",), size=16
    )
    (sample,) = own
    assert sample["nav_id"] == row["nav_id"]
    assert sample["action"].tolist() == way
    steps = read_run(data, "human-ann", "steps").to_pandas()
    steps = steps[(steps.task_id == shown) & ~steps.refused]
    flown = steps[["x_m", "y_m", "z_m", "yaw_rad"]].to_numpy()
    np.testing.assert_allclose(sample["pose"][1:], flown[:-1], atol=1e-9)
    with pytest.raises(UsageError, match="recordings are of the references"):
        Trajectories(data, split=row["split"], run="human-ann", source="recordings")
    with pytest.raises(UsageError, match="no task of the selection has a successful flight in human-ann"):
        Trajectories(data, split="id_train", run="human-ann")
    options = ExportOptions((row["split"],), sensors=Sensors(("front",), width=16, height=16), runs=("human-ann",))
    made = export_for_learning("webdataset", data, tmp_path / "out", options, workers=1)
    assert (made.parts, made.counts["samples"]) == (1, len(way))


def test_a_person_flies_to_the_goal_by_keys_and_report_has_the_rate(browser, smoke, tmp_path):
    one = Selection(modalities=("image",), limit=1, seed=7)  # 13 actions, of 6 kinds
    (row,) = select(smoke, one).to_pylist()
    routes = reference_actions(open_root(smoke), row["scene"], (row["subset"],), "agent_action")
    of = ("--data", smoke, "--modality", "image", "--limit", 1, "--seed", 7)
    with serving("fly", "--name", "pilot-1", "--out", tmp_path, *of) as page:
        follow(browser, page.url, row, routes[row["nav_id"]])
    assert "1 flown, success rate 100.0%" in page.out
    told = called("report", "human-pilot-1", "--log", tmp_path, "--data", smoke)
    assert re.search(r"human:pilot-1 .*100\.0", told.stdout), told


def follow(driver, url, row, actions):
    """Agree, look at the depth, and press the keys of a reference."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    keys = [Keys.ENTER, *"xswzaqcde", "f", "r", "g", "t", Keys.ARROW_LEFT, Keys.ARROW_RIGHT]

    def shown(name):
        return driver.execute_script(f"return document.body.dataset.{name}")

    def text(name):
        return driver.find_element("id", name).text

    driver.get(url)
    until("the person is asked", lambda: shown("phase") == "consent")
    assert "as human:pilot-1" in text("dialog-text")
    ActionChains(driver).send_keys(Keys.ENTER).perform()
    until("the flight begins", lambda: shown("phase") == "flying")
    assert row["target_name"] in text("target")
    width = "return document.getElementById('goal-image').naturalWidth"
    until("the goal's picture is there", lambda: driver.execute_script(width) > 0)
    ActionChains(driver).send_keys("v").perform()
    assert driver.find_element("id", "depth").get_attribute("aria-pressed") == "true"
    driver.find_element("id", "down-view").click()
    until("the distance is told", lambda: re.search(r"down: [\d.]+ m deep", text("reading")))
    for done, action in enumerate(actions):
        assert text("left") == f"{row['action_budget'] - done} of {row['action_budget']} actions left"
        version = shown("version")
        ActionChains(driver).send_keys(keys[action]).perform()
        until("the action is done", lambda before=version: shown("version") != before)
    assert shown("phase") == "done"
    assert text("dialog-title") == "Success"
    assert errors(driver) == []
