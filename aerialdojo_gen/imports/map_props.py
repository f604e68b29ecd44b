"""Objects of a map that the catalogue has: trees, benches, lamps, stops, statues."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.imports.map_tags import TABLES, Tags, bearing_deg, below_ground, metres
from aerialdojo_gen.imports.osm import Feature

_PLATE = ("plaque", "stolperstein", "plate")
_SMALL_ART = ("mural", "graffiti", "relief", "mosaic", "plaque", "painting")
_PARKING_METER = ("parking_tickets", "parking")
_SPACING_M = {"tree_row": 8.0, "bollard": 1.8}
_SHOPS = ("cafe", "restaurant", "bar", "pub", "fast_food", "bank", "pharmacy", "ice_cream", "cinema", "theatre")
_WALL_M = 1.5
_MAPPED_TREE_M = {"urban_tree": 6.0, "oak_tree": 10.7, "spruce_tree": 12.0}


def props(points: Sequence[Feature], lines: Sequence[Feature], areas: Sequence[Feature], site: Polygon,
           built: BaseGeometry, summary: Counter[str]) -> list[dict[str, Any]]:  # fmt: skip
    """Make the plan's things: points of the map, rows of trees and bollards, small things drawn as areas."""
    out = []
    for feature in points:
        category = _category(feature.tags)
        if category is None or below_ground(feature.tags) or not site.contains(feature.shape):
            continue
        # What lies in a building is no street furniture.
        at = _move_before_wall(feature.shape, built)
        if at is None:
            summary["things inside buildings left out"] += 1
            continue
        out.append(_thing(category, at, feature.tags))
    for feature in lines:
        row = feature.tags.get("natural") == "tree_row"
        spacing = _SPACING_M.get("tree_row" if row else feature.tags.get("barrier", ""))
        if spacing and not below_ground(feature.tags):
            category = "urban_tree" if "natural" in feature.tags else "bollard"
            places = (p for p in _along(feature.shape, spacing) if site.contains(p) and not built.contains(p))
            out += [_thing(category, p, feature.tags) for p in places]
    for feature in areas:
        category = _category(feature.tags)
        at = feature.shape.representative_point()
        if category and category != "urban_tree" and site.contains(at) and not built.contains(at):
            out.append(_thing(category, at, feature.tags))
    summary["things of the map"] += len(out)
    return out


def shop_points(points: Sequence[Feature], areas: Sequence[Feature]) -> list[BaseGeometry]:
    """Positions of shops, cafés and the like, metres."""
    return [f.shape.representative_point() for f in (*points, *areas)
            if "shop" in f.tags or f.tags.get("amenity") in _SHOPS]  # fmt: skip


def crossings(points: Sequence[Feature], site: Polygon) -> list[list[float]]:
    """Positions of marked crossings."""
    return [_at(f.shape) for f in points if site.contains(f.shape) and _striped(f.tags)]


def signals(points: Sequence[Feature], site: Polygon) -> list[list[float]]:
    """Positions of traffic lights."""
    kinds = ("highway", "crossing")
    return [_at(f.shape) for f in points if site.contains(f.shape)
            and any(f.tags.get(key) == "traffic_signals" for key in kinds)]  # fmt: skip


def _striped(tags: Tags) -> bool:
    kinds = ("zebra", "marked", "uncontrolled", "traffic_signals")
    marked = tags.get("crossing", "marked") in kinds and tags.get("crossing:markings", "yes") != "no"
    return tags.get("highway") == "crossing" and marked


def _category(tags: Tags) -> str | None:
    if tags.get("memorial") in _PLATE or tags.get("artwork_type") in _SMALL_ART:
        return None
    if tags.get("vending") in _PARKING_METER:
        return "parking_meter"
    if tags.get("amenity") == "bench" and tags.get("leisure") == "picnic_table":
        return "picnic_set"
    if tags.get("natural") == "tree":
        conifer = "conifer" in (tags.get("type"), tags.get("wood")) or tags.get("leaf_type") == "needleleaved"
        tall = (metres(tags, "height") or 0.0) > 9.0
        return "spruce_tree" if conifer else "oak_tree" if tall else "urban_tree"
    for key, values in TABLES["things"].items():
        if tags.get(key) in values:
            return values[tags[key]]
    return None


def _thing(category: str, at: Point, tags: Tags) -> dict[str, Any]:
    made: dict[str, Any] = {"category": category, "at": _at(at)}
    height = metres(tags, "height")
    if height and category in _MAPPED_TREE_M:
        made["scale"] = round(min(max(height / _MAPPED_TREE_M[category], 0.5), 2.5), 2)
    bearing = bearing_deg(tags, "direction")
    if bearing is not None:
        made["yaw"] = round(90.0 - bearing, 1)
    return made


def _at(point: BaseGeometry) -> list[float]:
    return [round(float(point.x), 2), round(float(point.y), 2)]


def _along(line: BaseGeometry, spacing_m: float) -> list[Point]:
    if not isinstance(line, LineString):
        return []
    n = max(int(line.length // spacing_m), 1)
    return [line.interpolate(line.length * k / n) for k in range(n + 1)]


def _move_before_wall(point: Point, built: BaseGeometry) -> Point | None:
    """Move a point in or on a wall to just outside it; None if it is well inside."""
    if built.is_empty or not built.intersects(point.buffer(0.3)):
        return point
    ring = built.boundary
    foot = ring.interpolate(ring.project(point))
    depth = foot.distance(point)
    if built.contains(point) and depth > _WALL_M:
        return None
    for k in range(16):
        a = math.pi * k / 8
        moved = Point(foot.x + math.cos(a), foot.y + math.sin(a))
        if not shapely.intersects(built, moved.buffer(0.9)):
            return moved
    return None
