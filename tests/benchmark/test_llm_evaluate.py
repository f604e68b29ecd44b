"""Evaluations by a language-model agent: the command, the real package, a real server, a real scene; presets."""

import json
import shlex
import time
from itertools import pairwise

import pytest
from support.command_line import called
from support.llm_server import KEY, Cut, Raw, Say, Status, agent_of, goal_for, observation, serving

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.estimate import estimate
from aerialdojo_gen.benchmark.llm.options import preset, presets
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.runner import Evaluation
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.tables import outcome_cells
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.store.schemas import ACTION_NAMES

TURN, STOP, UNREADABLE = '{"thought": "Look.", "action": "TurnLeft15"}', '{"action": "Stop"}', "I am lost."


def fly(smoke, out, service, *more):
    options = {
        "model": '"m"', "base_url": f'"{service.url}/v1"', "request_retries": 0, "timeout_s": 20, "answer": "text",
        "image_size_px": 32, "input_usd_per_million": 2.0, "output_usd_per_million": 10.0,
    }  # fmt: skip
    given = [word for name, value in options.items() for word in ("--option", f"{name}={value}")]
    command = ("evaluate", "--agent", "openai", "--data", smoke, "--out", out, "--limit", "2", "--workers", "1")
    done = called(*command, "--modality", "semantic", *given, *more, OPENAI_API_KEY=KEY)
    assert "Traceback" not in done.stderr
    assert all(line.isprintable() for line in done.stderr.splitlines())
    is_nowhere(KEY, out, done)
    return done


def is_nowhere(secret, out, done):
    """Not in what was said nor in a file; Parquet packs its pages: as read, too."""
    files = [path for path in out.rglob("*") if path.is_file()]
    assert all(secret.encode() not in path.read_bytes() for path in files)
    tables = ("episodes", "steps", "failures") if (out / "episodes").exists() else ()
    rows = [read_run(out, "openai", table).to_pylist() for table in tables]
    assert secret not in json.dumps(rows) + done.stdout + done.stderr


def test_an_evaluation_logs_what_was_said_and_what_it_cost(smoke, tmp_path):
    # Turn, say something that cannot be read (twice: its repair too), stop.
    said = iter([TURN, UNREADABLE, UNREADABLE, STOP] * 2)
    with serving() as service:
        service.policy = lambda _: next(said)
        done = fly(smoke, tmp_path, service)
    assert done.returncode == 0, done.stderr
    assert len(service.requests) == 8
    episodes = read_run(tmp_path, "openai")
    expected = {"termination": "stop", "n_actions": 3, "n_invalid": 1, "n_requests": 4, "input_tokens": 4000}
    assert episodes.select([*expected]).to_pylist() == [expected] * 2
    assert episodes["cost_usd"].to_pylist() == pytest.approx([(4000 * 2 + 80 * 10) / 1e6] * 2)
    steps = read_run(tmp_path, "openai", "steps")
    assert steps["action"].to_pylist() == [14, None, 0] * 2
    assert steps["answer"].to_pylist() == [TURN, UNREADABLE, STOP] * 2
    (run,) = load_runs(tmp_path)
    assert outcome_cells(run, PROFILES["aerialdojo"])[5:7] == ("2", "8")
    # Defaults too: how many pictures were sent is in the log.
    used = json.loads(episodes["agent_options"][0].as_py())
    assert used | {"history_images": 1, "actions": "sixteen", "image_size_px": 32, "answer": "text"} == used
    timings = read_run(tmp_path, "openai", "timings").to_pylist()
    assert all(0 < row["longest_request_s"] <= row["request_s"] <= row["agent_s"] for row in timings)
    # What went out: nothing that the runner alone may know.
    sent = json.dumps([request["body"] for request in service.requests])
    hidden = [str(value) for name in ("nav_id", "task_id", "start_x_m") for value in episodes[name].to_pylist()]
    assert not [value for value in ("goal_x_m", *hidden) if value in sent]


def test_a_failing_service_is_logged_apart_and_its_episodes_flown_again(smoke, tmp_path):
    more = ("--attempts", "2", "--limit", "1")
    with serving(Status(503, "overloaded\x1b[2J", {"retry-after": "0"})) as service:
        done = fly(smoke, tmp_path, service, *more)
        assert (done.returncode, len(service.requests)) == (1, 2), "none finished"
        (failure,) = read_run(tmp_path, "openai", "failures").to_pylist()
        assert (failure["kind"], failure["attempts"], failure["n_requests"]) == ("server error", 2, 2)
        assert "HTTP 503: overloaded" in failure["reason"]
        last = done.stderr.splitlines()[-1]
        assert last.startswith("error: 1 failed, which count as no episodes: 1 × server error (http://127.0.0.1")
        pasted = last.partition("To fly the failed again: aerialdojo-gen ")[2]
        for given in (f"--data {smoke}", f"--out {tmp_path}", "--attempts 2", "--option 'model=\"m\"'"):
            assert given in pasted
        assert fly(smoke, tmp_path, service, *more, "--rerun-failed").returncode == 1
        with pytest.raises(StoreError, match=r"no finished episode, and 1 that failed: .* --rerun-failed"):
            load_runs(tmp_path, ["openai"])
        service.script[:] = [Say(STOP)]
        done = called(*shlex.split(pasted), OPENAI_API_KEY=KEY)
        assert done.returncode == 0, done.stderr
    assert read_run(tmp_path, "openai").select(["n_actions", "n_invalid"]).to_pylist() == [
        {"n_actions": 1, "n_invalid": 0}
    ]


CONTEXT = "This model's maximum context length is 4096 tokens, your messages have 5000"
# Kinds of failure of a service, by the number of the episode that it strikes; test_llm_agents.py has each.
STRUCK = {
    2: (Status(400, "blocked", {}, "content_filter"), "content filter"),
    4: (Status(400, CONTEXT), "context too long"),
    7: (Raw(b"<html>hello"), "malformed answer"),
    9: (Raw(b'{"choices": 7}'), "malformed answer"),
    10: (Status(500, "broken\nby accident"), "server error"),
    12: (Status(429, "slow down", {"retry-after": "0"}), "rate limit"),
    13: (Cut(), "connection lost"),
}
NO_ACTION = ['{"thought": ' + "9" * 5_000 + ', "action": "Stop"}', "\ud800"]


def striking():
    """Strike episodes at their second step; some others say what no answer is, and stop."""
    episode = -1

    def answer(body):
        nonlocal episode
        said = json.dumps(body)
        if "This answer cannot be read" in said:
            return NO_ACTION[episode % 2]
        if "NOW: step 0;" in said:
            episode += 1
            return TURN
        if episode in STRUCK:
            return STRUCK[episode][0]
        return NO_ACTION[episode % 2] if episode % 5 == 1 and "NOW: step 1;" in said else STOP

    return answer


def test_whatever_a_service_does_a_run_of_sixteen_ends_with_sixteen_rows(smoke, tmp_path):
    # Two failures in a row, of two kinds, do not end it.
    more, n = ("--limit", "16", "--attempts", "1", "--failures-in-row", "2"), len(STRUCK)
    with serving(Say(STOP)) as service:
        service.policy = striking()
        done = fly(smoke, tmp_path, service, *more)
        assert done.returncode == 0, done.stderr
        episodes, failures = read_run(tmp_path, "openai"), read_run(tmp_path, "openai", "failures")
        assert (episodes.num_rows, failures.num_rows) == (16 - n, n)
        assert sorted(failures["kind"].to_pylist()) == sorted(kind for _, kind in STRUCK.values())
        assert not set(episodes["task_id"].to_pylist()) & set(failures["task_id"].to_pylist())
        assert any(reason.endswith("HTTP 500: broken") for reason in failures["reason"].to_pylist())
        assert sum(episodes["n_invalid"].to_pylist()) == len([k for k in range(1, 16, 5) if k not in STRUCK])
        *_, finished, last = done.stderr.splitlines()
        assert f"{16 - n} of 16 episodes finished, {n} failed" in finished
        assert f"{n} failed, which count as no episodes: 2 × malformed answer (" in last
        assert last.endswith(" --rerun-failed")
        assert last.count("(") == 1, "one reason, the most frequent one's"

        service.policy = None
        before = len(service.requests)
        assert fly(smoke, tmp_path, service, *more).returncode == 0
        assert len(service.requests) == before, "not without being asked"
        again = fly(smoke, tmp_path, service, *more, "--rerun-failed")
        assert again.returncode == 0, again.stderr
        assert f"{n} flown now" in again.stderr.splitlines()[-1], "exactly those that failed"
    assert [read_run(tmp_path, "openai", name).num_rows for name in ("episodes", "failures")] == [16, 0]


def test_failures_of_one_kind_in_a_row_end_the_run(smoke, tmp_path):
    retries = ("--limit", "20", "--option", "request_retries=1")
    with serving(Status(400, "no pictures here")) as service:
        more = ("--limit", "20", "--failures-in-row", "3", "--attempts", "4", "--quiet")
        done = fly(smoke, tmp_path, service, *more)
        assert (done.returncode, len(service.requests)) == (1, 3), "what is refused for good is not tried again"
        (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
        assert line.startswith("error: stopped after 3 failures in a row of one kind (bad request).")
        assert "17 not begun: the same command goes on with them" in line
        # The service goes away in the middle: one line, and what was flown stays.
        service.script[:] = [Say(STOP)]
        done = fly(smoke, tmp_path, service, *retries, "--max-tokens", "2100", "--restart")
        assert done.returncode == 0
        assert read_run(tmp_path, "openai").num_rows == 3, "3 x 1,020 tokens are enough"
        assert "stopped at --max-tokens 2100" in done.stderr
    done = fly(smoke, tmp_path, service, *retries)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("error: checked before the run, nothing flown: ")
    assert f"{service.url}/v1: " in last
    assert last.endswith("is the service there, and is base_url right?")
    assert read_run(tmp_path, "openai").num_rows == 3


def test_keys_in_options_stay_out_of_the_log(smoke, tmp_path):
    inner = "a-plain-word-that-nobody-knows"
    body = json.dumps({"api_key": inner, "nested": [{"x-auth-token": "tok-7712ab91f0"}], "metadata": {"k": KEY}})
    with serving(Say(json.dumps({"thought": f"your key is {inner}", "action": "Stop"}))) as service:
        done = fly(smoke, tmp_path, service, "--option", f"extra_body={body}")
    assert done.returncode == 0, done.stderr
    assert service.requests[0]["body"]["api_key"] == inner, "the service gets it all the same"
    for secret in (inner, "tok-7712ab91f0"):
        is_nowhere(secret, tmp_path, done)
    assert "[redacted]" in (tmp_path / "runs" / "openai" / "run.json").read_text()
    assert "your key is [redacted]" in read_run(tmp_path, "openai", "steps")["answer"][0].as_py()


def test_requests_keep_their_pace(smoke, tmp_path):
    """Of one worker: that turns are given out over all is a test of the executors."""
    times = []
    with serving() as service:
        service.policy = lambda _: times.append(time.monotonic()) or STOP
        done = fly(smoke, tmp_path, service, "--limit", "3", "--requests-per-minute", "40")
    assert done.returncode == 0, done.stderr
    # Sent 1.5 s apart; without a pace it is less than half of that.
    assert len(times) == 3
    assert min(b - a for a, b in pairwise(times)) > 0.75
    more = ("--requests-per-minute", "60", "--workers", "1")
    refused = called("evaluate", *more, "--data", smoke, "--out", tmp_path)
    assert (refused.returncode, "agent 'random' has no attribute pace" in refused.stderr) == (2, True)


# Of Table 4.
PAPER = {
    "Qwen3-VL-4B", "InternVL3.5-8B", "Ministral 3 8B", "Phi-4-multimodal", "MiniCPM-V 4.6", "GPT-5.6 Sol", "Grok-4.5",
    "Gemini 3.8 Flash", "Claude Opus 5",
}  # fmt: skip


def test_the_papers_nine_are_there_and_take_so_many_pictures():
    assert sorted(p.title for p in presets().values() if p.paper) == sorted(PAPER)
    with pytest.raises(UsageError, match="did you mean 'qwen3-vl-4b'"):
        preset("qwen3-vl-4bb")
    with pytest.raises(UsageError, match="7 pictures, more than max_pictures = 4"):
        load_agent("openai", **preset("qwen3-vl-4b").options | {"history_images": 4})


@pytest.mark.parametrize("name", presets())
def test_a_preset_flies(name, monkeypatch):
    found = preset(name)
    key = f"key-of-{name}-0123456789"
    monkeypatch.setenv(found.options.get("key_env", f"{found.agent.upper()}_API_KEY"), key)
    options = {name: value for name, value in found.options.items() if name != "base_url"} | {"actions": "eight"}
    with serving(Say('{"thought": "Higher.", "action": "MoveUp"}')) as service:
        agent = agent_of(found.agent, service, **options)
        agent.check()
        agent.reset(goal_for(agent, image=True))
        assert [agent.act(observation(step)) for step in range(2)] == [ACTION_NAMES.index("MoveUp1")] * 2
    body, headers = (service.requests[-1][part] for part in ("body", "headers"))
    assert body["model"] == found.options["model"]
    assert key in headers.get("authorization", "") + headers.get("x-api-key", "")
    parts = [part for m in body["messages"] for part in m["content"]]
    pictures = [part for part in parts if isinstance(part, dict) and "text" not in part]
    assert len(pictures) == agent.options.pictures <= (agent.options.max_pictures or 20)
    if found.served in ("vLLM", "Ollama"):
        assert found.options["base_url"].startswith("http://127.0.0.1:")
        assert found.options["model"] in str(found.serve) or "lora" in str(found.serve)


def test_an_evaluation_is_estimated_by_real_requests_or_by_reckoning(smoke):
    prices = {"input_usd_per_million": 1.0, "output_usd_per_million": 10.0}
    with serving(Say('{"action": "TurnLeft15"}', usage=(500, 30))) as service:
        options = {"model": "m", "base_url": service.url + "/v1", "image_size_px": 32} | prices
        job = Evaluation("r", "openai", options, Selection(settings=("base",), modalities=("semantic",), limit=5))
        found = estimate(smoke, job)
        assert (found.episodes, found.tokens_in, found.tokens_out) == (5, 500, 30)
        assert found.measured == len(service.requests)
        assert found.measured > 2
        assert found.requests[1] == 5 * 90
        assert 5 * 2 <= found.requests[0] < found.requests[1]
        assert found.cost_usd == pytest.approx([n * (500 + 300) / 1e6 for n in found.requests])
        assert "million tokens" in found.lines(2)[-1]
        assert found.request_s > 0
        service.refuses = lambda _: Status(503, "loading")
        reckoned = estimate(smoke, job)
        assert (reckoned.measured, len(service.requests)) == (0, found.measured)
        assert "HTTP 503: loading" in reckoned.lines(1)[1]
        assert 300 < reckoned.tokens_in < 3_000
    with pytest.raises(UsageError, match="not 'random'"):
        estimate(smoke, Evaluation("r", "random", {}, Selection(limit=1)))
