"""Buildings of a map: category, height, roof, façade."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from statistics import median_low
from typing import Any

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.imports.map_tags import TABLES, Tags, below_ground, by_word, colour, count, metres
from aerialdojo_gen.imports.osm import Feature
from aerialdojo_gen.scenes.colours import colour_name
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.materials import parse_colour

STOREY_M = 3.2
_ROOF_LEVEL_M = 2.4
_MIN_M2, _MIN_WIDTH_M = 6.0, 1.2
_MIN_HOLE_M2 = 1.0
# As many as a line of a plan has, or a little less.
_MAX_POINTS = 900
_LEFT_OUT = "outlines left out: self-intersecting or with too many corners"
_PITCH = 0.62
_MAX_RISE_M = 5.0
# If the parts cover more than this share of a building, its outline adds nothing.
_PARTED = 0.85
_SHOP_NEAR_M = 2.5

_CATEGORY, _ROOFS = by_word(TABLES["buildings"]), by_word(TABLES["roofs"])
_MATERIALS = {kind: specs.split() for kind, specs in TABLES["materials"].items()}


def plans_of(shape: BaseGeometry, tolerance_m: float, summary: Counter[str]) -> list[Polygon]:
    """Simplify an area and round it to centimetres; count what becomes invalid."""
    out = []
    for piece in polygons_of(shape):
        plan = piece.simplify(tolerance_m)
        rounded = [_to_centimetres(plan)]
        if not rounded[0].is_valid:
            # GEOS snaps to whole centimetres, so that rounding again changes nothing.
            rounded = [_to_centimetres(p) for p in polygons_of(shapely.set_precision(plan, 0.01))]
        valid = [p for p in rounded if p.is_valid and len(p.exterior.coords) <= _MAX_POINTS]
        if len(valid) < len(rounded):
            summary[_LEFT_OUT] += len(rounded) - len(valid)
        out += valid
    return out


def area_of(plan: Polygon) -> dict[str, Any]:
    """Return an area as plans write it."""
    outline, *holes = ([list(at) for at in ring.coords[:-1]] for ring in (plan.exterior, *plan.interiors))
    return {"polygon": outline, **({"minus": [{"polygon": hole} for hole in holes]} if holes else {})}


def _to_centimetres(plan: Polygon) -> Polygon:
    def ring(r: Any) -> list[tuple[float, float]]:
        return [(round(float(x), 2), round(float(y), 2)) for x, y in r.coords]

    return Polygon(ring(plan.exterior), [ring(r) for r in plan.interiors if Polygon(r).area > _MIN_HOLE_M2])


def buildings(
    areas: Sequence[Feature], shops: Sequence[BaseGeometry], site: Polygon, summary: Counter[str]
) -> list[dict[str, Any]]:
    """Make the plan's buildings from map areas in metres."""
    outlines = [a for a in areas if a.tags.get("building", "no") != "no" and not below_ground(a.tags)]
    parts = [a for a in areas if a.tags.get("building:part", "no") != "no" and not below_ground(a.tags)]
    levels = [n for a in outlines if (n := count(a.tags, "building:levels")) and n > 1]
    usual = median_low(levels) if len(levels) >= 3 else 3
    tree = STRtree([p.shape.representative_point() for p in parts])
    taken: list[BaseGeometry] = []
    shop_points = shapely.union_all(list(shops)) if shops else None
    out = []
    # Overlapping outlines are cut out of the larger building.
    for area in sorted(outlines, key=lambda a: (a.shape.area, a.key)):
        own = [parts[k] for k in sorted(tree.query(area.shape, predicate="contains"))]
        # The union of thousands that are elsewhere takes minutes.
        near = [taken[k] for k in np.flatnonzero(shapely.intersects(taken, area.shape))]
        plan = area.shape.difference(shapely.union_all(near)) if near else area.shape
        taken = [*taken, area.shape]
        bodies = [
            b
            for part in own
            for b in _bodies(part.shape.intersection(plan), _inherited(area, part), usual, site, summary, part=True)
        ]
        rest = plan.difference(shapely.union_all([p.shape for p in own])) if own else plan
        if not own or rest.area > (1.0 - _PARTED) * area.shape.area:
            bodies += _bodies(rest, area, usual, site, summary)
        if bodies:
            out.append((area.key, _building(area, bodies, shop_points)))
    summary["buildings"] += len(out)
    return [made for _, made in sorted(out, key=lambda item: item[0])]


def _inherited(whole: Feature, part: Feature) -> Feature:
    """Return a part with its building's tags as defaults, except for heights."""
    own = ("height", "building:levels", "roof:", "min_height", "building:min_level")
    given = {k: v for k, v in whole.tags.items() if not k.startswith(own)}
    return Feature(part.key, part.shape, given | dict(part.tags))


def category(tags: Tags) -> str:
    """Return the category of a building, by its kind or its use."""
    keys = ("building", "amenity", "tourism", "shop", "office", "building:use")
    if categories := [_CATEGORY[tags[key]] for key in keys if tags.get(key) in _CATEGORY]:
        return categories[0]
    if tags.get("amenity") == "place_of_worship":
        return "church"
    return "shop_building" if "shop" in tags else "office_building" if "office" in tags else "building"


def _building(area: Feature, bodies: list[dict[str, Any]], shops: BaseGeometry | None) -> dict[str, Any]:
    kind = category(area.tags)
    wall, word = _wall(area, kind, max(b["top_m"] for b in bodies))
    lets = kind in ("shop_building", "hotel") or (
        kind in ("building", "apartment_building", "office_building", "public_building")
        and shops is not None and shapely.distance(shops, area.shape) < _SHOP_NEAR_M
    )  # fmt: skip
    pitched = any(b["roof"] != "flat" for b in bodies)
    named = {"name": area.tags.get("name", "")[:80], "street": area.tags.get("addr:street", "")[:80]}
    return {
        "category": kind, **{k: v for k, v in named.items() if v}, "wall": wall,
        "roofing": _roofing(area, pitched, kind), **({"colour": word} if word else {}),
        **({"shops": True} if lets else {}), **({"canopy": True} if kind == "canopy" else {}), "bodies": bodies,
    }  # fmt: skip


def _bodies(
    shape: BaseGeometry, area: Feature, usual: int, site: Polygon, summary: Counter[str], *, part: bool = False
) -> list[dict[str, Any]]:
    out = []
    for plan in plans_of(shape.intersection(site), 0.12, summary):
        if plan.area < _MIN_M2 or plan.buffer(-_MIN_WIDTH_M / 2).is_empty:
            continue
        base, top, roof, rise = _heights(area, plan, usual, None if part else summary)
        out.append({
            "plan": plan, **({"base_m": round(base, 2)} if base else {}), "top_m": round(top, 2), "roof": roof,
            **({"roof_m": round(rise, 2)} if rise else {}),
        })  # fmt: skip
    return out


def _heights(
    area: Feature, plan: Polygon, usual: int, summary: Counter[str] | None
) -> tuple[float, float, str, float]:
    """Base, top, roof shape and roof rise, metres above ground."""
    tags, kind = area.tags, category(area.tags)
    height, levels = metres(tags, "height", "building:height"), count(tags, "building:levels")
    small = 1 if plan.area < 60.0 else 2 if plan.area < 160.0 else usual
    levels_used = TABLES["levels"].get(kind, small) if levels is None else levels
    if summary is not None:
        summary["height" if height else "levels" if levels else "rule"] += 1
    form = _ROOFS.get(tags.get("roof:shape", ""), "") or _usual_roof(area, kind, levels_used)
    # The roof slope spans half the narrower side.
    half = float(shapely.maximum_inscribed_circle(plan, tolerance=0.1).length)
    rise = metres(tags, "roof:height")
    if rise is None:
        usual_rise = min(half * (1.0 if form == "dome" else _PITCH), _MAX_RISE_M)
        rise = (count(tags, "roof:levels") or 0) * _ROOF_LEVEL_M or usual_rise
    rise = 0.0 if form == "flat" else rise
    base = metres(tags, "min_height", "building:min_height") or STOREY_M * (count(tags, "building:min_level") or 0)
    if height is None:
        height = (3.0 if kind == "canopy" else max(levels_used * STOREY_M, 2.6)) + rise
    height = min(max(height, 2.2), 400.0)
    base = min(base, height - 1.0)
    if rise > 0.8 * (height - base):
        rise = 0.5 * (height - base)
    return (base, height, form, rise) if rise >= 0.3 else (base, height, "flat", 0.0)


def _usual_roof(area: Feature, kind: str, levels: int) -> str:
    if kind in ("house", "church"):
        return "gabled"
    old = kind in ("apartment_building", "building", "public_building", "school", "hotel") and 2 <= levels <= 8
    return "hipped" if old and _rank(area, "roof") % 10 < 6 else "flat"


def _wall(area: Feature, kind: str, top_m: float) -> tuple[str, str]:
    """Material of the walls, and their colour word, empty for glass."""
    tags = area.tags
    given, material = colour(tags, "building:colour", "building:color"), tags.get("building:material", "")
    paint = given or _pick(area, "plaster")
    brick = given or _pick(area, "brick")
    if material == "glass" or (kind == "office_building" and not given and material in ("", "steel", "metal")):
        spec = "curtain_wall" if material == "glass" else _pick(area, "office")
    elif material == "wood":
        spec = f"planks:{given or '#b59468'}"
    elif kind in ("church", "outbuilding", "garage_building", "canopy") or top_m < 2.8:
        spec = f"brick:{brick}" if material == "brick" else f"plaster:{paint}"
    elif kind == "factory_building":
        spec = f"facade_industrial:{given}" if given else "facade_industrial"
    elif material == "brick" or (not material and not given and _rank(area, "wall") % 10 < 2):
        spec = f"facade_brick:{brick}"
    else:
        spec = f"facade_flats:{paint}"
    shade = spec.partition(":")[2]
    painted = shade and not spec.startswith(("curtain_wall", "facade_office"))
    return spec, colour_name(parse_colour(shade)) if painted else ""


def _roofing(area: Feature, pitched: bool, kind: str) -> str:
    given, material = colour(area.tags, "roof:colour", "roof:color"), area.tags.get("roof:material", "")
    if not pitched:
        return f"concrete:{given}" if given else _pick(area, "flat")
    tiled = material in ("roof_tiles", "tile", "tiles") or (not material and kind == "house")
    if given:
        return f"{'roof_tiles' if tiled else 'sheet_metal'}:{given}"
    if material == "copper":
        return "sheet_metal:#6fa08c"
    return _pick(area, "tiles" if tiled else "metal", "roofing")


def _pick(area: Feature, kind: str, what: str = "") -> str:
    """Choose a material of a kind."""
    return _MATERIALS[kind][_rank(area, what or kind) % len(_MATERIALS[kind])]


def _rank(area: Feature, what: str) -> int:
    """Draw by the building's position alone: independent of ids, other buildings and the bounding box."""
    return rank(0, "add-map", area.key, what)
