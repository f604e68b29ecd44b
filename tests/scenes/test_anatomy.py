"""Which faces are which parts: from the catalogue through placing and the scene file to the claims about them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.catalogue_faults import catalogue_faults

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.anatomy import FRONTS, Run, parse_anatomy, remap_runs
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.claims import Body, valid_phrases
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.model import Scene

MATERIALS = 'paint = { colour = "#c8c8c8" }\nboards = { texture = "planks", colour = "#9a6b3f", tile_m = 0.5 }\n'
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
TRUE = {
    "double": {"a tall pole", "two arms", "no hat", "glass above a black foot"},
    "single": {"a tall pole", "one arm", "a pointed hat on top", "glass above a black foot"},
}


@pytest.fixture
def assets(tmp_path):
    (tmp_path / "props").mkdir()
    (tmp_path / "materials.toml").write_text(MATERIALS)
    (tmp_path / "props" / "street.toml").write_text(LAMP)
    return tmp_path


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
    faults = catalogue_faults(load_catalogue(assets))
    assert [f.partition("]: ")[2].partition(" is true")[0] for f in faults] == [
        "'a wooden foot'", "'a round pole and a square foot'", "'a red glass'",
    ]  # fmt: skip
    path = assets / "props" / "street.toml"
    path.write_text(LAMP.replace('tells = ["glass"]', 'tells = ["hat"]'))
    assert any("variant 'double': tells: it has no hat" in f for f in catalogue_faults(load_catalogue(assets)))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('front = "x"', 'front = "z"', "front must be one of none, +x, -x, +y, -y, x, y, got 'z'"),
        ('tells = ["glass"]', 'tells = ["glas"]', "tells: no part 'glas': did you mean 'glass'?"),
        ('{ say = "no hat", lacks = "hat" }', '{ say = "no hat" }', "'no hat' claims nothing that can be checked"),
        ('lacks = "hat"', 'laks = "hat"', "unknown key 'laks': did you mean 'lacks'?"),
        ('shaft = "slender"', 'shaft = "slim"', "unknown form 'slim'"),
        ('lacks = "hat"', 'lacks = "hut"', "no part 'hut': did you mean 'hat'?"),
        ('"red|orange"', '"red|orang"', "unknown colour 'orang': did you mean 'orange'?"),
        ('"height > 3"', '"height = 3"', "'height = 3' is no comparison like"),
        ('"hat on top"', '"hat atop pole"', "'hat atop pole' is none of"),
        ("count = { arm = 1 }", "count = { arm = 0 }", "must be a whole number or [least, most], got 0"),
        ('say = "one arm"', 'say = "two arms"', "duplicate phrase 'two arms'"),
        ('say = "one arm"', 'say = "one arm", also = ["two arms"]', "duplicate phrase 'two arms'"),
        ('lacks = "hat"', 'adjective = "bare"', "'no hat' claims nothing that can be checked: add has"),
        ('lacks = "hat"', 'lacks = "hat", clause = "a hat lacks"', "clause 'a hat lacks' must begin with one of it"),
        ('tag = "hat"', "tag = [3]", "tag must be a word or a list of words"),
    ],
)
def test_what_is_wrong_in_a_look_is_named(assets, old, new, says):
    path = assets / "props" / "street.toml"
    assert old in LAMP
    path.write_text(LAMP.replace(old, new, 1))
    with pytest.raises(AssetError) as caught:
        load_catalogue(assets)
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(path))


@settings(max_examples=40, deadline=None)
@given(st.floats(-720, 720), st.sampled_from(sorted(FRONTS)))
def test_fronts_turn_with_the_thing(tmp_path_factory, yaw_deg, front):
    folder = tmp_path_factory.mktemp("assets")
    (folder / "props").mkdir()
    (folder / "materials.toml").write_text(MATERIALS)
    (folder / "props" / "street.toml").write_text(LAMP.replace('front = "x"', f'front = "{front}"'))
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


@settings(max_examples=200, deadline=None)
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
