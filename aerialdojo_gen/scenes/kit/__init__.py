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
from functools import cache, cached_property
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, create_model

Function = TypeVar("Function", bound=Callable[..., Any])
# What a builder works on: the site; the terrain, which it returns changed; or nothing, and it returns parts.
# Each with the number of arguments that a plan does not give.
KINDS = {"site": 1, "ground": 2, "parts": 0}


@dataclass(frozen=True)
class Builder:
    """A function of the kit, with the model of its arguments."""

    name: str
    kind: str  # One of `KINDS`
    function: Callable[..., Any]

    @cached_property
    def arguments(self) -> type[BaseModel]:
        """Model of the keyword parameters, made when it is first asked for: a scene calls some of the builders."""
        hints = typing.get_type_hints(self.function, include_extras=True)
        fields: dict[str, Any] = {}
        for parameter in list(inspect.signature(self.function).parameters.values())[KINDS[self.kind] :]:
            default = ... if parameter.default is inspect.Parameter.empty else parameter.default
            fields[parameter.name] = (hints[parameter.name], default)
        settings = ConfigDict(extra="forbid", arbitrary_types_allowed=True, frozen=True)
        return create_model(self.name, __config__=settings, **fields)

    @property
    def summary(self) -> str:
        """First line of the docstring."""
        return (inspect.getdoc(self.function) or "").partition("\n")[0]


_BUILDERS: dict[str, Builder] = {}


def _registering(kind: str) -> Callable[[Function], Function]:
    """Make the decorator of a kind of builders."""

    def register(function: Function) -> Function:
        name = function.__name__
        if name in _BUILDERS and _BUILDERS[name].function.__module__ != function.__module__:
            raise ValueError(f"two builders are called {name!r}")
        _BUILDERS[name] = Builder(name, kind, function)
        return function

    return register


site_builder = _registering("site")  # For ``build(site, *, …)``, which adds structure and things to the site
ground_builder = _registering("ground")  # For ``build(site, terrain, *, …)``, which returns another terrain
part_builder = _registering("parts")  # For ``build(*, …)``, which returns meshes in the structure's frame


@cache
def kit() -> dict[str, Builder]:
    """Load all modules of the kit and return its builders by name."""
    for module in sorted(found.name for found in pkgutil.walk_packages(__path__, f"{__name__}.")):
        importlib.import_module(module)
    return dict(sorted(_BUILDERS.items()))
