"""Plans: what a scene's TOML says is built in its order, or named in one line."""

import json
import tomllib

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point
from support.doc_blocks import blocks
from support.layout_checks import ASSETS, drawn

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.scenes.plans.build import build_plan
from aerialdojo_gen.scenes.plans.schema import schema_text
from aerialdojo_gen.scenes.plans.text import plan_text
from aerialdojo_gen.scenes.plans.values import PlanNames

PLANS = sorted(ASSETS.glob("s[cm]*/*_[01].toml"))
HEAD = {"plan": 1, "size_m": [40, 40], "ceiling_m": 12}
YARD = {
    **HEAD, "palette": {"wall": "brick:#8a4638"}, "floor_m": {"loft": 2.5},
    "lines": {"lane": {"points": [[-18, -6], [0, -4], [18, -6]], "smooth": 2}},
    "areas": {"yard": {"disc": [0, 6, 8], "minus": [-2, 4, 2, 8]}, "way": {"ribbon": "lane", "width_m": 3}},
    "ground": {"material": "meadow"},
    "site": [
        {"paint": "way", "material": "gravel"},
        {"paint": "yard", "material": "cobbles", "rise_m": 0.1},
        {"node": "barn", "footprint": [6, 2, 14, 9], "parts": [
            {"shape": "block", "role": "wall", "corners": [6, 2, 14, 9], "z": [0, "loft"]},
            {"make": "gable_roof", "box": [6, 2, 14, 9], "z": "loft", "rise_m": 2, "wall": "wall",
             "roof": "thatch"}]},
        {"place": [["tractor", 0, -12, 30], {"what": "beehive", "at": [-4, 10], "node": "hive"}],
         "phrase": "in the yard"},
        {"pattern": {"of": ["oak_tree", "birch_tree"], "along": "lane", "spacing_m": 9, "offset_m": 5},
         "fit": "skip"},
    ],
}  # fmt: skip


def build(tmp_path, catalogue, plan):
    path = tmp_path / "U_Yard_0.toml"
    path.write_text(plan_text(plan))
    return build_plan(path, catalogue)


def test_the_schema_is_that_of_the_code():
    """`python -c "from aerialdojo_gen.scenes.plans.schema import schema_text; print(schema_text(), end='')"`."""
    assert (ASSETS / "plan.schema.json").read_text() == schema_text()


@pytest.fixture(scope="module")
def schema():
    schema = json.loads((ASSETS / "plan.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("path", drawn(PLANS, 9))
def test_the_schema_fits_every_plan(schema, path):
    """An entry with `make` is held against its builder's branch alone: to try all of them takes minutes."""
    branches = {one["title"]: schema.evolve(schema=one) for one in schema.schema["$defs"]["Entry"]["anyOf"]}
    entry = schema.evolve(schema=schema.schema["$defs"]["Entry"])
    plan = tomllib.loads(path.read_text())
    entries = [one for several in plan["site"] for one in several.get("entries", [several])]
    assert [one for one in entries if not branches.get(one.get("make"), entry).is_valid(one)] == []
    assert schema.is_valid({**plan, "site": [{"entries": []}]})


@pytest.mark.parametrize(
    "entry",
    [
        {"paint": "yard", "material": "mud", "riser_m": 1},
        {"make": "flat_hose", "outline": [0, 0, 4, 4]},
        {"make": "wires", "headz": []},
        {"node": "a", "parts": [{"shape": "blok", "role": "wood"}]},
        {"node": "a", "parts": [{"make": "gable_ruf", "box": [0, 0, 1, 1]}]},
        {"place": [["tractor", 0, 0]], "fit": "perhaps"},
        {"place": [["tractor", 0, 0]], "settled_m": 1},
    ],
)
def test_the_schema_marks_what_would_not_be_built(schema, tmp_path, catalogue, entry):
    plan = {**YARD, "site": [entry]}
    assert schema.is_valid(YARD)
    assert not schema.is_valid(plan)
    with pytest.raises(AssetError):
        build(tmp_path, catalogue, plan)


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_a_plan_is_short_and_reads_back_as_it_is_written(path):
    text = path.read_text()
    assert text.count("\n") <= 500
    plan = tomllib.loads(text)
    assert tomllib.loads(plan_text(plan)) == plan


def test_a_yard_is_built_in_order(tmp_path, catalogue):
    scene = build(tmp_path, catalogue, YARD)
    nodes = [instance.node for instance in scene.instances]
    assert nodes[:4] == ["ground", "barn", "tractor_000", "hive"]
    trees = [i for i in scene.instances if i.category in ("oak_tree", "birch_tree")]
    assert len(trees) >= 3
    assert [i.category for i in trees[:2]] == ["oak_tree", "birch_tree"]
    barn = scene.instances[1]
    assert barn.bounds[1, 2] > 4.4
    assert {part.material for part in barn.parts} == {"brick:#8a4638", "thatch"}
    assert all(i.attributes["place"] == "in the yard" for i in scene.instances[2:4])
    again = build(tmp_path, catalogue, YARD)
    assert [i.bounds.tolist() for i in again.instances] == [i.bounds.tolist() for i in scene.instances]


def test_things_stand_in_rows_and_rings(tmp_path, catalogue):
    row = {"what": "bollard:steel", "at": [-8, 2], "count": 4, "step": [3, 0.5]}
    ring = {"of": ["bench", "planter"], "ring": [1, 2, 5, 4, 45]}
    plan = {**HEAD, "site": [{"place": [row], "phrase": "in a row"}, {"pattern": ring}]}
    _, *things = build(tmp_path, catalogue, plan).instances
    middles = np.array([i.centroid[:2] for i in things])
    assert [i.attributes.get("place") for i in things] == ["in a row"] * 4 + [None] * 4
    assert middles[:4] == pytest.approx(np.array([[-8, 2], [-5, 2.5], [-2, 3], [1, 3.5]]), abs=0.1)
    assert [i.category for i in things[4:]] == ["bench", "planter"] * 2
    assert np.hypot(*(middles[4:] - (1, 2)).T) == pytest.approx(5, abs=0.3)


def test_things_stand_in_a_frame_and_settle_on_a_slope(tmp_path, catalogue):
    rise = {"make": "rises", "axis": "x", "stations": [[-20, 20, 8]]}
    flat = {"make": "rolling_ground", "cell_m": 1, "height_m": 0, "wavelength_m": 9}
    plan = {
        **HEAD, "ground": {"steps": [flat, rise]},
        "site": [
            {"paint": [[-9, -9, -6, -6], {"blob": [6, 6, 3, 1, 0.2]}], "material": "gravel"},
            {"place": [["bench", 2, 1, 10]], "frame": [5, 0, 90], "on": 9, "phrase": "upstairs"},
            {"place": [["bench", 0, -8]], "settle_m": 1, "above_ground_m": -0.1, "fit": "must"},
        ],
    }  # fmt: skip
    ground, up, low = build(tmp_path, catalogue, plan).instances
    assert up.centroid[:2] == pytest.approx((4, 2), abs=0.3)
    assert up.bounds[0, 2] == pytest.approx(9, abs=0.01)
    # The ring about it is 0.3 m lower on one side.
    assert 3.6 < low.bounds[0, 2] < 3.9
    gravel = next(part for part in ground.parts if part.material == "gravel")
    assert gravel.vertices[:, 0].min() == pytest.approx(-9)
    assert gravel.vertices[:, 0].max() > 8


def test_things_are_strewn_by_a_field_made_of_others(tmp_path, catalogue):
    fields = {"by_yard": {"near": "yard", "reach_m": 6}, "dense": "min(1, 2*by_yard)"}
    bushes = {"make": "strew", "of": "bush", "area": [-19, -19, 19, 19], "spacing_m": 3, "limit": 40}
    plan = {**YARD, "fields": fields, "site": [{**bushes, "density": "dense"}]}
    yard = PlanNames(catalogue.materials).area(YARD["areas"]["yard"])
    found = [instance.bounds[:, :2].mean(axis=0) for instance in build(tmp_path, catalogue, plan).instances[1:]]
    assert len(found) >= 10
    assert max(yard.distance(Point(*at)) for at in found) < 6.5
    with pytest.raises(AssetError, match=r"'strew': density .*no field 'by_yard'"):
        build(tmp_path, catalogue, {**plan, "fields": dict(reversed(fields.items()))})


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"make": "strew", "of": "fern", "area": "yard", "spacing_m": 2, "limit": 9, "density": {"reach_m": 2}},
         "'strew': density .*a field has one of patches, near"),
        ({"paint": "yrd", "material": "mud"}, r"site\[0\] \(paint\): .*no area 'yrd'.*yard"),
        ({"paint": "yard", "material": "mudd"}, r"site\[0\] \(paint\): .*unknown material 'mudd'.*mud"),
        ({"paint": {"disc": [0, 0, 3], "minus": {"disc": [0, 0, 9]}}, "material": "mud"}, "the area is empty"),
        ({"paint": {"disc": [0, 0, 3], "box": [0, 0, 1, 1]}, "material": "mud"}, "an area has one of"),
        ({"paint": {"blob": [0, 0, 3]}, "material": "mud"}, r"blob is \[x, y, radius, seed\] or"),
        ({"paint": ["yard", "yrd"], "material": "mud"}, "no area 'yrd'"),
        ({"make": "flat_hose"}, r"site\[0\] \(make\): no site builder 'flat_hose'.*flat_house"),
        ({"make": "scorch_rays", "at": [0, 0], "radius_m": 4, "count": 0, "reach": [2, 3], "spread": [0.1, 0.2],
          "material": "asphalt"},
         "'scorch_rays': .*count"),
        ({"make": "torn_yard_wall", "brick": "brick", "hole": {"x": 0, "y": 0, "foot_m": 1, "head_m": 2},
          "runs": [[[0, 0], [5, 0], [5, 5]]]},
         "'torn_yard_wall': .*runs"),
        ({"make": "wires", "headz": []}, r"site\[0\] \(make\) 'wires': .*unknown key 'headz'"),
        ({"make": "wires", "heads": [[0, 0]]}, r"site\[0\] \(make\) 'wires': .*heads"),
        ({"make": "wires", "heads": [[0, 0, 5], [9, 0, 5]], "as": "top"}, "returns no height"),
        ({"parts": [{"shape": "block", "role": "wood", "corners": [0, 0, 1], "z": [0, 1]}], "node": "a"}, "corners"),
        ({"parts": [{"shape": "blok", "role": "wood"}], "node": "a"}, "unknown shape 'blok'.*block"),
        ({"make": "building", "outline": [0, 0, 4, 4], "wall": "wood", "roof": "thatch",
          "extra": [{"shape": "blok", "role": "wood"}]},
         "'building': .*extra.*unknown shape 'blok'.*block"),
        ({"place": [["tracter", 0, 0]]}, "unknown category 'tracter'.*tractor"),
        ({"place": [["tractor", 0]]}, "a thing is"),
        ({"place": [["tractor", "loft + x", 0]]}, "unknown parameter 'x'"),
        ({"place": [["tractor", 300, 0]], "fit": "must"}, "no room for tractor"),
        ({"pattern": {"of": ["oak_tree"]}}, "a pattern has one of"),
        ({"place": [{"what": "bench", "at": [0, 0], "count": 1001}]},
         "count = 1001: Input should be less than or equal"),
        ({"note": "nothing"}, "an entry has one of paint, make, parts, place, pattern"),
        ({"pattern": {"of": ["oak_tree"], "scatter": "yard", "limit": "many"}}, r"\(pattern\): \[pattern\] limit = "),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_in_one_line(tmp_path, catalogue, entry, message):
    with pytest.raises(AssetError, match=message) as error:
        build(tmp_path, catalogue, {**YARD, "site": [entry]})
    assert "U_Yard_0.toml" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ({"sead": 3}, "unknown key 'sead': did you mean 'seed'"),
        ({"plan": 2}, "plan = 2"),
        ({"size_m": [40, -30]}, r"size_m\.1 = "),
        ({"sky": "blue"}, "sky = "),
        ({"palette": {"wall": "brik"}}, "palette wall: unknown material 'brik': did you mean 'brick'"),
        ({"inventory": {"trctor": 1}}, "inventory: unknown category 'trctor': did you mean 'tractor'"),
        ({"inventory": {"tractor": 9}}, r"inventory: the scene has too few of tractor \(needs 9, has 1\)"),
    ],
)
def test_what_is_wrong_with_the_head_is_named_in_one_line(tmp_path, catalogue, head, message):
    with pytest.raises(AssetError, match=rf"^[^\n]*U_Yard_0\.toml: [^\n]*{message}[^\n]*$"):
        build(tmp_path, catalogue, YARD | head)


def test_things_settle_on_slopes_and_keep_others_at_a_distance(tmp_path, catalogue):
    hill = {"make": "hill", "at": [0, 0], "radius_m": 18, "height_m": 9}
    rolling = {"make": "rolling_ground", "cell_m": 1, "height_m": 0, "wavelength_m": 30}
    stone, bench = ["boulder", 8, 0], {"place": [["bench", 8, 2.6]], "fit": "skip"}

    def scene(**keys):
        plan = {**HEAD, "ground": {"steps": [rolling, hill]}, "site": [{"place": [stone], **keys}, bench]}
        return [i for i in build(tmp_path, catalogue, plan).instances[1:] if i.category != "plinth"]

    loose, firm = scene(), scene(settle_m=1.5, margin_m=3)
    assert [i.category for i in loose] == ["boulder", "bench"]
    assert [i.category for i in firm] == ["boulder"]
    assert 0.2 < loose[0].bounds[0, 2] - firm[0].bounds[0, 2] < 1.5
    stone = {"what": "boulder", "at": [8, 2.6], "solid": False}
    assert [i.category for i in scene()] == ["boulder", "bench"]
    stone["solid"] = True
    assert [i.category for i in scene()] == ["boulder"]


@settings(max_examples=10, deadline=None)
@given(order=st.permutations(range(len(YARD["site"]))), drop=st.sets(st.sampled_from(["lines", "areas", "floor_m"])))
def test_any_order_builds_or_ends_in_one_line(tmp_path_factory, catalogue, order, drop):
    plan = {key: value for key, value in YARD.items() if key not in drop} | {"site": [YARD["site"][k] for k in order]}
    folder = tmp_path_factory.mktemp("plan")
    if drop:
        with pytest.raises(AssetError, match=r"^[^\n]*U_Yard_0\.toml: [^\n]*$"):
            build(folder, catalogue, plan)
        return
    scene = build(folder, catalogue, plan)
    assert {"barn", "hive", "ground"} <= {instance.node for instance in scene.instances}


def test_areas_are_made_of_others_points_and_lines_and_have_ragged_outlines(catalogue):
    names = PlanNames(catalogue.materials, areas={"yard": rectangle(0, 0, 4, 2), "park": rectangle(0, 0, 40, 20)})
    assert names.area({"area": "yard", "offset_m": 1}).equals(rectangle(-1, -1, 5, 3))
    assert names.area({"area": "yard", "minus": [0, 0, 1, 2]}).equals(rectangle(1, 0, 4, 2))
    assert names.area({"box": [-1, 1, 2, 9], "within": "yard"}).equals(rectangle(0, 1, 2, 2))
    assert names.area({"around": [3, 4], "width_m": 6}).equals(Point(3, 4).buffer(3))
    assert names.area({"around": [[0, 0], [8, 0]], "width_m": 2}).bounds == pytest.approx((-1, -1, 9, 1))
    ragged = names.area({"area": "park", "ragged": [1, 5, 2]})
    assert 700 < ragged.area < 900
    assert len(ragged.exterior.coords) > 60


def test_ground_has_the_heights_of_a_formula(tmp_path, catalogue):
    step = {
        "make": "ground_by_formula", "cell_m": 1, "inland": {"inland": [-10, -10, 10, 10]},
        "let": {"mound": "top*eased(inland, 0, 5)"}, "height": "choose(inland, max(mound, 0.5), 0)",
    }  # fmt: skip
    plan = {
        **HEAD, "floor_m": {"top": 4}, "placing": {"settle_m": 0.5}, "ground": {"steps": [step]},
        "site": [{"place": [["bench", 0, 0], ["bench", 15, 0], ["bench", 5, 0, 0, 7]]}],
    }  # fmt: skip
    ground, *benches = build(tmp_path, catalogue, plan).instances
    assert [bench.bounds[0, 2] for bench in benches] == pytest.approx([4, 0, 7], abs=0.01)
    assert ground.bounds[:, 2] == pytest.approx((0, 4), abs=0.05)


@pytest.mark.parametrize(
    ("page", "nodes"),
    [
        ("CONTRIBUTING.md", {"barn", "tractor_000", "beehive_000"}),
        ("docs/plans.md", {"barn", "tractor_000", "beehive_001", "stone_wall_000", "bench_000"}),
    ],
)
def test_the_plan_of_a_page_is_built(tmp_path, catalogue, page, nodes):
    found = [block.text for block in blocks(ASSETS.parent / page) if block.language == "toml"]
    path = tmp_path / "U_Farm_0.toml"
    path.write_text("".join(found))
    assert nodes <= {instance.node for instance in build_plan(path, catalogue).instances}


def test_every_builder_says_what_it_builds():
    for name, one in kit().items():
        assert one.summary.endswith("."), name
        assert one.arguments.model_fields or one.kind == "ground", name


def test_the_ground_under_a_thing_on_a_slope_is_levelled_and_its_room_kept(tmp_path, catalogue):
    """What grows later keeps away; what looks for the things' places finds them by the name of the area."""
    shed = {"place": [["garden_shed", 4, 3, 30]], "settle_m": 0.5, "frame": [2, 1, 20]}
    strewn = {"pattern": {"of": ["sapling"], "scatter": [-12, -12, 12, 12], "spacing_m": 1.5}, "fit": "skip"}
    keep = {"make": "keep_free", "areas": ["sheds"], "z": [0, 40]}
    steps = [{"make": "rolling_ground", "cell_m": 1, "height_m": 6, "wavelength_m": 20}]

    def scene(entry, more=()):
        plan = {**HEAD, "ground": {"steps": [*steps, *more]}, "site": [entry, strewn]}
        return build(tmp_path, catalogue, plan)

    def saplings(built):
        return sum(i.category == "sapling" for i in built.instances)

    def unevenness(built):
        x, y = built.instances[1].bounds[:, :2].mean(axis=0)
        vertices = built.instances[0].vertices
        near = vertices[((vertices[:, :2] - (x, y)) ** 2).sum(axis=1) < 1.0]
        return float(near[:, 2].max() - near[:, 2].min())

    plain = scene(shed)
    level = scene({**shed, "level": True, "room_m": 4.0}, [{"make": "level_under_things"}])
    assert unevenness(level) < 0.01 < unevenness(plain)
    assert saplings(level) < saplings(plain)
    with pytest.raises(AssetError, match="no area 'sheds'"):
        build(tmp_path, catalogue, {**HEAD, "site": [shed, keep]})
    build(tmp_path, catalogue, {**HEAD, "site": [{**shed, "spots": "sheds"}, keep]})


def test_ribbons_run_along_several_lines_with_ends_as_round_as_said(catalogue):
    names = PlanNames(catalogue.materials)
    names.lines["round"] = names.line({"ellipse": [2, 0, 6, 3, 24]})
    names.lines["out"] = names.line([[8, 0], [14, 0]])
    assert names.lines["round"][0] == (8.0, 0.0) == pytest.approx(names.lines["round"][-1], abs=1e-9)
    ways = names.area({"ribbon": ["round", "out"], "width_m": 1})
    assert ways.bounds == pytest.approx((-4.5, -3.5, 14, 3.5), abs=0.05)
    assert not ways.covers(rectangle(1, -1, 3, 1))
    ways_out = [{"ribbon": "out", "width_m": 2, "round_ends": steps} for steps in (1, True, 12)]
    coarse, plain, fine = (names.area(way).area for way in ways_out)
    assert 12 < coarse < plain < fine < 12 + 3.1416


@pytest.mark.parametrize("core", [[0, 0, 0.5, 30], {"union": [[0, 0, 4, 4], [30, 0, 34, 4]]}])
def test_a_stand_without_one_front_edge_is_refused(tmp_path, catalogue, core):
    tier = {"core": core, "front_m": -0.5, "rows": 3, "z_m": 1}
    with pytest.raises(AssetError, match=r"site\[0\] \(make\) 'stand': tier .*must enclose one area"):
        build(tmp_path, catalogue, {**HEAD, "site": [{"make": "stand", "tier": tier, "seats": ["#ffffff"]}]})
