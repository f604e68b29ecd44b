"""Scalar fields of a plan: numbers that vary over the site, such as the density of a wood."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np
import shapely
from pydantic import PlainValidator, WithJsonSchema
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.expressions import evaluate, names_in
from aerialdojo_gen.scenes.plans.values import PlanNames, names_of, refuse_unknown
from aerialdojo_gen.scenes.site import Site

PointFunction = Callable[[float, float], float]
Field = Callable[[Site], PointFunction]
"""A number at every point of a site: gives the function of x and y, metres."""


def _gentle(site: Site, x: float, y: float, fall: float) -> float:
    """Say 1 where a stone stays lying, 0 where the ground falls by more than `fall` metres a metre."""
    east = site.ground_z(x + 0.7, y) - site.ground_z(x - 0.7, y)
    north = site.ground_z(x, y + 0.7) - site.ground_z(x, y - 0.7)
    return float(np.hypot(east, north) < 1.4 * fall)


def _above(site: Site, x: float, y: float, z_m: float) -> float:
    return float(site.ground_z(x, y) > z_m)


def resolve_field(names: PlanNames, value: Any, known: Mapping[str, Any]) -> Field:
    """Resolve a number, an expression over x, y, z, heights and the `known` fields, or one of `_KINDS` as a table."""
    if isinstance(value, str):
        return _expression(names, value, known)
    if not isinstance(value, dict):
        number = names.number(value)
        return lambda _site: lambda _x, _y: number
    refuse_unknown(value, (*_KINDS, "reach_m"))
    kinds = [key for key in _KINDS if key in value]
    if len(kinds) != 1:
        raise ValueError(f"a field has one of {', '.join(_KINDS)}, got {', '.join(kinds) or 'none'}")
    return _KINDS[kinds[0]](names, value)


def _expression(names: PlanNames, text: str, known: Mapping[str, Any]) -> Field:
    try:
        used = names_in(text)
    except ShapeError as error:
        raise ValueError(str(error)) from None
    heights = {name: z for name, z in names.heights.items() if name in used}
    for name in sorted(used - heights.keys() - {"x", "y", "z"}):
        if name not in known:
            raise ValueError(unknown("no field", name, [*known, "x", "y", "z"]))
    fields: dict[str, Field] = {}
    before: dict[str, Any] = {}  # A field is made of those before it
    for name, value in known.items():
        if name in used:
            fields[name] = resolve_field(names, value, dict(before))
        before[name] = value

    def on(site: Site) -> PointFunction:
        parts: dict[str, PointFunction] = {"x": lambda x, _y: x, "y": lambda _x, y: y, "z": site.ground_z}
        parts = {name: one for name, one in parts.items() if name in used}
        parts |= {name: field(site) for name, field in fields.items()}
        return lambda x, y: evaluate(text, heights | {name: one(x, y) for name, one in parts.items()})

    return on


def _patches(names: PlanNames, value: Mapping[str, Any]) -> Field:
    """Patches, about 1 on average, that rise to exp(sharpness) in the middle of some."""
    form = "patches is [seed, wavelength_m, sharpness]"
    seed, wavelength_m, sharpness = names.numbers(value["patches"], form, 3)
    if wavelength_m <= 0.0 or abs(sharpness) > 20.0:
        raise ValueError(f"patches have a wavelength above 0 and a sharpness up to 20, got {value['patches']!r}")
    noise = OpenSimplex(seed=int(seed))
    return lambda _site: lambda x, y: math.exp(sharpness * noise.noise2(x / wavelength_m, y / wavelength_m))


def _within_reach(names: PlanNames, area: BaseGeometry, value: Mapping[str, Any]) -> Field:
    reach_m = names.number(value.get("reach_m"))
    if reach_m <= 0.0:
        raise ValueError(f"reach_m must be above 0, got {reach_m:g}")
    shapely.prepare(area)
    return lambda _site: lambda x, y: max(0.0, 1.0 - float(shapely.distance(area, shapely.Point(x, y))) / reach_m)


def _of_line(names: PlanNames, value: Any) -> BaseGeometry:
    lines = value if isinstance(value, list) else [value]
    return shapely.union_all([LineString(names.line(line)) for line in lines])


def _inside(names: PlanNames, value: Mapping[str, Any]) -> Field:
    area = names.area(value["inside"])
    shapely.prepare(area)
    return lambda _site: lambda x, y: float(shapely.contains_xy(area, x, y))


def _of_ground(names: PlanNames, value: Any, function: Callable[[Site, float, float, float], float]) -> Field:
    limit = names.number(value)
    return lambda site: lambda x, y: function(site, x, y, limit)


# Patches of noise; 1 on an area or a line and 0 at `reach_m` from it; and 1 or 0: inside an area, where the ground
# falls by less than so much a metre, and where it lies higher than so much.
_KINDS: dict[str, Callable[[PlanNames, Mapping[str, Any]], Field]] = {
    "patches": _patches,
    "near": lambda names, value: _within_reach(names, names.area(value["near"]), value),
    "beside": lambda names, value: _within_reach(names, _of_line(names, value["beside"]), value),
    "inside": _inside,
    "gentle": lambda names, value: _of_ground(names, value["gentle"], _gentle),
    "above": lambda names, value: _of_ground(names, value["above"], _above),
}

ScalarField = Annotated[
    Field,
    PlainValidator(lambda value, info: resolve_field(names_of(info), value, names_of(info).fields)),
    WithJsonSchema({"type": ["number", "string", "object"]}),
]
"""A number, an expression over x, y, z and fields, or a table such as ``{near = "pond", reach_m = 9}``."""
