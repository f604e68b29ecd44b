"""Results of methods, kept in their object."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def cached_method(method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Any, P], R]:
    """Keep what a method returns, by its arguments, in its object, which `functools.cache` would keep alive."""
    name = f"_results_of_{method.__name__}"

    @wraps(method)
    def cached(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> R:
        results = self.__dict__.setdefault(name, {})
        key = args, *kwargs.items()
        if key not in results:
            results[key] = method(self, *args, **kwargs)
        found: R = results[key]
        return found

    return cached
