"""add-map: a town's buildings, streets and things are the map's, and stand on the ground that is given."""

import json
import re
import sys
from collections import Counter

import jsonschema
import numpy as np
import pytest
import shapely
from shapely.geometry import Point, Polygon
from support import maps
from support.layout_checks import ASSETS, catalogue

from aerialdojo_gen.annotations.draft import choose_landmarks
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.errors import AssetError, MissingPackage, UsageError
from aerialdojo_gen.imports import map_buildings, map_ground
from aerialdojo_gen.imports.dem import read_dem
from aerialdojo_gen.imports.earth import size_m, tile_bboxes
from aerialdojo_gen.imports.map_plan import TownOptions
from aerialdojo_gen.imports.map_props import _thing
from aerialdojo_gen.imports.map_tags import bearing_deg
from aerialdojo_gen.imports.osm import Feature, read_into, read_maps
from aerialdojo_gen.imports.places import add_map
from aerialdojo_gen.pipeline.stages.work.build_scenes import scene_row
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.ground import rectangle


@pytest.fixture(scope="module")
def extract(tmp_path_factory):
    return maps.write_town(tmp_path_factory.mktemp("map") / "town.osm.pbf")


@pytest.fixture(scope="module")
def town(extract, tmp_path_factory):
    return add_map("Town", extract, tmp_path_factory.mktemp("mine"), bbox=[maps.box()])[0]


KINDS = {"tall": "apartment_building", "levels": "office_building", "house": "house", "hall": "building"}


def built(place):
    """Buildings as the map has them: name, the instance that stands there."""
    bounds = {name: np.reshape(Polygon(maps.BUILDINGS[name][0]).bounds, (2, 2)) for name in KINDS}
    return {
        name: next(i for i in place.scene.instances
                   if i.category == kind and np.abs(i.bounds[:, :2] - bounds[name]).max() < 1.0)
        for name, kind in KINDS.items()
    }  # fmt: skip


def test_buildings_are_as_high_and_as_wide_as_their_tags_say(town):
    buildings = built(town)
    tops = {name: float(i.bounds[1, 2]) for name, i in buildings.items()}
    wanted = {"tall": 21.5, "levels": 4 * 3.2, "house": 8.0, "hall": 30 * 0.3048}
    assert tops == pytest.approx(wanted, abs=0.01)
    for name in ("tall", "levels"):
        assert np.abs(buildings[name].bounds[:, :2].ravel() - Polygon(maps.BUILDINGS[name][0]).bounds).max() < 0.02
    # A hip's ridge is the highest line of it, and its eaves are 3 m below.
    assert np.any(np.abs(buildings["hall"].vertices[:, 2] - (tops["hall"] - 3.0)) < 0.01)
    assert buildings["house"].attributes["colour"] == "red"
    assert any("3 by their height, 1 by their levels" in line for line in town.notes)


def test_streets_lie_on_the_ground_with_marks_and_a_crossing(town):
    by_material = {}
    for part in town.scene["ground"].parts:
        by_material.setdefault(part.material.split(":")[0], []).append(part)

    def area(material):
        return shapely.union_all([Polygon(p.vertices[f][:, :2]) for p in by_material[material] for f in p.faces])

    # The secondary street's two lanes of 3.2 m, from border to border.
    street = shapely.box(-59, -3.1, 59, 3.1) - Point(0, 0).buffer(8) - area("marking").buffer(0.02)
    assert area("asphalt").buffer(0.02).contains(street)
    marks = np.concatenate([part.vertices for part in by_material["marking"]])
    assert np.abs(marks[:, 2]).max() < 1e-6
    stripes = marks[(np.abs(marks[:, 0]) < 2) & (np.abs(marks[:, 1]) < 3.3)]
    assert len(np.unique(np.round(stripes[:, 1], 1))) >= 6  # both edges of three stripes or more
    # The tunnel is not there.
    streets = maps.made_by(town, "street_network")["streets"]
    assert all(abs(y + 70) > 1 for street in streets for _, y in street["line"])
    assert any("1 ways in tunnels" in line for line in town.notes)


def test_things_of_the_map_are_the_catalogues_and_what_is_in_a_building_is_not(town):
    scene = town.scene
    categories = [i.category for i in scene.instances]
    assert {"bus_shelter", "mailbox", "litter_bin", "statue"} <= set(categories)
    bench = [i for i in scene.instances if i.category == "bench" and np.hypot(*(i.centroid[:2] - (-40, 7.6))) < 2.5]
    assert len(bench) == 1
    assert bench[0].attributes["place"] == "on Long Street"
    assert any("1 things inside buildings left out" in line for line in town.notes)
    plans = shapely.union_all([Polygon(o) for o, _ in maps.BUILDINGS.values()]).buffer(-0.2)
    feet = [i for i in scene.instances if i.bounds[0, 2] < 3.0 and i.category not in
            ("ground", "apartment_building", "office_building", "house", "building")]  # fmt: skip
    assert len(feet) > 20
    assert not [i.node for i in feet if plans.contains(Point(i.centroid[:2]))]
    # Cars stand along the side street and drive on the right of the main one.
    cars = [i for i in scene.instances if i.category in ("sedan", "hatchback", "suv", "delivery_van", "motorcycle")]
    assert cars
    road = shapely.union_all([shapely.box(-60, -3.3, 60, 3.3), shapely.box(-6, -60, 6, 4)])
    assert all(road.contains(Point(c.centroid[:2])) for c in cars)
    rows = [row for entry in maps.plan_of(town)["site"] for row in entry.get("place", ()) if isinstance(row, list)]
    driving = [(y, yaw) for _, x, y, yaw in rows if abs(y) < 3.2 and abs(x) > 8.0]
    assert len(driving) >= 2
    assert all(yaw == (0.0 if y < 0.0 else 180.0) for y, yaw in driving)
    # Lamps look at their street, and all are of one kind.
    lamps = {(what, y, yaw) for what, _, y, yaw in rows if what.startswith("street_lamp") and abs(y) < 4.0}
    assert lamps == {("street_lamp:single", 3.7, 270.0)}


def test_nobody_is_in_a_building_and_everybody_may_be_in_the_street(town):
    # Anchors, goals and starts are what the grid can reach.
    grid = ClearanceGrid.build(town.scene)
    rng = np.random.default_rng(6)
    for outline, top in ((maps.BUILDINGS["tall"][0], 21.0), (maps.BUILDINGS["levels"][0], 12.3)):
        x0, y0, x1, y1 = Polygon(outline).bounds
        inside = rng.uniform([x0 + 0.3, y0 + 0.3, 0.3], [x1 - 0.3, y1 - 0.3, top], size=(400, 3))
        assert not any(grid.reachable(p) for p in inside)
    street = rng.uniform([-55, -3, 6.0], [55, 3, 9.0], size=(200, 3))
    assert np.mean([grid.reachable(p) for p in street]) > 0.9


def test_the_same_map_makes_the_same_bytes_whatever_the_order_of_its_things(town, extract, tmp_path):
    other = maps.write_town(tmp_path / extract.name, order=-1)
    assert other.read_bytes() != extract.read_bytes()
    again = add_map("Town", other, tmp_path / "a", bbox=[maps.box()])[0]
    assert again.recipe.read_bytes() == town.recipe.read_bytes()
    assert maps.same_scene(again.scene, town.scene)


def test_on_a_height_model_everything_stands_on_the_ground(extract, tmp_path):
    west, south, east, north = maps.box(90.0)
    dem = tmp_path / "hill.npz"
    np.savez(dem, heights_m=maps.heights(2.0, 90.0), bbox_deg=[west, south, east, north])
    options = TownOptions(attribution="A survey")
    (place,) = add_map("Town", extract, tmp_path / "mine", bbox=[maps.box()], options=options, dem=dem)
    datum = maps.origin_z(place)
    places = np.random.default_rng(5).uniform(-55, 55, size=(300, 2))
    z = maps.ground_z(place.scene, places) + datum
    # Between points of 2 m the hill bends by less than 3 cm; pavements rise by 12.
    off = z - maps.hill(places[:, 0], places[:, 1])
    assert off.min() > -0.05
    assert off.max() < 0.18
    for name, top in (("tall", 21.5), ("levels", 12.8)):
        outline = np.array(maps.BUILDINGS[name][0], dtype=float)
        lowest = (maps.hill(outline[:, 0], outline[:, 1]) - datum).min()
        assert float(built(place)[name].bounds[1, 2]) == pytest.approx(lowest + top, abs=0.05)
    things = [i for i in place.scene.instances if i.category in ("bench", "mailbox", "litter_bin")]
    under = maps.ground_z(place.scene, np.array([i.centroid[:2] for i in things]))
    assert things
    assert np.abs(np.array([i.bounds[0, 2] for i in things]) - under).max() < 0.35
    assert "A survey" in place.scene.attribution


def test_what_a_person_changes_in_the_plan_is_what_is_built(town, tmp_path):
    text = town.recipe.read_text()
    assert "# Added by rule: parked and driving vehicles\n" in text
    bench = re.search(r'\["bench:wooden", -40, 7.6, 270\]', text)
    changed = text.replace(bench[0], '["bench:wooden", -44, 7.6, 90]').replace("top_m = 21.5", "top_m = 24.7")
    # All that rules add, without which only the map is left.
    changed = changed.partition("\n# Added by rule")[0] + "\n"
    (tmp_path / "Town.toml").write_text(changed)
    scene = build_scene(tmp_path / "Town.toml", catalogue())
    assert scene["bench_000"].centroid[:2] == pytest.approx((-44.0, 7.6), abs=0.3)
    assert max(float(i.bounds[1, 2]) for i in scene.instances) == pytest.approx(24.7, abs=0.01)
    left = {i.category for i in scene.instances}
    assert {"bus_shelter", "statue", "urban_tree", "house"} <= left
    assert not left & {"sedan", "street_lamp", "air_conditioner"}


def test_beyond_the_most_that_a_scene_has_things_are_left_out_and_counted(extract, tmp_path, monkeypatch):
    monkeypatch.setattr("aerialdojo_gen.imports.placing.MAX_NODES", 20)
    place = add_map("Town", extract, tmp_path / "mine", bbox=[maps.box()])[0]
    assert len(place.scene.instances) == 20
    assert {"house", "statue", "bus_shelter"} <= {i.category for i in place.scene.instances}
    assert re.search(r"^[1-9][0-9]* things left out: a scene has [0-9,]+ instances at most$", place.notes[-1])


def test_a_recipe_of_an_older_version_says_what_to_run(tmp_path):
    (tmp_path / "Town.toml").write_text('layout = "town"\nsize_m = [60, 60]\nceiling_m = 20\n[parameters]\n')
    with pytest.raises(AssetError, match=r"run add-map again, with --force$"):
        build_scene(tmp_path / "Town.toml", catalogue())


def test_what_is_written_is_a_plan_as_the_schema_has_it_and_says_whose_data_it_is(town, tmp_path):
    validator = jsonschema.Draft202012Validator(json.loads((ASSETS / "plan.schema.json").read_text()))
    assert not [error.message for error in validator.iter_errors(maps.plan_of(town))]
    assert town.scene.attribution.startswith("© OpenStreetMap contributors, Open Database License")
    write_glb(town.scene, tmp_path / "town.glb")
    assert b'"copyright":"\xc2\xa9 OpenStreetMap contributors' in (tmp_path / "town.glb").read_bytes()
    assert read_glb(tmp_path / "town.glb").attribution == town.scene.attribution
    assert scene_row(town.scene, "x", "y")["attribution"] == town.scene.attribution


def test_a_box_is_cut_into_tiles_with_a_shared_frame(extract, tmp_path):
    west, south, east, north = box = maps.box()
    cut = tile_bboxes(box, 60.0)
    assert len(cut) == 4
    assert all(size_m(one) == pytest.approx((60.0, 60.0), abs=0.001) for one in cut)
    assert cut[0][:2] == (west, south)
    assert cut[3][2:] == pytest.approx((east, north), abs=1e-8)
    places = add_map("Tiles", extract, tmp_path / "mine", bbox=[box], tile_m=60.0)
    assert [p.name for p in places] == ["Tiles-1", "Tiles-2", "Tiles-3", "Tiles-4"]
    origins = [maps.plan_of(p)["origin"] for p in places]
    x, y = maps.FRAME.metres([o["lon_deg"] for o in origins], [o["lat_deg"] for o in origins])
    assert np.round(np.column_stack([x, y])).tolist() == [[-30, -30], [30, -30], [-30, 30], [30, 30]]
    # The street runs on from one to the next.
    for place, side in ((places[0], 30.0), (places[2], -30.0)):
        lines = [shapely.LineString(one["line"]) for one in maps.made_by(place, "street_network")["streets"]]
        assert shapely.union_all(lines).distance(Point(-10, side)) < 0.1


def test_several_boxes_are_read_at_once_as_each_by_itself(extract):
    west, south, east, north = maps.box()
    middle = (west + east) / 2
    boxes = [(west, south, middle, north), (west, south, east, (south + north) / 2)]
    together = read_maps(extract, boxes)
    for box, mapped in zip(boxes, together, strict=True):
        (alone,) = read_maps(extract, [box])
        assert alone == mapped
        window = shapely.box(*box)
        assert all(window.intersects(f.shape) for f in (*mapped.points, *mapped.lines, *mapped.areas))
    assert {len(mapped.points) for mapped in together} != {len(maps.POINTS)}


@pytest.mark.parametrize(
    ("box", "said"),
    [
        ((10.0, 50.0, 10.002, 50.001), "lies outside the extract: town.osm.pbf covers 24.89"),
        ((24.9, 60.3, 24.8, 60.2), "must be WEST SOUTH EAST NORTH"),
        ((60.19, 24.89, 60.2, 124.9), "degrees of longitude"),
        ((24.0, 60.0, 25.0, 61.0), "--tiles 200 cuts a large one"),
        ((24.9, 60.2, 24.9, 60.2), "must be WEST SOUTH EAST NORTH"),
    ],
)
def test_a_box_that_cannot_be_is_one_line(extract, tmp_path, box, said):
    with pytest.raises(UsageError, match=rf"^[^\n]*{said}[^\n]*\Z"):
        add_map("X", extract, tmp_path / "mine", bbox=[box])
    assert not (tmp_path / "mine").exists()


def test_a_file_that_cannot_be_read_is_one_line(extract, tmp_path):
    whole = extract.read_bytes()
    for part in (10, len(whole) // 2, len(whole) - 7):
        (tmp_path / "cut.osm.pbf").write_bytes(whole[:part])
        fault = read_into(tmp_path / "cut.osm.pbf", tmp_path / "found.json", [maps.box()])
        assert fault.startswith("cannot be read as a map, or is cut short: ")
        assert "\n" not in fault
    cut = r"^\S+/cut\.osm\.pbf: cannot be read as a map[^\n]*$"
    wrong = {"cut.osm.pbf": cut, "town.shp": r"a map is a file \.pbf", "none.osm.pbf": "No such file"}
    for name, said in wrong.items():
        with pytest.raises(AssetError, match=said):
            add_map("X", tmp_path / name, tmp_path / "mine", bbox=[maps.box()])
    nowhere = tmp_path / "grid.npz"
    np.savez(nowhere, heights_m=maps.heights(2.0, 60.0), cell_m=2.0)
    with pytest.raises(UsageError, match="has no geographic coordinates"):
        add_map("X", extract, tmp_path / "mine", bbox=[maps.box()], dem=nowhere)


@pytest.mark.parametrize(
    ("package", "read"), [("osmium", lambda d: read_maps(d, [maps.box()])), ("rasterio", lambda d: read_dem(d))]
)
def test_without_a_package_it_says_what_to_install(package, read, tmp_path, monkeypatch):
    (tmp_path / "x.tif").touch()
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackage, match=rf"lacks the package {package}: pip install 'aerialdojo-gen\[maps\]'"):
        read(tmp_path / "x.tif")


def test_landmarks_of_a_town_without_the_catalogues_are_large_and_their_names_fit_nothing_else(tmp_path):
    outlines = [([*o, o[0]], tags) for o, tags in maps.BUILDINGS.values()]
    extract = maps.write_map(tmp_path / "town.osm.pbf", [*maps.LINES, *outlines])
    (place,) = add_map("Town", extract, tmp_path / "mine", bbox=[maps.box()])
    scene, vocabulary = place.scene, Vocabulary(place.scene, catalogue())
    assert [i for i in scene.instances if i.bounds[0, 2] > 8.0], "a roof with something on it, higher than most"
    marks = choose_landmarks(vocabulary, 2, at_most=True)
    assert marks
    for mark in (*marks, *choose_landmarks(vocabulary, 1, at_most=True)):
        assert np.ptp(scene[mark.node].bounds, axis=0).min() >= 3.0
        words = set(mark.name.split())
        # "A building" would be any of them, an office building, too.
        fits = [i.node for i, noun in zip(scene.instances, vocabulary.nouns, strict=True)
                if words <= {*noun.name.split(), *noun.short.split(), *noun.adjectives}]  # fmt: skip
        assert fits in ([mark.node], [])


SITE = rectangle(-60, -60, 60, 60)


# One or two of 70 outlines cross themselves when they are merely rounded.
@pytest.mark.parametrize("seed", [2, 13, 26])
def test_what_is_built_is_simple_polygons_that_cover_what_the_map_has(seed):
    summary, rings = Counter(), maps.crowded(seed)
    town = [Feature(f"{k:03d}", Polygon(ring), tags) for k, (ring, tags) in enumerate(rings)]
    bodies = [b for one in map_buildings.buildings(town, [], SITE, summary) for b in one["bodies"]]
    assert all(b["plan"].is_valid for b in bodies)
    mapped = shapely.union_all([f.shape for f in town]).intersection(SITE)
    assert shapely.union_all([b["plan"] for b in bodies]).symmetric_difference(mapped).area < 0.05 * mapped.area
    parks = [Feature(f.key, f.shape, {"leisure": "park"}) for f in town]
    areas = map_ground.areas(parks, [], SITE, summary)
    assert all(a["plan"].is_valid for a in areas)
    assert shapely.union_all([a["plan"] for a in areas]).symmetric_difference(mapped).area < 0.05 * mapped.area
    assert not [line for line in summary if "left out" in line]


def test_a_crowded_town_is_made_and_what_cannot_be_is_counted(tmp_path):
    zigzag = shapely.Point(0, 0).buffer(30).exterior.segmentize(0.15).coords[:-1]
    zigzag = [(x * (1 + 0.03 * (k % 2)), y * (1 + 0.03 * (k % 2))) for k, (x, y) in enumerate(zigzag)]
    ways = [([*ring, ring[0]], tags) for ring, tags in [*maps.crowded(2, 20), (zigzag, {"leisure": "park"})]]
    extract = maps.write_map(tmp_path / "town.osm.pbf", ways)
    (place,) = add_map("Town", extract, tmp_path / "mine", bbox=[maps.box()])
    assert "20 buildings" in place.notes
    assert "1 outlines left out: self-intersecting or with too many corners" in place.notes
    assert len(maps.made_by(place, "buildings")["buildings"]) == 20


@pytest.mark.parametrize(
    ("said", "bearing"),
    [
        ("0", 0.0), ("N", 0.0), ("360", 360.0), ("92.5", 92.5), ("180°", 180.0), ("sw", 225.0), (" NNW ", 337.5),
        ("361", None), ("-90", None), ("forward", None), ("90-120", None), ("1e2", None), ("", None),
    ],
)  # fmt: skip
def test_directions_are_degrees_or_points_of_the_compass_and_things_are_turned_to_them(said, bearing):
    assert bearing_deg({"direction": said}, "direction") == bearing
    yaw = None if bearing is None else 90.0 - bearing
    assert _thing("bench", Point(1, 2), {"direction": said}).get("yaw") == yaw
