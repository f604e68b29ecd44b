"""Where builders put themselves down by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from aerialdojo_gen.scenes.mesh import Mesh

Builder = Callable[[np.random.Generator, Mapping[str, float]], Sequence[tuple[str, Mesh]]]
BUILDERS: dict[str, Builder] = {}


def builder(function: Builder) -> Builder:
    """Register a builder under its function's name; a name that stands twice is refused."""
    name = function.__name__
    if name in BUILDERS:
        raise ValueError(f"builder {name!r} stands twice")
    BUILDERS[name] = function
    return function
