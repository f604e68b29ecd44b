"""Types of a layout's parameters: coordinates, lengths and lines, each with its limits.

What becomes a coordinate, a length or an array is bounded here, so that no layout has to ask whether a path has a
length or a hill a radius.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated

from pydantic import AfterValidator, Field

# The largest site is 1,000 m across.
_FARTHEST_M, _LONGEST_M, _SHORTEST_M = 2000.0, 5000.0, 0.05

Metres = Annotated[float, Field(ge=-_FARTHEST_M, le=_FARTHEST_M)]
Degrees = Annotated[float, Field(ge=-3600, le=3600)]
Length = Annotated[float, Field(ge=0.1, le=500)]
Rise = Annotated[float, Field(ge=-200, le=200)]
At = tuple[Metres, Metres]
Size2 = tuple[Length, Length]
Hill = tuple[Metres, Metres, Length, Rise]
"""Middle x and y, radius and rise, metres."""
Bridge = tuple[Metres, Metres, Degrees, Length]
"""Middle x and y, metres, yaw, degrees, and span, metres."""


def _line(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    if len(points) < 2:
        raise ValueError("a line needs two points or more")
    legs = [math.dist(a, b) for a, b in pairwise(points)]
    if min(legs) < _SHORTEST_M:
        raise ValueError(f"consecutive points of a line must be at least {_SHORTEST_M:g} m from each other")
    if sum(legs) > _LONGEST_M:
        raise ValueError(f"a line may be {_LONGEST_M:,.0f} m long, this is {sum(legs):,.0f} m")
    return points


def _line_or_none(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    return _line(points) if points else points


def _crest(points: tuple[tuple[float, float, float], ...]) -> tuple[tuple[float, float, float], ...]:
    if len(points) > 1:
        _line(tuple((x, y) for x, y, _ in points))
    return points


def _separated(step: tuple[float, float, float]) -> tuple[float, float, float]:
    if step[1] - step[0] < _SHORTEST_M:
        raise ValueError(f"a step ends {_SHORTEST_M:g} m or more beyond where it begins")
    return step


Line = Annotated[tuple[At, ...], Field(max_length=1000), AfterValidator(_line)]
"""Two points or more, distinct from one to the next, metres."""
LineOrNone = Annotated[tuple[At, ...], Field(max_length=1000), AfterValidator(_line_or_none)]
"""A line, or no point at all."""
Crest = Annotated[tuple[tuple[Metres, Metres, Annotated[float, Field(ge=0, le=500)]], ...],
                  Field(min_length=1, max_length=1000), AfterValidator(_crest)]  # fmt: skip
"""A line of points x, y, z, or a peak alone, metres."""
Step = Annotated[tuple[Metres, Metres, Rise], AfterValidator(_separated)]
"""From and to, distances from a line, and the rise between them, metres."""
