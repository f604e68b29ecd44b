"""The language-model agents: the real client packages against a real server on 127.0.0.1."""

import base64
import json
import logging
import sys
import traceback

import cv2
import numpy as np
import pytest
from support.llm_server import (
    FORWARD_3,
    KEY,
    MOVE,
    Call,
    Filtered,
    Raw,
    Say,
    Status,
    agent_of,
    begun,
    goal_for,
    observation,
    serving,
)

from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError
from aerialdojo_gen.benchmark.agents import AgentUnavailable, InvalidAnswer, load_agent
from aerialdojo_gen.benchmark.llm.answer import parse_answer
from aerialdojo_gen.store.schemas import ACTION_NAMES, STOP

pytestmark = pytest.mark.usefixtures("keys")


def parts_of(request):
    messages = request["body"]["messages"]
    return [part for m in messages if m["role"] == "user" for part in m["content"]]


def texts_of(request):
    return "\n".join(part["text"] for part in parts_of(request) if part["type"] == "text")


def pictures_of(request):
    found = []
    for part in parts_of(request):
        if part["type"] != "text":
            data = part["source"]["data"] if part["type"] == "image" else part["image_url"]["url"].split(",", 1)[1]
            found.append(cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED))
    return found


def test_a_normal_answer_becomes_an_action(protocol):
    with serving(Say(MOVE), Say('{"action": "Stop"}')) as service:
        agent = begun(protocol, service, input_usd_per_million=2.0, output_usd_per_million=10.0, temperature=0.5)
        assert agent.act(observation(0)) == FORWARD_3
        assert agent.answer() == MOVE
        assert agent.act(observation(1)) == STOP
        usage = agent.usage()
        assert (usage.requests, usage.input_tokens, usage.output_tokens) == (2, 2000, 40)
        assert usage.cost_usd == pytest.approx((2000 * 2 + 40 * 10) / 1e6)
        agent.reset(goal_for(agent))
        assert agent.usage().requests == 0
    first, second = service.requests
    assert first["path"] == {"openai": "/v1/chat/completions", "anthropic": "/v1/messages"}[protocol]
    assert (first["body"]["temperature"], first["body"]["max_tokens"]) == (0.5, 1024)
    assert any(KEY in value for name, value in first["headers"].items() if name in ("authorization", "x-api-key"))
    # The system prompt, the goal, and what is seen, with its budget; then what was done.
    assert "You pilot a small drone" in json.dumps(first["body"])
    assert "TARGET: red van" in texts_of(first)
    assert "step 0; 90 actions left" in texts_of(first)
    assert "YOUR LAST ACTIONS" not in texts_of(first)
    assert "- step 0: MoveForward3. Nothing here." in texts_of(second)
    colour, depth = pictures_of(first)
    assert (colour.shape, depth.shape) == ((64, 64, 3), (64, 64))
    assert (depth == round(10 / 50 * 255)).all()


def test_what_is_sent_follows_the_options(protocol):
    with serving(Say(MOVE)) as service:
        views = ("front", "down")
        agent = agent_of(
            protocol, service, views="front,down", depth=False, image_size_px=32, history=2,
            max_tokens=99, extra_body={"seed": 7},
        )  # fmt: skip
        assert (agent.sensors.views, agent.sensors.depth, agent.sensors.width) == (views, False, 32)
        agent.reset(goal_for(agent, image=True))
        for step in range(4):
            agent.act(observation(step, views))
    last = service.requests[-1]
    assert (last["body"]["max_tokens"], last["body"]["seed"]) == (99, 7)
    assert "temperature" not in last["body"]
    done = [line.partition(":")[0] for line in texts_of(last).splitlines() if line.startswith("- step")]
    assert done == ["- step 1", "- step 2"]
    # The goal's picture, that of the step before, and two views.
    assert [p.shape for p in pictures_of(last)] == [(8, 8, 3), (32, 32, 3), (32, 32, 3), (32, 32, 3)]
    assert [float(p.mean()) for p in pictures_of(last)] == pytest.approx([200, 0, 0, 40], abs=2)
    assert "Earlier, at step 2, front camera" in texts_of(last)
    assert "depth" not in texts_of(last)


@pytest.mark.parametrize("bad", ["Let me think. " + MOVE, '{"action": "Fly"}', "", "half a pair \ud800"])
def test_an_unreadable_answer_gets_one_attempt_at_repair(protocol, bad):
    with serving(Say(bad), Say(MOVE)) as service:
        agent = begun(protocol, service)
        assert agent.act(observation()) == FORWARD_3
        usage = agent.usage()
        assert (usage.requests, usage.input_tokens, usage.cost_usd) == (2, 2000, None), "no prices"
    messages = [m for m in service.requests[1]["body"]["messages"] if m["role"] != "system"]
    assert [m["role"] for m in messages] == ["user", "assistant", "user"]
    assert bad.partition("\ud800")[0] in json.dumps(messages[1], ensure_ascii=False).replace('\\"', '"')
    with pytest.raises(InvalidAnswer) as refused:
        parse_answer(bad)
    assert f"This answer cannot be read: {refused.value}" in texts_of(service.requests[1])


def test_what_cannot_be_read_is_said_never_guessed(protocol):
    with serving(Say("I stop."), Say("Stop!"), Say(MOVE)) as service:
        agent = begun(protocol, service)
        with pytest.raises(InvalidAnswer, match="not one JSON object"):
            agent.act(observation(0))
        assert agent.answer() == "Stop!"
        assert len(service.requests) == 2
        # The episode goes on, and the model is told.
        assert agent.act(observation(1)) == FORWARD_3
    assert "- step 0: none (the answer could not be read)" in texts_of(service.requests[-1])


@pytest.mark.parametrize(("protocol", "error"), [("openai", AgentUnavailable), ("anthropic", InvalidAnswer)])
def test_an_answer_that_the_filter_took_is_the_services(protocol, error):
    with serving(Filtered()) as service, pytest.raises(error):
        begun(protocol, service).act(observation())


def test_what_is_no_count_is_none():
    bad = Raw(b'{"choices": [{"message": {"content": "x"}}], "usage": {"prompt_tokens": 1e400}}')
    with serving(bad) as service:
        agent = begun("openai", service)
        with pytest.raises(InvalidAnswer):
            agent.act(observation())
        assert agent.usage().input_tokens is None
    with serving(Say(MOVE, usage=None)) as service:
        agent = begun("openai", service, input_usd_per_million=2.0, output_usd_per_million=10.0)
        agent.act(observation())
        assert (agent.usage().input_tokens, agent.usage().cost_usd) == (None, None)


FORMS = {
    ("openai", "json"): lambda body: body["response_format"]["json_schema"]["schema"],
    ("openai", "tool"): lambda body: body["tools"][0]["function"]["parameters"],
    ("anthropic", "json"): lambda body: body["output_config"]["format"]["schema"],
    ("anthropic", "tool"): lambda body: body["tools"][0]["input_schema"],
    ("openai", "text"): None,
    ("anthropic", "text"): None,
}


@pytest.mark.parametrize(("protocol", "form"), FORMS)
def test_the_answer_is_asked_for_as_the_option_says(protocol, form):
    answer, schema_in = '{"thought": "so", "action": "MoveUp"}', FORMS[protocol, form]
    with serving(Call(answer) if form == "tool" else Say(answer)) as service:
        agent = begun(protocol, service, answer=form, actions="eight", climb_m=2)
        assert agent.act(observation()) == ACTION_NAMES.index("MoveUp2")
        body = service.requests[0]["body"]
    if schema_in is None:
        assert not {"response_format", "tools", "output_config"} & set(body)
    else:
        assert schema_in(body) == agent.options.action_set.schema()


def test_the_check_settles_how_answers_are_asked_for(protocol):
    def only(*refused):
        return lambda body: Status(400, "unknown field") if set(refused) & set(body) else None

    with serving() as service:
        first = {"openai": "json", "anthropic": "tool"}[protocol]
        agent = agent_of(protocol, service)
        assert agent.check().endswith(f"by {first}")
        assert agent.settled() == {"answer": first}
        service.refuses = only("response_format", "output_config", "tools")
        agent = agent_of(protocol, service)
        assert "by text" in agent.check()
        assert agent.used_options()["answer"] == "text"
        assert agent.used_options()["history_images"] == 1
        # What was asked for by name is not exchanged for something else.
        service.refuses = only("tools")
        with pytest.raises(AerialDojoError, match=r"checked before the run, nothing flown: .*HTTP 400"):
            agent_of(protocol, service, answer="tool").check()
        service.refuses = lambda _: Status(503, "loading")
        with pytest.raises(AerialDojoError, match="HTTP 503: loading"):
            agent_of(protocol, service).check()
        service.refuses = lambda _: Say("Hello!", usage=None if protocol == "openai" else (1, 1))
        agent = agent_of(protocol, service)
        assert "by text" in agent.check(), "a service that ignores the form is asked by text"
        assert agent.tells_tokens == (protocol == "anthropic")


def test_the_key_stays_out_of_answers_and_logs(protocol, caplog):
    echo = json.dumps({"thought": f"your key is {KEY}", "action": "Stop"})
    with caplog.at_level(logging.DEBUG), serving(Status(500), Say(echo), Say("no")) as service:
        agent = begun(protocol, service, request_retries=1)
        agent.act(observation(0))
        kept = [agent.answer()]
        with pytest.raises(InvalidAnswer) as failure:
            agent.act(observation(1))
        kept += ["".join(traceback.format_exception(failure.value)), repr(vars(agent)["options"]), repr(agent)]
        assert "your key is [key]" in str(kept[0])
        assert KEY not in str(kept)
        assert KEY not in json.dumps([r["body"] for r in service.requests])
    assert caplog.records, "the packages log nothing at all: this test sees nothing"
    assert KEY not in caplog.text


def test_keys_come_from_the_environment(protocol, monkeypatch):
    variable = f"{protocol.upper()}_API_KEY"
    with serving() as service:
        monkeypatch.delenv(variable)
        with pytest.raises(UsageError, match=f"no API key: set {variable}"):
            load_agent(protocol, model="m")
        # A service of one's own may do without.
        assert begun(protocol, service).act(observation()) == FORWARD_3
        monkeypatch.setenv(variable, "sk-bad\nkey")
        with pytest.raises(UsageError, match=f"{variable} has characters") as failure:
            agent_of(protocol, service)
        assert "bad" not in str(failure.value)
        with pytest.raises(UsageError, match="unknown key 'api_key'"):
            agent_of(protocol, service, api_key=KEY)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "model"),
        ({"model": "m", "extra_body": "sk-live-0123456789abcdef0123"}, r"extra_body = .*\[redacted\]"),
        ({"model": "m", "modle": "x"}, "unknown key 'modle': did you mean 'model'"),
        ({"model": "m", "temperature": 3}, "temperature"),
        ({"model": "m", "base_url": "ftp://x/v1"}, "base_url.*not a URL"),
        ({"model": "m", "base_url": "http://[::1/v1"}, "base_url.*not a URL"),
        ({"model": "m", "base_url": "https://user:pw@x/v1"}, "base_url.*keys come from the environment"),
        ({"model": "m", "base_url": "https://x/v1?key=1"}, "base_url.*keys come from the environment"),
    ],
)
def test_wrong_options_are_named_in_one_line(options, message):
    with pytest.raises(UsageError, match=message) as failure:
        load_agent("openai", **options)
    assert "\n" not in str(failure.value)
    assert ":pw@" not in str(failure.value)


def test_a_missing_package_is_named_with_its_extra(protocol, monkeypatch):
    monkeypatch.setitem(sys.modules, protocol, None)
    with pytest.raises(MissingPackage, match=rf"lacks the package {protocol}: pip install 'aerialdojo-gen\[llm\]'"):
        load_agent(protocol, model="m")
