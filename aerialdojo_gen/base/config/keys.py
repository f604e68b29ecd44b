"""Every key of a pipeline file with its value, unit, default, bounds and meaning, read off the models."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from aerialdojo_gen.base.config.pipeline import Pipeline, load_pipeline
from aerialdojo_gen.base.config.shared import shared_values
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.explain import model_in
from aerialdojo_gen.base.names import unknown

# Longest first: a name's end says its unit.
_UNITS = {
    "_deg_s": "°/s", "_m_s": "m/s", "_per_m": "1/m", "_deg": "°", "_px": "px", "_cost_m": "m", "_m": "m", "_s": "s",
}  # fmt: skip
_NAMED = {"width": "px", "height": "px", "fps": "1/s"}
_BOUNDS = {
    "ge": "≥ {}", "gt": "> {}", "le": "≤ {}", "lt": "< {}", "min_length": "{} at least", "max_length": "{} at most",
    "multiple_of": "a multiple of {}", "pattern": "like {}",
}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """A key of a pipeline file.

    Attributes
    ----------
    section : str
        The table that it stands in, ``"anchor-sample"``; empty for the file's own keys, ``"plan.ladder[]"`` for those
        of each table of a list.
    name : str
        As it is written.
    value : object
        What the pipeline has; None where nothing is set.
    default : object
        What it is where the file says nothing; None where that is nothing.
    required : bool
        Whether the table that it stands in cannot do without it.
    kind : str
        What it takes: ``"number"``, ``"integer"``, ``"true or false"``, ``"text"``, ``"path"``, ``"list of …"``,
        ``"table"``, or the words that there are.
    unit : str
        Of the value; empty where it has none.
    bounds : str
        What the value must be beside that.
    meaning : str
        In words.
    """

    section: str
    name: str
    value: object
    default: object
    required: bool
    kind: str
    unit: str
    bounds: str
    meaning: str

    @property
    def changed(self) -> bool:
        """Whether the pipeline says something else than the default."""
        return bool(self.value != self.default)

    def as_json(self) -> dict[str, Any]:
        """Return the key as plain values, paths as text and tables as objects."""
        return {"key" if name == "name" else name: plain(value) for name, value in vars(self).items()}


def config_keys(pipeline: str | Path | Pipeline | None = None, stage: str | None = None) -> list[Key]:
    """List the keys of a pipeline file; the twin of ``aerialdojo-gen config show``.

    Parameters
    ----------
    pipeline : str, Path or Pipeline, optional
        A TOML file, or what was read of one, whose values are listed; the defaults where absent.
    stage : str, optional
        The section of this stage alone, or ``"embodiment"``, ``"camera"``, ``"task"``; all keys where absent.

    Returns
    -------
    list of Key
        In the order of the file. A key that holds a table comes before the keys of that table.

    Raises
    ------
    ConfigError
        The file is missing or wrong.
    UsageError
        There is no such section.
    """
    if not isinstance(pipeline, Pipeline):
        pipeline = Pipeline() if pipeline is None else load_pipeline(pipeline)
    every = list(_own(pipeline)) if stage is None else []
    sections = _sections()
    if stage is not None and stage not in sections:
        raise UsageError(unknown("no section", stage, sections))
    for name, attribute in sections.items():
        if stage in (None, name):
            section = getattr(pipeline, attribute)
            every += _keys(name, type(section), section, type(section)())
    return every


def section_meanings() -> dict[str, str]:
    """Return the first line that the model of every section says of it, by the section's name."""
    return {
        name: (type(getattr(Pipeline(), attribute)).__doc__ or "").partition("\n")[0]
        for name, attribute in _sections().items()
    }


def plain(value: object) -> Any:
    """Turn a value of a section into what JSON and TOML have: paths into text, models into dicts."""
    if isinstance(value, BaseModel):
        return {key: plain(inner) for key, inner in value if inner is not None}
    if isinstance(value, tuple | list):
        return [plain(inner) for inner in value]
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    return value.as_posix() if isinstance(value, PurePath) else value


def _sections() -> dict[str, str]:
    """Name the sections by what they are called in the file, with the model's attribute."""
    return {
        field.alias or name: name
        for name, field in Pipeline.model_fields.items()
        if model_in(field.annotation) is not None
    }


def _own(pipeline: Pipeline) -> Iterator[Key]:
    for name, field in Pipeline.model_fields.items():
        if model_in(field.annotation) is None:
            yield _key("", name, field, getattr(pipeline, name), _default(field))


def _keys(
    section: str, model: type[BaseModel], values: BaseModel | None, defaults: BaseModel | None
) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        if name in shared_values(model):
            continue
        value, default = getattr(values, name, None), getattr(defaults, name, _default(field))
        yield _key(section, name, field, value, default)
        inner = model_in(field.annotation)
        if inner is not None:
            many = typing.get_origin(field.annotation) is tuple
            one, other = (v if isinstance(v, BaseModel) else None for v in (value, default))
            yield from _keys(f"{section}.{name}{'[]' if many else ''}", inner, one, other)


def _default(field: FieldInfo) -> object:
    return None if field.is_required() else field.get_default(call_default_factory=True)


def _key(section: str, name: str, field: FieldInfo, value: object, default: object) -> Key:
    bounds = [
        text.format(getattr(limit, key))
        for limit in field.metadata
        for key, text in _BOUNDS.items()
        if getattr(limit, key, None) is not None
    ]
    ends = (unit for end, unit in _UNITS.items() if name.endswith(end))
    inner = model_in(field.annotation)
    text = field.description or (inner.__doc__ or "" if inner else "").partition("\n")[0]
    return Key(
        section, field.alias or name, value, default, field.is_required(), _kind(field.annotation),
        _NAMED.get(name) or next(ends, ""), ", ".join(bounds), text.rstrip("."),
    )  # fmt: skip


def _kind(annotation: Any) -> str:
    """Say in words what a key takes."""
    origin, args = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Literal:
        return " or ".join(str(word) for word in args)
    if origin in (types.UnionType, typing.Union):
        return " or ".join(_kind(arg) for arg in args if arg is not types.NoneType)
    if origin is tuple:
        many = f"list of {_kind(args[0])}"
        return many if Ellipsis in args else f"{many}, {len(args)} of them"
    if origin is dict:
        return f"table of {_kind(args[1])} by {_kind(args[0])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "table"
    return {bool: "true or false", int: "integer", float: "number", str: "text", Path: "path"}[annotation]
