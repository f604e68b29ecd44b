"""Read OpenStreetMap extracts with osmium: the features in bounding boxes.

Files are untrusted: they are read in a child process with limits on memory and time.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.base.environment_errors import is_out_of_memory
from aerialdojo_gen.base.errors import AssetError, MissingPackage, UsageError, check_regular, no_package
from aerialdojo_gen.imports.earth import Bbox, format_bbox
from aerialdojo_gen.imports.untrusted import MAX_MEMORY_BYTES, exit_status, read_in_sandbox
from aerialdojo_gen.store.staging import scratch_folder

ATTRIBUTION = "© OpenStreetMap contributors, Open Database License (ODbL) 1.0, openstreetmap.org/copyright"
SUFFIXES = (".pbf", ".osm", ".osm.bz2", ".osm.gz")
# A city's extract has tens of megabytes; a country's node positions need gigabytes of memory.
_MAX_BYTES = 1 << 30
_MAX_POINTS = 5_000
# Closed ways with these keys are areas; others stay lines.
_AREA_KEYS = ("building", "building:part", "landuse", "leisure", "natural", "amenity", "area", "area:highway",
              "tourism", "place", "water", "man_made", "public_transport", "railway")  # fmt: skip
_LINES = {"natural": ("tree_row", "cliff", "coastline"), "man_made": ("embankment", "pipeline", "beam", "wire"),
          "railway": ("rail", "tram", "subway", "light_rail")}  # fmt: skip

_KINDS = ("points", "lines", "areas")

Tags = Mapping[str, str]
_RawFeature = tuple[str, str, Tags]
"""Key, shape as hexadecimal WKB, tags."""


@dataclass(frozen=True)
class Feature:
    """A feature of the map."""

    key: str
    shape: Any  # Point, LineString or Polygon, degrees; parts of a multipolygon are features with the same key
    tags: Tags  # As mapped

    def order(self) -> tuple[str, list[tuple[str, str]], bytes]:
        """Key by which features are sorted, whatever their order in the file."""
        return self.key, sorted(self.tags.items()), shapely.to_wkb(self.shape)


@dataclass(frozen=True)
class Map:
    """The features of an extract in a bounding box, sorted by position."""

    points: tuple[Feature, ...]
    lines: tuple[Feature, ...]
    areas: tuple[Feature, ...]
    extent: Bbox


def read_maps(path: Path, boxes: Sequence[Bbox]) -> list[Map]:
    """Read the features that touch bounding boxes (degrees) in one pass; ways and areas stay whole."""
    try:
        importlib.import_module("osmium")
    except ImportError:
        raise MissingPackage(no_package("add-map", "osmium", "maps")) from None
    if not path.name.endswith(SUFFIXES):
        raise AssetError(f"{path}: a map is a file {', '.join(SUFFIXES)}")
    try:
        check_regular(path)
        size = path.stat().st_size
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror})") from None
    if size > _MAX_BYTES:
        raise AssetError(f"{path} has {size / 2**30:.1f} GiB, the maximum is 1 GiB: {_extract_advice(path, boxes)}")
    with scratch_folder() as folder:
        out = folder / "found.json"
        args = [str(out), json.dumps(boxes)]
        read_in_sandbox(__name__, path, args, MAX_MEMORY_BYTES, _extract_advice(path, boxes))
        content = json.loads(out.read_text(encoding="utf-8"))
    west, south, east, north = extent = tuple(content["extent"])
    maps = []
    for box, own in zip(boxes, content["boxes"], strict=True):
        if not any(own.values()):
            disjoint = box[0] > east or box[2] < west or box[1] > north or box[3] < south
            why = "lies outside the extract" if disjoint else "contains no map data"
            raise UsageError(f"--bbox {format_bbox(box)} {why}: {path.name} covers {format_bbox(extent)}")
        points, lines, areas = (
            tuple(sorted((Feature(k, shapely.from_wkb(shape), t) for k, shape, t in own[kind]), key=Feature.order))
            for kind in _KINDS
        )
        maps.append(Map(points, lines, areas, extent))
    return maps


def _extract_advice(path: Path, boxes: Sequence[Bbox]) -> str:
    where = ",".join(f"{v:g}" for v in (*np.min(boxes, axis=0)[:2], *np.max(boxes, axis=0)[2:]))
    return f"cut a part out of it first, e.g. osmium extract --bbox {where} {path.name} -o part.osm.pbf"


def read_into(path: Path, out: Path, boxes: Sequence[Bbox]) -> str:
    """Read an extract in the sandboxed child process; returns the error message, or an empty string."""
    try:
        content, extent = _read(importlib.import_module("osmium"), path, boxes)
        if extent is None:
            return "holds no points"
        out.write_text(json.dumps({"extent": extent, "boxes": content}), encoding="utf-8")
    except Exception as error:  # untrusted files can make a reader fail in any way: report it
        if isinstance(error, MemoryError) or is_out_of_memory(str(error)):
            raise MemoryError from None
        why = " ".join(str(error).split())[:200] or "it is damaged"
        return f"cannot be read as a map, or is cut short: {why}; download it again"
    return ""


def _read(osmium: Any, path: Path, boxes: Sequence[Bbox]) -> tuple[list[dict[str, list[_RawFeature]]], Bbox | None]:
    """Read a file once; the extent is computed from its points, as a header need not state it."""
    windows = shapely.box(*np.asarray(boxes, dtype=np.float64).T)
    extent_box = shapely.box(*shapely.total_bounds(windows))
    for shape in (windows, extent_box):
        shapely.prepare(shape)
    content: list[dict[str, list[_RawFeature]]] = [{kind: [] for kind in _KINDS} for _ in boxes]
    low, high = (1e9, 1e9), (-1e9, -1e9)
    factory = osmium.geom.WKBFactory()

    def keep(kind: str, shape: Any, part: Any, tags: Tags) -> None:
        if not extent_box.intersects(part):
            return
        key = " ".join(f"{degrees:.7f}" for degrees in shape.bounds)  # as many decimals as the map has
        for k in np.flatnonzero(shapely.intersects(windows, part)):
            content[k][kind].append((key, str(shapely.to_wkb(part, hex=True)), tags))

    for thing in osmium.FileProcessor(str(path)).with_locations().with_areas():
        if thing.is_node():
            lon, lat = thing.location.lon, thing.location.lat
            low, high = (min(low[0], lon), min(low[1], lat)), (max(high[0], lon), max(high[1], lat))
            if thing.tags:
                point = shapely.Point(lon, lat)
                keep("points", point, point, dict(thing.tags))
        elif thing.is_way():
            tags = dict(thing.tags)
            if not tags or (thing.is_closed() and _is_area(tags)) or len(thing.nodes) > _MAX_POINTS:
                continue
            line = _line(thing.nodes)
            if line is not None:
                keep("lines", line, line, tags)
        elif thing.is_area():
            tags = dict(thing.tags)
            if not _is_area(tags):
                continue
            try:
                whole = shapely.from_wkb(bytes.fromhex(factory.create_multipolygon(thing)))
            except RuntimeError:
                continue  # an outline that the extract cuts off
            for part in shapely.get_parts(whole):
                if isinstance(part, Polygon):
                    keep("areas", whole, part, tags)
    return content, None if low[0] > high[0] else (*low, *high)


def _is_area(tags: Tags) -> bool:
    if tags.get("area") == "no" or ("barrier" in tags and not {"building", "landuse"} & tags.keys()):
        return False
    if "highway" in tags and tags.get("area") != "yes" and "building" not in tags:
        return tags["highway"] == "platform"
    return any(key in tags and tags[key] not in _LINES.get(key, ()) for key in _AREA_KEYS)


def _line(nodes: Any) -> LineString | None:
    """Make the line of a way from the points in the extract."""
    at = [(n.lon, n.lat) for n in nodes if n.location.valid()]
    at = [p for k, p in enumerate(at) if k == 0 or p != at[k - 1]]
    return LineString(at) if len(at) > 1 else None


if __name__ == "__main__":
    raise SystemExit(exit_status(lambda args: read_into(Path(args[0]), Path(args[1]), json.loads(args[2]))))
