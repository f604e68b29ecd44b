"""Agents: those that do what they may not are named, or logged and flown on; what they are handed reveals nothing."""

import gc
import sys
import types
from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import numpy as np
import pytest
from support.command_line import called

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.secrets import Secrets as Redactor
from aerialdojo_gen.benchmark import AerialDojoEnv
from aerialdojo_gen.benchmark.agents import AgentBase, InvalidAnswer, load_agent
from aerialdojo_gen.benchmark.agents.goal import BLIND, Sensors
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.evaluation import Limits
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection, read_tasks, select
from aerialdojo_gen.benchmark.worker import AgentError, RetryPolicy, Worker, WorkUnit
from aerialdojo_gen.scenes.context import open_contexts
from aerialdojo_gen.store import shards as store

HERE, FILE = __name__, Path(__file__).stem


class Unsure:
    """A number that raises when it is asked for."""

    def __index__(self):
        raise RuntimeError("ask later")

    def __repr__(self):
        return "an unsure number"


WRONG = {"float": 2.5, "none": None, "far": 16, "true": True, "array": np.array([3, 4]), "index": Unsure()}


class Faulty(AgentBase):
    """Fails as it is told, in every `every`-th episode of an instance."""

    sensors = BLIND

    def __init__(self, how, every=1):
        if how == "init":
            raise RuntimeError("two\nlines")
        self._how, self._every, self._n = how, every, 0

    def reset(self, goal):
        self._n += 1
        self._fault = "" if self._n % self._every else self._how
        if self._fault == "reset":
            {}["map"]
        if self._fault == "exit":
            sys.exit("no more")
        if self._fault == "invalid":
            raise InvalidAnswer("nothing to answer yet")

    def act(self, observation):
        if self._fault == "act":
            raise OSError("disk\nof mine")
        return WRONG.get(self._fault, 0)

    def usage(self):
        return 7 if self._how == "usage" else None

    def answer(self):
        return {"half": "\ud800", "number": 5}.get(self._how)


class Breaking(AgentBase):
    """Takes the renderer's context away in its second episode, once."""

    sensors = Sensors(("front",), depth=False, width=32, height=32)
    begun = 0

    def reset(self, goal):
        self.begun += 1

    def act(self, observation):
        if self.begun == 2:
            open_contexts()[-1]._parts["renderer"][1].close()
        return 0 if observation.step else 14


def job(how, limit=3, tolerate=False, every=1):
    options, policy = {"how": how, "every": every}, RetryPolicy(2, 0.0, tolerate)
    return Evaluation("r", f"{HERE}:Faulty", options, Selection(limit=limit), retry_policy=policy)


SAID = {
    "reset": rf"KeyError at {FILE}\.py:\d+: 'map' \(in reset\); --tolerate logs",
    "exit": rf"SystemExit at {FILE}\.py:\d+: no more \(in reset\)",
    "invalid": r"raised InvalidAnswer in reset.*nothing to answer yet",
    "act": rf"OSError at {FILE}\.py:\d+: disk \(in act\)",
    "float": r"returned 2\.5 \(float\) from act, where an action is expected: a whole number from 0 \(Stop\) to 15;",
    "none": r"returned None \(NoneType\) from act",
    "far": r"returned 16 \(int\) from act",
    "true": r"returned True \(bool\) from act",
    "array": r"returned array\(\[3, 4\]\) \(ndarray\) from act",
    "index": r"returned an unsure number \(Unsure\) from act",
    "usage": r"returned 7 \(int\) from usage, where Usage or None is expected",
}


@pytest.mark.parametrize("how", SAID)
def test_a_faulty_agent_is_named_at_the_first_fault(smoke, tmp_path, how):
    before = 0 if how == "usage" else 1
    with pytest.raises(AgentError, match=rf"agent {HERE}:Faulty failed at task U_\S+: {SAID[how]}") as told:
        evaluate(smoke, job(how, every=1 + before), out=tmp_path)
    assert "\n" not in str(told.value)
    sent = ForkingPickler.loads(ForkingPickler.dumps(told.value))
    assert (type(sent), str(sent), sent.traceback) == (AgentError, str(told.value), told.value.traceback)
    assert bool(sent.traceback) == (how in ("reset", "exit", "act")), "of what the agent raised"
    # What was flown before it stays.
    assert not before or read_run(tmp_path, "r").num_rows == before


def test_what_is_tolerated_is_logged(smoke, tmp_path):
    outcome = evaluate(smoke, job("reset", 6, tolerate=True, every=2), out=tmp_path)
    assert (outcome.finished, outcome.failed, outcome.all_failed) == (3, 3, False)
    failures = read_run(tmp_path, "r", "failures")
    assert failures["kind"].to_pylist() == ["agent error"] * 3
    assert failures["attempts"].to_pylist() == [1] * 3, "a defect does not go away by trying again"
    assert "'map'" in outcome.failure_message()
    evaluate(smoke, job("none", 2, tolerate=True), out=tmp_path / "b")
    rows = read_run(tmp_path / "b", "r")
    assert rows["n_invalid"].to_pylist() == rows["action_budget"].to_pylist()
    outcome = evaluate(smoke, job("act", 6, tolerate=True), out=tmp_path / "c", limits=Limits(failures_in_row=2))
    assert (outcome.finished, outcome.failed, outcome.all_failed) == (0, 2, True)
    assert "stopped after 2 failures in a row of one kind (agent error)" in outcome.failure_message()


@pytest.mark.parametrize(("how", "logged"), [("half", "?"), ("number", None)])
def test_what_an_agent_says_never_breaks_the_log(smoke, tmp_path, how, logged):
    evaluate(smoke, job(how, 1), out=tmp_path)
    assert read_run(tmp_path, "r", "steps")["answer"].to_pylist() == [logged]


def test_an_agent_that_cannot_be_made_is_one_line(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match=rf"cannot be made: RuntimeError at {FILE}\.py:\d+: two$"):
        load_agent(f"{HERE}:Faulty", how="init")
    (tmp_path / "sick_module.py").write_text("import math\nmath.nothing\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UsageError, match=r"cannot load agent .*AttributeError at sick_module\.py:2"):
        load_agent("sick_module:Agent")


@pytest.mark.parametrize(("attempts", "failures"), [(1, [("renderer", 1)]), (3, [])])
def test_a_renderer_that_fails_is_opened_anew_or_logged(smoke, tmp_path, attempts, failures):
    chosen, policy = Selection(limit=4, scenes=("U_Courtyard_0",)), RetryPolicy(attempts, 0.0)
    outcome = evaluate(smoke, Evaluation("r", f"{HERE}:Breaking", {}, chosen, retry_policy=policy), out=tmp_path)
    assert (outcome.finished, outcome.failed) == (4 - len(failures), len(failures))
    logged = read_run(tmp_path, "r", "failures").to_pylist()
    assert [(row["kind"], row["attempts"]) for row in logged] == failures
    assert all(row["reason"].startswith("the renderer failed: ") for row in logged)


OWN_CODE = """
import json

class Agent:
    def __init__(self, how="act"):
        self.how = how
        if how == "init":
            json.loads("broken in init")

    def reset(self, goal):
        pass

    def act(self, observation):
        return self.think()

    def think(self):
        return json.loads("broken in act")
"""


# Over a process's border, too: by night, as two workers import everything; by day errors are sent and come back.
@pytest.mark.parametrize(
    ("how", "line", "workers", "asked"),
    [pytest.param("act", 17, 2, True, marks=pytest.mark.nightly), ("act", 17, 1, True), ("act", 17, 1, False),
     ("init", 8, 1, True)],
)  # fmt: skip
def test_an_agents_own_file_is_named_and_its_traceback_shown_on_demand(
    smoke, tmp_path, monkeypatch, how, line, workers, asked
):
    (tmp_path / "own_agent.py").write_text(OWN_CODE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_agent", raising=False)
    agent = ("--agent", "own_agent:Agent", "--option", f"how={how}", "--limit", "2", "--workers", workers)
    done = called("evaluate", "--data", smoke, "--out", tmp_path, *agent, *["--traceback"] * asked)
    assert done.returncode == (1 if how == "act" else 2)
    # The library's line helps nobody: the place is in the agent's file.
    said = f"JSONDecodeError at own_agent.py:{line}: Expecting value" if how == "act" else "Expecting value"
    assert said in done.stderr.splitlines()[-1]
    assert done.stderr.count("Traceback") == asked
    if asked:
        trace = done.stderr[done.stderr.index("Traceback") :].splitlines()[:-1]
        assert trace[1].startswith(f'  File "{tmp_path}/own_agent.py", line '), "it begins with the agent"
        assert f'own_agent.py", line {line}, in ' in done.stderr
        assert trace[-1].startswith("json.decoder.JSONDecodeError: ")


SENSORS = Sensors(("front", "down"), width=24, height=16)
# What belongs to the program, not to what was handed out.
_PROGRAM = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.CodeType, types.FrameType)


def reachable(*roots):
    """Every object that the roots lead to: attributes, items, cells, bases of arrays; the program's own left out."""
    seen, queue = {}, list(roots)
    while queue:
        thing = queue.pop()
        if id(thing) in seen or (isinstance(thing, _PROGRAM) and not getattr(thing, "__closure__", None)):
            continue
        seen[id(thing)] = thing
        if isinstance(thing, types.FunctionType):
            queue += [cell.cell_contents for cell in thing.__closure__]
            continue
        if isinstance(thing, np.ndarray) and thing.base is not None:
            queue.append(thing.base)
        queue += gc.get_referents(thing)
    return list(seen.values())


class Secrets:
    """What only the evaluator may know of a task."""

    def __init__(self, data, task):
        row = task.row
        routes, objects = (
            store.read_scene(data, table, row["scene"]).to_pylist()
            for table in (f"routes/{row['subset']}", "release/objects")
        )
        route = next(r for r in routes if r["nav_id"] == row["nav_id"])
        target = next(o for o in objects if o["object_id"] == route["target_object_id"])
        goal = np.array([route["goal_x_m"], route["goal_y_m"], route["goal_z_m"]])
        path = np.array([route["x_m"], route["y_m"], route["z_m"]]).T
        known = np.concatenate([
            goal, path.ravel(), np.linalg.norm(path - goal, axis=1), route["yaw_rad"], [route["goal_yaw_rad"]],
            [route["euclidean_m"], route["length_m"], route["detour_ratio"], route["min_clearance_m"]],
            [target[k] for k in ("x_m", "y_m", "z_m", "size_x_m", "size_y_m", "size_z_m")],
        ])  # fmt: skip
        # Round numbers (0 m, 1 m, a right angle) tell nothing, and stand everywhere.
        self.numbers = known[np.abs(known * 1000 - np.rint(known * 1000)) > 1e-6]
        self.words = [
            row["task_id"], row["nav_id"], row["scene"], target["mesh_node"], target["reference_image_id"], str(data),
            "/meshes", ".glb", ".parquet",
        ]  # fmt: skip

    def found(self, *roots):
        """What of it the roots lead to; depth, which is float32, is seen."""
        hits = []
        for thing in reachable(*roots):
            if isinstance(thing, str | bytes):
                text = thing if isinstance(thing, str) else thing.decode("latin-1")
                hits += [word for word in self.words if word in text]
            elif isinstance(thing, float) or (isinstance(thing, np.ndarray) and thing.dtype == np.float64):
                values = np.ravel(thing)
                hits += values[(np.abs(values[:, None] - self.numbers) < 1e-5).any(axis=1)].tolist()
        return hits


class Spy(AgentBase):
    """Keeps all that it is handed."""

    sensors = SENSORS

    def __init__(self):
        self.handed = []

    def reset(self, goal):
        self.handed.append(goal)

    def act(self, observation):
        self.handed.append(observation)
        return [1, 14, 10, 4, 0][min(observation.step, 4)]


def tasks_of(data, modality, n=2):
    return read_tasks(data, select(data, Selection(modalities=(modality,), limit=n)))


@pytest.mark.parametrize("modality", ["semantic", "image"])
def test_an_agent_gets_nothing_of_the_evaluators(smoke, tmp_path, modality):
    rows = select(smoke, Selection(modalities=(modality,), limit=1))
    task = read_tasks(smoke, rows)[0]
    spy = Spy()
    flight = Flight(smoke, SENSORS)
    Worker(spy, flight, smoke, Evaluation().identity(), RetryPolicy(1, 0.0), Redactor()).fly(
        WorkUnit(task.row["scene"], rows, tmp_path / "j.jsonl"), lambda _: None, lambda: False
    )
    assert len(spy.handed) >= 3
    secrets = Secrets(smoke, task)
    assert len(secrets.numbers) > 20
    assert secrets.found(spy) == []
    kinds = {type(thing).__name__ for thing in reachable(spy)}
    assert not kinds & {"Flight", "Episode", "FlightSpace", "Scene", "Task", "Instance", "CollisionWorld", "Table"}
    # The walk would have seen it: it does in what the evaluator keeps.
    kept = secrets.found(flight)
    assert any(isinstance(hit, float) for hit in kept)
    assert any(isinstance(hit, str) for hit in kept)


@pytest.mark.parametrize("hidden", ["attribute", "closure", "array", "slot", "text"])
def test_the_walk_finds_what_is_hidden(smoke, hidden):
    task = tasks_of(smoke, "semantic", 1)[0]
    secrets, spy = Secrets(smoke, task), Spy()
    x = task.goal[0] if abs(task.goal[0] * 1000 % 1) > 1e-3 else task.euclidean_m
    assert secrets.found(spy) == []

    class Slotted:
        __slots__ = ("x",)

    slotted = Slotted()
    slotted.x = x
    spy.handed = {
        "attribute": [types.SimpleNamespace(deep={"er": (x,)})],
        "closure": [lambda: x],
        "array": [np.array([[1.0, x]])[:, :1]],
        "slot": [slotted],
        "text": [b"id=" + task.row["nav_id"].encode()],
    }[hidden]
    assert secrets.found(spy), hidden


@pytest.mark.parametrize("modality", ["semantic", "image"])
def test_observations_and_infos_of_the_environment_hold_nothing_either(smoke, modality):
    env = AerialDojoEnv(smoke, sensors=SENSORS, modality=modality)
    for task in tasks_of(smoke, modality):
        secrets = Secrets(smoke, task)
        handed = [*env.reset(options={"task_id": task.row["task_id"]})]
        for action in (1, 15, 10, 3, 0):
            handed += [*env.step(action)]
            if handed[-1]["reason"]:
                break
        last, infos = handed.pop(), [info for info in handed if isinstance(info, dict) and "reason" in info]
        assert last["reason"], "the episode is over"
        assert len(infos) >= 2
        assert secrets.found(handed, env.action_space) == []
        assert all(info == {"reason": ""} for info in infos)
        assert set(last) == {"reason", "task_id", "success", "distance_m"}
