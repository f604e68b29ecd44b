"""A server on 127.0.0.1 that speaks OpenAI's chat protocol and Anthropic's, and errs on demand; its agents."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np

from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent
from aerialdojo_gen.store.schemas import ACTION_NAMES

MOVE = '{"thought": "Nothing here.", "action": "MoveForward3"}'


@dataclass(frozen=True)
class Say:
    """A proper answer of the model."""

    text: str
    usage: tuple[int, int] | None = (1000, 20)


@dataclass(frozen=True)
class Call:
    """A tool call: the model answers by arguments."""

    arguments: str
    usage = (1000, 20)


class Filtered:
    """A content filter has taken the answer away."""

    usage = (1000, 20)


@dataclass(frozen=True)
class Status:
    """An error of the service."""

    code: int
    message: str = "something is wrong"
    headers: dict[str, str] = field(default_factory=dict)
    error: str = "error"


@dataclass(frozen=True)
class Raw:
    """Any bytes with status 200, or another."""

    body: bytes
    content_type: str = "application/json"
    code: int = 200


@dataclass(frozen=True)
class Endless:
    """A body without end."""

    code: int = 200


class Drip:
    """A byte now and then, for ever: no single read takes long."""


class Trickle:
    """Headers of 8 bytes every 20 ms: no single read takes long."""


class Hang:
    """No answer at all."""


class Cut:
    """The connection is cut in the middle of an answer."""


Act = Say | Call | Filtered | Status | Raw | Endless | Drip | Trickle | Hang | Cut


@dataclass
class Service:
    """What the server does next, and what it was asked: path, headers (lower case) and JSON body of every request."""

    url: str  # Without a path
    script: list[Act]  # Done one a request; the last one for ever
    requests: list[dict[str, Any]]  # Of a flight
    stop: threading.Event
    policy: Callable[[dict[str, Any]], str | Act] | None = None  # Answers by the body, in place of the script
    checks: list[dict[str, Any]] = field(default_factory=list)  # The requests of checks before a run
    refuses: Callable[[dict[str, Any]], Act | None] | None = None  # Answers a check by its body


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    service: Service

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["content-length"])))
        headers = {k.lower(): v for k, v in self.headers.items()}
        seen = {"path": self.path, "headers": headers, "body": body}
        if "This is a test of the connection" in json.dumps(body):
            self.service.checks.append(seen)
            refuses = self.service.refuses
            answer = (Call if "tools" in body else Say)('{"thought": "a test", "action": "Stop"}')
            act: Act = (refuses(body) if refuses else None) or answer
        else:
            self.service.requests.append(seen)
            policy, script = self.service.policy, self.service.script
            said = policy(body) if policy else script.pop(0) if len(script) > 1 else script[0]
            act = Say(said) if isinstance(said, str) else said
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.play(act, anthropic=self.path == "/v1/messages")

    def play(self, act: Act, anthropic: bool) -> None:
        if isinstance(act, Say | Call | Filtered):
            self.send(200, _message(act) if anthropic else _completion(act))
        elif isinstance(act, Status):
            # A careless service: it sends back all that it was sent.
            key = self.headers.get("authorization", "") + self.headers.get("x-api-key", "")
            error = {"type": act.error, "message": f"{act.message} (you sent {key})"}
            self.send(act.code, json.dumps({"type": "error", "error": error}).encode(), act.headers)
        elif isinstance(act, Raw):
            self.send(act.code, act.body, {"content-type": act.content_type})
        elif isinstance(act, Cut):
            self.send(200, b'{"id": "x", ', {"content-length": "1000"})
            self.close_connection = True
        elif isinstance(act, Trickle):
            self.wfile.write(b"HTTP/1.1 200 OK\r\n")
            # It ends, so that a client without a deadline fails instead of hanging.
            for k in range(500):
                self.wfile.write(b"X-%03d:\r\n" % k)
                if self.service.stop.wait(0.02):
                    break
            self.close_connection = True
        elif isinstance(act, Hang):
            self.service.stop.wait(30)
            self.close_connection = True
        else:
            self.send_response(act.code if isinstance(act, Endless) else 200)
            self.send_header("content-type", "application/json")
            self.end_headers()
            chunk, pause_s = (b" " * 65536, 0.0) if isinstance(act, Endless) else (b" ", 0.05)
            while not self.service.stop.wait(pause_s):
                self.wfile.write(chunk)
                self.wfile.flush()
            self.close_connection = True

    def send(self, code: int, body: bytes, headers: dict[str, str] | None = None) -> None:
        self.send_response(code)
        usual = {"content-type": "application/json", "content-length": str(len(body))}
        for name, value in (usual | (headers or {})).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing on stderr."""


def _completion(said: Say | Call | Filtered) -> bytes:
    message: dict[str, Any] = {"role": "assistant", "content": said.text if isinstance(said, Say) else None}
    if isinstance(said, Call):
        function = {"name": "act", "arguments": said.arguments}
        message["tool_calls"] = [{"id": "call_1", "type": "function", "function": function}]
    reason = "content_filter" if isinstance(said, Filtered) else "stop"
    value: dict[str, Any] = {
        "id": "chatcmpl-1", "object": "chat.completion", "created": 1, "model": "m",
        "choices": [{"index": 0, "message": message, "finish_reason": reason}],
    }  # fmt: skip
    if said.usage:
        into, out = said.usage
        value["usage"] = {"prompt_tokens": into, "completion_tokens": out, "total_tokens": into + out}
    return json.dumps(value).encode()


def _message(said: Say | Call | Filtered) -> bytes:
    content: list[dict[str, Any]] = []
    if isinstance(said, Say):
        content = [{"type": "text", "text": said.text}]
    elif isinstance(said, Call):
        content = [{"type": "tool_use", "id": "toolu_1", "name": "act", "input": json.loads(said.arguments)}]
    value: dict[str, Any] = {
        "id": "msg_1", "type": "message", "role": "assistant", "model": "m", "stop_reason": "end_turn",
        "stop_sequence": None, "content": content,
    }  # fmt: skip
    if said.usage:
        value["usage"] = dict(zip(("input_tokens", "output_tokens"), said.usage, strict=True))
    return json.dumps(value).encode()


@contextlib.contextmanager
def serving(*script: Act) -> Iterator[Service]:
    """Run the server in a thread."""
    stop = threading.Event()
    handler = type("Handler", (_Handler,), {})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    service = Service(f"http://127.0.0.1:{server.server_port}", list(script) or [Say(MOVE)], [], stop)
    handler.service = service  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield service
    finally:
        stop.set()
        server.shutdown()
        server.server_close()
        thread.join()


KEY = "sk-test-51f0c1e7a9b24d6e8f30"
FORWARD_3 = ACTION_NAMES.index("MoveForward3")
PROTOCOLS = ["openai", "anthropic"]


def agent_of(protocol: str, service: Service, **options: Any) -> LanguageModelAgent:
    base_url = service.url + ("/v1" if protocol == "openai" else "")
    given = {"model": "m", "base_url": base_url, "timeout_s": 5.0, "request_retries": 0} | options
    agent = load_agent(protocol, **given)
    assert isinstance(agent, LanguageModelAgent)
    return agent


def goal_for(agent: LanguageModelAgent, image: bool = False) -> Goal:
    picture = np.full((8, 8, 3), 200, np.uint8) if image else None
    kind, text = ("image", None) if image else ("semantic", "A van.")
    return Goal(kind, "red van", "clock tower", "north", text, picture, Rules(90, sensors=agent.sensors))


def observation(step: int = 0, views: tuple[str, ...] = ("front",)) -> Observation:
    rgb = {view: np.full((64, 64, 3), 40 * k, np.uint8) for k, view in enumerate(views)}
    depth = {view: np.full((64, 64), 10.0 + k, np.float32) for k, view in enumerate(views)}
    return Observation(step, 90 - step, False, rgb, depth)


def begun(protocol: str, service: Service, **options: Any) -> LanguageModelAgent:
    agent = agent_of(protocol, service, **options)
    agent.reset(goal_for(agent))
    return agent
