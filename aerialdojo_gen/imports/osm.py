"""Extracts of OpenStreetMap, read by osmium: what lies in a bounding box, by tags."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.errors import AssetError, MissingPackage, UsageError, lacks
from aerialdojo_gen.imports.earth import Bbox, in_words

ATTRIBUTION = "© OpenStreetMap contributors, Open Database License (ODbL) 1.0, openstreetmap.org/copyright"
SUFFIXES = (".pbf", ".osm", ".osm.bz2", ".osm.gz")
# An extract of a city has tens of megabytes; positions of a country's points take gigabytes of memory.
_LARGEST_BYTES = 1 << 30
_MOST_POINTS = 5_000
# Ways of these are outlines of areas where they are closed; others stay lines.
_AREA_KEYS = ("building", "building:part", "landuse", "leisure", "natural", "amenity", "area", "area:highway",
              "tourism", "place", "water", "man_made", "public_transport", "railway")  # fmt: skip
_LINES = {"natural": ("tree_row", "cliff", "coastline"), "man_made": ("embankment", "pipeline", "beam", "wire"),
          "railway": ("rail", "tram", "subway", "light_rail")}  # fmt: skip

Tags = Mapping[str, str]


@dataclass(frozen=True)
class Feature:
    """A thing of the map.

    Attributes
    ----------
    key : str
        Where it is: the bounding box of all of it in degrees. Ids depend on who wrote the extract, this does not.
    shape : shapely geometry
        Point, LineString or Polygon, degrees; a multipolygon's parts are features of the same key.
    tags : mapping
        As mapped.
    """

    key: str
    shape: Any
    tags: Tags


@dataclass(frozen=True)
class Map:
    """What an extract has in a bounding box, each in the order of its places, whatever the order in the file."""

    points: tuple[Feature, ...]
    lines: tuple[Feature, ...]
    areas: tuple[Feature, ...]
    extent: Bbox


def read_map(path: Path, bbox: Bbox) -> Map:
    """Read what of an extract touches a bounding box; ways and areas whole.

    Parameters
    ----------
    path : Path
        ``.osm.pbf``, or ``.osm`` with or without ``.gz`` or ``.bz2``.
    bbox : (west, south, east, north)
        Degrees.

    Raises
    ------
    MissingPackage
        osmium is not installed.
    UsageError
        The box lies outside the extract: the message has the extract's.
    AssetError
        The file is missing, too large, cut short, or no such file.
    """
    try:
        osmium = importlib.import_module("osmium")
    except ImportError:
        raise MissingPackage(lacks("add-map", "osmium", "maps")) from None
    if not path.name.endswith(SUFFIXES):
        raise AssetError(f"{path}: a map is a file {', '.join(SUFFIXES)}")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror})") from None
    if size > _LARGEST_BYTES:
        raise AssetError(
            f"{path} has {size / 2**30:.1f} GiB, 1 GiB is the most: cut a part out of it first, e.g. osmium extract "
            f"--bbox {','.join(f'{v:g}' for v in bbox)} {path.name} -o part.osm.pbf"
        )
    try:
        found, extent = _read(osmium, path, bbox)
    except (RuntimeError, ValueError, UnicodeError) as error:
        why = " ".join(str(error).split()) or "it is damaged"
        raise AssetError(f"{path} cannot be read as a map, or is cut short: {why}; download it again") from None
    if extent is None:
        raise AssetError(f"{path} holds no points")
    if not any(found.values()):
        west, south, east, north = bbox
        apart = west > extent[2] or east < extent[0] or south > extent[3] or north < extent[1]
        why = "lies outside the extract" if apart else "has nothing of the map in it"
        raise UsageError(f"--bbox {in_words(bbox)} {why}: {path.name} reaches over {in_words(extent)}")
    points, lines, areas = (tuple(sorted(found[k], key=_order)) for k in ("points", "lines", "areas"))
    return Map(points, lines, areas, extent)


def _order(feature: Feature) -> tuple[str, list[tuple[str, str]], bytes]:
    return feature.key, sorted(feature.tags.items()), shapely.to_wkb(feature.shape)


def _key(shape: Any) -> str:
    # OpenStreetMap's coordinates have seven digits.
    return " ".join(f"{degrees:.7f}" for degrees in shape.bounds)


def _read(osmium: Any, path: Path, bbox: Bbox) -> tuple[dict[str, list[Feature]], Bbox | None]:
    """Go through a file once; the extent is that of its points, which a header need not state."""
    window = shapely.box(*bbox)
    shapely.prepare(window)
    found: dict[str, list[Feature]] = {"points": [], "lines": [], "areas": []}
    low, high = [1e9, 1e9], [-1e9, -1e9]
    factory = osmium.geom.WKBFactory()
    for thing in osmium.FileProcessor(str(path)).with_locations().with_areas():
        if thing.is_node():
            lon, lat = thing.location.lon, thing.location.lat
            low, high = [min(low[0], lon), min(low[1], lat)], [max(high[0], lon), max(high[1], lat)]
            if thing.tags and bbox[0] <= lon <= bbox[2] and bbox[1] <= lat <= bbox[3]:
                point = shapely.Point(lon, lat)
                found["points"].append(Feature(_key(point), point, dict(thing.tags)))
        elif thing.is_way():
            tags = dict(thing.tags)
            if not tags or (thing.is_closed() and _is_area(tags)) or len(thing.nodes) > _MOST_POINTS:
                continue
            line = _line(thing.nodes)
            if line is not None and window.intersects(line):
                found["lines"].append(Feature(_key(line), line, tags))
        elif thing.is_area():
            tags = dict(thing.tags)
            if not _is_area(tags):
                continue
            try:
                whole = shapely.from_wkb(bytes.fromhex(factory.create_multipolygon(thing)))
            except RuntimeError:
                continue  # an outline that the extract has cut
            if not window.intersects(whole):
                continue
            for part in shapely.get_parts(whole):
                if isinstance(part, Polygon) and window.intersects(part):
                    found["areas"].append(Feature(_key(whole), part, tags))
    extent = None if low[0] > high[0] else (low[0], low[1], high[0], high[1])
    return found, extent


def _is_area(tags: Tags) -> bool:
    if tags.get("area") == "no" or ("barrier" in tags and not {"building", "landuse"} & tags.keys()):
        return False
    if "highway" in tags and tags.get("area") != "yes" and "building" not in tags:
        return tags["highway"] == "platform"
    return any(key in tags and tags[key] not in _LINES.get(key, ()) for key in _AREA_KEYS)


def _line(nodes: Any) -> LineString | None:
    """Make the line of a way, as far as the extract has its points."""
    at = [(n.lon, n.lat) for n in nodes if n.location.valid()]
    at = [p for k, p in enumerate(at) if k == 0 or p != at[k - 1]]
    return LineString(at) if len(at) > 1 else None
