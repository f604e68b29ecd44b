"""An agent that asks a multimodal language model for every action; what the two protocols have in common."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from aerialdojo_gen.benchmark.agents.base import AgentBase, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.goal import Goal, Observation, Sensors
from aerialdojo_gen.benchmark.llm.answer import parse_answer
from aerialdojo_gen.benchmark.llm.images import Picture, colour_picture, depth_picture
from aerialdojo_gen.benchmark.llm.prompt import Turn, goal_text, repair_text, step_text, system_prompt
from aerialdojo_gen.benchmark.llm.service import Connection
from aerialdojo_gen.config import explain
from aerialdojo_gen.errors import UsageError

View = Literal["front", "left", "right", "down"]
# An answer that is shown again for repair, or kept in the log: enough to see what is wrong with it.
_KEPT_CHARACTERS = 4_000


class Options(BaseModel):
    """Options of a language-model agent; none of them is a secret, keys come from the environment.

    Attributes
    ----------
    model : str
        Name of the model at the service.
    base_url : str or None
        Where the service is; the provider's own where absent.
    temperature : float or None
        None leaves it to the service; some models take no other.
    max_tokens : int
        Most tokens of an answer.
    timeout_s : float
        Longest wait for an answer.
    request_retries : int
        How often a request that failed for the service's sake is sent again before the episode is given up. A
        repeated request changes nothing for the agent; an episode begun again costs all of its requests anew.
    views : tuple of str
        Cameras whose pictures are sent; the paper's is the front one alone.
    depth : bool
        Whether their depth is sent too.
    image_size_px : int
        Width and height of the pictures.
    max_depth_m : float
        Depth that is drawn white.
    history : int
        How many earlier steps are told again: the action and what the model said of it.
    history_images : int
        Of how many earlier steps the colour picture of the first view is sent again.
    extra_body : dict
        Anything else that the service takes, e.g. ``{"seed": 1}``.
    input_usd_per_million, output_usd_per_million : float or None
        Prices of tokens; without them no cost is reported.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    model: str = Field(min_length=1)
    base_url: str | None = None
    temperature: float | None = Field(default=None, ge=0.0, le=2.0)
    max_tokens: int = Field(default=1024, ge=16)
    timeout_s: float = Field(default=60.0, gt=0.0)
    request_retries: int = Field(default=3, ge=0, le=10)
    views: tuple[View, ...] = Field(default=("front",), min_length=1)
    depth: bool = True
    image_size_px: int = Field(default=448, ge=32, le=2048)
    max_depth_m: float = Field(default=50.0, gt=0.0)
    history: int = Field(default=8, ge=0)
    history_images: int = Field(default=0, ge=0, le=20)
    extra_body: dict[str, Any] = {}
    input_usd_per_million: float | None = Field(default=None, ge=0.0)
    output_usd_per_million: float | None = Field(default=None, ge=0.0)

    @field_validator("base_url")
    @classmethod
    def _plain_url(cls, url: str | None) -> str | None:
        if url is not None:
            parts = urlsplit(url)
            if parts.scheme not in ("http", "https") or not parts.hostname:
                raise ValueError("not a URL like http://127.0.0.1:8000/v1")
            # Options are written to the log of the run. Not a ValueError: its message would quote the URL.
            if parts.username or parts.password or parts.query:
                raise UsageError("base_url holds a name, a password or a query: keys come from the environment only")
        return url

    @field_validator("views", mode="before")
    @classmethod
    def _several(cls, views: Any) -> Any:
        return views.split(",") if isinstance(views, str) else views


@dataclass(frozen=True)
class Message:
    """What is said, by whom.

    Attributes
    ----------
    role : str
        user or assistant.
    parts : tuple of str or Picture
        In their order.
    """

    role: str
    parts: tuple[str | Picture, ...]


@dataclass(frozen=True)
class Reply:
    """What a service answers.

    Attributes
    ----------
    text : str
        All the text of it.
    input_tokens, output_tokens : int or None
        Where the service says.
    """

    text: str
    input_tokens: int | None = None
    output_tokens: int | None = None


class LanguageModelAgent(AgentBase):
    """Asks a model for every action: all it knows in one message, strictly parsed, with one attempt at repair.

    An answer that cannot be read even then raises `InvalidAnswer`: it is counted, it spends one action, and the drone
    stays where it is. That is the fairest of the alternatives: an action guessed at would not be the model's, and
    ending the episode would weigh one slip in 300 steps like a crash.

    Subclasses speak a protocol: they name its package and implement `ask`.

    Parameters
    ----------
    **options
        Fields of `Options`.

    Raises
    ------
    UsageError
        An option is wrong or missing, the package is not installed, or there is no key.
    """

    package = ""

    def __init__(self, **options: Any) -> None:
        try:
            self.options = Options.model_validate(options)
        except ValidationError as error:
            raise UsageError("; ".join(explain(error, Options))) from None
        o = self.options
        self.sensors = Sensors(o.views, depth=o.depth, width=o.image_size_px, height=o.image_size_px)
        self.service = Connection(self.package, o.base_url, o.timeout_s, o.request_retries)
        self._begin()

    def close(self) -> None:
        """Close the connections."""
        self.service.close()

    def ask(self, system: str, messages: Sequence[Message]) -> Reply:
        """Send one request.

        Raises
        ------
        AgentUnavailable
            The service failed; nothing of it is the model's doing.
        UsageError
            The service refuses the request for good.
        """
        raise NotImplementedError

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""
        self._begin()
        o = self.options
        fov_deg = goal.rules.sensors.fov_deg
        self._system = system_prompt(goal, o.views, o.depth, o.max_depth_m, fov_deg)
        self._goal: tuple[str | Picture, ...] = (goal_text(goal),)
        if goal.image is not None:
            self._goal += (colour_picture(goal.image, o.image_size_px),)

    def _begin(self) -> None:
        self._turns: deque[Turn] = deque(maxlen=self.options.history)
        self._seen: deque[tuple[int, Picture]] = deque(maxlen=self.options.history_images)
        self._requests = 0
        self._tokens: list[int | None] = [0, 0]
        self._answer: str | None = None

    def act(self, observation: Observation) -> int:
        """Ask for an action.

        Raises
        ------
        InvalidAnswer
            Neither the answer nor its repair names one.
        AgentUnavailable, UsageError
            As `ask` does.
        """
        messages = [Message("user", (*self._goal, *self._report(observation)))]
        said = self._ask(messages)
        try:
            try:
                answer = parse_answer(said)
            except InvalidAnswer as error:
                shown = said[:_KEPT_CHARACTERS].strip() or "(nothing)"
                messages += [Message("assistant", (shown,)), Message("user", (repair_text(str(error)),))]
                answer = parse_answer(self._ask(messages))
        except InvalidAnswer:
            self._turns.append(Turn(observation.step, None))
            raise
        self._turns.append(Turn(observation.step, answer.action, " ".join(answer.thought.split())[:300]))
        return answer.action_id

    def _ask(self, messages: Sequence[Message]) -> str:
        self._requests += 1
        reply = self.ask(self._system, messages)
        for k, count in enumerate((reply.input_tokens, reply.output_tokens)):
            so_far = self._tokens[k]
            self._tokens[k] = None if so_far is None or count is None else so_far + count
        self._answer = reply.text[:_KEPT_CHARACTERS]
        return reply.text

    def _report(self, observation: Observation) -> list[str | Picture]:
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

    def usage(self) -> Usage:
        """Return requests, tokens and cost since `reset`."""
        tokens_in, tokens_out = self._tokens
        prices = self.options.input_usd_per_million, self.options.output_usd_per_million
        cost = None
        if tokens_in is not None and tokens_out is not None and prices[0] is not None and prices[1] is not None:
            cost = (tokens_in * prices[0] + tokens_out * prices[1]) / 1e6
        return Usage(self._requests, tokens_in, tokens_out, cost)

    def answer(self) -> str | None:
        """Return what the model said last, cut to 4,000 characters."""
        return self._answer
