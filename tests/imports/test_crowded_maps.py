"""add-map on maps whose buildings and areas overlap, so that cut and rounded outlines cross themselves."""

import re
import tomllib
from collections import Counter

import pytest
import shapely
from shapely.geometry import Polygon
from support import maps
from support.command_line import said

from aerialdojo_gen.imports import map_buildings, map_ground
from aerialdojo_gen.imports.osm import Feature
from aerialdojo_gen.scenes.ground import rectangle

SITE = rectangle(-60, -60, 60, 60)


def plan(table) -> Polygon:
    return Polygon(table["outline"], table.get("holes", ()))


def features(found) -> list[Feature]:
    return [Feature(f"{k:03d}", Polygon(ring), tags) for k, (ring, tags) in enumerate(found)]


# Of seeds 2, 11, 13, 14 and 26 one or two of 70 outlines cross themselves when they are merely rounded.
@pytest.mark.parametrize("seed", [1, 2, 11, 13, 14, 26])
def test_what_is_built_is_simple_polygons_that_cover_what_the_map_has(seed):
    summary, town = Counter(), features(maps.crowded(seed))
    bodies = [b for one in map_buildings.buildings(town, [], SITE, summary) for b in one["bodies"]]
    assert all(plan(b).is_valid for b in bodies)
    mapped = shapely.union_all([f.shape for f in town]).intersection(SITE)
    assert shapely.union_all([plan(b) for b in bodies]).symmetric_difference(mapped).area < 0.05 * mapped.area
    parks = [Feature(f.key, f.shape, {"leisure": "park"}) for f in town]
    areas = map_ground.areas(parks, [], SITE, summary)
    assert all(plan(a).is_valid for a in areas)
    assert shapely.union_all([plan(a) for a in areas]).symmetric_difference(mapped).area < 0.05 * mapped.area
    assert not [line for line in summary if "left out" in line]


def test_a_crowded_town_is_made_and_what_cannot_be_is_counted(tmp_path, capsys):
    zigzag = shapely.Point(0, 0).buffer(30).exterior.segmentize(0.15).coords[:-1]
    zigzag = [(x * (1 + 0.03 * (k % 2)), y * (1 + 0.03 * (k % 2))) for k, (x, y) in enumerate(zigzag)]
    ways = [([*ring, ring[0]], tags) for ring, tags in [*maps.crowded(2), (zigzag, {"leisure": "park"})]]
    extract = maps.write_map(tmp_path / "town.osm.pbf", ways)
    box = ",".join(map(str, maps.box()))
    code, out, err = said(capsys, "add-map", "Town", extract, f"--bbox={box}", "--project", tmp_path / "mine")
    assert code == 0, err
    assert re.search(r"^  40 buildings$", out, re.MULTILINE)
    assert re.search(r"^  1 outlines left out: self-intersecting or with too many corners$", out, re.MULTILINE)
    plan = tomllib.loads((tmp_path / "mine/scenes/Town.toml").read_text())
    assert [len(one["buildings"]) for one in plan["site"] if one.get("make") == "buildings"] == [40]
