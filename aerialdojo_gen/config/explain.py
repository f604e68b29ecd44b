"""What is wrong with a file, in lines that name the key and what was probably meant."""

from __future__ import annotations

import difflib
from typing import Any

from pydantic import BaseModel, ValidationError

from aerialdojo_gen.errors import brief

# What people read; a file may have thousands of faults.
_MOST_FAULTS = 20


def explain(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Turn a validation error into one line a fault, with the nearest known key for an unknown one.

    Parameters
    ----------
    error : pydantic.ValidationError
        What validating against `model` raised.
    model : type of BaseModel
        The model, to look up the keys that exist.

    Returns
    -------
    list of str
        E.g. ``["[plan] unknown key 'wieght': did you mean 'weight'?"]``; of many faults the first and how many more.
    """
    lines: list[str] = []
    for fault in error.errors():
        if not fault["loc"]:
            # Of the whole: what it says names its keys itself.
            lines += str(fault["ctx"]["error"]).split("; ") if "ctx" in fault else [fault["msg"]]
            continue
        *where, last = [str(part) for part in fault["loc"]] or [""]
        table = f"[{'.'.join(where)}] " if where else ""
        if fault["type"] == "extra_forbidden":
            known = _keys_at(model, where)
            near = difflib.get_close_matches(last, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(known)}"
            lines.append(f"{table}unknown key {last!r}: {hint}")
        else:
            lines.append(f"{table}{last} = {_short(fault.get('input'))}: {fault['msg']}")
    told = [brief(line) for line in lines[:_MOST_FAULTS]]
    return [*told, f"and {len(lines) - _MOST_FAULTS} more faults"] if len(lines) > _MOST_FAULTS else told


def _keys_at(model: type[BaseModel], where: list[str]) -> list[str]:
    for name in where:
        fields = {(f.alias or key): f for key, f in model.model_fields.items()}
        inner = fields[name].annotation if name in fields else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return []
        model = inner
    return sorted(f.alias or key for key, f in model.model_fields.items())


def _short(value: Any) -> str:
    return brief(repr(value), 60)
