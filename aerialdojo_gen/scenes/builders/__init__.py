"""Props that the shape vocabulary cannot express, as code.

A builder is a function ``(rng, params) -> [(role, mesh), …]``. It draws from the generator alone, takes the prop's
parameters by name, and returns meshes in the prop's own frame (metres; base centre at the origin, front along +x),
each with a role of the category or a material. `builder` registers it under its name; every module of this folder is
loaded.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from aerialdojo_gen.scenes.mesh import Mesh

Builder = Callable[[np.random.Generator, Mapping[str, float]], Sequence[tuple[str, Mesh]]]
BUILDERS: dict[str, Builder] = {}


def builder(function: Builder) -> Builder:
    """Register a builder under its function's name; ValueError for a duplicate."""
    name = function.__name__
    if name in BUILDERS:
        raise ValueError(f"duplicate builder {name!r}")
    BUILDERS[name] = function
    return function


@cache
def builders() -> dict[str, Builder]:
    """Load all modules of this folder and give their builders by name."""
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__)):
        importlib.import_module(f"{__name__}.{module}")
    return dict(sorted(BUILDERS.items()))
