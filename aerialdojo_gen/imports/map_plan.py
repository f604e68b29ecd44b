"""Convert map data to the plan of a town."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any

import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.imports import map_bridges, map_buildings, map_ground, map_props
from aerialdojo_gen.imports.earth import Bbox, LocalFrame, format_bbox, size_m
from aerialdojo_gen.imports.map_buildings import area_of
from aerialdojo_gen.imports.map_furniture import Furniture, Streets, car_park_rows
from aerialdojo_gen.imports.map_tags import TABLES
from aerialdojo_gen.imports.osm import ATTRIBUTION, Feature, Map
from aerialdojo_gen.imports.placing import Placer
from aerialdojo_gen.imports.relief import LARGEST_M, SMALLEST_M, HeightTable, PlacePlan
from aerialdojo_gen.scenes.ground import polygons_of, rectangle
from aerialdojo_gen.scenes.kit.street_network import Street, lay_out
from aerialdojo_gen.scenes.kit.streets import Bridge

# Streets extend beyond the border, to hide their ends.
_BEYOND_M = 15.0
_HEADROOM_M, _LOWEST_CEILING_M = 6.0, 15.0
# Built-up share above which the ground is paved.
_PAVED = 0.12
_MAX_ITEMS, _MAX_BUILDINGS = 1000, 3000


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


def _place_things(placer: Placer, town: Mapping[str, list[Any]], drive_on: str) -> None:
    """Place what the map has, and what such streets have by rule, where the built streets leave room."""
    streets = [Street(**_points(table)) for table in map(_street, town["roads"])]
    bridges = [Bridge(**_points(table)) for table in town["bridges"]]
    layout = lay_out(placer.site, streets, bridges, town["crossings"])
    level = [
        road for road, street in zip(town["roads"], streets, strict=True)
        if street.kind != "path" and layout.on_ground(street)
    ]  # fmt: skip
    level_streets = Streets(tuple(level), tuple(LineString(road["line"]) for road in level), layout)
    furniture = Furniture(placer, town, level_streets, drive_on)
    furniture.place_mapped()
    furniture.place_by_rule()


def town_plan(
    mapped: Map, bbox: Bbox, source: str, options: TownOptions,
    heights: Callable[[LocalFrame, tuple[float, float]], HeightTable] | None,
) -> tuple[PlacePlan, Counter[str]]:  # fmt: skip
    """Make the plan of a town; its origin is the centre of the bounding box (degrees)."""
    width, depth = (float(math.floor(s * 100 + 0.5) / 100) for s in size_m(bbox))
    if not (min(width, depth) >= SMALLEST_M and max(width, depth) <= LARGEST_M):
        raise UsageError(
            f"--bbox {format_bbox(bbox)} is {width:,.0f} by {depth:,.0f} m, a scene "
            f"{SMALLEST_M:g} to {LARGEST_M:,.0f} m: --tiles 200 cuts a large one into several"
        )
    frame, site = LocalFrame.about(bbox), rectangle(-width / 2, -depth / 2, width / 2, depth / 2)
    table = None if heights is None else heights(frame, (width, depth))
    summary: Counter[str] = Counter()
    town, built_share = _town(mapped, frame, site, table, summary)
    if not any(town[key] for key in ("buildings", "roads", "areas", "things")):
        raise UsageError(
            f"--bbox {format_bbox(bbox)} contains no map data: {source} covers {format_bbox(mapped.extent)}"
        )
    entries, sections = _entries(town, site)
    tops = [b["top_m"] for one in town["buildings"] for b in one["bodies"]]
    tops += [max(b["heights_m"]) for b in town["bridges"]]
    top = max(tops, default=0.0) + (0.0 if table is None else float(table.rows_m.max()))
    ceiling = max(math.ceil(top + _HEADROOM_M), _LOWEST_CEILING_M) if options.ceiling_m is None else options.ceiling_m
    plan = {
        "plan": 1, "seed": options.seed, "size_m": [width, depth], "ceiling_m": float(ceiling),
        "attribution": "; ".join(filter(None, (ATTRIBUTION, options.attribution))),
        "origin": {"lon_deg": round(frame.lon_deg, 7), "lat_deg": round(frame.lat_deg, 7),
                   **({} if table is None else {"z_m": table.datum_m})},
        "ground": {"material": "paving:#98958d" if built_share > _PAVED else "grass",
                   **({} if table is None else {"steps": [{"make": "surveyed_heights"}]})},
        "site": entries,
    }  # fmt: skip
    comments = (
        f"Made by add-map of {source}, --bbox {' '.join(f'{v:.7g}' for v in bbox)}.",
        "Metres about the middle of the box, x east, y north. Change what is not so, and run again.",
    )
    place_things = partial(_place_things, town=town, drive_on=options.drive_on)
    return PlacePlan(plan, sections, comments, table, place_things), summary


def _town(
    mapped: Map, frame: LocalFrame, site: shapely.Polygon, table: HeightTable | None, summary: Counter[str]
) -> tuple[dict[str, list[Any]], float]:
    """Collect what the map has, in metres, and the share of the site that is built up."""
    window = site.buffer(_BEYOND_M, join_style="mitre")
    points, lines, areas = (_in_metres(frame, some) for some in (mapped.points, mapped.lines, mapped.areas))
    inner = site.buffer(-0.3, join_style="mitre")
    shops = map_props.shop_points(points, areas)
    buildings = map_buildings.buildings([a for a in areas if a.shape.intersects(site)], shops, inner, summary)
    built = shapely.union_all([b["plan"] for one in buildings for b in one["bodies"]])
    ground = None if table is None else table.terrain()
    raised, lines = map_bridges.bridges(
        lines, areas, site, (lambda x, y: 0.0) if ground is None else lambda x, y: float(ground.z(x, y)), summary
    )
    town: dict[str, list[Any]] = {
        "rails": map_ground.rails(lines, window),
        "crossings": map_props.crossings(points, site),
        "signals": map_props.signals(points, site),
        "areas": map_ground.areas(areas, lines, window, summary),
        "roads": map_ground.streets(lines, window, summary),
        "bridges": [
            b.to_plan() | ({"rails": rails} if (rails := map_ground.rails(lines, window, str(k))) else {})
            for k, b in enumerate(raised)
        ],
        "buildings": buildings,
        "barriers": map_ground.barriers(lines, inner),
        "things": map_props.props(points, lines, areas, inner, built, summary),
    }
    for key, value in town.items():
        most = _MAX_BUILDINGS if key == "buildings" else _MAX_ITEMS
        if len(value) > most:
            summary[f"{key} beyond the first {most:,} left out"] += len(value) - most
            town[key] = value[:most]
    return town, built.area / site.area


def _entries(town: Mapping[str, list[Any]], site: shapely.Polygon) -> tuple[list[dict[str, Any]], dict[int, str]]:
    """Make the entries of what lies on the ground and of what is built, and the comments of their sections."""
    out: list[dict[str, Any]] = []
    sections: dict[int, str] = {}

    def add(section: str, entries: Sequence[dict[str, Any]]) -> None:
        if entries:
            sections[len(out)] = section
            out.extend(entries)

    # Later ones cover earlier ones: only neighbours of one material share an entry.
    groups = [(key, list(group)) for key, group in groupby(town["areas"], key=lambda area: area["material"])]
    add(
        "Kinds of ground",
        [{"paint": [area_of(one["plan"]) for one in group], "material": key} for key, group in groups],
    )
    streets = {"make": "street_network", "streets": [_street(road) for road in town["roads"]]}
    streets |= {key: town[key] for key in ("bridges", "rails", "crossings") if town[key]}
    add("Streets, paths and bridges", [streets] if town["roads"] or town["bridges"] or town["rails"] else [])
    rows = [row for area in town["areas"] if area.get("parking") for row in car_park_rows(area, site)]
    add("Bays of car parks", [{"make": "parking_rows", "rows": rows}] if rows else [])
    whole = [
        {**one, "bodies": [{"outline": area_of(body["plan"]), **_without(body, "plan")} for body in one["bodies"]]}
        for one in town["buildings"]
    ]
    add("Buildings", [{"make": "buildings", "buildings": whole}] if whole else [])
    wet = [area_of(area["plan"]) for area in town["areas"] if area["material"].startswith("water")]
    add("Nothing stands in the water", [{"make": "keep_free", "areas": wet}] if wet else [])
    add("Walls, fences and hedges", list(_barriers(town["barriers"], site)))
    return out, sections


def _barriers(barriers: Sequence[Mapping[str, Any]], site: shapely.Polygon) -> list[dict[str, Any]]:
    """Make the entries of barriers, by kind and height, of the legs that lie on the site."""
    groups: dict[tuple[str, float], dict[str, Any]] = {}
    for barrier in barriers:
        kind, high = barrier["kind"], barrier["height_m"]
        line = shapely.intersection(LineString(barrier["line"]), site.buffer(-0.4))
        for leg in shapely.get_parts(line):
            if isinstance(leg, LineString) and leg.length > 0.6:
                entry = TABLES["barriers"][kind]["entry"]
                own = entry | ({"height_m": high} if "height_m" in entry else {}) | {"lines": []}
                points = [[round(x, 2), round(y, 2)] for x, y in leg.simplify(0.1).coords]
                groups.setdefault((kind, high), own)["lines"].append(points)
    return list(groups.values())


def _street(road: Mapping[str, Any]) -> dict[str, Any]:
    """Return a street as the plan has it: whether cars park and drive there is seen by the cars."""
    kind = {} if road["kind"] in ("main", "side") else {"kind": road["kind"]}
    return kind | _without(road, "kind", "parking")


def _without(table: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in keys}


def _points(table: Mapping[str, Any]) -> dict[str, Any]:
    """Give the points of lines the type that builders get."""
    rails = {"rails": [[tuple(at) for at in line] for line in table["rails"]]} if "rails" in table else {}
    return {**table, **rails, "line": [tuple(at) for at in table["line"]]}


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
