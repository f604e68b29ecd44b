"""A whole evaluation by a language-model agent: the command, the real package, a real server, a real scene."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from llm_server import Act, Say, Status, serving

from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.runs import conduct, load_runs

KEY = "sk-test-0b7a41dc95e84f2f8c63"
TURN, STOP, UNREADABLE = '{"thought": "Look.", "action": "TurnLeft15"}', '{"action": "Stop"}', "I am lost."


def fly(smoke: Path, out: Path, agent: str, url: str, *more: str) -> subprocess.CompletedProcess[str]:
    options = {
        "model": "m", "base_url": url + ("/v1" if agent == "openai" else ""), "request_retries": 0, "timeout_s": 20,
        "image_size_px": 32, "input_usd_per_million": 2.0, "output_usd_per_million": 10.0,
    }  # fmt: skip
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "evaluate", "--agent", agent, "--data", str(smoke)]
    command += ["--out", str(out), "--limit", "2", "--workers", "1", "--modality", "semantic", *more]
    for name, value in options.items():
        command += ["--option", f"{name}={json.dumps(value)}"]
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(out), "OPENAI_LOG": "debug", "ANTHROPIC_LOG": "debug"}
    environment[f"{agent.upper()}_API_KEY"] = KEY
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


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
        done = fly(smoke, tmp_path, agent, service.url)
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
    assert (conduct(run).invalid, conduct(run).requests) == (2, 8)
    # What went out: nothing that the runner alone may know.
    told = json.dumps([request["body"] for request in service.requests])
    assert "goal_x_m" not in told
    for column in ("nav_id", "task_id", "start_x_m"):
        for value in episodes[column].to_pylist():
            assert str(value) not in told


def test_a_failing_service_is_logged_apart_and_its_episodes_flown_again(smoke: Path, tmp_path: Path) -> None:
    broken: list[Act] = [Status(503, "overloaded", {"retry-after": "0"})]
    with serving(*broken) as service:
        done = fly(smoke, tmp_path, "openai", service.url, "--attempts", "2", "--limit", "1")
        assert len(service.requests) == 2
        key_is_nowhere(tmp_path, done)
        failures = read_run(tmp_path, "openai", "failures") if (tmp_path / "failures").exists() else None
        assert failures is not None
        assert failures["attempts"].to_pylist() == [2]
        assert "HTTP 503: overloaded" in failures["reason"][0].as_py()
        assert not list((tmp_path / "episodes").rglob("*.parquet")) or read_run(tmp_path, "openai").num_rows == 0
        service.script[:] = [Say(STOP)]
        done = fly(smoke, tmp_path, "openai", service.url, "--attempts", "2", "--limit", "1", "--rerun-failed")
        assert done.returncode == 0, done.stderr
    episodes = read_run(tmp_path, "openai")
    assert episodes["n_actions"].to_pylist() == [1]
    assert episodes["n_invalid"].to_pylist() == [0]


def test_a_refusal_ends_the_run_with_one_line(smoke: Path, tmp_path: Path) -> None:
    with serving(Status(401, "wrong key")) as service:
        done = fly(smoke, tmp_path, "openai", service.url, "--quiet")
        assert len(service.requests) == 1
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert "HTTP 401: wrong key (you sent Bearer [key])" in lines[0]
    assert "Traceback" not in done.stderr
    key_is_nowhere(tmp_path, done)
