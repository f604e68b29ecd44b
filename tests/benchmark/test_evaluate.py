"""The runner: samples, the log, kills, workers, infrastructure failures, costs."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pytest
from support.command_line import called

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark import journal
from aerialdojo_gen.benchmark.agents import AgentBase, AgentUnavailable, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.goal import BLIND
from aerialdojo_gen.benchmark.episodes import TABLES, read_run, runs
from aerialdojo_gen.benchmark.evaluation import Limits
from aerialdojo_gen.benchmark.runner import Evaluation, Outcome, evaluate
from aerialdojo_gen.benchmark.tasks import Selection, select
from aerialdojo_gen.benchmark.worker import RetryPolicy
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.store import schemas

HERE, FILE = __name__, Path(__file__).stem


class Flaky(AgentBase):
    """Its service fails at the first `failures` calls of the process, and counts cents."""

    sensors = BLIND
    left = 0

    def __init__(self, note=""):
        self._note = note

    def reset(self, goal):
        self._calls = 0

    def act(self, observation):
        self._calls += 1
        if type(self).left:
            type(self).left -= 1
            raise AgentUnavailable("429 from the service", retry_after_s=0.0)
        if observation.step == 0:
            raise InvalidAnswer("no action in it")
        return [99, "north", True, 14][observation.step] if observation.step < 4 else 0

    def usage(self):
        return Usage(self._calls, 10 * self._calls, self._calls, 0.01 * self._calls)

    def answer(self):
        return f"call {self._calls}"


def job(agent="random", limit=12, run="r", tolerate=True, **kw):
    retry_policy = RetryPolicy(pause_s=0.0, tolerate=tolerate)
    return Evaluation(run, agent, kw.pop("options", {}), Selection(limit=limit, **kw), retry_policy=retry_policy)


def snapshot(out, run="r", tables=("episodes", "steps")):
    return {p.name + t: p.read_bytes() for t in tables for p in (out / t / run).glob("*.parquet")}


@pytest.fixture(scope="module")
def whole(smoke, tmp_path_factory):
    """An uninterrupted run of the random agent over everything."""
    out = tmp_path_factory.mktemp("whole")
    evaluate(smoke, job(limit=None, modalities=("semantic",)), out=out)
    return out


def test_the_oracle_succeeds_everywhere(smoke, tmp_path):
    outcome = evaluate(smoke, job("oracle", None, modalities=("semantic",)), out=tmp_path)
    rows = read_run(tmp_path, "r").to_pandas()
    assert outcome.finished == len(rows) == select(smoke, Selection(modalities=("semantic",))).num_rows
    assert rows.success.all()
    assert rows.oracle_success.all()
    assert not rows.collision.any()
    assert (rows.final_distance_m <= 1.0).all(), "an Approach is at most 1 m"
    assert (rows.n_actions <= rows.action_budget).all()
    assert (rows.reference_length_m / np.maximum(rows.path_length_m, rows.reference_length_m)).mean() >= 0.99


def test_the_log_tells_what_happened(whole):
    rows = read_run(whole, "r").to_pandas().set_index("task_id")
    steps = read_run(whole, "r", "steps").to_pandas()
    assert steps.groupby("task_id").size().to_dict() == rows.n_actions.to_dict()
    assert set(rows.termination) <= set(schemas.TERMINATIONS)
    assert len(set(rows.termination)) >= 2
    for task_id, mine in list(steps.groupby("task_id"))[:40]:
        row = rows.loc[task_id]
        start = [row.start_x_m, row.start_y_m, row.start_z_m, row.start_yaw_rad]
        assert mine.step.tolist() == list(range(len(mine)))
        moved = mine[~mine.refused]
        flown = replay(start, moved.action.astype(int).tolist())
        last = -2 if row.collision else -1
        if len(flown) + last > 0:
            x_m, y_m, z_m = flown[last, :3]
            at = moved.iloc[last if row.collision else -1]
            assert (at.x_m, at.y_m, at.z_m) == pytest.approx((x_m, y_m, z_m), abs=1e-9)
        assert row.n_refused == mine.refused.sum()
        assert row.stop_called == (mine.action.iloc[-1] == 0) == (row.termination == "stop")
        assert row.collision == (row.termination == "collision")
        assert mine.distance_m.iloc[-1] == row.final_distance_m
        assert row.min_distance_m == pytest.approx(min(row.euclidean_m, mine.distance_m.min()), abs=1e-6)
        assert row.min_horizontal_distance_m <= row.min_distance_m
        assert row.success == (row.stop_called and not row.collision and row.final_distance_m <= 3.0)
    assert rows[["n_requests", "input_tokens", "cost_usd"]].isna().all(axis=None)
    counts = {table: read_run(whole, "r", table).num_rows for table in TABLES}
    expected = {"episodes": len(rows), "steps": rows.n_actions.sum(), "timings": len(rows), "failures": 0}
    assert counts == expected


def test_several_workers_give_the_same_bytes(smoke, whole, tmp_path):
    outcome = evaluate(smoke, job(limit=None, modalities=("semantic",)), out=tmp_path, workers=2)
    assert outcome.flown == outcome.episodes
    assert snapshot(tmp_path) == snapshot(whole)


SLOW = """
import time
from aerialdojo_gen.benchmark.agents.simple import RandomAgent
class Slow(RandomAgent):
    def reset(self, goal):
        time.sleep(0.01)
        super().reset(goal)
"""


def slow_run(project, smoke, folder, out, *more, sleep="0.01"):
    """The words of a command, and how a process runs it."""
    (folder / "slowagent.py").write_text(SLOW.replace("0.01", sleep))
    command = ["evaluate", "--data", smoke, "--out", out, "--run", "r", "--agent", "slowagent:Slow"]
    command += ["--pipeline", project / "pipelines" / "smoke.toml", *more]
    env = os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{project}"}
    process = [sys.executable, "-m", "aerialdojo_gen.cli", *command]
    how = {"cwd": folder, "env": env, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    return command, lambda: subprocess.Popen(process, **how)


@pytest.mark.kill
def test_killed_again_and_again_ends_with_the_same_bytes(project, smoke, tmp_path, monkeypatch):
    out, fresh = tmp_path / "out", tmp_path / "fresh"
    command, begin = slow_run(project, smoke, tmp_path, out, "--limit", "60", "--workers", "1")

    def finished():
        ids = set(read_run(out, "r")["task_id"].to_pylist()) if runs(out) else set()
        for path in (out / "runs" / "r" / "journal").glob("*.jsonl"):
            with contextlib.suppress(FileNotFoundError):
                ids |= {record["task_id"] for record in journal.read_journal(path)}
        return ids

    kept = set()
    for _ in range(2):
        process = begin()
        while process.poll() is None and len(finished()) < len(kept) + 8:
            time.sleep(0.005)
        assert process.poll() is None, "killed in the middle"
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        assert finished() > kept, "what was finished stays"
        kept = finished()
    # What a kill in the middle of a line leaves.
    with max((out / "runs" / "r" / "journal").glob("*.jsonl")).open("a") as file:
        file.write('{"task_id":"U_')
    monkeypatch.syspath_prepend(tmp_path)
    done = called(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    flown = int(done.stderr.split(" flown now")[0].rsplit(" ", 1)[1])
    assert flown == 60 - len(kept), "no finished episode is flown again"
    assert called(*(fresh if word == out else word for word in command), cwd=tmp_path).returncode == 0
    assert snapshot(out) == snapshot(fresh)
    assert not list(out.rglob("*.jsonl"))
    assert not list(out.rglob(".aerialdojo-staging"))


def test_a_sample_is_even_over_the_scenes_and_grows(smoke):
    small, large = (select(smoke, Selection(limit=n)) for n in (7, 20))
    assert (small.num_rows, large.num_rows) == (7, 20)
    counts = large["scene"].value_counts().to_pylist()
    assert max(c["counts"] for c in counts) - min(c["counts"] for c in counts) <= 1
    assert set(small["task_id"].to_pylist()) < set(large["task_id"].to_pylist())
    assert set(select(smoke, Selection(limit=7, seed=1))["task_id"].to_pylist()) != set(small["task_id"].to_pylist())
    some = select(smoke, Selection(splits=("id_test",), settings=("base",), modalities=("image",)))
    assert some["split"].unique().to_pylist() == ["id_test"]
    assert some["setting"].unique().to_pylist() == ["base"]
    assert pc.sum(pc.is_valid(some["description"])).as_py() == 0


def test_train_and_test_are_those_of_both_partitions(smoke):
    train = Selection(splits=("train",), modalities=("image",))
    assert train == Selection(splits=("id_train", "ood_train"), modalities=("image",)), (
        "one run, however it is called"
    )
    assert select(smoke, train) == select(smoke, Selection(splits=("ood_train", "id_train"), modalities=("image",)))
    parts = [select(smoke, Selection(splits=(name,))).num_rows for name in ("train", "test")]
    assert min(parts) > 0
    assert sum(parts) == select(smoke, Selection(splits=("all",))).num_rows == select(smoke, Selection()).num_rows
    with pytest.raises(UsageError, match="there are id_train, id_test, ood_train, ood_test, train, test, all"):
        Selection(splits=("x",))


def test_other_settings_do_not_mix_with_a_run(smoke, tmp_path):
    with pytest.raises(StoreError, match=r"there is no run 'r': there is none"):
        read_run(tmp_path, "r")
    evaluate(smoke, job(limit=2), out=tmp_path)
    before = snapshot(tmp_path)
    with pytest.raises(
        UsageError, match=r"run 'r' was begun with limit = 2, not 3: give another --run, or --restart"
    ):
        evaluate(smoke, job(limit=3), out=tmp_path)
    with pytest.raises(UsageError, match="agent = 'random', not 'stop'"):
        evaluate(smoke, job("stop", limit=2), out=tmp_path)
    assert snapshot(tmp_path) == before
    shutil.rmtree(tmp_path / "runs")
    with pytest.raises(UsageError, match="there are episodes of another run 'r'"):
        evaluate(smoke, job("stop", limit=2), out=tmp_path)
    assert evaluate(smoke, job("stop", limit=3), out=tmp_path, restart=True).flown == 3
    assert read_run(tmp_path, "r")["agent"].unique().to_pylist() == ["stop"]
    assert evaluate(smoke, job("stop", limit=3), out=tmp_path).flown == 0


def test_a_run_is_not_gone_on_with_by_other_code(smoke, tmp_path, monkeypatch):
    mine = tmp_path / "flyer_of_a_test.py"
    text = "from aerialdojo_gen.benchmark.agents.simple import StopAgent\n\n\nclass Flyer(StopAgent):\n    pass\n"
    mine.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    flyer = job("flyer_of_a_test:Flyer", limit=1)
    assert evaluate(smoke, flyer, out=tmp_path / "out").flown == 1
    assert evaluate(smoke, flyer, out=tmp_path / "out").flown == 0
    mine.write_text(text + "    colour = 'red'\n")
    with pytest.raises(UsageError, match=r"run 'r' was begun with other code: give another --run, or --restart"):
        evaluate(smoke, flyer, out=tmp_path / "out")


def test_an_agent_that_cannot_be_made_does_not_take_the_name(smoke, tmp_path):
    with pytest.raises(UsageError, match="its options: seed, stop_probability"):
        evaluate(smoke, job(limit=2, options={"sead": 1}), out=tmp_path)
    assert evaluate(smoke, job(limit=2, options={"seed": 1}), out=tmp_path).finished == 2


def test_infrastructure_failures_are_tried_again_and_logged_apart(smoke, tmp_path):
    flaky = f"{HERE}:Flaky"
    Flaky.left = 2
    outcome = evaluate(smoke, job(flaky, limit=3), out=tmp_path)
    assert (outcome.finished, outcome.failed) == (3, 0)
    tries = read_run(tmp_path, "r", "timings")["attempts"].to_pylist()
    assert sorted(tries) == [1, 1, 3]
    first = tries.index(3)
    rows = read_run(tmp_path, "r").to_pylist()
    assert rows[first]["n_requests"] == 5 + 2, "what the failed attempts cost is on the bill"
    assert rows[first]["cost_usd"] == pytest.approx(0.07)

    Flaky.left = 5 + 1
    outcome = evaluate(smoke, job(flaky, limit=3, run="s"), out=tmp_path)
    assert (outcome.finished, outcome.failed) == (2, 1)
    failure = read_run(tmp_path, "s", "failures").to_pylist()[0]
    assert (failure["attempts"], failure["reason"]) == (5, "429 from the service")
    assert failure["task_id"] not in read_run(tmp_path, "s")["task_id"].to_pylist()
    assert evaluate(smoke, job(flaky, limit=3, run="s"), out=tmp_path).flown == 0, "not without being asked"
    outcome = evaluate(smoke, job(flaky, limit=3, run="s"), out=tmp_path, rerun_failed=True)
    assert (outcome.flown, outcome.finished, outcome.failed) == (1, 3, 0)
    assert read_run(tmp_path, "s", "failures").num_rows == 0


def test_answers_that_name_no_action_are_counted(smoke, tmp_path):
    evaluate(smoke, job(f"{HERE}:Flaky", limit=1), out=tmp_path)
    row = read_run(tmp_path, "r").to_pylist()[0]
    assert (row["n_invalid"], row["n_actions"], row["termination"], row["path_length_m"]) == (3, 5, "stop", 0.0)
    steps = read_run(tmp_path, "r", "steps").to_pylist()
    assert [s["action"] for s in steps] == [None, None, None, 14, 0]
    assert [s["answer"] for s in steps] == [f"call {k}" for k in range(1, 6)]
    assert (row["input_tokens"], row["output_tokens"]) == (50, 5)


def test_no_more_than_the_maximal_cost(smoke, tmp_path):
    flaky = job(f"{HERE}:Flaky", limit=6)
    outcome = evaluate(smoke, flaky, out=tmp_path, limits=Limits(cost_usd=0.12))
    assert (outcome.finished, outcome.cost_usd) == (3, pytest.approx(0.15))
    assert evaluate(smoke, flaky, out=tmp_path, limits=Limits(cost_usd=0.12)).flown == 0
    assert evaluate(smoke, flaky, out=tmp_path, limits=Limits(cost_usd=1.0)).finished == 6


def test_the_command_in_one_line(project, smoke, tmp_path):
    def call(*args):
        return called("evaluate", "--data", smoke, "--out", tmp_path, *args, cwd=project)

    done = call("--agent", "random", "--option", "seed=3", "--limit", "4", "--setting", "base", "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert "evaluate random: 4 of 4 episodes finished, success rate 0.0%; 4 flown now" in done.stderr
    assert json.loads(read_run(tmp_path, "random")["agent_options"][0].as_py()) == {"seed": 3}
    for args, said in (
        (("--agent", "oracel"), "no agent 'oracel': did you mean 'oracle'?"),
        (("--split", "valid"), "no split 'valid'"),
        (("--run", "../x"), "'../x' is no name of a run"),
        (("--option", "seed"), "--option 'seed': write key=value"),
    ):
        wrong = call(*args)
        assert wrong.returncode == 2
        assert wrong.stderr.splitlines()[-1].startswith(f"error: {said}"), wrong.stderr


def test_the_last_line_has_the_success_rate_and_the_command_for_the_scores(smoke, tmp_path):
    command = ["evaluate", "--data", smoke, "--out", tmp_path, "--agent", "oracle", "--limit", "5", "--workers", "1"]
    done = called(*command)
    assert done.returncode == 0, done.stderr
    last = done.stderr.splitlines()[-1]
    assert "evaluate oracle: 5 of 5 episodes finished, success rate 100.0%; 5 flown now" in last
    advised = last.partition("; for all scores: aerialdojo-gen ")[2]
    assert advised == f"report oracle --log {tmp_path} --data {smoke}"
    told = called(*advised.split(), "--json")
    assert told.returncode == 0, told.stderr
    assert '"oracle"' in told.stdout
    some = Outcome(10, 8, 1, 9, 90, 0.0, 0, 1.0, successes=3)
    assert str(some).startswith("8 of 10 episodes finished, 1 failed, success rate 37.5%; 9 flown now")
    assert "rate" not in str(Outcome(10, 0, 0, 0, 0, 0.0, 0, 1.0)), "no episode, no rate"


@pytest.mark.kill
def test_ctrl_c_keeps_what_was_finished_and_ends_the_workers(project, smoke, tmp_path):
    out = tmp_path / "out"
    process = slow_run(project, smoke, tmp_path, out, "--workers", "2", sleep="0.1")[1]()
    journals = out / "runs" / "r" / "journal"
    while process.poll() is None and sum(p.read_bytes().count(b"\n") for p in journals.glob("*.jsonl")) < 4:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.strip().splitlines()[-1].startswith("interrupted: finished episodes are kept")
    assert "Traceback" not in err
    assert read_run(out, "r").num_rows >= 4
    assert not list(out.rglob("*.jsonl"))
