"""Read a model's answer, strictly: what is not the JSON that was asked for is refused, never guessed at."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from aerialdojo_gen.benchmark.agents.base import InvalidAnswer
from aerialdojo_gen.benchmark.llm.prompt import CHOICES

MAX_CHARACTERS = 20_000
# What wraps an answer without being part of it: a reasoning model's thoughts, a Markdown fence around all the rest.
_THOUGHTS = re.compile(r"\A\s*<think>.*?</think>", re.DOTALL)
_FENCE = re.compile(r"\A```(?:json)?[ \t]*\n(.*)\n?```\Z", re.DOTALL)


class Answer(BaseModel):
    """One action.

    Attributes
    ----------
    action : str
        One of the 16 names.
    thought : str
        What the model says of it.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    action: str
    thought: str = ""

    @field_validator("action")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in CHOICES:
            raise ValueError(f"{name[:40]!r} is none of the actions")
        return name

    @property
    def action_id(self) -> int:
        """The action's id, 0 to 15."""
        return CHOICES.index(self.action)


def parse_answer(text: str) -> Answer:
    """Read an answer.

    Parameters
    ----------
    text : str
        All that the model said. A leading ``<think>`` block and a Markdown fence around the whole are taken off.

    Returns
    -------
    Answer

    Raises
    ------
    InvalidAnswer
        It is empty, too long, not one JSON object, has a key twice, an unknown or no action; the message says which.
    """
    if len(text) > MAX_CHARACTERS:
        raise InvalidAnswer(f"it has {len(text):,} characters, more than {MAX_CHARACTERS:,}")
    body = _THOUGHTS.sub("", text, count=1).strip()
    fenced = _FENCE.match(body)
    body = fenced[1] if fenced else body
    if not body.strip():
        raise InvalidAnswer("it is empty")
    try:
        value = json.loads(body, object_pairs_hook=_without_doubles)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InvalidAnswer(f"it is not one JSON object ({error})") from None
    if not isinstance(value, dict):
        raise InvalidAnswer(f"it is JSON, but no object: {type(value).__name__}")
    try:
        return Answer.model_validate(value)
    except ValidationError as error:
        problems = (
            f"{'.'.join(map(str, e['loc']))}: {e['msg'].removeprefix('Value error, ')}" for e in error.errors()
        )
        raise InvalidAnswer("; ".join(problems)[:500]) from None


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise InvalidAnswer("a key stands twice in it")
    return value
