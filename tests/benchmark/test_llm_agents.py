"""The language-model agents: the real client packages against a real server on 127.0.0.1, which does all wrong."""

import base64
import email.utils
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
    PROTOCOLS,
    Call,
    Cut,
    Drip,
    Endless,
    Filtered,
    Hang,
    Raw,
    Say,
    Status,
    Trickle,
    agent_of,
    begun,
    goal_for,
    observation,
    serving,
)

from aerialdojo_gen.base import llm_client
from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError
from aerialdojo_gen.base.llm_client import retry_after_s
from aerialdojo_gen.benchmark.agents import AgentUnavailable, InvalidAnswer, ServiceDown, load_agent
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


def test_an_answer_that_the_filter_took_and_what_is_no_count():
    for name, error in (("openai", AgentUnavailable), ("anthropic", InvalidAnswer)):
        with serving(Filtered()) as service, pytest.raises(error):
            begun(name, service).act(observation())
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


LARGE = b'{"choices": [], "usage": {"prompt_tokens": ' + b"9" * 5_000 + b"}}"
DEEP = b'{"a":' * 100_000 + b"1" + b"}" * 100_000
TOO_LONG = "This model's maximum context length is 4096 tokens"
# What the server does; what is said of it, its kind, and how long the service asks to wait.
FAILURES = {
    "429": (Status(429, "slow down", {"retry-after": "7"}), r"HTTP 429: slow down", "rate limit", 7.0),
    "503": (Status(503, "later", {"retry-after": "0.5"}), r"HTTP 503: later", "server error", 0.5),
    "cut": (Cut(), r"http://127\.0\.0\.1:\d+.*: \w+", "connection lost", None),
    "hang": (Hang(), r"no complete answer within 0\.4 s", "time-out", None),
    "body trickles": (Drip(), r"no complete answer within 0\.4 s", "time-out", None),
    "headers trickle": (Trickle(), r"no complete answer within 0\.4 s", "time-out", None),
    "huge": (Endless(), r"larger than 4 MiB", "malformed answer", None),
    "no json": (Raw(b"<html>hello</html>", "text/html"), r"base_url right.*hello", "malformed answer", None),
    "large number": (Raw(LARGE), r"its answer is no JSON", "malformed answer", None),
    "deep json": (Raw(DEEP), r"its answer is no JSON", "malformed answer", None),
    "other json": (Raw(b'{"choices": null, "content": null}'), r"base_url right", "malformed answer", None),
    "choices no list": (Raw(b'{"choices": {"0": 1}, "content": {}}'), r"base_url right", "malformed answer", None),
    "400": (Status(400, "bad picture"), r"HTTP 400: bad picture", "bad request", None),
    "filtered": (Status(400, "no", {}, "content_filter"), r"HTTP 400: no", "content filter", None),
    "too long": (Status(400, TOO_LONG), r"maximum context", "context too long", None),
    "404 of a picture": (Status(404, "the image was not found"), r"HTTP 404", "not found", None),
}
WITHOUT_AGAIN = ("malformed answer", "bad request", "content filter", "context too long", "not found")


# The protocols have the connection in common; where its answer is looked at they have not.
OF_BOTH = ("429", "hang", "no json", "other json", "choices no list", "filtered", "too long")


@pytest.mark.parametrize(
    ("protocol", "name"), [*(("openai", name) for name in FAILURES), *(("anthropic", name) for name in OF_BOTH)]
)
def test_a_failure_of_the_service_is_no_failure_of_the_agent(protocol, name):
    act, message, kind, asked_s = FAILURES[name]
    with serving(act) as service:
        slow = {"timeout_s": 0.4} if kind == "time-out" else {}
        agent = begun(protocol, service, **slow)
        with pytest.raises(AgentUnavailable, match=message) as failure:
            agent.act(observation())
        assert failure.value.retry_after_s == asked_s
        assert (failure.value.kind, failure.value.again) == (kind, kind not in WITHOUT_AGAIN)
        assert len(service.requests) == 1, "the package tried again by itself"
        said = "".join(traceback.format_exception(failure.value)) + repr(failure.value)
        assert KEY not in said
        assert "\n" not in str(failure.value)


def test_a_service_that_is_not_there_ends_the_run(protocol):
    with serving() as service:
        pass
    agent = begun(protocol, service)
    with pytest.raises(ServiceDown, match=r"refused.*is the service there"):
        agent.act(observation())
    nowhere = agent_of(protocol, service, base_url="http://no-such-host.invalid/v1")
    with pytest.raises(ServiceDown, match=r"no-such-host\.invalid.*is the service there"):
        nowhere.check()


def test_requests_are_sent_again_as_often_as_asked(protocol, monkeypatch):
    waits = []
    monkeypatch.setattr(llm_client.time, "sleep", waits.append)
    with serving(Status(500), Status(429, "m", {"retry-after": "11"}), Status(502), Say(MOVE)) as service:
        agent = begun(protocol, service, request_retries=3)
        assert agent.act(observation()) == FORWARD_3
        assert len(service.requests) == 4
        assert service.requests[0]["body"] == service.requests[3]["body"]
    assert waits == [1.0, 11.0, 4.0]
    with serving(Status(429, "m", {"retry-after": "3600"})) as service:
        # An hour is the runner's affair.
        with pytest.raises(AgentUnavailable) as failure:
            begun(protocol, service, request_retries=3).act(observation())
        assert (failure.value.retry_after_s, len(service.requests)) == (3600.0, 1)


def test_the_check_does_not_wait_twice():
    with serving() as service:
        service.refuses = lambda _: Hang()
        with pytest.raises(AerialDojoError, match=r"nothing flown: .*no complete answer within 0.4 s: is it busy"):
            begun("openai", service, request_retries=3, timeout_s=0.4).check()
        assert len(service.checks) == 1
        first = iter([Status(503, "one moment", {"retry-after": "0"})])
        service.refuses = lambda _: next(first, None)
        assert "answers in" in begun("anthropic", service).check()
        assert len(service.checks) == 3, "what may pass is asked once more"


KEY_RIGHT, PAID, SERVED = (
    "is the key in [A-Z]+_API_KEY right", "has the account anything left", "is --option model=m served there"
)  # fmt: skip


# 307: a redirect would carry the key to wherever it points.
@pytest.mark.parametrize(
    ("protocol", "code", "error", "mend"),
    [
        *((protocol, 401, "x", KEY_RIGHT) for protocol in PROTOCOLS),
        ("openai", 402, "x", PAID),
        ("openai", 403, "x", KEY_RIGHT),
        ("openai", 404, "x", SERVED),
        *((protocol, 404, "model_not_found", SERVED) for protocol in PROTOCOLS),
        *((protocol, 307, "x", "it sends requests elsewhere") for protocol in PROTOCOLS),
        ("openai", 429, "insufficient_quota", PAID),
        ("openai", 400, "api_key_invalid", KEY_RIGHT),
    ],
)
def test_a_refusal_for_good_ends_the_run_with_one_line(protocol, code, error, mend):
    status = Status(code, "no such thing", {"location": "http://127.0.0.1:1/elsewhere"}, error)
    with serving(status) as service:
        said = rf"HTTP {code}: .*no such thing \(you sent .*\[key\]\): {mend}"
        with pytest.raises(ServiceDown, match=said) as failure:
            begun(protocol, service, request_retries=3).act(observation())
        service.refuses = lambda _: status
        with pytest.raises(ServiceDown, match=rf"checked before the run, nothing flown: {service.url}.*{said}"):
            begun(protocol, service, request_retries=3).check()
        assert (len(service.checks), len(service.requests)) == (1, 1)
    assert KEY not in "".join(traceback.format_exception(failure.value))


def test_retry_after_is_read_in_both_of_its_forms():
    assert retry_after_s({"retry-after": "12.5"}) == 12.5
    later = email.utils.format_datetime(email.utils.localtime().replace(microsecond=0), usegmt=False)
    assert retry_after_s({"retry-after": later}) == pytest.approx(0.0, abs=1.0)
    assert retry_after_s({"retry-after": "-3"}) == 0.0
    for nonsense in ("", "soon", "inf", "nan"):
        assert retry_after_s({"retry-after": nonsense}) is None
