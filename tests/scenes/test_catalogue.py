"""The catalogue: what it refuses and how it says so, what it draws, and the catalogue that ships."""

from pathlib import Path

import numpy as np
import pytest

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Overrides, load_catalogue

ASSETS = Path(__file__).parents[2] / "scene_assets"

MATERIALS = """
paint = { colour = "#c8c8c8" }
metal = { colour = "#808080" }
brick = { texture = "brick", colour = "#9a4a3c", tile_m = 0.5 }
"""
MAILBOX = """
[mailbox]
name = "mailbox"
kind = "prop"
params = { body_h = [0.9, 1.1], post_h = 0.5 }
roles = { body = "paint:#b02020", pole = "metal" }
[[mailbox.parts]]
shape = "box"
size = [0.4, 0.5, "body_h"]
at = [0, 0, "post_h"]
role = "body"
[[mailbox.parts]]
shape = "cylinder"
radius = 0.05
height = "post_h"
role = "pole"
[[mailbox.parts]]
shape = "box"
size = [0.1, 0.1, 0.1]
at = [0.25, 0, 1]
role = "brick"
tag = "flag"
[[mailbox.variants]]
name = "red"
attributes = { colour = "red" }
weight = 3
[[mailbox.variants]]
name = "blue"
attributes = { colour = "blue" }
roles = { body = "paint:#2020b0" }
params = { body_h = 2.0 }
without = ["flag"]
"""


@pytest.fixture
def assets(tmp_path):
    (tmp_path / "props").mkdir()
    (tmp_path / "materials.toml").write_text(MATERIALS)
    (tmp_path / "props" / "street.toml").write_text(MAILBOX)
    return tmp_path


def spoil(assets: Path, old: str, new: str) -> str:
    path = assets / "props" / "street.toml"
    assert old in MAILBOX
    path.write_text(MAILBOX.replace(old, new, 1))
    with pytest.raises(AssetError) as caught:
        load_catalogue(assets)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("height = ", "hight = ", "[mailbox] parts[1] (cylinder): unknown key 'hight': did you mean 'height'?"),
        ("radius = 0.05\n", "", "[mailbox] parts[1] (cylinder): key 'radius' is missing"),
        ('shape = "cylinder"', 'shape = "cylindre"', "parts[1]: unknown shape 'cylindre': did you mean 'cylinder'?"),
        ('role = "pole"', 'role = "pol"', "parts[1] (cylinder): unknown role 'pol': did you mean 'pole'?"),
        ('role = "brick"', 'role = "brik"', "parts[2] (box): unknown material 'brik': did you mean 'brick'?"),
        ('pole = "metal"', 'pole = "metall"', "roles pole: unknown material 'metall': did you mean 'metal'?"),
        ("#b02020", "#b0202", "roles body: colour of material 'paint:#b0202' is not of the form #rrggbb"),
        ('"body_h"]', '"body_hh"]', "parts[0] (box): unknown parameter 'body_hh': did you mean 'body_h'?"),
        ('"body_h"]', '"body_h**2"]', "parts[0] (box): 'body_h**2' is no arithmetic expression"),
        ("[0.9, 1.1]", "[1.1, 0.9]", "params: body_h must be a number or [low, high], got [1.1, 0.9]"),
        ("weight = 3", "weigth = 3", "variants[0] (red): unknown key 'weigth': did you mean 'weight'?"),
        ("weight = 3", "weight = 0", "variants[0] (red): weight must be a positive number, got 0"),
        ('name = "blue"', 'name = "red"', "variants[1]: duplicate variant 'red'"),
        ('["flag"]', '["flagg"]', "without names the unknown tag 'flagg': did you mean 'flag'?"),
        ("{ body = \"paint:#2020b0\" }", "{ bod = \"metal\" }", "variants[1] (blue) roles: unknown key 'bod'"),
        ("{ body_h = 2.0 }", "{ bodyh = 2.0 }", "(blue) params: unknown key 'bodyh': did you mean 'body_h'?"),
        ('kind = "prop"', 'kind = "prob"', "[mailbox]: unknown kind 'prob': did you mean 'prop'?"),
        ('name = "mailbox"', "", "[mailbox]: name is missing"),
        ('kind = "prop"', 'kinds = "prop"', "[mailbox]: unknown key 'kinds': did you mean 'kind'?"),
        ('kind = "prop"', 'kind = "prop"\nbuilder = "x"', "[mailbox]: give parts or a builder, one of them"),
        ('kind = "prop"', 'kind = "prop', "Illegal character"),
        ('tag = "flag"', 'tag = "flag"\nring = { number = 3 }', "parts[2] (box): ring must be a table with a count"),
        ('tag = "flag"', 'tag = "flag"\nring = { count = 3, radus = 1 }', "ring: unknown key 'radus'"),
        ('tag = "flag"', 'tag = "flag"\nmirror = "z"', "parts[2] (box): mirror must be x, y or xy, got 'z'"),
    ],
)  # fmt: skip
def test_errors_name_file_category_and_key(assets, old, new, says):
    assert says in spoil(assets, old, new)


def test_unknown_builder_is_named(assets):
    (assets / "props" / "a.toml").write_text('[x]\nname = "x"\nbuilder = "no_such_builder"\n')
    with pytest.raises(AssetError, match=r"a\.toml: \[x\]: unknown builder 'no_such_builder'"):
        load_catalogue(assets)


def test_category_that_stands_twice_names_both_files(assets):
    (assets / "props" / "twice.toml").write_text(MAILBOX)
    with pytest.raises(AssetError, match=r"twice\.toml: \[mailbox\] is already in .*street\.toml"):
        load_catalogue(assets)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('texture = "brick"', 'texture = "brck"', "material 'brick': unknown texture 'brck': did you mean 'brick'?"),
        ("tile_m = 0.5", "tile_m = -1", "material 'brick': tile_m must be 0.01 to 1000 m, got -1"),
        ("tile_m = 0.5", "tile = 1", "material 'brick': unknown key 'tile': did you mean 'tile_m'?"),
        ('"#808080"', '"grey"', "material 'metal': colour must be of the form #rrggbb, got 'grey'"),
    ],
)
def test_errors_in_materials(assets, old, new, says):
    (assets / "materials.toml").write_text(MATERIALS.replace(old, new))
    with pytest.raises(AssetError) as caught:
        load_catalogue(assets)
    assert says in str(caught.value)
    assert "materials.toml" in str(caught.value)


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
    share = np.mean([i.variant == "red" for i in made])
    assert 0.68 < share < 0.82
    heights = {float(i.bounds[1, 2]) for i in made if i.variant == "red"}
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
