"""Trees under snow: what grew before, white where it faces the sky."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aerialdojo_gen.scenes.builders.growth import split_by_slope
from aerialdojo_gen.scenes.builders.registry import builder
from aerialdojo_gen.scenes.builders.trees import Parts, spruce

# Cosine of the steepest twigs that still hold snow.
_HOLDS = 0.5


@builder
def snowy_spruce(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Spruce whose upper sides carry snow; `load` is the share of its tiers that are white, from the top down."""
    grown = spruce(rng, params)
    tiers = [k for k, (role, _) in enumerate(grown) if role == "needles"]
    out: Parts = []
    for k, (role, body) in enumerate(grown):
        if role != "needles" or tiers.index(k) < len(tiers) * (1.0 - params["load"]):
            out.append((role, body))
            continue
        white, green = split_by_slope(body, _HOLDS)
        out += [("snow", white), ("needles", green)]
    return [(role, body) for role, body in out if len(body.faces)]
