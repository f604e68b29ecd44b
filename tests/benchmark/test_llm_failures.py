"""What a language model's service can do wrong: each failure is named, retried or ends the run, and tells no key."""

import email.utils
import traceback

import pytest
from support.llm_server import (
    FORWARD_3,
    KEY,
    MOVE,
    PROTOCOLS,
    Cut,
    Drip,
    Endless,
    Hang,
    Raw,
    Say,
    Status,
    Trickle,
    agent_of,
    begun,
    observation,
    serving,
)

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.llm_client import service as services
from aerialdojo_gen.base.llm_client.http import retry_after_s
from aerialdojo_gen.benchmark.agents import AgentUnavailable, ServiceDown

pytestmark = pytest.mark.usefixtures("keys")
LARGE = b'{"choices": [], "usage": {"prompt_tokens": ' + b"9" * 5_000 + b"}}"
DEEP = b'{"a":' * 100_000 + b"1" + b"}" * 100_000
TOO_LONG = "This model's maximum context length is 4096 tokens"
# What the server does; what is said of it, its kind, and how long the service asks to wait.
FAILURES = {
    "429": (Status(429, "slow down", {"retry-after": "7"}), r"HTTP 429: slow down", "rate limit", 7.0),
    "500": (Status(500), r"HTTP 500: something is wrong", "server error", None),
    "503": (Status(503, "later", {"retry-after": "0.5"}), r"HTTP 503: later", "server error", 0.5),
    "cut": (Cut(), r"http://127\.0\.0\.1:\d+.*: \w+", "connection lost", None),
    "hang": (Hang(), r"no complete answer within 0\.4 s", "time-out", None),
    "body trickles": (Drip(), r"no complete answer within 0\.4 s", "time-out", None),
    "headers trickle": (Trickle(), r"no complete answer within 0\.4 s", "time-out", None),
    "huge": (Endless(), r"larger than 4 MiB", "malformed answer", None),
    "huge error": (Endless(500), r"larger than 4 MiB", "malformed answer", None),
    "no json": (Raw(b"<html>hello</html>", "text/html"), r"base_url right.*hello", "malformed answer", None),
    "broken json": (Raw(b'{"choices": ['), r"its answer is no JSON", "malformed answer", None),
    "large number": (Raw(LARGE), r"its answer is no JSON", "malformed answer", None),
    "deep json": (Raw(DEEP), r"its answer is no JSON", "malformed answer", None),
    "empty": (Raw(b"{}"), r"base_url right", "malformed answer", None),
    "other json": (Raw(b'{"choices": null, "content": null}'), r"base_url right", "malformed answer", None),
    "choices no list": (Raw(b'{"choices": {"0": 1}, "content": {}}'), r"base_url right", "malformed answer", None),
    "400": (Status(400, "bad picture"), r"HTTP 400: bad picture", "bad request", None),
    "filtered": (Status(400, "no", {}, "content_filter"), r"HTTP 400: no", "content filter", None),
    "too long": (Status(400, TOO_LONG), r"maximum context", "context too long", None),
    "413": (Status(413, "large"), r"HTTP 413", "context too long", None),
    "422": (Status(422, "what"), r"HTTP 422: what", "bad request", None),
    "404 of a picture": (Status(404, "the image was not found"), r"HTTP 404", "not found", None),
}
WITHOUT_AGAIN = ("malformed answer", "bad request", "content filter", "context too long", "not found")


# The protocols have the connection in common; where its answer is looked at they have not.
OF_BOTH = ("429", "hang", "broken json", "empty", "other json", "choices no list", "filtered", "too long")


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
    monkeypatch.setattr(services.time, "sleep", waits.append)
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
