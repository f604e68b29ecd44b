"""An agent that asks a multimodal language model for every action; what the two protocols have in common."""

from __future__ import annotations

import re
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from aerialdojo_gen.base.errors import AerialDojoError, AgentUnavailable, ServiceDown, UsageError
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.llm_client import Connection, Meter
from aerialdojo_gen.base.pictures import Picture, colour_picture, depth_picture
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents.base import AgentBase, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Sensors
from aerialdojo_gen.benchmark.llm.answer import parse_answer
from aerialdojo_gen.benchmark.llm.options import Form, Options
from aerialdojo_gen.benchmark.llm.prompt import Turn, goal_text, repair_text, step_text, system_prompt

# By the kind of a failure that is met in the check before a run.
_BY_KIND = {
    "time-out": "is it busy, or loading its model? Try again, or with a longer --option timeout_s=…",
    "rate limit": "wait, or use another account",
    "bad request": "does it take pictures, and the options model, answer, max_tokens, extra_body?",
    "malformed answer": "is base_url right?",
}
_STATUS = re.compile(r": HTTP (\d{3}): ")


def _remedy(error: UsageError, model: str, key_variable: str) -> str:
    status = _STATUS.search(str(error))
    code = status[1] if status else ""
    if code == "404":
        return f"is --option model={model} served there, and is base_url right?"
    if code.startswith("3"):
        return "it sends requests elsewhere: is base_url right?"
    if code in ("402", "429"):
        return "has the account anything left to spend?"
    return f"is the key in {key_variable} right, and may it use model={model}?"


# An answer that is shown again for repair, or kept in the log: enough to see what is wrong with it.
_KEPT_CHARACTERS = 4_000
# More tokens than any request has: what a service counts beyond this it has not counted.
_MAX_TOKENS = 1 << 40
# What a service answers that does not know structured outputs, or tool calls.
_UNSUPPORTED = ("bad request", "not found", "malformed answer", "server error")
# What may be over a moment later, and how long the check before a run waits for that, seconds.
_TRANSIENT = ("rate limit", "server error", "connection lost", "malformed answer")
_PATIENCE_S = 10.0


Schema = Mapping[str, Any]


@dataclass(frozen=True)
class Message:
    """What is said, by whom."""

    role: str  # user or assistant
    parts: tuple[str | Picture, ...]  # In their order


@dataclass(frozen=True)
class Reply:
    """What a service answers."""

    text: str  # All the text of it, or the arguments of its tool call
    input_tokens: int | None = None  # Where the service says
    output_tokens: int | None = None


class LanguageModelAgent(AgentBase, ABC):
    """Asks a model for every action: all it knows in one message, strictly parsed, with one attempt at repair.

    An answer that cannot be read even then raises `InvalidAnswer`: it is counted, it spends one action, and the drone
    stays where it is. That is the fairest of the alternatives: an action guessed at would not be the model's, and
    ending the episode would weigh one slip in 300 steps like a crash.

    Subclasses speak a protocol: they name its package, word a request and read its answer.
    """

    package = ""
    # In the order in which the check before a run tries them.
    forms: tuple[Form, ...] = ("json", "tool", "text")

    def __init__(self, **options: Any) -> None:
        self._secrets = Secrets(options)
        try:
            self.options = Options.model_validate(options)
        except ValidationError as error:
            raise UsageError(self._secrets.text("; ".join(explain(error, Options)))) from None
        o = self.options
        self.form: Form = "text" if o.answer == "auto" else o.answer
        self.tells_tokens = True
        self._asked = False  # Whether `ask_for` has settled the form
        self.sensors = Sensors(o.views, depth=o.depth, width=o.image_size_px, height=o.image_size_px)
        self.pace: Callable[[], object] = lambda: None  # Called before each request; waits until one may be sent
        self.service = Connection(
            self.package, o.base_url, o.timeout_s, o.request_retries, secrets=self._secrets, key_variable=o.key_env,
            model=o.model, pace=lambda: self.pace(),
        )  # fmt: skip
        self._begin()

    def close(self) -> None:
        """Close the connections."""
        self.service.close()

    def used_options(self) -> dict[str, Any]:
        """Return all options as used, defaults too, without secrets."""
        return dict(self._secrets.options(self.options.model_dump(mode="json") | {"answer": self.form}))

    @abstractmethod
    async def request(self, client: Any, system: str, messages: Sequence[Message], body: dict[str, Any]) -> Any:
        """Send a request by the package; `body` adds to what it sends."""

    @abstractmethod
    def read(self, answer: Any) -> Reply:
        """Read the service's answer; AgentUnavailable where it is none of the protocol."""

    @abstractmethod
    def form_of(self, name: str, what: str, schema: Schema) -> dict[str, Any]:
        """Word, in the form that is settled, that the answer has a JSON schema; a tool is called `name`."""

    def reply(self, text: str, answer: Any, *counts: str) -> Reply:
        """Make a reply: the text without keys, and the tokens in and out, by their names in the answer's usage."""
        found = (getattr(getattr(answer, "usage", None), name, None) for name in counts)
        tokens = (n if type(n) is int and 0 <= n < _MAX_TOKENS else None for n in found)
        return Reply(self.service.clean(text), *tokens)

    def ask_for(self, system: str, text: str, schema: Schema) -> Reply:
        """Ask for something else than an action, in the first form that the service takes."""

        def ask() -> Reply:
            return self._send(system, [Message("user", (text,))], schema=schema)

        reply = ask() if self._asked else self._first_form(ask)
        self._asked = True
        return reply

    def _first_form(self, ask: Callable[[], Reply], is_right: Callable[[Reply], bool] = lambda _: True) -> Reply:
        """Ask in one form of answer after the other; the last either answers or raises."""
        *forms, last = self.forms if self.options.answer == "auto" else (self.options.answer,)
        for self.form in forms:
            try:
                reply = ask()
            except AgentUnavailable as error:
                if error.kind not in _UNSUPPORTED:
                    raise
                continue
            if is_right(reply):
                return reply
        self.form = last
        return ask()

    def check(self) -> str:
        """Send one small request as the run will send them; settles how answers are asked for."""
        grey = colour_picture(np.full((32, 32, 3), 128, np.uint8), 32)
        example = f'{{"thought": "...", "action": "{self.options.action_set.names[0]}"}}'
        text = f"Answer with one JSON object: {example}. This is a test of the connection: choose Stop."
        said = [Message("user", ("A grey picture:", grey))]
        try:
            reply = self._first_form(lambda: self._ask_with_retry(text, said), self._readable)
        except ServiceDown as error:
            raise ServiceDown(f"checked before the run, nothing flown: {error}") from None
        except AgentUnavailable as error:
            mend = "" if str(error).endswith("?") else f": {_BY_KIND.get(error.kind, 'try again later')}"
            raise AerialDojoError(f"checked before the run, nothing flown: {error}{mend}") from None
        self.tells_tokens = reply.input_tokens is not None and reply.output_tokens is not None
        counted = "" if self.tells_tokens else ", tells no tokens"
        return f"{self.service.name} answers in {self.service.meter.longest_s:.1f} s, by {self.form}{counted}"

    def _ask_with_retry(self, system: str, messages: Sequence[Message]) -> Reply:
        """Ask once more where the service answers at all: somebody waits, and one that is not there stays so."""
        try:
            return self._send(system, messages, 0)
        except AgentUnavailable as error:
            if error.kind not in _TRANSIENT or (error.retry_after_s or 0.0) > _PATIENCE_S:
                raise
            time.sleep(1.0 if error.retry_after_s is None else error.retry_after_s)
        return self._send(system, messages, 0)

    def _send(
        self, system: str, messages: Sequence[Message], retries: int | None = None, schema: Schema | None = None
    ) -> Reply:
        """Ask, for an action where `schema` is None; what is refused for all requests ends the run."""
        o, act = self.options, ("act", "Do one action.", self.options.action_set.schema())
        body = self.form_of(*act if schema is None else ("answer", "Give the answer.", schema)) | o.extra_body
        # By the body, for a package has dropped the argument: its newest models take no temperature.
        body |= {} if o.temperature is None else {"temperature": o.temperature}
        try:
            return self.read(self.service.call(lambda client: self.request(client, system, messages, body), retries))
        except UsageError as error:
            variable = self.options.key_env or f"{self.package.upper()}_API_KEY"
            # Not what was asked for is wrong, but what stands behind it: the exit code is 1.
            raise ServiceDown(f"{error}: {_remedy(error, self.options.model, variable)}") from None

    def settled(self) -> dict[str, Any]:
        """Return options that `check` has settled, for the agents that fly."""
        return {"answer": self.form}

    @property
    def priced(self) -> bool:
        """Whether the cost of an episode will be known, if the service reports tokens."""
        return self.options.priced

    def _readable(self, reply: Reply) -> bool:
        try:
            parse_answer(reply.text, self.options.action_set.names)
        except InvalidAnswer:
            return False
        return True

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""
        self._begin()
        self._system = system_prompt(goal, self.options, self.form)
        self._goal: tuple[str | Picture, ...] = (goal_text(goal),)
        if goal.image is not None:
            self._goal += (colour_picture(goal.image, self.options.image_size_px),)

    def _begin(self) -> None:
        self._turns: deque[Turn] = deque(maxlen=self.options.history)
        self._seen: deque[tuple[int, Picture]] = deque(maxlen=self.options.history_images)
        self._tokens: list[int | None] = [0, 0]
        self._answer: str | None = None
        self.service.meter = Meter()

    def act(self, observation: Observation) -> int:
        """Ask for an action."""
        actions = self.options.action_set
        messages = [Message("user", (*self._goal, *self._observation_parts(observation)))]
        text = self._ask(messages)
        try:
            try:
                answer = parse_answer(text, actions.names)
            except InvalidAnswer as error:
                shown = text[:_KEPT_CHARACTERS].strip() or "(nothing)"
                repair = repair_text(str(error), actions)
                messages += [Message("assistant", (shown,)), Message("user", (repair,))]
                answer = parse_answer(self._ask(messages), actions.names)
        except InvalidAnswer:
            self._turns.append(Turn(observation.step, None))
            raise
        self._turns.append(Turn(observation.step, answer.action, " ".join(answer.thought.split())[:300]))
        return actions.ids[answer.action]

    def _ask(self, messages: Sequence[Message]) -> str:
        reply = self._send(self._system, messages)
        for k, count in enumerate((reply.input_tokens, reply.output_tokens)):
            so_far = self._tokens[k]
            self._tokens[k] = None if so_far is None or count is None else so_far + count
        self._answer = reply.text[:_KEPT_CHARACTERS]
        return reply.text

    def _observation_parts(self, observation: Observation) -> list[str | Picture]:
        o = self.options
        parts: list[str | Picture] = []
        for step, picture in self._seen:
            parts += [f"Earlier, at step {step}, {o.views[0]} camera:", picture]
        parts.append(step_text(observation, tuple(self._turns)))
        for k, view in enumerate(o.views):
            if view in observation.rgb:
                picture = colour_picture(observation.rgb[view], o.image_size_px)
                parts += [f"{view} camera, colour:", picture]
                if k == 0:
                    self._seen.append((observation.step, picture))
            if o.depth and view in observation.depth_m:
                depth = depth_picture(observation.depth_m[view], o.max_depth_m, o.image_size_px)
                parts += [f"{view} camera, depth (black 0 m, white {o.max_depth_m:g} m or more):", depth]
        return parts

    def estimate_tokens(self, observation: Observation) -> int:
        """Reckon what a request would have without sending it: four letters a token, and its pictures."""
        o = self.options
        parts = [self._system, *self._goal, *self._observation_parts(observation)]
        a_picture = o.tokens_per_picture or round(o.image_size_px**2 / 750)
        return sum(a_picture if isinstance(part, Picture) else -(-len(part) // 4) for part in parts)

    def usage(self) -> Usage:
        """Return requests, tokens, cost and times since `reset`."""
        tokens_in, tokens_out = self._tokens
        meter = self.service.meter
        cost = self.options.cost_usd(tokens_in, tokens_out)
        return Usage(meter.requests, tokens_in, tokens_out, cost, meter.seconds, meter.longest_s)

    def answer(self) -> str | None:
        """Return what the model said last, cut to 4,000 characters."""
        return self._answer
