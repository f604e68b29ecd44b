"""Convert map data to the recipe of a town."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.imports import map_bridges, map_buildings, map_ground, map_things
from aerialdojo_gen.imports.earth import Bbox, LocalFrame, format_bbox, size_m
from aerialdojo_gen.imports.map_buildings import MapSummary
from aerialdojo_gen.imports.osm import ATTRIBUTION, Feature, Map
from aerialdojo_gen.imports.relief import LARGEST_M, SMALLEST_M
from aerialdojo_gen.imports.toml_text import recipe_text
from aerialdojo_gen.scenes.ground import polygons_of, rectangle
from aerialdojo_gen.scenes.layouts.places.parts.heights import Heights as HeightTable

# Streets extend beyond the border, to hide their ends.
_BEYOND_M = 15.0
_HEADROOM_M, _LOWEST_CEILING_M = 6.0, 15.0
# Built-up share above which the ground is paved.
_PAVED = 0.12
_MAX_ITEMS = 1000

Heights = dict[str, Any]


@dataclass(frozen=True)
class TownOptions:
    """What of a town the map does not say."""

    cell_m: float | None = None  # Of the ground
    attribution: str = ""  # Of the ground's heights
    seed: int = 0
    ceiling_m: float | None = None
    drive_on: str = "right"

    def __post_init__(self) -> None:
        """Check the side of the road."""
        if self.drive_on not in ("right", "left"):
            raise UsageError(f"--drive-on {self.drive_on[:20]!r}: right or left")


def town_recipe(
    found: Map, bbox: Bbox, source: str, options: TownOptions,
    heights: Callable[[LocalFrame, tuple[float, float]], Heights] | None,
) -> tuple[str, MapSummary]:  # fmt: skip
    """Write the recipe of a town; its origin is the centre of the bounding box (degrees)."""
    width, depth = (float(math.floor(s * 100 + 0.5) / 100) for s in size_m(bbox))
    if not (min(width, depth) >= SMALLEST_M and max(width, depth) <= LARGEST_M):
        raise UsageError(
            f"--bbox {format_bbox(bbox)} is {width:,.0f} by {depth:,.0f} m, a scene "
            f"{SMALLEST_M:g} to {LARGEST_M:,.0f} m: --tiles 200 cuts a large one into several"
        )
    frame, site = LocalFrame.about(bbox), rectangle(-width / 2, -depth / 2, width / 2, depth / 2)
    window = site.buffer(_BEYOND_M, join_style="mitre")
    points, lines, areas = (_in_metres(frame, features) for features in (found.points, found.lines, found.areas))
    summary = MapSummary()
    inner = site.buffer(-0.3, join_style="mitre")
    shops = map_things.shop_points(points, areas)
    buildings = map_buildings.buildings([a for a in areas if a.shape.intersects(site)], shops, inner, summary)
    built = shapely.union_all([Polygon(b["outline"], b.get("holes", ())) for one in buildings for b in one["bodies"]])
    share = built.area / site.area
    origin = {"lon_deg": round(frame.lon_deg, 7), "lat_deg": round(frame.lat_deg, 7)}
    table = None if heights is None else heights(frame, (width, depth))
    if table is not None:
        origin["z_m"] = table.pop("z_m")
    ground = _ground(table, (width, depth))
    raised, lines = map_bridges.bridges(lines, areas, site, ground, summary)
    parameters: dict[str, Any] = {
        "ground": "paving:#98958d" if share > _PAVED else "grass",
        "drive_on": options.drive_on,
        "rails": map_ground.rails(lines, window),
        "crossings": map_things.crossings(points, site),
        "signals": map_things.signals(points, site),
        "areas": map_ground.areas(areas, lines, window, summary),
        "roads": map_ground.streets(lines, window, summary),
        "bridges": [
            b.to_recipe() | ({"rails": rails} if (rails := map_ground.rails(lines, window, str(k))) else {})
            for k, b in enumerate(raised)
        ],
        "buildings": buildings,
        "barriers": map_ground.barriers(lines, inner),
        "things": map_things.things(points, lines, areas, inner, built, summary),
    }
    for key, value in parameters.items():
        if isinstance(value, list) and len(value) > _MAX_ITEMS:
            summary.add(f"{key} beyond the first {_MAX_ITEMS:,} left out", len(value) - _MAX_ITEMS)
            parameters[key] = value[:_MAX_ITEMS]
    parameters = {k: v for k, v in parameters.items() if v != []}
    if not ({"buildings", "roads", "areas", "things"} & parameters.keys()):
        raise UsageError(
            f"--bbox {format_bbox(bbox)} contains no map data: {source} covers {format_bbox(found.extent)}"
        )
    rise = 0.0
    if table is not None:
        parameters["heights"] = table
        rise = max(max(row) for row in table["rows_m"])
    tops = [b["top_m"] for one in buildings for b in one["bodies"]]
    top = max([*tops, *(max(b.heights_m) for b in raised)], default=0.0) + rise
    ceiling = options.ceiling_m
    if ceiling is None:
        ceiling = max(math.ceil(top + _HEADROOM_M), _LOWEST_CEILING_M)
    head = {
        "layout": "town", "seed": options.seed, "size_m": [width, depth], "ceiling_m": float(ceiling),
        "attribution": "; ".join(filter(None, (ATTRIBUTION, options.attribution))), "origin": origin,
    }  # fmt: skip
    comments = (
        f"Made by add-map of {source}, --bbox {' '.join(f'{v:.7g}' for v in bbox)}.",
        "Metres about the middle of the box, x east, y north. Change what is not so, and run again.",
    )
    return recipe_text(head, parameters, comments), summary


def _ground(table: Heights | None, size: tuple[float, float]) -> Callable[[float, float], float]:
    """Return the height of the ground at a point, metres."""
    if table is None:
        return lambda x, y: 0.0
    terrain = HeightTable.model_validate(table).terrain(size)
    return lambda x, y: float(terrain.z(x, y))


def _in_metres(frame: LocalFrame, features: Sequence[Feature]) -> list[Feature]:
    def moved(at: NDArray[Any]) -> NDArray[Any]:
        x, y = frame.metres(at[:, 0], at[:, 1])
        return shapely.get_coordinates(shapely.points(x, y))

    return [Feature(f.key, _make_valid(shapely.transform(f.shape, moved)), f.tags) for f in features]


def _make_valid(shape: Any) -> Any:
    if shape.is_valid:
        return shape
    made = shapely.make_valid(shape)
    # Repairing an area may leave lines, which overlays do not accept.
    return shapely.MultiPolygon(polygons_of(made)) if shape.geom_type.endswith("Polygon") else made
