"""Streets, paths, rails, areas and barriers of a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import polygonize, unary_union

from aerialdojo_gen.imports.map_bridges import BRIDGE
from aerialdojo_gen.imports.map_buildings import plans_of
from aerialdojo_gen.imports.map_tags import SURFACES, TABLES, Tags, below_ground, by_word, count, metres
from aerialdojo_gen.imports.osm import Feature

_SPACING_M = 0.06
_PARKED = ("parallel", "lane", "diagonal", "perpendicular", "street_side", "on_kerb", "half_on_kerb", "yes")
_LANE_M, _PARKED_M = 3.2, 2.2
_LEAST_AREA_M2 = 2.0
_BARRIERS = by_word({kind: table["tags"] for kind, table in TABLES["barriers"].items()})


def streets(lines: Sequence[Feature], window: Polygon, summary: Counter[str]) -> list[dict[str, Any]]:
    """Make the plan's streets and paths, clipped to a window somewhat larger than the site."""
    out = []
    for feature in lines:
        made = _street(feature.tags)
        if made is None:
            continue
        if below_ground(feature.tags):
            summary["ways in tunnels or below ground left out"] += 1
            continue
        if BRIDGE in feature.tags:
            # No parking on bridges.
            made = {k: v for k, v in made.items() if k != "parking"} | {"bridge": int(feature.tags[BRIDGE])}
        for line in clipped(feature.shape, window):
            out.append({**made, "line": line})
            summary["streets" if made["kind"] != "path" else "paths"] += 1
    return out


def clipped(shape: BaseGeometry, window: Polygon) -> list[list[list[float]]]:
    """Clip a line and round it to centimetres, without coincident points."""
    inner = shape.intersection(window)
    out = []
    for part in getattr(inner, "geoms", [inner]):
        if not isinstance(part, LineString) or part.is_empty:
            continue
        line: list[list[float]] = []
        for x, y in part.coords:
            p = [round(float(x), 2), round(float(y), 2)]
            if not line or (p[0] - line[-1][0]) ** 2 + (p[1] - line[-1][1]) ** 2 > _SPACING_M**2:
                line.append(p)
        if len(line) > 1 and LineString(line).length > 0.5:
            out.append(line)
    return out


def _street(tags: Tags) -> dict[str, Any] | None:
    kind_of = tags.get("highway", "").removesuffix("_link")
    if kind_of not in TABLES["streets"] or tags.get("footway") == "crossing" or tags.get("area") == "yes":
        return None
    kind, width, lanes, pavement = TABLES["streets"][kind_of]
    surface = SURFACES.get(tags.get("surface", ""), "")
    name = {"name": tags["name"][:80]} if tags.get("name") else {}
    if kind == "path":
        paved = surface or TABLES["path_surfaces"][kind_of]
        raised = tags.get("footway") == "sidewalk"
        own = metres(tags, "width", "est_width") or width
        return {"kind": kind, **name, "width_m": _wide(own), "surface": paved, **({"raised": True} if raised else {})}
    oneway = tags.get("oneway") in ("yes", "1", "true", "-1") or tags.get("junction") == "roundabout"
    tagged = count(tags, "lanes")
    lanes = min(tagged or (max(lanes - 1, 1) if oneway else lanes), 8)
    parking = kind == "side" and _parks(tags, by_rule=kind_of in ("residential", "unclassified", "living_street"))
    usual = (lanes * _LANE_M if tagged or oneway else width) + (2 * _PARKED_M if parking else 0.0)
    width = metres(tags, "width", "est_width") or usual
    sidewalk = tags.get("sidewalk", tags.get("sidewalk:both", ""))
    pavement = 0.0 if sidewalk in ("no", "none") else min(pavement, 1.2) if sidewalk == "separate" else pavement
    surface = surface or ("dirt" if kind_of == "track" else "asphalt")
    smooth = surface.startswith(("asphalt", "concrete"))
    return {
        "kind": kind, **name, "width_m": _wide(width), "lanes": lanes,
        **({"pavement_m": pavement} if pavement else {}), **({"oneway": True} if oneway else {}),
        **({"marks": True} if smooth and lanes > 1 and kind == "main" else {}),
        **({"parking": True} if parking and width >= 5.0 else {}), "surface": surface,
    }  # fmt: skip


def _wide(width: float) -> float:
    return round(min(max(width, 0.6), 40.0), 2)


def _parks(tags: Tags, *, by_rule: bool) -> bool:
    keys = [k for k in tags if k.startswith("parking:") and k.count(":") <= 2]
    values = [tags[k] for k in keys if not k.endswith(("fee", "conditional"))]
    return any(v in _PARKED for v in values) if values else by_rule


def rails(lines: Sequence[Feature], window: Polygon, on: str = "") -> list[list[list[float]]]:
    """Make the tracks in the open, on the ground or on bridge `on`."""
    kinds = ("tram", "rail", "light_rail", "narrow_gauge")
    open_ = (f for f in lines if f.tags.get("railway") in kinds and not below_ground(f.tags))
    return [line for f in open_ if f.tags.get(BRIDGE, "") == on for line in clipped(f.shape, window)]


def areas(
    features: Iterable[Feature], lines: Sequence[Feature], window: Polygon, summary: Counter[str]
) -> list[dict[str, Any]]:
    """Make the plan's areas, larger ones first, water above land."""
    out: list[tuple[bool, float, str, dict[str, Any]]] = []
    for feature in features:
        rule = _ground(feature.tags)
        if rule is None or below_ground(feature.tags) or "building" in feature.tags:
            continue
        material, grows = rule
        parking = feature.tags.get("amenity") == "parking"
        name = feature.tags.get("name", "")[:80] if grows == "park" or parking else ""
        for made in _areas(feature.shape.intersection(window), summary, material, grows, parking, name):
            out.append((material.startswith("water"), -feature.shape.area, feature.key, made))
    for feature in lines:
        wide = TABLES["waterways"].get(feature.tags.get("waterway", ""))
        if wide and not below_ground(feature.tags):
            wide = metres(feature.tags, "width") or wide
            wet = feature.shape.buffer(wide / 2).intersection(window)
            out += [(True, -wet.area, feature.key, made) for made in _areas(wet, summary, "water")]
    for piece in _sea(lines, window):
        out += [(True, -piece.area, "sea", made) for made in _areas(piece, summary, "water:#46788c")]
    return [made for *_, made in sorted(out, key=lambda row: row[:3])]


def _ground(tags: Tags) -> tuple[str, str] | None:
    if tags.get("parking") in ("underground", "multi-storey", "rooftop") or tags.get("amenity") == "parking_space":
        return None
    for key, values in TABLES["areas"].items():
        if tags.get(key) in values:
            material, _, grows = values[tags[key]].partition(" ")
            surface = SURFACES.get(tags.get("surface", ""), "")
            return (surface or material) if not material.startswith("water") else material, grows
    return None


def _areas(
    shape: BaseGeometry, summary: Counter[str], material: str, grows: str = "", parking: bool = False, name: str = ""
) -> list[dict[str, Any]]:
    optional = {k: v for k, v in {"grows": grows, "parking": parking, "name": name}.items() if v}
    plans = (plan for plan in plans_of(shape, 0.1, summary) if plan.area >= _LEAST_AREA_M2)
    return [{"material": material, **optional, "plan": plan} for plan in plans]


def _sea(lines: Sequence[Feature], window: Polygon) -> list[Polygon]:
    """Return the sea: what lies to the right of coastlines in OpenStreetMap."""
    coasts = [f.shape for f in lines if f.tags.get("natural") == "coastline" and f.shape.intersects(window)]
    if not coasts:
        return []
    out = []
    for face in polygonize(unary_union([*coasts, window.exterior])):
        spot: Point = face.representative_point()
        if not window.contains(spot):
            continue
        coast = min(coasts, key=lambda line: line.distance(spot))
        s = coast.project(spot)
        a, b = coast.interpolate(max(s - 0.5, 0.0)), coast.interpolate(min(s + 0.5, coast.length))
        if (b.x - a.x) * (spot.y - a.y) - (b.y - a.y) * (spot.x - a.x) < 0.0:
            out.append(face)
    return out


def barriers(lines: Sequence[Feature], window: Polygon) -> list[dict[str, Any]]:
    """Make walls, fences and hedges."""
    out = []
    for feature in lines:
        kind = _BARRIERS.get(feature.tags.get("barrier", ""))
        if kind is None or below_ground(feature.tags):
            continue
        height = min(max(metres(feature.tags, "height") or TABLES["barriers"][kind]["height_m"], 0.4), 8.0)
        out += [{"kind": kind, "height_m": round(height, 2), "line": line} for line in clipped(feature.shape, window)]
    return out
