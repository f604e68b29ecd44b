"""The format of a plan: its head, its names, its fields, and its entries in the order in which they are built."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from pydantic import BaseModel, Field, PlainValidator, WithJsonSchema, field_validator, model_validator
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import ShapeError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.expressions import evaluate, names_in
from aerialdojo_gen.scenes.plans.values import (
    Area,
    Areas,
    At,
    Line,
    Material,
    Number,
    PlanNames,
    names_of,
    refuse_unknown,
)
from aerialdojo_gen.scenes.recipe import SceneHead
from aerialdojo_gen.scenes.site import Site

MAX_ENTRIES = 2000
_Text = Annotated[str, Field(min_length=1, max_length=200)]
_Table = Annotated[dict[str, Any], Field(default_factory=dict)]


class PlanHead(SceneHead):
    """Everything of a plan; its ground and its entries are read when their turn comes."""

    plan: Literal[1]  # Version of the format
    world: _Table  # Of a plan that `vary` wrote: type, seed, generator version and what was drawn
    floor_m: _Table  # Named heights, metres; also in expressions
    lines: _Table
    areas: _Table
    fields: _Table  # Named numbers that vary over the site; each may be made of those before it
    placing: _Table  # What every `place` entry has that does not say otherwise, e.g. ``margin_m``
    ground: _Table
    site: Annotated[list[dict[str, Any]], Field(max_length=MAX_ENTRIES, default_factory=list)]

    @field_validator("site")
    @classmethod
    def _few_entries(cls, site: list[dict[str, Any]]) -> list[dict[str, Any]]:
        for number, entry in enumerate(site):
            if "entries" in entry and (set(entry) != {"entries"} or not _tables(entry["entries"])):
                raise ValueError(f"site[{number}]: entries is a list of entries, alone in its table")
        if sum(len(entry.get("entries", [entry])) for entry in site) > MAX_ENTRIES:
            raise ValueError(f"more than {MAX_ENTRIES:,} entries")
        return site


def _tables(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, dict) for one in value)


class Ground(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """The terrain, and what shows where nothing is painted."""

    material: Material = "grass"
    steps: list[dict[str, Any]] = []  # Ground builders, each on the terrain of the one before


class Paint(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """Paint an area of the ground, or several, over what was painted before."""

    paint: Areas
    material: Material
    rise_m: Number = 0.0  # Height over the terrain; its edge becomes a kerb
    edge: Material = "concrete"  # Material of that kerb


class Structure(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """A body made of parts, in the grammar of a prop's parts, or by part builders."""

    parts: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=1000)]
    node: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_]{0,59}$")] | None = None
    category: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_]{0,59}$")] = ""  # The node's name where absent
    at: At = (0.0, 0.0)  # Origin of the parts' frame
    yaw_deg: Number = 0.0
    on: Number = 0.0  # Height of that origin; the name of a floor is a number too
    attributes: dict[str, str] = {}
    footprint: Area | None = None  # Ground that it takes
    keep_clear: list[tuple[Number, Number, Number]] = []  # Discs of ground that it takes: x, y, radius

    @model_validator(mode="after")
    def _named(self) -> Structure:
        if not (self.node or self.category):
            raise ValueError("a structure has a node or a category")
        return self


class Thing(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """A prop of the catalogue, in the long form; the short one is ``["category:variant", x, y, yaw, z]``.

    In the short form its own phrase stands behind a bar: ``"bench:blue | beside the pond"``.
    """

    what: _Text
    at: At
    yaw_deg: Number = 0.0
    on: Number | None = None
    count: Annotated[int, Field(ge=1, le=1000)] = 1  # Of a straight row that begins there
    step: At = (0.0, 0.0)  # From one to the next, metres
    phrase: Annotated[str, Field(max_length=200)] = ""  # In place of that of the entry
    above_ground_m: Number = 0.0  # The same
    node: str | None = None
    design: Annotated[str, Field(max_length=60)] | None = None  # One of the scene's side where absent
    scale: Annotated[float, Field(ge=0.05, le=20)] = 1.0
    roles: dict[str, Material] = {}
    params: dict[str, Number] = {}
    attributes: dict[str, str] = {}
    solid: bool = True  # Whether it takes the ground it stands on


class Pattern(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """Poses that are computed; the categories are dealt over them in turn."""

    of: Annotated[list[_Text], Field(min_length=1)]
    along: Line | None = None  # A line, with a thing every `spacing_m`
    grid: tuple[list[Number], list[Number]] | None = None  # Every x with every y
    # About a point, facing away from it: x, y, radius, number, direction of the first.
    ring: tuple[Number, Number, Number, Annotated[int, Field(ge=1, le=1000)], Number] | None = None
    poses: list[tuple[Number, Number, Number]] = []  # x, y, yaw
    scatter: Area | None = None  # An area, strewn at least `spacing_m` apart
    spacing_m: Annotated[Number, Field(gt=0)] = 5.0
    offset_m: Number = 0.0  # To the left of the line
    start_m: Number = 0.0  # What stays free at the ends of the line
    end_m: Number = 0.0
    turn_deg: Number = 0.0  # Of the things, from the line's direction or the ring's outwards
    yaw: str | float = 0.0  # An expression over x and y for the poses of a grid
    limit: Annotated[int, Field(ge=1, le=10_000)] = 10_000
    stream: str = ""  # Name of the random stream of a scatter

    @model_validator(mode="after")
    def _one_kind(self) -> Pattern:
        given = (self.along, self.grid, self.ring, self.scatter, self.poses or None)
        if sum(one is not None for one in given) != 1:
            raise ValueError("a pattern has one of along, grid, ring, scatter, poses")
        return self


class Place(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """Place things of the catalogue."""

    place: Annotated[list[Any], Field(max_length=2000)] = []  # Things, short or long
    pattern: Pattern | None = None
    frame: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)  # Origin and direction that their poses are given in
    phrase: Annotated[str, Field(max_length=200)] = ""  # Where they are, in words: "on the dyke"
    on: Number | None = None  # Height that they stand on; the ground where absent
    above_ground_m: Number = 0.0  # Height over the ground; negative: sunk into it
    settle_m: Number | None = None  # On a slope: neither afloat nor buried, its foot being of this radius
    sunk: tuple[Number, Number] | None = None  # Below that: a share of its own height, and the most, metres
    fit: Literal["as_is", "skip", "must"] = "as_is"  # Where there is no room: placed all the same, left out, an error
    clear_m: Annotated[Number, Field(ge=0)] = 0.0  # Ground about them that stays free of what follows
    margin_m: Annotated[Number, Field(ge=0)] = 0.0  # The same, about the rectangle that each takes
    room_m: Annotated[Number, Field(ge=0)] = 0.0  # The same, about its outline, from 1 m below it to 6 m above it
    level: bool = False  # Whether `level_under_things` among the ground's steps levels the ground under each
    spots: str = ""  # Name of an area that the points where they stand are added to


PointFunction = Callable[[float, float], float]
SiteFunction = Callable[[Site], PointFunction]
"""A number at every point of a site: gives the function of x and y, metres."""


def _gentle(site: Site, x: float, y: float, fall: float) -> float:
    """Say 1 where a stone stays lying, 0 where the ground falls by more than `fall` metres a metre."""
    east = site.ground_z(x + 0.7, y) - site.ground_z(x - 0.7, y)
    north = site.ground_z(x, y + 0.7) - site.ground_z(x, y - 0.7)
    return float(np.hypot(east, north) < 1.4 * fall)


def resolve_field(names: PlanNames, value: Any, known: Mapping[str, Any]) -> SiteFunction:
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


def _expression(names: PlanNames, text: str, known: Mapping[str, Any]) -> SiteFunction:
    try:
        used = names_in(text)
    except ShapeError as error:
        raise ValueError(str(error)) from None
    heights = {name: z for name, z in names.heights.items() if name in used}
    for name in sorted(used - heights.keys() - {"x", "y", "z"}):
        if name not in known:
            raise ValueError(unknown("no field", name, [*known, "x", "y", "z"]))
    fields: dict[str, SiteFunction] = {}
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


def _patches(names: PlanNames, value: Mapping[str, Any]) -> SiteFunction:
    """Patches, about 1 on average, that rise to exp(sharpness) in the middle of some."""
    form = "patches is [seed, wavelength_m, sharpness]"
    seed, wavelength_m, sharpness = names.numbers(value["patches"], form, 3)
    if wavelength_m <= 0.0 or abs(sharpness) > 20.0:
        raise ValueError(f"patches have a wavelength above 0 and a sharpness up to 20, got {value['patches']!r}")
    noise = OpenSimplex(seed=int(seed))
    return lambda _site: lambda x, y: math.exp(sharpness * noise.noise2(x / wavelength_m, y / wavelength_m))


def _within_reach(names: PlanNames, area: BaseGeometry, value: Mapping[str, Any]) -> SiteFunction:
    reach_m = names.number(value.get("reach_m"))
    if reach_m <= 0.0:
        raise ValueError(f"reach_m must be above 0, got {reach_m:g}")
    shapely.prepare(area)
    return lambda _site: lambda x, y: max(0.0, 1.0 - float(shapely.distance(area, shapely.Point(x, y))) / reach_m)


def _next_to(names: PlanNames, value: Mapping[str, Any]) -> SiteFunction:
    lines = value["beside"] if isinstance(value["beside"], list) else [value["beside"]]
    return _within_reach(names, shapely.union_all([LineString(names.line(line)) for line in lines]), value)


def _inside(names: PlanNames, value: Mapping[str, Any]) -> SiteFunction:
    area = names.area(value["inside"])
    shapely.prepare(area)
    return lambda _site: lambda x, y: float(shapely.contains_xy(area, x, y))


def _of_ground(names: PlanNames, value: Any, function: Callable[[Site, float, float, float], float]) -> SiteFunction:
    limit = names.number(value)
    return lambda site: lambda x, y: function(site, x, y, limit)


# Patches of noise; 1 on an area or a line and 0 at `reach_m` from it; and 1 or 0: inside an area, where the ground
# falls by less than so much a metre, and where it lies higher than so much.
_KINDS: dict[str, Callable[[PlanNames, Mapping[str, Any]], SiteFunction]] = {
    "patches": _patches,
    "near": lambda names, value: _within_reach(names, names.area(value["near"]), value),
    "beside": _next_to,
    "inside": _inside,
    "gentle": lambda names, value: _of_ground(names, value["gentle"], _gentle),
    "above": lambda names, value: _of_ground(
        names, value["above"], lambda site, x, y, z: float(site.ground_z(x, y) > z)
    ),
}

ScalarField = Annotated[
    SiteFunction,
    PlainValidator(lambda value, info: resolve_field(names_of(info), value, names_of(info).fields)),
    WithJsonSchema({"type": ["number", "string", "object"]}),
]
"""A number, an expression over x, y, z and fields, or a table such as ``{near = "pond", reach_m = 9}``."""
