"""The catalogue: what it refuses and how it says so, what it draws, which faces are which parts, and their claims."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.catalogue_faults import catalogue_faults

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.appearances import Body, valid_phrases
from aerialdojo_gen.scenes.catalogue import Overrides, _is_drawn_crown, load_catalogue
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.model import FRONTS, Run, Scene, parse_anatomy, remap_runs

ASSETS = Path(__file__).parents[2] / "scene_assets"

MATERIALS = """
paint = { colour = "#c8c8c8" }
metal = { colour = "#808080" }
brick = { texture = "brick", colour = "#9a4a3c", tile_m = 0.5 }
boards = { texture = "planks", colour = "#9a6b3f", tile_m = 0.5 }
"""
MAILBOX = """
[mailbox]
name = "mailbox"
kind = "prop"
params = { body_h = [0.9, 1.1], post_h = 0.5 }
roles = { body = "paint:#b02020", pole = "metal" }
parts = [
  { shape = "box", size = [0.4, 0.5, "body_h"], at = [0, 0, "post_h"], role = "body" },
  { shape = "cylinder", radius = 0.05, height = "post_h", role = "pole" },
  { shape = "box", size = [0.1, 0.1, 0.1], at = [0.25, 0, 1], role = "brick", tag = "flag" },
]
variants = [
  { name = "red", attributes = { colour = "red" }, weight = 3 },
  { name = "blue", attributes = { colour = "blue" }, roles = { body = "paint:#2020b0" }, \
    params = { body_h = 2.0 }, without = ["flag"] },
]
"""


LAMP = """
[lamp]
name = "lamp"
front = "x"
tells = ["glass"]
roles = { pole = "paint:#101010", glass = "#ffffff" }
looks = [
  { say = "a tall pole", form = { shaft = "slender" }, size = ["height > 3", "shaft.height > 4 * length"] },
  { say = "two arms", count = { arm = 2 } },
  { say = "one arm", count = { arm = 1 } },
  { say = "no hat", lacks = "hat" },
  { say = "a pointed hat on top", form = { hat = "pointed" }, order = ["hat on top", "hat above pole"] },
  { say = "glass above a black foot", colour = { glass = "white", foot = "black" }, order = ["glass above foot"] },
  { say = "a wooden foot", material = { foot = "boards" } },
  { say = "a round pole and a square foot", form = { pole = "round", foot = "boxy" } },
  { say = "a red glass", colour = { glass = "red|orange" } },
]
parts = [
  { shape = "cylinder", radius = 0.06, height = 4, segments = 12, role = "pole", tag = "shaft" },
  { shape = "box", size = [0.4, 0.4, 0.3], role = "pole", tag = "foot" },
  { shape = "box", size = [0.3, 0.05, 0.05], at = [0.2, 0, 3.6], mirror = "x", role = "pole", tag = ["arm", "pair"] },
  { shape = "box", size = [0.3, 0.05, 0.05], at = [0.2, 0, 3.6], role = "pole", tag = ["arm", "single"] },
  { shape = "sphere", radii = [0.15, 0.15, 0.15], at = [0.4, 0, 3.7], role = "glass" },
  { shape = "cone", radius = 0.2, height = 0.4, at = [0, 0, 4], role = "glass", tag = "hat" },
]
variants = [
  { name = "double", without = ["single", "hat"] },
  { name = "single", without = ["pair"], tells = ["hat"] },
]
"""


def written(folder: Path, lamp: str = LAMP) -> Path:
    """Write a folder of assets."""
    (folder / "props").mkdir()
    (folder / "materials.toml").write_text(MATERIALS)
    (folder / "props" / "street.toml").write_text(MAILBOX)
    (folder / "props" / "lamp.toml").write_text(lamp)
    return folder


@pytest.fixture
def assets(tmp_path):
    return written(tmp_path)


def look_up_all(assets: Path) -> None:
    """Look every category of a catalogue up: only then are all of them checked."""
    catalogue = load_catalogue(assets)
    for category in catalogue:
        catalogue[category]


MAILBOX_FAULTS = [
    ("height = ", "hight = ", "[mailbox] parts[1] (cylinder): unknown key 'hight': did you mean 'height'?"),
    ("radius = 0.05, ", "", "[mailbox] parts[1] (cylinder): key 'radius' is missing"),
    ('shape = "cylinder"', 'shape = "cylindre"', "parts[1]: unknown shape 'cylindre': did you mean 'cylinder'?"),
    ('role = "pole"', 'role = "pol"', "parts[1] (cylinder): unknown role 'pol': did you mean 'pole'?"),
    ('role = "brick"', 'role = "brik"', "parts[2] (box): unknown material 'brik': did you mean 'brick'?"),
    ('pole = "metal"', 'pole = "metall"', "roles pole: unknown material 'metall': did you mean 'metal'?"),
    ("#b02020", "#b0202", "roles body: colour of material 'paint:#b0202' is not of the form #rrggbb"),
    ('"body_h"]', '"body_hh"]', "parts[0] (box): unknown parameter 'body_hh': did you mean 'body_h'?"),
    ('"body_h"]', '"body_h**2"]', "parts[0] (box): 'body_h**2' is no arithmetic expression"),
    ("[0.9, 1.1]", "[1.1, 0.9]", "[params] body_h = [1.1, 0.9]: must be a number or [low, high]"),
    ("weight = 3", "weigth = 3", "variants[0] (red): unknown key 'weigth': did you mean 'weight'?"),
    ("weight = 3", "weight = 0", "variants[0] (red): weight = 0: Input should be greater than 0"),
    ('name = "blue"', 'name = "red"', "variants[1]: duplicate variant 'red'"),
    ('["flag"]', '["flagg"]', "variants[1] (blue) without: unknown tag 'flagg': did you mean 'flag'?"),
    ("{ body = \"paint:#2020b0\" }", "{ bod = \"metal\" }", "variants[1] (blue) roles: unknown key 'bod'"),
    ("{ body_h = 2.0 }", "{ bodyh = 2.0 }", "(blue) params: unknown key 'bodyh': did you mean 'body_h'?"),
    ('kind = "prop"', 'kind = "prob"', "[mailbox]: unknown kind 'prob': did you mean 'prop'?"),
    ('name = "mailbox"', "", "[mailbox]: name is missing"),
    ('kind = "prop"', 'kinds = "prop"', "[mailbox]: unknown key 'kinds': did you mean 'kind'?"),
    ('kind = "prop"', 'kind = "prop"\nbuilder = "x"', "[mailbox]: give parts or a builder, one of them"),
    ('kind = "prop"', 'kind = "prop', "Illegal character"),
    ('tag = "flag"', 'tag = "flag", ring = { number = 3 }', "parts[2] (box): ring must be a table with a count"),
    ('tag = "flag"', 'tag = "flag", ring = { count = 3, radus = 1 }', "ring: unknown key 'radus'"),
    ('tag = "flag"', 'tag = "flag", mirror = "z"', "parts[2] (box): mirror must be x, y or xy, got 'z'"),
]  # fmt: skip
LAMP_FAULTS = [
    ('front = "x"', 'front = "z"', "front must be one of none, +x, -x, +y, -y, x, y, got 'z'"),
    (
        'tells = ["glass"]',
        'tells = ["glas"]',
        "tells: parts are named by tag or role: unknown part 'glas': did you mean 'glass'?",
    ),
    ('{ say = "no hat", lacks = "hat" }', '{ say = "no hat" }', "'no hat' claims nothing that can be checked"),
    ('lacks = "hat"', 'laks = "hat"', "unknown key 'laks': did you mean 'lacks'?"),
    ('shaft = "slender"', 'shaft = "slim"', "shaft = 'slim': unknown form (one of round, boxy"),
    (
        'lacks = "hat"',
        'lacks = "hut"',
        "looks[3]: parts are named by tag or role: unknown part 'hut': did you mean 'hat'?",
    ),
    ('"red|orange"', '"red|orang"', "unknown colour 'orang': did you mean 'orange'?"),
    ('"height > 3"', '"height = 3"', "'height = 3' is no comparison like"),
    ('"hat on top"', '"hat atop pole"', "'hat atop pole' is none of"),
    ("count = { arm = 1 }", "count = { arm = 0 }", "[count] arm = 0: must be a whole number or [least, most]"),
    ('say = "one arm"', 'say = "one arm", also = ["two arms"]', "duplicate phrase 'two arms'"),
    ('lacks = "hat"', 'adjective = "bare"', "'no hat' claims nothing that can be checked: add has"),
    ('lacks = "hat"', 'lacks = "hat", clause = "a hat lacks"', "clause 'a hat lacks' must begin with one of it"),
    ('tag = "hat"', "tag = [3]", "tag must be a word or a list of words"),
]
MATERIAL_FAULTS = [
    ('texture = "brick"', 'texture = "brck"', "unknown texture 'brck': did you mean 'brick'?"),
    ("tile_m = 0.5", "tile_m = -1", "tile_m = -1: Input should be greater than or equal to 0.01"),
    ("tile_m = 0.5", "tile = 1", "unknown key 'tile': did you mean 'tile_m'?"),
    ('"#9a4a3c"', '"grey"', "colour = 'grey': String should match pattern '^#[0-9a-fA-F]{6}$'"),
]


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        *(("props/street.toml", *row) for row in MAILBOX_FAULTS),
        *(("props/lamp.toml", *row) for row in LAMP_FAULTS),
        *(("materials.toml", *row) for row in MATERIAL_FAULTS),
    ],
)
def test_what_is_wrong_is_named_with_file_category_and_key(assets, file, old, new, says):
    path = assets / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(AssetError) as caught:
        look_up_all(assets)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    assert says in message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[x]\nname = "x"\nbuilder = "no_such_builder"\n', r"\[x\]: unknown builder 'no_such_builder'"),
        (MAILBOX, r"\[mailbox\] is already in .*street\.toml"),
    ],
)
def test_what_is_wrong_in_a_file_beside_others_is_named_with_it(assets, text, says):
    (assets / "props" / "twice.toml").write_text(text)
    with pytest.raises(AssetError, match=rf"twice\.toml: {says}"):
        load_catalogue(assets)["x"]


def test_what_is_wrong_with_a_category_stops_no_scene_without_it(assets):
    (assets / "props" / "wrong.toml").write_text(MAILBOX.replace("[mailbox", "[letterbox").replace("height", "hight"))
    catalogue = load_catalogue(assets)
    assert catalogue.instantiate("mailbox", "m", generator(0, "t")).category == "mailbox"
    with pytest.raises(AssetError, match="unknown key 'hight'"):
        catalogue.instantiate("letterbox", "l", generator(0, "t"))


def test_what_was_asked_for_but_is_unknown(assets):
    catalogue = load_catalogue(assets)
    rng = generator(0, "t")
    with pytest.raises(AssetError, match="unknown category 'mailbux': did you mean 'mailbox'"):
        catalogue["mailbux"]
    with pytest.raises(AssetError, match="unknown variant 'blu': did you mean 'blue'"):
        catalogue.instantiate("mailbox", "n", rng, variant="blu")
    with pytest.raises(AssetError, match="params: unknown key 'body': did you mean 'body_h'"):
        catalogue.instantiate("mailbox", "n", rng, own=Overrides({"body": 1}))
    with pytest.raises(AssetError, match=r"parts\[0\] \(box\): size must be positive, got 0\.4, 0\.5, -1"):
        catalogue.instantiate("mailbox", "n", rng, own=Overrides({"body_h": -1}))


def test_variant_changes_materials_sizes_and_parts(assets):
    catalogue = load_catalogue(assets)
    red = catalogue.instantiate("mailbox", "a", generator(0, "t"), variant="red")
    blue = catalogue.instantiate("mailbox", "b", generator(0, "t"), variant="blue")
    assert [p.material for p in red.parts] == ["paint:#b02020", "metal", "brick"]
    assert [p.material for p in blue.parts] == ["paint:#2020b0", "metal"]
    assert blue.bounds[1, 2] == 2.5
    assert 1.4 <= red.bounds[1, 2] <= 1.6
    assert red.attributes == {"colour": "red"}
    assert catalogue.materials["paint:#2020b0"].colour == (0x20, 0x20, 0xB0)


def test_draws_follow_weights_and_ranges_and_depend_on_the_generator_alone(assets):
    catalogue = load_catalogue(assets)
    made = [catalogue.instantiate("mailbox", f"n{k}", generator(0, "t", k)) for k in range(400)]
    assert 0.68 < np.mean([i.variant == "red" for i in made]) < 0.82
    heights = [float(i.bounds[1, 2]) for i in made if i.variant == "red"]
    assert 1.39 < min(heights) < 1.43
    assert 1.57 < max(heights) < 1.61
    again = load_catalogue(assets)
    for k in (399, 7, 0):
        twin = again.instantiate("mailbox", f"n{k}", generator(0, "t", k))
        assert twin.variant == made[k].variant
        assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(twin.parts, made[k].parts, strict=True))


def test_instance_stands_turned_and_scaled_in_the_world(assets):
    catalogue = load_catalogue(assets)
    options = {"variant": "red", "own": Overrides({"body_h": 1.0})}
    here = catalogue.instantiate("mailbox", "a", generator(0, "t"), **options)
    there = catalogue.instantiate("mailbox", "b", generator(0, "t"), (10, 20, 3), 90.0, scale=2.0, **options)
    np.testing.assert_allclose(here.bounds, [[-0.2, -0.25, 0], [0.3, 0.25, 1.5]], atol=1e-6)
    np.testing.assert_allclose(there.bounds, [[9.5, 19.6, 3], [10.5, 20.6, 6]], atol=1e-5)
    assert all(np.array_equal(p.vertices, p.vertices.astype(np.float32)) for p in there.parts)
    # The pattern keeps its size: texture grows with the body.
    assert np.ptp(there.parts[2].uv[:, 1]) == pytest.approx(2 * np.ptp(here.parts[2].uv[:, 1]))


def test_sign_text_speaks_of_attributes(assets):
    (assets / "props" / "sign.toml").write_text(
        '[sign]\nname = "sign"\n[[sign.parts]]\nshape = "text"\ntext = "{label}"\nheight = 1\nrole = "metal"\n'
    )
    catalogue = load_catalogue(assets)
    widths = [
        np.ptp(catalogue.instantiate("sign", "s", generator(0, "t"), own=own).vertices[:, 1])
        for own in (Overrides(attributes={"label": w}) for w in ("I", "WWW"))
    ]
    assert widths[1] > 4 * widths[0]


TRUE = {
    "double": {"a tall pole", "two arms", "no hat", "glass above a black foot"},
    "single": {"a tall pole", "one arm", "a pointed hat on top", "glass above a black foot"},
}


def lamp(assets, variant, yaw_deg=0.0, position=(0.0, 0.0, 0.0)):
    return load_catalogue(assets).instantiate("lamp", "lamp_000", generator(0, "test"), position, yaw_deg, variant)


@pytest.mark.parametrize("variant", TRUE)
@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, 200.0])
def test_phrases_are_true_of_the_variants_that_bear_them_out_whichever_way_they_stand(assets, variant, yaw_deg):
    catalogue = load_catalogue(assets)
    thing = lamp(assets, variant, yaw_deg, (120.25, -80.5, 3.0))
    assert {one.phrase for one in valid_phrases(catalogue["lamp"].looks, thing, catalogue.materials)} == TRUE[variant]


def test_a_phrase_that_is_not_true_says_what_is(assets):
    catalogue = load_catalogue(assets)
    body = Body(lamp(assets, "double"), catalogue.materials)
    wrong = {look.phrase: body.false_claims(look) for look in catalogue["lamp"].looks}
    assert wrong["one arm"] == ["has 2 x arm"]
    assert wrong["a red glass"] == ["its glass is white"]
    assert wrong["a wooden foot"] == ["its foot is of paint"]
    assert wrong["a pointed hat on top"] == ["has no hat"]
    assert wrong["a round pole and a square foot"] == ["its pole is not round"]  # the foot is of the pole's role too


def test_what_the_catalogue_cannot_bear_out_is_named(assets):
    faults = catalogue_faults(load_catalogue(assets), ["lamp"])
    assert [f.partition("]: ")[2].partition(" is true")[0] for f in faults] == [
        "'a wooden foot'", "'a round pole and a square foot'", "'a red glass'",
    ]  # fmt: skip
    path = assets / "props" / "lamp.toml"
    path.write_text(LAMP.replace('tells = ["glass"]', 'tells = ["hat"]'))
    assert any(
        "variant 'double': tells: it has no hat" in f for f in catalogue_faults(load_catalogue(assets), ["lamp"])
    )


@settings(max_examples=20, deadline=None)
@given(st.floats(-720, 720), st.sampled_from(sorted(FRONTS)))
def test_fronts_turn_with_the_thing(tmp_path_factory, yaw_deg, front):
    text = LAMP.replace('front = "x"', f'front = "{front}"')
    folder = written(tmp_path_factory.mktemp("assets"), text)
    anatomy = lamp(folder, "double", yaw_deg).anatomy
    wanted = [math.radians(yaw_deg + side) for side in FRONTS[front]]
    assert np.allclose(np.exp(1j * np.array(anatomy.fronts_rad)), np.exp(1j * np.array(wanted)))


@pytest.mark.parametrize("variant", TRUE)
def test_a_scene_file_keeps_which_faces_are_which(assets, tmp_path, variant):
    catalogue, thing = load_catalogue(assets), lamp(assets, variant, 33.0, (7.1, 2.3, 0.0))
    materials = {p.material: catalogue.materials[p.material] for p in thing.parts}
    write_glb(Scene("U_Test_0", (thing,), materials, np.array([[-9.0] * 3, [9.0] * 3])), tmp_path / "s.glb")
    again = read_glb(tmp_path / "s.glb").instances[0]
    assert (again.anatomy.fronts_rad, again.anatomy.identifying_parts) == (
        thing.anatomy.fronts_rad,
        thing.anatomy.identifying_parts,
    )
    assert again.anatomy.runs == thing.anatomy.runs
    glass = thing.vertices[thing.faces[thing.faces_of("glass")]]
    assert len(glass)
    assert np.array_equal(again.vertices[again.faces[again.faces_of("glass")]], glass)
    assert len(again.copies_of("arm")) == {"double": 2, "single": 1}[variant]
    assert set(again.faces_of("pole|glass")) == set(range(len(again.faces)))


def test_crowns_of_one_size_differ(catalogue):
    kind = next(name for name in catalogue if any(_is_drawn_crown(part) for part in catalogue[name].parts))
    variant, own = catalogue[kind].variants[0], Overrides({n: low for n, (low, _) in catalogue[kind].params.items()})
    grown = [catalogue.instantiate(kind, "it", generator(0, k), variant=variant.name, own=own) for k in range(12)]
    assert len({one.shape for one in grown}) > 1


@settings(max_examples=80, deadline=None)
@given(st.data())
def test_runs_follow_the_faces_that_are_left(data):
    counts = data.draw(st.lists(st.integers(1, 12), min_size=1, max_size=4))
    kept = [np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n))) for n in counts]
    part = data.draw(st.integers(0, len(counts) - 1))
    faces = data.draw(st.integers(1, counts[part]))
    copies = data.draw(st.integers(1, counts[part] // faces))
    first = data.draw(st.integers(0, counts[part] - faces * copies))
    before = np.concatenate([np.flatnonzero(np.ones(n)) + 100 * k for k, n in enumerate(counts)])
    own = {100 * part + f for f in range(first, first + faces * copies)}
    left = np.concatenate([np.flatnonzero(k) + 100 * n for n, k in enumerate(kept)])
    there = [int(k.sum()) for k in kept if k.any()]
    offsets = np.cumsum([0, *there])
    runs = remap_runs({"it": [Run(part, first, faces, copies)]}, kept)
    found = {int(left[offsets[r.part] + r.first + n]) for r in runs.get("it", ()) for n in range(r.faces * r.copies)}
    assert found == own & set(left.tolist()) <= set(before.tolist())


@pytest.mark.parametrize(
    "spoil",
    [
        {"parts": {"pole": [[0, 0, 4, 3]]}}, {"parts": {"pole": [[1, 0, 4, 1]]}},
        {"parts": {"pole": [[0, -1, 4, 1]]}},
        {"parts": {"pole": [[0, 0, 0, 1]]}}, {"parts": {"pole": [[0.0, 0, 4, 1]]}}, {"parts": {"pole": [[0, 0, 4]]}},
        {"fronts_rad": [math.inf]}, {"yaw_rad": "east"}, {"tells": [3]},
    ],
)  # fmt: skip
def test_an_anatomy_of_faces_that_are_not_there_is_refused(spoil):
    sound = {"yaw_rad": 0.0, "fronts_rad": [0.0], "tells": ["pole"], "parts": {"pole": [[0, 0, 5, 2]]}}
    assert parse_anatomy(sound, [10]).runs["pole"] == (Run(0, 0, 5, 2),)
    with pytest.raises((ValueError, TypeError, KeyError)):
        parse_anatomy(sound | spoil, [10])
