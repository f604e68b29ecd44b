"""Read a model's answer, strictly: what is not the JSON that was asked for is refused, never guessed at."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from aerialdojo_gen.benchmark.agents.base import InvalidAnswer
from aerialdojo_gen.benchmark.llm.actions import SIXTEEN

MAX_CHARACTERS = 20_000
# What wraps an answer without being part of it: a reasoning model's thoughts, a Markdown fence around all the rest.
_THOUGHTS = re.compile(r"\A\s*<think>.*?</think>", re.DOTALL)
_FENCE = re.compile(r"\A```(?:json)?[ \t]*\n(.*)\n?```\Z", re.DOTALL)


class Answer(BaseModel):
    """One action."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    action: str  # One of the names that were told
    thought: str = ""  # What the model says of it


def parse_answer(text: str, names: Sequence[str] = SIXTEEN.names) -> Answer:
    """Read an answer."""
    if len(text) > MAX_CHARACTERS:
        raise InvalidAnswer(f"it has {len(text):,} characters, more than {MAX_CHARACTERS:,}")
    body = _THOUGHTS.sub("", text, count=1).strip()
    fenced = _FENCE.match(body)
    body = fenced[1] if fenced else body
    if not body.strip():
        raise InvalidAnswer("it is empty")
    try:
        value = json.loads(body, object_pairs_hook=_without_doubles, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        # A number of 4,300 digits or more is a ValueError of its own kind.
        raise _refused(f"it is not one JSON object ({error})") from None
    if not isinstance(value, dict):
        raise InvalidAnswer(f"it is JSON, but no object: {type(value).__name__}")
    try:
        answer = Answer.model_validate(value)
    except (ValidationError, ValueError) as error:
        raise _refused(_problems(error)) from None
    if answer.action not in names:
        raise _refused(f"action: {answer.action[:40]!r} is none of the actions")
    try:
        answer.thought.encode("utf-8")
    except UnicodeEncodeError:
        raise InvalidAnswer("thought: it holds half of a surrogate pair, which is no character") from None
    return answer


def _problems(error: ValueError) -> str:
    if not isinstance(error, ValidationError):
        return "it holds half of a surrogate pair, which is no character"
    return "; ".join(
        f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_input=False, include_url=False)
    )


def _refused(why: str) -> InvalidAnswer:
    # The reason is sent back to the model and kept: no lone surrogates in it, and no more than it takes.
    return InvalidAnswer(why.encode("utf-8", "backslashreplace").decode("utf-8")[:500])


def _no_number(name: str) -> Any:
    raise ValueError(f"{name} is no number of JSON")


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise InvalidAnswer("a key stands twice in it")
    return value
