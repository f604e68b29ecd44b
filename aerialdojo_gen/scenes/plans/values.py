"""Types of values in a plan: numbers, areas, lines and materials, by name or written out.

They are annotations of Pydantic models and of the kit's builders. A value is resolved against the names of its plan,
which are the validation context.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import pairwise
from typing import Annotated, Any

import shapely
from pydantic import BeforeValidator, Field, PlainValidator, ValidationInfo, WithJsonSchema
from shapely.affinity import rotate, scale
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError, ShapeError
from aerialdojo_gen.base.names import nearest, unknown
from aerialdojo_gen.scenes.expressions import Floats, evaluate, evaluate_arrays
from aerialdojo_gen.scenes.grammar import Frame, blob, eased_path, ragged_outline, smooth_path
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle, ribbon
from aerialdojo_gen.scenes.materials import MaterialLibrary
from aerialdojo_gen.scenes.mesh import Parts

Point = tuple[float, float]
ArrayFunction = Callable[[Mapping[str, Floats]], Floats]

# The largest site is 1,000 m across.
_MAX_M, _MAX_POINTS = 2000.0, 1000
_SHORTEST_M = 0.01


@dataclass
class PlanNames:
    """What the entries of a plan may refer to by name."""

    materials: MaterialLibrary
    palette: Mapping[str, str] = field(default_factory=dict)
    heights: dict[str, float] = field(default_factory=dict)  # Metres
    lines: dict[str, list[Point]] = field(default_factory=dict)
    areas: dict[str, BaseGeometry] = field(default_factory=dict)
    fields: Mapping[str, Any] = field(default_factory=dict)  # As given, see `plans.model`
    make_parts: Callable[[list[Any]], Parts] = list  # Set by what builds the plan

    def number(self, value: Any) -> float:
        """Resolve a number, or an expression over the plan's heights."""
        if isinstance(value, str):
            try:
                value = evaluate(value, self.heights)
            except ShapeError as error:
                raise ValueError(str(error)) from None
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"expected a number or an expression, got {value!r}")
        if abs(value) > _MAX_M:
            raise ValueError(f"must lie within {_MAX_M:,.0f}, got {value:g}")
        return float(value)

    def numbers(self, value: Any, form: str, *counts: int) -> list[float]:
        """Resolve a list of as many numbers as one of the counts says; its form is for the message."""
        if not isinstance(value, list) or len(value) not in counts:
            raise ValueError(f"{form}, got {value!r}")
        return [self.number(one) for one in value]

    def formula(self, value: Any) -> ArrayFunction:
        """Resolve a formula over arrays and the plan's heights; it takes the arrays by name."""
        text = value if isinstance(value, str) else repr(self.number(value))
        return lambda arrays: evaluate_arrays(text, {**self.heights, **arrays})

    def point(self, value: Any) -> Point:
        """Resolve ``[x, y]``, metres."""
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(f"expected a point [x, y], got {value!r}")
        return self.number(value[0]), self.number(value[1])

    def frame(self, value: Any) -> Frame:
        """Resolve ``[x, y, yaw]``."""
        return Frame(*self.numbers(value, "frame is [x, y, yaw]", 3))

    def line(self, value: Any) -> list[Point]:
        """Resolve the name of a line, its points, or ``{points, smooth}``, ``{points, eased}``, ``{points, frame}``.

        `smooth` rounds the corners so many times; `eased` makes S-curves of so many steps of the legs across x.
        In place of points, ``ellipse = [x, y, radius along x, radius along y, steps]`` gives a closed line.
        The points may be another line's, by its name.
        """
        if isinstance(value, str):
            if value not in self.lines:
                raise ValueError(unknown("no line", value, self.lines))
            return self.lines[value]
        smooth = eased = 0
        frame = None
        if isinstance(value, dict):
            refuse_unknown(value, ("points", "ellipse", "smooth", "eased", "frame"))
            frame = self.frame(value["frame"]) if "frame" in value else None
            smooth, eased = value.get("smooth", 0), value.get("eased", 0)
            value = self._ellipse(value["ellipse"]) if "ellipse" in value else value.get("points")
            if not isinstance(smooth, int) or not 0 <= smooth <= 6:
                raise ValueError(f"smooth must be from 0 to 6, got {smooth!r}")
            if not isinstance(eased, int) or not 0 <= eased <= 20:
                raise ValueError(f"eased must be from 0 to 20, got {eased!r}")
            if isinstance(value, str):
                value = self.line(value)
        if not isinstance(value, list | tuple) or not 2 <= len(value) <= _MAX_POINTS:
            raise ValueError(f"a line has from 2 to {_MAX_POINTS:,} points [x, y]")
        points = [self.point(point) for point in value]
        points = frame.path(points) if frame else points
        if min(math.dist(a, b) for a, b in pairwise(points)) < _SHORTEST_M:
            raise ValueError(f"consecutive points of a line must be {_SHORTEST_M:g} m apart")
        return smooth_path(eased_path(points, eased) if eased else points, smooth)

    def _ellipse(self, value: Any) -> list[Point]:
        form = "ellipse is [x, y, radius along x, radius along y, steps]"
        x, y, a, b, steps = self.numbers(value, form, 5)
        turns = [2 * math.pi * k / max(int(steps), 3) for k in range(max(int(steps), 3) + 1)]
        return [(x + a * math.cos(turn), y + b * math.sin(turn)) for turn in turns]

    def area(self, value: Any) -> BaseGeometry:
        """Resolve the name of an area, ``[x0, y0, x1, y1]``, or a table with one of the keys of `_AREAS`."""
        if isinstance(value, str):
            if value not in self.areas:
                raise ValueError(unknown("no area", value, self.areas))
            return self.areas[value]
        if isinstance(value, list):
            value = {"box": value}
        if not isinstance(value, dict):
            raise ValueError(f"an area is a name, [x0, y0, x1, y1] or a table, got {value!r}")
        refuse_unknown(value, (*_AREAS, *_CHANGES, "width_m", "round_ends", "long"))
        kinds = [key for key in _AREAS if key in value]
        if len(kinds) != 1:
            raise ValueError(f"an area has one of {', '.join(_AREAS)}, got {', '.join(kinds) or 'none'}")
        try:
            area = _AREAS[kinds[0]](self, value)
            for key, change in _CHANGES.items():
                if key in value:
                    area = change(self, area, value[key])
        except shapely.errors.GEOSException as error:
            raise ValueError(f"an outline crosses itself: {error}") from None
        if area.is_empty:
            raise ValueError("the area is empty")
        return area

    def bodies(self, value: Any) -> Parts:
        """Make a list of parts, each a shape or by a part builder."""
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            raise ValueError(f"expected a list of parts, got {value!r}")
        try:
            return self.make_parts(value)
        except AssetError as error:
            raise ValueError(str(error)) from None

    def several(self, value: Any) -> list[BaseGeometry]:
        """Resolve a list of areas, or one area."""
        if isinstance(value, list) and value and not any(isinstance(one, int | float) for one in value):
            return [self.area(one) for one in value]
        return [self.area(value)]

    def material(self, value: Any) -> str:
        """Resolve a name of the palette, or a material."""
        if not isinstance(value, str):
            raise ValueError(f"expected a material, got {value!r}")
        spec = self.palette.get(value, value)
        base = spec.partition(":")[0]
        if not spec.startswith("#") and base not in self.materials.names:
            raise ValueError(f"unknown material {value!r}{nearest(base, [*self.palette, *self.materials.names])}")
        return spec


def _box(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    x0, y0, x1, y1 = names.numbers(value["box"], "box is [x0, y0, x1, y1]", 4)
    if min(abs(x1 - x0), abs(y1 - y0)) < _SHORTEST_M:
        raise ValueError(f"a rectangle must be {_SHORTEST_M:g} m wide and deep or more")
    return rectangle(x0, y0, x1, y1)


def _disc(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    form = "disc is [x, y, radius] or [x, y, radius, corners]"
    x, y, radius, *corners = names.numbers(value["disc"], form, 3, 4)
    return disc(x, y, radius, *map(int, corners))


def _blob(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    form = "blob is [x, y, radius, seed] or that with ragged, corners"
    x, y, radius, seed, *more = names.numbers(value["blob"], form, 4, 5, 6)
    ragged, corners = [*more, *[0.25, 28.0][len(more) :]]
    area = blob(x, y, radius, int(seed), ragged, min(max(int(corners), 3), _MAX_POINTS))
    if "long" not in value:
        return area
    # Length over width, and the direction of the length.
    long, yaw_deg = names.point(value["long"])
    if long < 1.0:
        raise ValueError(f"long is [length over width, degrees], the first 1 or more, got {long:g}")
    return rotate(scale(area, math.sqrt(long), 1.0 / math.sqrt(long), origin=(x, y)), yaw_deg, origin=(x, y))


def _ribbon(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    """Make the area about a line, or several named ones; `round_ends` is true, or the steps of a quarter turn."""
    if isinstance(value["ribbon"], list) and all(isinstance(one, str) for one in value["ribbon"]):
        return shapely.union_all([_ribbon(names, {**value, "ribbon": one}) for one in value["ribbon"]])
    line, width_m, ends = names.line(value["ribbon"]), names.number(value.get("width_m")), value.get("round_ends")
    if ends is None or isinstance(ends, bool):
        return ribbon(line, width_m, bool(ends))
    return LineString(line).buffer(width_m / 2, quad_segs=min(max(int(names.number(ends)), 1), 64))


def _outline(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    """Draw a line of a width along the edge of an area, its outer corners round."""
    edges = [piece.exterior for piece in polygons_of(names.area(value["outline"]))]
    return shapely.union_all([edge.buffer(names.number(value.get("width_m")) / 2) for edge in edges])


def _around(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    """Give what lies within half a width of a line or of a point, with round ends."""
    given = value["around"]
    single = isinstance(given, list) and len(given) == 2 and not isinstance(given[0], list)
    middle = shapely.Point(names.point(given)) if single else shapely.LineString(names.line(given))
    return middle.buffer(names.number(value.get("width_m")) / 2)


def _polygon(names: PlanNames, value: Mapping[str, Any]) -> BaseGeometry:
    points: list[Point] = []
    for one in value["polygon"]:
        points += names.line(one) if isinstance(one, str) else [names.point(one)]
    area = Polygon(points)
    if not area.is_valid:
        raise ValueError("the polygon crosses itself")
    return area


def _others(value: Any) -> list[Any]:
    """List areas that are given one by one or as one, which may be a rectangle."""
    is_box = isinstance(value, list) and len(value) == 4 and all(isinstance(one, int | float) for one in value)
    return value if isinstance(value, list) and not is_box else [value]


def _grown(names: PlanNames, area: BaseGeometry, by_m: Any) -> BaseGeometry:
    """Grow an area by metres, or by ``[metres, steps of a round corner]``."""
    if not isinstance(by_m, list):
        return area.buffer(names.number(by_m))
    by, steps = names.point(by_m)
    return area.buffer(by, quad_segs=min(max(int(steps), 1), 64))


def _ragged(names: PlanNames, area: BaseGeometry, given: Any) -> BaseGeometry:
    """Make the outline natural: ``[metres in and out, seed, metres from point to point]``, of its largest piece."""
    form = "ragged is [metres in and out, seed, metres from point to point]"
    amplitude_m, seed, step_m = names.numbers(given, form, 3)
    ring = max(polygons_of(area), key=lambda piece: piece.area).exterior
    if not 8 <= ring.length / max(step_m, _SHORTEST_M) <= _MAX_POINTS:
        raise ValueError(f"ragged makes from 8 to {_MAX_POINTS:,} points, got one every {step_m:g} m")
    return ragged_outline(ring, int(seed), amplitude_m, step_m)


_AREAS: dict[str, Callable[[PlanNames, Mapping[str, Any]], BaseGeometry]] = {
    "area": lambda names, value: names.area(value["area"]),  # Of which the other keys make a new one
    "box": _box, "disc": _disc, "blob": _blob, "ribbon": _ribbon, "polygon": _polygon, "outline": _outline,
    "around": _around,
    "union": lambda names, value: shapely.union_all([names.area(one) for one in value["union"]]),
}  # fmt: skip
_CHANGES: dict[str, Callable[[PlanNames, BaseGeometry, Any], BaseGeometry]] = {
    "frame": lambda names, area, pose: names.frame(pose).area(area),  # It was one in the frame ``[x, y, yaw]``
    "ragged": _ragged,
    "plus": lambda names, area, others: reduce(lambda a, b: a.union(names.area(b)), _others(others), area),
    "minus": lambda names, area, others: reduce(lambda a, b: a.difference(names.area(b)), _others(others), area),
    "grow_m": _grown,
    # With sharp corners.
    "offset_m": lambda names, area, by_m: area.buffer(names.number(by_m), join_style="mitre"),
    "within": lambda names, area, other: area.intersection(names.area(other)),
}


def refuse_unknown(value: Mapping[str, Any], known: Sequence[str]) -> None:
    """Raise a `ValueError` if a table has another key than the known ones."""
    for key in value:
        if key not in known:
            raise ValueError(unknown("unknown key", key, known))


def names_of(info: ValidationInfo) -> PlanNames:
    """Give the names of the plan that a value is resolved for."""
    assert isinstance(info.context, PlanNames)
    return info.context


def _by(resolve: Callable[[PlanNames, Any], Any]) -> PlainValidator:
    return PlainValidator(lambda value, info: resolve(names_of(info), value))


_NUMBER_SCHEMA = {"type": ["number", "string"]}
_POINT_SCHEMA = {"type": "array", "items": _NUMBER_SCHEMA, "minItems": 2, "maxItems": 2}


def _named(items: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [{"type": "string"}, {"type": "array", "items": items}, {"type": "object"}]}


Number = Annotated[
    float, BeforeValidator(lambda value, info: names_of(info).number(value)), WithJsonSchema(_NUMBER_SCHEMA)
]
"""A number, or an expression over the plan's heights such as ``"quay + 0.2"``."""
Positive = Annotated[Number, Field(gt=0)]
Spacing = Annotated[Number, Field(ge=0.5)]
"""A distance of things that are repeated, or a size of cells, metres: none so small that there are too many."""
Formula = Annotated[ArrayFunction, _by(PlanNames.formula), WithJsonSchema(_NUMBER_SCHEMA)]
"""An expression over arrays, such as ``"2*eased(inland, 12, 26)*(1 + 0.8*noise)"``; see `evaluate_arrays`."""
At = Annotated[Point, _by(PlanNames.point), WithJsonSchema(_POINT_SCHEMA)]
"""A point ``[x, y]``, metres."""
Box = tuple[Number, Number, Number, Number]
"""An axis-parallel rectangle ``[x0, y0, x1, y1]``, metres."""
Point3 = tuple[Number, Number, Number]
"""A point ``[x, y, z]``, metres."""
Line = Annotated[list[Point], _by(PlanNames.line), WithJsonSchema(_named(_POINT_SCHEMA))]
"""The name of a line, its points, or ``{points, smooth}`` or ``{points, eased}``."""
Area = Annotated[BaseGeometry, _by(PlanNames.area), WithJsonSchema(_named(_NUMBER_SCHEMA))]
"""The name of an area, ``[x0, y0, x1, y1]``, or a table such as ``{disc = [x, y, radius], minus = "yard"}``."""
Bodies = Annotated[Parts, _by(PlanNames.bodies), WithJsonSchema({"type": "array", "items": {"type": "object"}})]
"""Parts as of a structure, which a builder adds to what it makes."""
Areas = Annotated[
    list[BaseGeometry],
    _by(PlanNames.several),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array"}, {"type": "object"}]}),
]
"""An area, or a list of areas."""
Material = Annotated[str, _by(PlanNames.material), WithJsonSchema({"type": "string"})]
"""A name of the palette, or a material such as ``"brick:#8a4638"``."""
Materials = Annotated[list[Material], Field(min_length=1)]
