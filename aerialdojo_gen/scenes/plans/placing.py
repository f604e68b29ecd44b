"""Poses of patterns, and the heights of things before they are placed."""

from __future__ import annotations

import math
from collections.abc import Iterator

from aerialdojo_gen.scenes.expressions import evaluate
from aerialdojo_gen.scenes.grammar_scatter import Pose, along, poisson_disc
from aerialdojo_gen.scenes.plans.model import Pattern
from aerialdojo_gen.scenes.site import Site


def prop_height(site: Site, category: str, variant: str | None, x: float, y: float) -> float:
    """Height of a thing that stands at z = 0, metres, in the variant that it would have."""
    chosen = variant if variant is not None else site.next_variant(category)
    return float(
        site.catalogue.instantiate(category, "trial", site.rng_for("trial"), (x, y, 0.0), 0.0, chosen).bounds[1, 2]
    )


def poses_of(site: Site, pattern: Pattern) -> Iterator[Pose]:
    """Yield the poses of a pattern."""
    if pattern.along is not None:
        yield from along(
            pattern.along, pattern.spacing_m, pattern.offset_m, pattern.start_m, pattern.end_m, pattern.turn_deg
        )
    elif pattern.grid is not None:
        for x in pattern.grid[0]:
            for y in pattern.grid[1]:
                yaw = pattern.yaw
                yield Pose(x, y, evaluate(yaw, {"x": x, "y": y}) if isinstance(yaw, str) else float(yaw))
    elif pattern.ring is not None:
        x, y, radius_m, count, start_deg = pattern.ring
        for k in range(count):
            a = math.radians(start_deg + 360.0 / count * k)
            yield Pose(x + radius_m * math.cos(a), y + radius_m * math.sin(a), math.degrees(a) + pattern.turn_deg)
    elif pattern.scatter is not None:
        stream = site.rng_for(*(pattern.stream or "scatter").split("/"))
        yield from poisson_disc(pattern.scatter, pattern.spacing_m, stream, limit=pattern.limit)
    else:
        yield from (Pose(*pose) for pose in pattern.poses)
