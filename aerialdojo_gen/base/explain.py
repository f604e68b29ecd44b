"""What is wrong with a value from outside, by Pydantic's errors: one line per fault, with the key that was meant."""

from __future__ import annotations

import typing
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError

from aerialdojo_gen.base.errors import brief
from aerialdojo_gen.base.names import unknown

# What people read; a file may have thousands of faults.
_MAX_FAULTS = 20


@dataclass(frozen=True)
class ModelFault:
    """One thing that is wrong."""

    path: tuple[str | int, ...]  # Where: keys, and indices of lists; empty for the whole
    message: str
    line: str  # What, with the last key of the path


def faults_of(error: ValidationError, model: type[BaseModel]) -> list[ModelFault]:
    """Take a validation error apart, with the nearest known key for an unknown one."""
    faults = []
    for raw in error.errors(include_url=False):
        path = tuple(raw["loc"])
        if not path:
            # Of the whole: what it says names its keys itself.
            error_of = raw.get("ctx", {}).get("error")
            texts = [raw["msg"]] if error_of is None else str(error_of).split("; ")
            faults += [ModelFault(path, text, text) for text in texts]
            continue
        key = ".".join(map(str, path[_owner(path) :]))
        if raw["type"] == "extra_forbidden":
            message = line = unknown("unknown key", key, _keys_at(model, path[:-1]))
        elif raw["type"] == "missing":
            message, line = "the key is missing", f"key {brief(key, 60)!r} is missing"
        else:
            message = raw["msg"].removeprefix("Value error, ")
            line = f"{brief(key, 60)} = {brief(repr(raw.get('input')), 60)}: {message}"
        faults.append(ModelFault(path, message, line))
    return faults


def explain(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Turn a validation error into one line a fault."""
    faults = faults_of(error, model)
    lines = [brief(f"{_table(fault.path[: _owner(fault.path)])}{fault.line}") for fault in faults[:_MAX_FAULTS]]
    return [*lines, f"and {len(faults) - _MAX_FAULTS} more faults"] if len(faults) > _MAX_FAULTS else lines


def _owner(path: Sequence[str | int]) -> int:
    """Find the last key of a path: indices behind it belong to its value."""
    return max((k for k, step in enumerate(path) if isinstance(step, str)), default=0)


def _table(path: Sequence[str | int]) -> str:
    return f"[{'.'.join(map(str, path))}] " if path else ""


def _keys_at(model: type[BaseModel], path: Sequence[str | int]) -> list[str]:
    for step in path:
        if isinstance(step, int):
            continue
        fields = {(field.alias or key): field for key, field in model.model_fields.items()}
        inner = model_in(fields[step].annotation) if step in fields else None
        if inner is None:
            return []
        model = inner
    return sorted(field.alias or key for key, field in model.model_fields.items())


def model_in(annotation: Any) -> type[BaseModel] | None:
    """Find the model of a field, also where it may be None or stands in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(model_in, typing.get_args(annotation))), None)
