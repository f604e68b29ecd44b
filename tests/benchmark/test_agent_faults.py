"""Agents and renderers that do what they may not: named at the first one, or logged and flown on."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.command_line import called

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.agents import AgentBase, InvalidAnswer, load_agent
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Observation, Sensors
from aerialdojo_gen.benchmark.episodes import read_run, runs
from aerialdojo_gen.benchmark.evaluation import Limits
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.benchmark.worker import AgentError, RetryPolicy
from aerialdojo_gen.scenes.context import open_contexts

HERE, FILE = __name__, Path(__file__).stem


class Unsure:
    """A number that raises when it is asked for."""

    def __index__(self) -> int:
        raise RuntimeError("ask later")

    def __repr__(self) -> str:
        return "an unsure number"


class Faulty(AgentBase):
    """Fails as it is told, in every `every`-th episode of an instance."""

    sensors = BLIND

    def __init__(self, how: str = "", every: int = 1, note: str = "") -> None:
        if how == "init":
            raise RuntimeError("two\nlines")
        self._how, self._every, self._n = how, every, -1
        self._mine = False

    def reset(self, goal: Goal) -> None:
        self._n += 1
        self._mine = self._n % self._every == self._every - 1
        if self._mine and self._how == "reset":
            {}["map"]
        if self._mine and self._how == "exit":
            sys.exit("no more")
        if self._mine and self._how == "invalid":
            raise InvalidAnswer("nothing to answer yet")

    def act(self, observation: Observation) -> Any:
        if self._mine and self._how == "act":
            raise OSError("disk\nof mine")
        given = {"float": 2.5, "none": None, "far": 16, "true": True, "array": np.array([3, 4]), "index": Unsure()}
        return given[self._how] if self._mine and self._how in given else 0

    def usage(self) -> Any:
        return 7 if self._how == "usage" else None

    def answer(self) -> Any:
        return "\ud800" if self._how == "half" else 5 if self._how == "number" else None


class Breaking(AgentBase):
    """Takes the renderer's context away in its second episode, once."""

    sensors = Sensors(("front",), depth=False, width=32, height=32)

    def __init__(self) -> None:
        self._n = 0

    def reset(self, goal: Goal) -> None:
        self._n += 1

    def act(self, observation: Observation) -> int:
        if self._n == 2:
            open_contexts()[-1]._parts["renderer"][1].close()
        return 0 if observation.step else 14


def job(how: str, limit: int = 3, tolerate: bool = False, attempts: int = 2, **options: Any) -> Evaluation:
    retry_policy = RetryPolicy(attempts, 0.0, tolerate)
    given = {"how": how} | options
    return Evaluation("r", f"{HERE}:Faulty", given, Selection(limit=limit), retry_policy=retry_policy)


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
def test_a_faulty_agent_is_named_at_the_first_fault(smoke: Path, tmp_path: Path, how: str) -> None:
    with pytest.raises(AgentError, match=rf"agent {HERE}:Faulty failed at task U_\S+: {SAID[how]}") as told:
        evaluate(smoke, job(how, every=2 if how != "usage" else 1), out=tmp_path)
    assert "\n" not in str(told.value)
    assert told.value.exit_code == 1
    # What was flown before it stays.
    if how != "usage":
        assert read_run(tmp_path, "r").num_rows == 1


def test_what_is_tolerated_is_logged(smoke: Path, tmp_path: Path) -> None:
    outcome = evaluate(smoke, job("reset", 6, tolerate=True, every=2), out=tmp_path)
    assert (outcome.finished, outcome.failed) == (3, 3)
    failures = read_run(tmp_path, "r", "failures")
    assert failures["kind"].to_pylist() == ["agent error"] * 3
    assert failures["attempts"].to_pylist() == [1] * 3, "a defect does not go away by trying again"
    assert "'map'" in outcome.failure_message()
    assert not outcome.all_failed
    outcome = evaluate(smoke, job("none", 2, tolerate=True), out=tmp_path / "b")
    rows = read_run(tmp_path / "b", "r")
    assert rows["n_invalid"].to_pylist() == rows["action_budget"].to_pylist()
    outcome = evaluate(smoke, job("act", 6, tolerate=True), out=tmp_path / "c", limits=Limits(failures_in_row=2))
    assert (outcome.finished, outcome.failed) == (0, 2)
    assert "stopped after 2 failures in a row of one kind (agent error)" in outcome.failure_message()
    assert outcome.all_failed


@pytest.mark.parametrize("how", ["half", "number"])
def test_what_an_agent_says_never_breaks_the_log(smoke: Path, tmp_path: Path, how: str) -> None:
    assert evaluate(smoke, job(how, 1), out=tmp_path).finished == 1
    assert read_run(tmp_path, "r", "steps")["answer"].to_pylist() == [{"half": "?", "number": None}[how]]


def test_keys_among_an_agents_options_are_not_logged(smoke: Path, tmp_path: Path) -> None:
    note = "https://me:hunter2@example.org/v1?api_key=abc123"
    assert evaluate(smoke, job("", 1, note=note), out=tmp_path).finished == 1
    logged = read_run(tmp_path, "r")["agent_options"][0].as_py() + (tmp_path / "runs/r/run.json").read_text()
    assert "hunter2" not in logged
    assert "abc123" not in logged
    assert "[redacted]@example.org" in logged


def test_an_agent_that_cannot_be_made_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=rf"cannot be made: RuntimeError at {FILE}\.py:\d+: two$"):
        load_agent(f"{HERE}:Faulty", how="init")
    (tmp_path / "sick_module.py").write_text("import math\nmath.nothing\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UsageError, match=r"cannot load agent .*AttributeError at sick_module\.py:2"):
        load_agent("sick_module:Agent")


def test_a_renderer_that_fails_is_opened_anew_or_logged(smoke: Path, tmp_path: Path) -> None:
    def run(attempts: int, out: Path) -> Any:
        retry_policy = RetryPolicy(attempts, 0.0)
        chosen = Selection(limit=4, scenes=("U_Courtyard_0",))
        return evaluate(smoke, Evaluation("r", f"{HERE}:Breaking", {}, chosen, retry_policy=retry_policy), out=out)

    outcome = run(1, tmp_path / "a")
    assert (outcome.finished, outcome.failed) == (3, 1)
    row = read_run(tmp_path / "a", "r", "failures").to_pylist()[0]
    assert (row["kind"], row["attempts"]) == ("renderer", 1)
    assert row["reason"].startswith("the renderer failed: ")
    outcome = run(3, tmp_path / "b")
    assert (outcome.finished, outcome.failed) == (4, 0)


def test_the_command_tells_a_faulty_agent_in_one_line(smoke: Path, tmp_path: Path) -> None:
    agent = ("--agent", f"{HERE}:Faulty", "--option", "how=reset", "--limit", "4", "--workers", "1")
    done = called("evaluate", "--data", smoke, "--out", tmp_path, *agent)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"error: agent {HERE}:Faulty failed at task U_")
    assert "(in reset); --tolerate logs such episodes as failures and goes on" in last
    assert not runs(tmp_path)


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


@pytest.mark.parametrize(("how", "line", "workers"), [("act", 17, 1), ("act", 17, 2), ("init", 8, 1)])
def test_an_agents_own_file_is_named_and_its_traceback_shown_on_demand(
    smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, line: int, workers: int
) -> None:
    (tmp_path / "own_agent.py").write_text(OWN_CODE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_agent", raising=False)
    agent = ("--agent", "own_agent:Agent", "--option", f"how={how}", "--limit", "2", "--workers", workers)
    done = called("evaluate", "--data", smoke, "--out", tmp_path, *agent, "--traceback")
    assert done.returncode == (1 if how == "act" else 2)
    # The library's line helps nobody: the place is in the agent's file.
    said = f"JSONDecodeError at own_agent.py:{line}: Expecting value" if how == "act" else "Expecting value"
    assert said in done.stderr.splitlines()[-1]
    trace = done.stderr[done.stderr.index("Traceback") :].splitlines()[:-1]
    files = [one.split('"')[1] for one in trace if one.startswith("  File ")]
    assert files[0].endswith("own_agent.py"), "it begins with the agent"
    assert f'own_agent.py", line {line}, in ' in done.stderr
    assert trace[-1].startswith("json.decoder.JSONDecodeError: ")
    assert len(done.stderr.split("Traceback")) == 2
