"""The kit: builders that plans call by name, grouped by what they build.

A builder is a function with a decorator. Its keyword parameters are what a plan may give, by their annotations:
those of `aerialdojo_gen.scenes.plans.values`, numbers, words and dataclasses of them.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, create_model

Function = TypeVar("Function", bound=Callable[..., Any])
# What a builder works on: the site; the terrain, which it returns changed; or nothing, and it returns parts.
KINDS = ("site", "ground", "parts")


@dataclass(frozen=True)
class Builder:
    """A function of the kit, with the model of its arguments."""

    name: str
    kind: str  # One of `KINDS`
    function: Callable[..., Any]
    arguments: type[BaseModel]

    @property
    def summary(self) -> str:
        """First line of the docstring."""
        return (inspect.getdoc(self.function) or "").partition("\n")[0]


_BUILDERS: dict[str, Builder] = {}


def site_builder(function: Function) -> Function:
    """Register ``build(site, *, …)``, which adds structure and things to the site."""
    return _register(function, "site", 1)


def ground_builder(function: Function) -> Function:
    """Register ``build(site, terrain, *, …)``, which returns another terrain."""
    return _register(function, "ground", 2)


def part_builder(function: Function) -> Function:
    """Register ``build(*, …)``, which returns parts: materials with meshes in the structure's frame."""
    return _register(function, "parts", 0)


def _register(function: Function, kind: str, positional: int) -> Function:
    name = function.__name__
    if name in _BUILDERS and _BUILDERS[name].function.__module__ != function.__module__:
        raise ValueError(f"two builders are called {name!r}")
    hints = typing.get_type_hints(function, include_extras=True)
    fields: dict[str, Any] = {}
    for parameter in list(inspect.signature(function).parameters.values())[positional:]:
        default = ... if parameter.default is inspect.Parameter.empty else parameter.default
        fields[parameter.name] = (hints[parameter.name], default)
    settings = ConfigDict(extra="forbid", arbitrary_types_allowed=True, frozen=True)
    _BUILDERS[name] = Builder(name, kind, function, create_model(name, __config__=settings, **fields))
    return function


@cache
def kit() -> dict[str, Builder]:
    """Load all modules of the kit and return its builders by name."""
    for module in sorted(found.name for found in pkgutil.walk_packages(__path__, f"{__name__}.")):
        importlib.import_module(module)
    return dict(sorted(_BUILDERS.items()))
