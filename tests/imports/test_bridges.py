"""Bridges of a map: a drone flies below, streets run on above and below, and nothing hangs in the air."""

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Point
from support import maps
from support.layout_checks import catalogue

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.imports.places import add_map
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.build import build_scene

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    extract = maps.write_map(tmp_path_factory.mktemp("map") / "town.osm.pbf", maps.BRIDGES)
    return add_map("Bridges", extract, tmp_path_factory.mktemp("mine"), bbox=[maps.box()])[0]


@pytest.fixture(scope="module")
def caster(town):
    return RayCaster(town.scene)


def hits(caster, places, z, way):
    origins = np.column_stack([places, np.full(len(places), z)])
    return caster.first_hit(origins, np.tile(way, (len(origins), 1)))[0]


def bridge_at(town, x, y):
    """The plan's bridge whose axis passes a place, and what was built of it."""
    tables = maps.made_by(town, "street_network")["bridges"]
    k = min(range(len(tables)), key=lambda k: LineString(tables[k]["line"]).distance(Point(x, y)))
    built = [i for i in town.scene.instances if i.category == "bridge"]
    assert len(built) == len(tables) == 3
    return tables[k], min(built, key=lambda i: np.hypot(*(i.centroid[:2] - (x, y))))


def test_a_lorry_passes_below_and_the_street_below_is_there(town, caster):
    street = np.stack(np.meshgrid(np.linspace(14.5, 25.5, 12), np.linspace(-23.0, -17.0, 9)), -1).reshape(-1, 2)
    free = hits(caster, street, 0.2, UP) + 0.2
    assert free.min() >= 4.6
    assert np.abs(hits(caster, street, 3.0, DOWN) - 3.0).max() < 1e-3
    # The deck has a body between its underside and its road.
    thick = 50.0 - hits(caster, street, 50.0, DOWN) - free
    assert thick.min() > 0.7
    assert thick.max() < 2.0  # with a parapet
    paved = {p.material.split(":")[0] for p in town.scene["ground"].parts
             for f in p.vertices[p.faces][:, :, :2] if shapely.Polygon(f).contains(Point(20.03, -21.02))}  # fmt: skip
    assert paved == {"asphalt"}


def test_a_drone_flies_below_and_not_in_the_ramps(town):
    grid = ClearanceGrid.build(town.scene)
    rng = np.random.default_rng(3)
    below = rng.uniform([16, -23, 1.0], [24, -17, 3.8], size=(200, 3))
    assert all(grid.reachable(p) for p in below)
    # High Street's ramps: 2 m inside their walls, between the ground and the road.
    table, _ = bridge_at(town, 20.0, -20.0)
    axis, at = LineString(table["line"]), np.linspace(0.0, 1.0, len(table["heights_m"]))
    start, end = table["span_m"]
    ramps = []
    for p in rng.uniform([17, -58, 0.3], [23, 58, 5.0], size=(600, 3)):
        s = axis.project(Point(p[:2]))
        if not start - 1 < s < end + 1 and p[2] < np.interp(s / axis.length, at, table["heights_m"]) - 0.3:
            ramps.append(p)
    assert len(ramps) > 50
    assert not any(grid.reachable(p) for p in ramps)


@pytest.mark.parametrize(("x", "y"), [(20.0, -20.0), (-30.0, 20.0), (-50.0, -50.0)])
def test_roads_climb_without_steps_and_decks_stand_on_something(town, caster, x, y):
    table, built = bridge_at(town, x, y)
    axis = LineString(table["line"])
    inside = axis.intersection(shapely.box(-59.5, -59.5, 59.5, 59.5))
    along = shapely.get_coordinates(inside.interpolate(np.arange(0.0, inside.length, 0.25)))
    z = 50.0 - hits(caster, along, 50.0, DOWN)
    assert np.abs(np.diff(z)).max() < 0.25 * 0.22
    high = max(table["heights_m"])
    assert z.max() == pytest.approx(high, abs=0.15)
    # Whatever reaches the ground carries it; two carriers are less than 25 m apart.
    feet = built.vertices[built.vertices[:, 2] < 0.0][:, :2]
    carried = np.sort([inside.project(Point(p)) for p in feet])
    up = np.flatnonzero(z > 1.0) * 0.25
    gaps = np.diff([up[0], *carried[(carried > up[0]) & (carried < up[-1])], up[-1]])
    assert gaps.max() < 25.0
    # What ends in the scene ends on the ground.
    for end, first in ((along[0], z[0]), (along[-1], z[-1])):
        if np.abs(end).max() < 59.0:
            assert first == pytest.approx(0.0, abs=0.15)


def test_ways_side_by_side_share_a_deck(town):
    network = maps.made_by(town, "street_network")
    table, built = bridge_at(town, -30.0, 20.0)
    number = network["bridges"].index(table)
    on = [street for street in network["streets"] if street.get("bridge") == number]
    assert {street.get("kind", "street") for street in on} == {"street", "path"}
    plan = shapely.union_all([LineString(road["line"]).buffer(road["width_m"] / 2, cap_style="flat") for road in on])
    west, east = plan.bounds[0], plan.bounds[2]
    low, high = built.bounds
    assert low[0] <= west + 0.01
    assert high[0] >= east - 0.01
    # No room for ramps: all of the rise is on the bridge itself, and that is said where it is not enough.
    assert table["span_m"] == pytest.approx([0.0, LineString(table["line"]).length], abs=0.05)


def test_nothing_stands_in_a_deck_or_in_a_ramp(town):
    others = [i for i in town.scene.instances if i.category not in ("bridge", "ground")]
    assert len(others) > 5
    for built in (i for i in town.scene.instances if i.category == "bridge"):
        box = shapely.box(*built.bounds[0, :2], *built.bounds[1, :2])
        near = [i for i in others if box.intersects(shapely.box(*i.bounds[0, :2], *i.bounds[1, :2]))]
        deck = RayCaster(type(town.scene)("deck", (built,), town.scene.materials, town.scene.bounds))
        for thing in near:
            spots = thing.vertices[:, :2]
            feet = np.column_stack([spots, np.full(len(spots), -5.0)])
            under = deck.first_hit(feet, np.tile(UP, (len(feet), 1)))[0] - 5.0
            over = 50.0 - hits(deck, spots, 50.0, DOWN)
            z = thing.vertices[:, 2]
            assert not (np.isfinite(under) & (z > under + 0.01) & (z < over - 0.01)).any(), thing.node


def test_the_same_map_makes_the_same_bridges_whatever_its_order(town, tmp_path):
    other = maps.write_map(tmp_path / "town.osm.pbf", maps.BRIDGES, order=-1)
    again = add_map("Bridges", other, tmp_path / "a", bbox=[maps.box()])[0]
    assert again.recipe.read_bytes() == town.recipe.read_bytes()


def test_over_a_valley_the_deck_is_level_and_its_piers_reach_down(tmp_path):
    lines = [([(-80, 0), (-30, 0)], {"highway": "tertiary"}), ([(30, 0), (80, 0)], {"highway": "tertiary"}),
             ([(-30, 0), (30, 0)], {"highway": "tertiary", "bridge": "viaduct"})]  # fmt: skip
    extract = maps.write_map(tmp_path / "valley.osm.pbf", lines)
    west, south, east, north = maps.box(90.0)
    x, _ = np.meshgrid(np.arange(-90.0, 90.1, 2.0), np.arange(-90.0, 90.1, 2.0))
    z = 50.0 - 12.0 * np.clip(1.0 - (np.abs(x) - 15.0) / 12.0, 0.0, 1.0)
    np.savez(tmp_path / "dem.npz", heights_m=z, bbox_deg=[west, south, east, north])
    place = add_map("Valley", extract, tmp_path / "mine", bbox=[maps.box()], dem=tmp_path / "dem.npz")[0]
    caster = RayCaster(place.scene)
    along = np.column_stack([np.arange(-28.0, 28.0, 0.5), np.zeros(112)])
    road = 80.0 - hits(caster, along, 80.0, DOWN)
    assert np.ptp(road) < 0.1
    low = along[np.abs(along[:, 0]) < 13.0][::6]
    assert (hits(caster, low + np.array([0.3, 0.0]), 0.5, UP) > 5.0).sum() >= 6
    assert np.abs(hits(caster, low + np.array([0.3, 8.0]), 30.0, DOWN) - 30.0).max() < 0.2
    grid = ClearanceGrid.build(place.scene)
    assert grid.reachable(np.array([1.5, 0.0, 5.0])) or grid.reachable(np.array([4.5, 0.0, 5.0]))


def test_a_plan_that_cannot_be_is_one_line(town, tmp_path):
    text = town.recipe.read_text()
    for wrong, said in (
        (text.replace("bridge = 0", "bridge = 7", 1), "bridge 7 is none of 3"),
        (text.replace("heights_m = [", "heights_m = [0.5, ", 1), "as many points"),
        (text.replace("span_m = [", "span_m = [900.0, ", 1), "span_m"),
    ):
        (tmp_path / "Wrong.toml").write_text(wrong)
        with pytest.raises(AssetError, match=said):
            build_scene(tmp_path / "Wrong.toml", catalogue())
