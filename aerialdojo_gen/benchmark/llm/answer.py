"""Actions that a model may choose, and the strict parser of its answers: only the requested JSON is accepted."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from aerialdojo_gen.benchmark.agents.base import InvalidAnswer
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH

_EFFECTS = {
    "Stop": "end the episode",
    "MoveForward": "fly {} m forward, the way the front camera looks",
    "MoveLeft": "fly {} m to the left without turning",
    "MoveRight": "fly {} m to the right without turning",
    "MoveUp": "climb {} m",
    "MoveDown": "sink {} m",
    "TurnLeft": "turn {}° to the left on the spot",
    "TurnRight": "turn {}° to the right on the spot",
}


@dataclass(frozen=True)
class ActionSet:
    """Names that a model answers with, and the actions that they mean."""

    ids: Mapping[str, int]  # The action's id, 0 to 15, by the name that the model is given

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in their order."""
        return tuple(self.ids)

    def describe(self) -> str:
        """Return one line an action, with its magnitude."""
        lines = []
        for name, action in self.ids.items():
            full = ACTION_NAMES[action]
            kind = full.rstrip("0123456789")
            lines.append(f"- {name}: {_EFFECTS[kind].format(full.removeprefix(kind))}")
        return "\n".join(lines)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of an answer."""
        return {
            "type": "object",
            "properties": {
                "thought": {"type": "string", "description": "one or two sentences: what you see, where you go"},
                "action": {"type": "string", "enum": list(self.ids)},
            },
            "required": ["thought", "action"],
            "additionalProperties": False,
        }


SIXTEEN = ActionSet({name: k for k, name in enumerate(ACTION_NAMES[:APPROACH])})


def eight(move_m: int, climb_m: int) -> ActionSet:
    """The paper's eight action types (Appendix A), moves of `move_m` and climbs of `climb_m` metres, turns of 15°."""
    magnitudes = {"Stop": "", "Turn": "15", "MoveUp": str(climb_m), "MoveDown": str(climb_m), "Move": str(move_m)}
    ids = {}
    for kind in _EFFECTS:
        size = next(m for start, m in magnitudes.items() if kind.startswith(start))
        ids[kind] = ACTION_NAMES.index(kind + size)
    return ActionSet(ids)


MAX_CHARACTERS = 20_000
# What wraps an answer without being part of it: a reasoning model's thoughts, a Markdown fence around all the rest.
_THOUGHTS = re.compile(r"\A\s*<think>.*?</think>", re.DOTALL)
_FENCE = re.compile(r"\A```(?:json)?[ \t]*\n(.*)\n?```\Z", re.DOTALL)


Model = TypeVar("Model", bound=BaseModel)


class Answer(BaseModel):
    """One action."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    action: str  # One of the names that were given
    thought: str = ""  # What the model says of it


def parse_answer(text: str, names: Sequence[str] = SIXTEEN.names) -> Answer:
    """Read an answer."""
    answer = read_as(Answer, text)
    if answer.action not in names:
        raise _refused(f"action: {answer.action[:40]!r} is none of the actions")
    return answer


def read_as(kind: type[Model], text: str) -> Model:
    """Read an answer that is one JSON object of a kind, and nothing around it."""
    if len(text) > MAX_CHARACTERS:
        raise InvalidAnswer(f"it has {len(text):,} characters, more than {MAX_CHARACTERS:,}")
    body = _THOUGHTS.sub("", text, count=1).strip()
    fenced = _FENCE.match(body)
    body = fenced[1] if fenced else body
    if not body.strip():
        raise InvalidAnswer("it is empty")
    try:
        value = json.loads(body, object_pairs_hook=_reject_duplicates, parse_constant=_reject_constant)
    except (ValueError, RecursionError) as error:
        # A number of 4,300 digits or more is a ValueError of its own kind.
        raise _refused(f"it is not one JSON object ({error})") from None
    if not isinstance(value, dict):
        raise InvalidAnswer(f"it is JSON, but no object: {type(value).__name__}")
    try:
        answer = kind.model_validate(value)
    except ValidationError as error:
        faults = error.errors(include_input=False, include_url=False)
        raise _refused("; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in faults)) from None
    except ValueError:
        raise _refused("it holds half of a surrogate pair, which is no character") from None
    try:
        json.dumps(value, ensure_ascii=False).encode("utf-8")
    except UnicodeEncodeError:
        raise InvalidAnswer("it holds half of a surrogate pair, which is no character") from None
    return answer


def _refused(why: str) -> InvalidAnswer:
    # The reason is sent back to the model and kept: no lone surrogates in it, and no more than it takes.
    return InvalidAnswer(why.encode("utf-8", "backslashreplace").decode("utf-8")[:500])


def _reject_constant(name: str) -> Any:
    raise ValueError(f"{name} is no number of JSON")


def _reject_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise InvalidAnswer("it has a duplicate key")
    return value
