"""A whole evaluation by a language-model agent: the command, the real package, a real server, a real scene."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.command_line import called
from support.llm_server import Act, Cut, Endless, Filtered, Hang, Raw, Say, Status, Trickle, serving

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.tables import outcome_cells

KEY = "sk-test-0b7a41dc95e84f2f8c63"
TURN, STOP, UNREADABLE = '{"thought": "Look.", "action": "TurnLeft15"}', '{"action": "Stop"}', "I am lost."


def command_of(smoke: Path, out: Path, agent: str, url: str, *more: str) -> list[str]:
    options = {
        "model": "m", "base_url": url + ("/v1" if agent == "openai" else ""), "request_retries": 0, "timeout_s": 20,
        "image_size_px": 32, "input_usd_per_million": 2.0, "output_usd_per_million": 10.0,
    }  # fmt: skip
    command = ["evaluate", "--agent", agent, "--data", str(smoke), "--out", str(out), "--limit", "2"]
    command += ["--workers", "1", "--modality", "semantic", "--option", "answer=text"]
    for name, value in options.items():
        command += ["--option", f"{name}={json.dumps(value)}"]
    return [*command, *more]


def fly(smoke: Path, out: Path, url: str, *more: str, agent: str = "openai") -> subprocess.CompletedProcess[str]:
    return called(*command_of(smoke, out, agent, url, *more), **{f"{agent.upper()}_API_KEY": KEY})


def shell(line: str, out: Path) -> subprocess.CompletedProcess[str]:
    """Do as a person does: in a process of its own, which logs all that the packages log."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(out), "OPENAI_LOG": "debug", "OPENAI_API_KEY": KEY}
    return subprocess.run(line, shell=True, capture_output=True, text=True, check=False, env=environment)


def key_is_nowhere(out: Path, done: subprocess.CompletedProcess[str]) -> None:
    assert KEY not in done.stdout + done.stderr
    files = [path for path in out.rglob("*") if path.is_file()]
    assert files
    for path in files:
        assert KEY.encode() not in path.read_bytes(), path


def scripted() -> Callable[[dict[str, Any]], str]:
    """Turn, say something that cannot be read (twice: its repair too), stop."""
    said = iter([TURN, UNREADABLE, UNREADABLE, STOP] * 2)
    return lambda _: next(said)


@pytest.mark.parametrize("agent", ["openai", "anthropic"])
def test_an_evaluation_logs_what_was_said_and_what_it_cost(smoke: Path, tmp_path: Path, agent: str) -> None:
    with serving() as service:
        service.policy = scripted()
        done = fly(smoke, tmp_path, service.url, agent=agent)
        assert done.returncode == 0, done.stderr
        assert len(service.requests) == 8
    key_is_nowhere(tmp_path, done)
    episodes = read_run(tmp_path, agent)
    assert episodes["termination"].to_pylist() == ["stop"] * 2
    assert episodes["n_actions"].to_pylist() == [3, 3]
    assert episodes["n_invalid"].to_pylist() == [1, 1]
    assert episodes["n_requests"].to_pylist() == [4, 4]
    assert episodes["input_tokens"].to_pylist() == [4000, 4000]
    assert episodes["cost_usd"].to_pylist() == pytest.approx([(4000 * 2 + 80 * 10) / 1e6] * 2)
    steps = read_run(tmp_path, agent, "steps")
    assert steps["action"].to_pylist() == [14, None, 0] * 2
    assert steps["answer"].to_pylist() == [TURN, UNREADABLE, STOP] * 2
    (run,) = load_runs(tmp_path)
    assert outcome_cells(run, PROFILES["aerialdojo"])[5:7] == ("2", "8")
    # Defaults too: how many pictures were sent is in the log.
    used = json.loads(episodes["agent_options"][0].as_py())
    expected = {"history_images": 1, "actions": "sixteen", "image_size_px": 32, "answer": "text"}
    assert {name: used[name] for name in expected} == expected
    timings = read_run(tmp_path, agent, "timings").to_pylist()
    assert all(0 < row["longest_request_s"] <= row["request_s"] <= row["agent_s"] for row in timings)
    # What went out: nothing that the runner alone may know.
    told = json.dumps([request["body"] for request in service.requests])
    assert "goal_x_m" not in told
    for column in ("nav_id", "task_id", "start_x_m"):
        for value in episodes[column].to_pylist():
            assert str(value) not in told


def test_a_failing_service_is_logged_apart_and_its_episodes_flown_again(smoke: Path, tmp_path: Path) -> None:
    more = ("--attempts", "2", "--limit", "1")
    with serving(Status(503, "overloaded\x1b[2J", {"retry-after": "0"})) as service:
        words = command_of(smoke, tmp_path, "openai", service.url, *more)
        done = shell(shlex.join([sys.executable, "-m", "aerialdojo_gen.cli", *words]), tmp_path)
        assert len(service.requests) == 2
        key_is_nowhere(tmp_path, done)
        failures = read_run(tmp_path, "openai", "failures")
        assert failures["attempts"].to_pylist() == [2]
        assert "HTTP 503: overloaded" in failures["reason"][0].as_py()
        assert (failures["kind"].to_pylist(), failures["n_requests"].to_pylist()) == (["server error"], [2])
        assert done.returncode == 1, "none finished"
        assert all(line.isprintable() for line in done.stderr.splitlines())
        last = done.stderr.splitlines()[-1]
        assert last.startswith("error: 1 failed, which count as no episodes: 1 × server error (http://127.0.0.1")
        pasted = last.partition("To fly the failed again: ")[2]
        assert shlex.split(pasted)[:4] == [sys.executable, "-m", "aerialdojo_gen.cli", "evaluate"]
        for given in (f"--data {smoke}", f"--out {tmp_path}", "--attempts 2", "--option 'model=\"m\"'"):
            assert given in pasted
        again = fly(smoke, tmp_path, service.url, *more, "--rerun-failed")
        assert again.returncode == 1, "none finished this time either"
        with pytest.raises(StoreError, match=r"no finished episode, and 1 that failed: .* --rerun-failed"):
            load_runs(tmp_path, ["openai"])
        assert read_run(tmp_path, "openai").num_rows == 0
        service.script[:] = [Say(STOP)]
        done = shell(pasted, tmp_path)
        assert done.returncode == 0, done.stderr
    episodes = read_run(tmp_path, "openai")
    assert episodes["n_actions"].to_pylist() == [1]
    assert episodes["n_invalid"].to_pylist() == [0]


def test_a_refusal_ends_the_run_with_one_line(smoke: Path, tmp_path: Path) -> None:
    with serving() as service:
        service.refuses = lambda _: Status(401, "wrong key\x1b]0;owned\x07\x1b[2J\x9b\u202e")
        done = fly(smoke, tmp_path, service.url, "--quiet")
        assert (len(service.checks), len(service.requests)) == (1, 0)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert "HTTP 401: wrong key\\u001b]0;owned\\u0007\\u001b[2J\\u009b\\u202e (you sent Bearer [key])" in lines[0]
    assert all(line.isprintable() for line in done.stderr.splitlines())
    assert "Traceback" not in done.stderr
    key_is_nowhere(tmp_path, done)


CONTEXT = "This model's maximum context length is 4096 tokens, your messages have 5000"
# Each kind of failure of a service, by the number of the episode that it strikes.
STRUCK: dict[int, tuple[Act, str]] = {
    2: (Status(400, "blocked", {}, "content_filter"), "content filter"),
    4: (Status(400, CONTEXT), "context too long"),
    6: (Status(404, "image not found"), "not found"),
    8: (Status(422, "cannot read the picture"), "bad request"),
    10: (Raw(b"<html>hello"), "malformed answer"),
    12: (Raw(b'{"choices": 7}'), "malformed answer"),
    14: (Status(500, "broken\nby accident"), "server error"),
    16: (Status(429, "slow down", {"retry-after": "0"}), "rate limit"),
    18: (Cut(), "connection lost"),
    20: (Hang(), "time-out"),
    22: (Filtered(), "content filter"),
    24: (Endless(), "malformed answer"),
    26: (Trickle(), "time-out"),
}
NO_ACTION = [
    '{"thought": ' + "9" * 5_000 + ', "action": "Stop"}', '{"thought": "\\ud800", "action": "Stop"}', "\ud800",
    '{"a":' * 3_000,
]  # fmt: skip


def striking(left: set[int]) -> Callable[[dict[str, Any]], str | Act]:
    """Strike the episodes that are left at their second step; some others say what no answer is, and stop."""
    episode = -1

    def answer(body: dict[str, Any]) -> str | Act:
        nonlocal episode
        said = json.dumps(body)
        if "This answer cannot be read" in said:
            return NO_ACTION[episode % 4]
        if "NOW: step 0;" in said:
            episode += 1
            return TURN
        if episode in STRUCK and episode in left:
            return STRUCK[episode][0]
        return NO_ACTION[episode % 4] if episode % 5 == 1 and "NOW: step 1;" in said else STOP

    return answer


def test_whatever_a_service_does_a_run_of_thirty_ends_with_thirty_rows(smoke: Path, tmp_path: Path) -> None:
    more = ("--limit", "30", "--attempts", "1", "--option", "timeout_s=4.0")
    with serving() as service:
        service.policy = striking(set(STRUCK))
        done = fly(smoke, tmp_path, service.url, *more)
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
        key_is_nowhere(tmp_path, done)
        episodes, failures = read_run(tmp_path, "openai"), read_run(tmp_path, "openai", "failures")
        assert (episodes.num_rows, failures.num_rows) == (30 - len(STRUCK), len(STRUCK))
        assert sorted(failures["kind"].to_pylist()) == sorted(kind for _, kind in STRUCK.values())
        assert not set(episodes["task_id"].to_pylist()) & set(failures["task_id"].to_pylist())
        assert all("\n" not in reason for reason in failures["reason"].to_pylist())
        assert any(reason.endswith("HTTP 500: broken") for reason in failures["reason"].to_pylist())
        assert sum(episodes["n_invalid"].to_pylist()) == len([k for k in range(1, 30, 5) if k not in STRUCK])
        lines = done.stderr.splitlines()
        assert f"{len(STRUCK)} failed, which count as no episodes: 3 × malformed answer (" in lines[-1]
        assert lines[-1].endswith(" --rerun-failed")
        assert lines[-1].count("(") == 1, "one reason, the most frequent one's"
        assert f"{30 - len(STRUCK)} of 30 episodes finished, {len(STRUCK)} failed" in lines[-2]

        before = len(service.requests)
        again = fly(smoke, tmp_path, service.url, *more)
        assert again.returncode == 0
        assert len(service.requests) == before, "not without being asked"
        service.policy = striking(set())
        again = fly(smoke, tmp_path, service.url, *more, "--rerun-failed")
        assert again.returncode == 0, again.stderr
        assert f"{len(STRUCK)} flown now" in again.stderr.splitlines()[-1], "exactly those that failed"
    assert (read_run(tmp_path, "openai").num_rows, read_run(tmp_path, "openai", "failures").num_rows) == (30, 0)


def test_failures_of_one_kind_in_a_row_end_the_run(smoke: Path, tmp_path: Path) -> None:
    with serving(Status(400, "no pictures here")) as service:
        more = ("--limit", "20", "--failures-in-row", "3", "--attempts", "4", "--quiet")
        done = fly(smoke, tmp_path, service.url, *more)
        assert done.returncode == 1
        assert len(service.requests) == 3, "what is refused for good is not tried again"
        (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
        assert line.startswith("error: stopped after 3 failures in a row of one kind (bad request).")
        assert "17 not begun: the same command goes on with them" in line
        # The service goes away in the middle: one line, and what was flown stays.
        service.script[:] = [Say(STOP)]
        more = ("--limit", "20", "--max-tokens", "2100", "--option", "request_retries=1")
        done = fly(smoke, tmp_path, service.url, *more, "--restart")
        assert done.returncode == 0
        assert read_run(tmp_path, "openai").num_rows == 3, "3 x 1,020 tokens are enough"
        assert "stopped at --max-tokens 2100" in done.stderr
    done = fly(smoke, tmp_path, service.url, "--limit", "20", "--option", "request_retries=1")
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("error: checked before the run, nothing flown: ")
    assert "refused" in last
    assert f"{service.url}/v1: " in last
    assert last.endswith("is the service there, and is base_url right?")
    assert "Traceback" not in done.stderr
    assert read_run(tmp_path, "openai").num_rows == 3


def test_keys_in_options_and_addresses_stay_out_of_the_log(smoke: Path, tmp_path: Path) -> None:
    inner = "a-plain-word-that-nobody-knows"
    body = json.dumps({"api_key": inner, "nested": [{"x-auth-token": "tok-7712ab91f0"}], "metadata": {"k": KEY}})
    echo = json.dumps({"thought": f"your key is {inner}", "action": "Stop"})
    with serving(Say(echo)) as service:
        done = fly(smoke, tmp_path, service.url, "--option", f"extra_body={body}")
        assert done.returncode == 0, done.stderr
        assert service.requests[0]["body"]["api_key"] == inner, "the service gets it all the same"
    for path in [path for path in tmp_path.rglob("*") if path.is_file()]:
        for value in (inner, "tok-7712ab91f0", KEY):
            assert value.encode() not in path.read_bytes(), (path, value)
    # Parquet packs its pages: as read, too.
    rows = [read_run(tmp_path, "openai", table).to_pylist() for table in ("episodes", "steps", "failures")]
    for value in (inner, "tok-7712ab91f0", KEY):
        assert value not in json.dumps(rows) + done.stdout + done.stderr
    assert "[redacted]" in (tmp_path / "runs" / "openai" / "run.json").read_text()
    assert "your key is [redacted]" in read_run(tmp_path, "openai", "steps")["answer"][0].as_py()


def test_requests_keep_their_pace_over_several_workers(smoke: Path, tmp_path: Path) -> None:
    times: list[float] = []

    def stop(_: dict[str, Any]) -> str:
        times.append(time.monotonic())
        return STOP

    with serving() as service:
        service.policy = stop
        more = ("--limit", "6", "--workers", "2", "--requests-per-minute", "240")
        done = fly(smoke, tmp_path, service.url, *more)
        assert done.returncode == 0, done.stderr
    # Sent 0.25 s apart at least; a slow machine only makes it longer.
    assert len(times) == 6
    assert times[-1] - times[0] > 4 * 0.25
    more = ("--agent", "random", "--requests-per-minute", "60", "--run", "r")
    assert fly(smoke, tmp_path, service.url, *more).returncode == 2
