"""The runner: samples, the log, kills, workers, infrastructure failures, costs."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow.compute as pc
import pytest
from support.command_line import called

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents import AgentBase, AgentUnavailable, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.goal import BLIND
from aerialdojo_gen.benchmark.episodes import TABLES, Journal, read_journal, read_run, runs
from aerialdojo_gen.benchmark.evaluation import Limits
from aerialdojo_gen.benchmark.runner import Evaluation, Outcome, evaluate
from aerialdojo_gen.benchmark.tasks import Selection, select
from aerialdojo_gen.benchmark.worker import RetryPolicy
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.store import schemas


class Flaky(AgentBase):
    """Its service fails at the first `left` calls of the process, and counts cents."""

    sensors = BLIND
    left = 0

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


FLAKY = f"{__name__}:Flaky"


def job(agent="random", limit=12, run="r", options=(), **kw):
    retry_policy = RetryPolicy(pause_s=0.0, tolerate=True)
    return Evaluation(run, agent, dict(options), Selection(limit=limit, **kw), retry_policy=retry_policy)


def snapshot(out):
    return {p.name + t: p.read_bytes() for t in ("episodes", "steps") for p in (out / t / "r").glob("*.parquet")}


def test_the_oracle_succeeds_everywhere(smoke, tmp_path):
    outcome = evaluate(smoke, job("oracle", None, modalities=("semantic",)), out=tmp_path)
    rows = read_run(tmp_path, "r").to_pandas()
    assert outcome.finished == len(rows) == select(smoke, Selection(modalities=("semantic",))).num_rows
    assert (rows.success & rows.oracle_success & ~rows.collision).all()
    assert (rows.final_distance_m <= 1.0).all(), "an Approach is at most 1 m"
    assert (rows.n_actions <= rows.action_budget).all()
    assert (rows.reference_length_m / np.maximum(rows.path_length_m, rows.reference_length_m)).mean() >= 0.99


def test_the_log_tells_what_happened(smoke, tmp_path):
    evaluate(smoke, job(limit=60, modalities=("semantic",)), out=tmp_path)
    rows = read_run(tmp_path, "r").to_pandas().set_index("task_id")
    steps = read_run(tmp_path, "r", "steps").to_pandas()
    assert steps.groupby("task_id").size().to_dict() == rows.n_actions.to_dict()
    assert len({*rows.termination} & {*schemas.TERMINATIONS}) >= 2
    for task_id, mine in steps.groupby("task_id"):
        row = rows.loc[task_id]
        assert mine.step.tolist() == list(range(len(mine)))
        # A collision ends on the way to where its action leads.
        moved = mine[~mine.refused][: -1 if row.collision else None]
        if len(moved):
            start = [row.start_x_m, row.start_y_m, row.start_z_m, row.start_yaw_rad]
            flown = replay(start, moved.action.astype(int).tolist())
            assert moved[["x_m", "y_m", "z_m"]].iloc[-1].tolist() == pytest.approx(flown[-1, :3].tolist(), abs=1e-9)
        assert row.n_refused == mine.refused.sum()
        assert row.stop_called == (mine.action.iloc[-1] == 0) == (row.termination == "stop")
        assert row.collision == (row.termination == "collision")
        assert mine.distance_m.iloc[-1] == row.final_distance_m
        assert row.min_distance_m == pytest.approx(min(row.euclidean_m, mine.distance_m.min()), abs=1e-6)
        assert row.min_horizontal_distance_m <= row.min_distance_m
        assert row.success == (row.stop_called and row.final_distance_m <= 3.0)
    assert rows[["n_requests", "input_tokens", "cost_usd"]].isna().all(axis=None)
    counts = {table: read_run(tmp_path, "r", table).num_rows for table in TABLES}
    assert counts == {"episodes": 60, "steps": rows.n_actions.sum(), "timings": 60, "failures": 0}


SLOW = """
import os, signal, time
from pathlib import Path
from aerialdojo_gen.benchmark.agents.simple import RandomAgent
class Slow(RandomAgent):
    left = 9
    def reset(self, goal):
        super().reset(goal)
        Path(f"worker-{os.getpid()}").touch()
        while len(list(Path().glob("worker-*"))) < int(os.environ.get("WORKERS", 0)):
            time.sleep(0.01)
        time.sleep(0.03)
        self.left -= 1
        if not self.left and Path("interrupt").exists():
            os.kill(os.getpid(), signal.SIGINT)
"""


@pytest.mark.kill
def test_killed_and_interrupted_and_gone_on_with_it_ends_with_the_same_bytes(project, smoke, tmp_path, monkeypatch):
    """Two workers and one, and what Ctrl-C says; that it ends the workers is a test of the executors."""
    out, fresh = tmp_path / "out", tmp_path / "fresh"
    (tmp_path / "slowagent.py").write_text(SLOW)
    command = ["evaluate", "--data", smoke, "--out", out, "--run", "r", "--agent", "slowagent:Slow", "--limit", "60"]
    command += ["--pipeline", project / "pipelines" / "smoke.toml", "--workers"]

    def finished():
        ids = set(read_run(out, "r")["task_id"].to_pylist()) if runs(out) else set()
        for path in (out / "runs" / "r" / "journal").glob("*.jsonl"):
            with contextlib.suppress(FileNotFoundError):
                ids |= {record["task_id"] for record in read_journal(path)}
        return ids

    env = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{project}", "WORKERS": "2"}
    process = subprocess.Popen(
        [sys.executable, "-m", "aerialdojo_gen.cli", *command, "2"], cwd=tmp_path, env=env, start_new_session=True
    )
    while process.poll() is None and len(finished()) < 8:
        time.sleep(0.005)
    assert process.poll() is None, "killed in the middle"
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    killed = finished()
    # What a kill in the middle of a line leaves.
    with max((out / "runs" / "r" / "journal").glob("*.jsonl")).open("a") as file:
        file.write('{"task_id":"U_')

    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "interrupt").touch()
    done = called(*command, "1", cwd=tmp_path)
    assert done.returncode == 130, done.stderr
    assert done.stderr.splitlines()[-1].startswith("interrupted: finished episodes are kept")
    assert "Traceback" not in done.stderr
    assert not list(out.rglob("*.jsonl")), "they are in the tables"
    kept = finished()
    assert kept > killed, "what was finished stays"
    (tmp_path / "interrupt").unlink()
    done = called(*command, "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"; {60 - len(kept)} flown now" in done.stderr, "no finished episode is flown again"
    assert called(*(fresh if word == out else word for word in command), "1", cwd=tmp_path).returncode == 0
    assert snapshot(out) == snapshot(fresh)
    assert not list(out.rglob(".aerialdojo-staging"))


def test_a_journal_that_a_lost_worker_has_begun_is_gone_on_with(tmp_path):
    path = tmp_path / "journal" / "U_Mall_0.0000.jsonl"
    for done, name in (((), "a"), ("a", "c")):
        with Journal(path) as journal:
            assert journal.done == {*done}
            journal.add({"task_id": name})
        if name == "a":
            with path.open("ab") as file:
                file.write(b'{"task_id": "b"')
    assert [record["task_id"] for record in read_journal(path)] == ["a", "c"]


def test_a_sample_is_even_over_the_scenes_and_grows(smoke):
    small, large = (select(smoke, Selection(limit=n)) for n in (7, 20))
    assert (small.num_rows, large.num_rows) == (7, 20)
    counts = [each["counts"] for each in large["scene"].value_counts().to_pylist()]
    assert max(counts) - min(counts) <= 1
    assert set(small["task_id"].to_pylist()) < set(large["task_id"].to_pylist())
    assert set(select(smoke, Selection(limit=7, seed=1))["task_id"].to_pylist()) != set(small["task_id"].to_pylist())
    some = select(smoke, Selection(splits=("ood_test",), settings=("base",), modalities=("image",)))
    assert [some[name].unique().to_pylist() for name in ("split", "setting")] == [["ood_test"], ["base"]]
    assert pc.sum(pc.is_valid(some["description"])).as_py() == 0


def test_train_and_test_are_those_of_both_partitions(smoke):
    one = Selection(splits=("train",), modalities=("image",))
    assert one == Selection(splits=("id_train", "ood_train"), modalities=("image",)), "one run, however it is called"
    assert select(smoke, one) == select(smoke, Selection(splits=("ood_train", "id_train"), modalities=("image",)))
    parts = [select(smoke, Selection(splits=(name,))).num_rows for name in ("train", "test")]
    assert min(parts) > 0
    assert sum(parts) == select(smoke, Selection(splits=("all",))).num_rows == select(smoke, Selection()).num_rows
    with pytest.raises(UsageError, match="there are id_train, id_test, ood_train, ood_test, train, test, all"):
        Selection(splits=("x",))
    with pytest.raises(UsageError, match="a limit is at least 1"):
        Selection(limit=0)


def test_other_settings_do_not_mix_with_a_run(smoke, tmp_path):
    with pytest.raises(StoreError, match=r"there is no run 'r': there is none"):
        read_run(tmp_path, "r")
    with pytest.raises(UsageError, match="its options: seed, stop_probability"):
        evaluate(smoke, job(limit=2, options={"sead": 1}), out=tmp_path)
    evaluate(smoke, job(limit=2), out=tmp_path)  # An agent that cannot be made has not taken the name.
    before = snapshot(tmp_path)
    for other, said in (
        (job(limit=3), "run 'r' was begun with limit = 2, not 3: give another --run, or --restart"),
        (job("stop", limit=2), "agent = 'random', not 'stop'"),
    ):
        with pytest.raises(UsageError, match=said):
            evaluate(smoke, other, out=tmp_path)
    assert snapshot(tmp_path) == before
    shutil.rmtree(tmp_path / "runs")
    with pytest.raises(UsageError, match="there are episodes of another run 'r'"):
        evaluate(smoke, job("stop", limit=2), out=tmp_path)
    assert evaluate(smoke, job("stop", limit=3), out=tmp_path, restart=True).flown == 3
    assert read_run(tmp_path, "r")["agent"].unique().to_pylist() == ["stop"]
    assert evaluate(smoke, job("stop", limit=3), out=tmp_path).flown == 0


def test_a_run_is_not_gone_on_with_by_other_code(smoke, tmp_path, monkeypatch):
    mine = tmp_path / "flyer_of_a_test.py"
    mine.write_text("from aerialdojo_gen.benchmark.agents.simple import StopAgent as Flyer\n")
    monkeypatch.syspath_prepend(tmp_path)
    flyer = job("flyer_of_a_test:Flyer", limit=1)
    assert [evaluate(smoke, flyer, out=tmp_path / "out").flown for _ in range(2)] == [1, 0]
    mine.write_text(mine.read_text() + "colour = 'red'\n")
    with pytest.raises(UsageError, match=r"run 'r' was begun with other code: give another --run, or --restart"):
        evaluate(smoke, flyer, out=tmp_path / "out")


def test_infrastructure_failures_are_tried_again_and_logged_apart(smoke, tmp_path):
    Flaky.left = 2
    outcome = evaluate(smoke, job(FLAKY, limit=3), out=tmp_path)
    assert (outcome.finished, outcome.failed) == (3, 0)
    tries = read_run(tmp_path, "r", "timings")["attempts"].to_pylist()
    assert sorted(tries) == [1, 1, 3]
    row = read_run(tmp_path, "r").to_pylist()[tries.index(3)]
    assert row["n_requests"] == 5 + 2, "what the failed attempts cost is on the bill"
    assert row["cost_usd"] == pytest.approx(0.07)

    Flaky.left = 5 + 1
    again = job(FLAKY, limit=3, run="s")
    outcome = evaluate(smoke, again, out=tmp_path)
    assert (outcome.finished, outcome.failed) == (2, 1)
    failure = read_run(tmp_path, "s", "failures").to_pylist()[0]
    assert (failure["attempts"], failure["reason"]) == (5, "429 from the service")
    assert failure["task_id"] not in read_run(tmp_path, "s")["task_id"].to_pylist()
    assert evaluate(smoke, again, out=tmp_path).flown == 0, "not without being asked"
    outcome = evaluate(smoke, again, out=tmp_path, rerun_failed=True)
    assert (outcome.flown, outcome.finished, outcome.failed) == (1, 3, 0)
    assert read_run(tmp_path, "s", "failures").num_rows == 0


def test_answers_that_name_no_action_are_counted(smoke, tmp_path):
    evaluate(smoke, job(FLAKY, limit=1), out=tmp_path)
    row = read_run(tmp_path, "r").to_pylist()[0]
    assert (row["n_invalid"], row["n_actions"], row["termination"], row["path_length_m"]) == (3, 5, "stop", 0.0)
    steps = read_run(tmp_path, "r", "steps").to_pylist()
    assert [s["action"] for s in steps] == [None, None, None, 14, 0]
    assert [s["answer"] for s in steps] == [f"call {k}" for k in range(1, 6)]
    assert (row["input_tokens"], row["output_tokens"]) == (50, 5)


def test_no_more_than_the_maximal_cost(smoke, tmp_path):
    flaky = job(FLAKY, limit=6)
    outcome = evaluate(smoke, flaky, out=tmp_path, limits=Limits(cost_usd=0.12))
    assert (outcome.finished, outcome.cost_usd) == (3, pytest.approx(0.15))
    assert evaluate(smoke, flaky, out=tmp_path, limits=Limits(cost_usd=0.12)).flown == 0
    assert evaluate(smoke, flaky, out=tmp_path, limits=Limits(cost_usd=1.0)).finished == 6


def test_the_command_and_what_its_last_line_says(smoke, tmp_path):
    def call(*args):
        return called("evaluate", "--data", smoke, "--out", tmp_path, *args)

    done = call("--agent", "random", "--option", "seed=3", "--limit", "4", "--workers", "1")
    assert done.returncode == 0, done.stderr
    last = done.stderr.splitlines()[-1]
    assert "evaluate random: 4 of 4 episodes finished, success rate 0.0%; 4 flown now" in last
    assert json.loads(read_run(tmp_path, "random")["agent_options"][0].as_py()) == {"seed": 3}
    advised = last.partition("; for all scores: aerialdojo-gen ")[2]
    assert advised == f"report random --log {tmp_path} --data {smoke}"
    told = called(*advised.split(), "--json")
    assert told.returncode == 0, told.stderr
    assert '"random"' in told.stdout
    for args, said in (
        (("--agent", "oracel"), "no agent 'oracel': did you mean 'oracle'?"),
        (("--split", "valid"), "no split 'valid'"),
        (("--run", "../x"), "'../x' is no name of a run"),
        (("--option", "seed"), "--option 'seed': write key=value"),
    ):
        wrong = call(*args)
        assert wrong.returncode == 2
        assert wrong.stderr.splitlines()[-1].startswith(f"error: {said}"), wrong.stderr
    some = Outcome(10, 8, 1, 9, 90, 0.0, 0, 1.0, successes=3)
    assert str(some).startswith("8 of 10 episodes finished, 1 failed, success rate 37.5%; 9 flown now")
    assert "rate" not in str(Outcome(10, 0, 0, 0, 0, 0.0, 0, 1.0)), "no episode, no rate"
