"""Files that would hang a command, fill the memory or end in a traceback: one line at the level of the user."""

import json

import numpy as np
import pytest
from fuzzing.mutate import Raw, toml_dumped
from fuzzing.tables import recording_row
from shapely.geometry import Polygon
from support import rendered
from support.command_line import said
from support.layout_checks import catalogue

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.rendering import finished
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.grammar import poisson_disc
from aerialdojo_gen.scenes.ground import disc
from aerialdojo_gen.scenes.model import Material, Scene
from aerialdojo_gen.scenes.recipe import load_imported
from aerialdojo_gen.scenes.terrain import rolling_terrain
from aerialdojo_gen.store.root import open_root

COURT = {"plan": 1, "size_m": [30, 30], "ceiling_m": 12}
WALLS = {"make": "walls", "lines": [[[0, 0], [9, 0]]], "height_m": 3, "material": "brick"}
ROOF = {"shape": "block", "role": "roof_tiles", "corners": [-6, -6, 0, 0], "z": [3, 3.2]}
POST = {"name": "post", "roles": {"body": "#808080"}, "params": {"h": 2}}


def test_a_command_names_the_place_in_a_pipeline_that_no_parser_survives(tmp_path, capsys):
    path = tmp_path / "p.toml"
    path.write_text("name = 'x'\nseed = " + "[" * 50_000)
    code, _, err = said(capsys, "plan", "--pipeline", path, "--data", tmp_path / "d")
    assert (code, err) == (2, f"error: {path}: line 2, column 72: nested more than 64 deep\n")
    assert not (tmp_path / "d").exists()


def recipe(tmp_path, body):
    path = tmp_path / "U_Court_0.toml"
    path.write_text(toml_dumped(body))
    return path


ROLLING = {"make": "rolling_ground", "cell_m": 1, "height_m": 1, "wavelength_m": 20}
VALLEY = {"make": "stepped_valley", "cell_m": 2, "bed": [[-9, 0], [9, 0]], "roughness_m": 1, "steps": [[5, 5, 1]]}
ROCKS, FAR = {"make": "layered_rocks", "bands": ["rock"]}, {"disc": [200, 100, 4]}


def drawn(*parts):
    return {"category": "roof", "parts": [ROOF | part for part in parts]}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"size_m": [float("nan"), 30]}, "size_m[0]: is nan, no finite number"),
        ({"size_m": [1e9, 30]}, "size_m.0 = 1000000000.0: Input should be less than or equal to 1000"),
        ({"seed": 10**30}, "seed: is an integer beyond 64 bits"),
        ({"seed": Raw("[" * 40_000)}, "nested more than 64 deep"),
        ({"site": [{"entries": [{}] * 1500}, {"entries": [{}] * 501}]}, "more than 2,000 entries"),
        ({"site": [{"entries": 3}]}, "site[0]: entries is a list of entries"),
        ({"attribution": "A" * 501}, "attribution = "),
        ({"steps": [ROLLING, {"make": "level_area", "area": FAR}]}, "the ground about (200, 100) lies off the site"),
        ({"steps": [VALLEY]}, "a step ends 0.05 m or more beyond where it begins"),
        ({"steps": [{"make": "massif", "ridges": [{"line": [[0, 0, -1]], "width_m": 9}]}]},
         "line.0.2 = -1: Input should be greater than or equal to 0"),
        ({"steps": [{"make": "level_along", "lines": [[[-2000, 0], [2000, 0]]], "width_m": 2}]},
         "a way may be 3,000 m long"),
    ],
)  # fmt: skip
def test_a_plan_s_numbers_are_bounded_before_anything_is_made_of_them(tmp_path, change, says):
    change = {"ground": change} if "steps" in change else change
    assert_refused(recipe(tmp_path, COURT | change), says)


def assert_refused(path, says, place=""):
    with pytest.raises(AssetError) as refused:
        build_scene(path, catalogue())
    assert str(refused.value).startswith(f"{path}: {place}")
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"paint": ["nan", -6, 0, 0], "material": "mud"}, "(paint): paint = ['nan', -6, 0, 0]: 'nan' uses"),
        ({"paint": [-6, False, 0, 0], "material": "mud"}, "expected a number or an expression, got False"),
        ({"paint": [-6, -1e-300, 0, 0], "material": "mud"}, "a rectangle must be 0.01 m wide and deep or more"),
        (drawn({"corners": [-6, -1e-300, 0, 0]}), "parts[0] (block): the outline has no area"),
        (WALLS | {"lines": [[[1, 1], [1, 1]]]}, "consecutive points of a line must be 0.01 m apart"),
        (WALLS | {"lines": [[[0, 0], [1e7, 0]]]}, "must lie within 2,000"),
        (WALLS | {"height_m": 0}, "height_m = 0: Input should be greater than 0"),
        ({"place": [["bench", 0, 0, "inf"]]}, "(place)[0]: yaw_deg = 'inf': 'inf' uses"),
        (ROCKS | {"rocks": [{"area": FAR, "name": "far", "height_m": 3}]}, "rock_000 has no body"),
        ({"make": "mudbrick_houses", "houses": [{"at": [0, 0], "name": "a", "size_m": [0.5, 5, 3]}]},
         "[houses.0] size_m.0 = 0.5: Input should be greater"),
        (ROCKS | {"as": ["low", "high"], "rocks": [{"area": [0, 0, 4, 4], "name": "one", "height_m": 3}]},
         "'layered_rocks' returns no height for each name of 'as'"),
    ],
)  # fmt: skip
def test_what_an_entry_cannot_make_is_an_error_of_its_plan(tmp_path, entry, says):
    assert_refused(recipe(tmp_path, COURT | {"site": [entry]}), says, "site[0]")


def test_ground_stays_a_number_where_an_area_to_be_levelled_has_shrunk_to_nothing():
    ground = rolling_terrain((20.0, 20.0), 2.0, 1, 1.0, 9.0)
    assert ground.flattened(disc(0, 0, 1.0).buffer(-1.2), 0.5).heights_m.tolist() == ground.heights_m.tolist()
    assert poisson_disc(Polygon(), 1.0, np.random.default_rng(0)) == []


def test_the_sun_of_an_imported_scene_stands_above_too(tmp_path):
    body = {"source": "x", "source_sha256": "", "up": "z", "scale": 1, "ceiling_m": 9, "sun": [0, 0, 0]}
    with pytest.raises(AssetError, match="the sun must stand above the horizon"):
        load_imported(recipe(tmp_path, {"imported": body}))


@pytest.mark.parametrize(
    ("part", "place"),
    [
        ({"shape": "cylinder", "radius": 1, "height": 1, "segments": "h*1e9"}, "segments must be 3 to 256"),
        ({"shape": "sphere", "radius": 1, "subdivisions": 1e6, "half": True}, "subdivisions must be 0 to 4"),
        ({"shape": "sweep", "path": [[0, 0, 0], [0, 0, 1]], "radius": 1, "sides": "1e15"}, "sides must be 3 to 64"),
        ({"shape": "lathe", "points": [[1, 0]] * 2001}, "points must be 2 to 2,000 points"),
        ({"shape": "box", "size": [1, 1, 1e300]}, "size must lie within 10,000"),
        ({"shape": "box", "size": [1, 1, True]}, "size must be a number"),
        ({"shape": "box", "size": {"x": 1}}, "is neither a number nor an expression"),
        ({"shape": "box", "size": ["1/0", 1, 1]}, "division by zero"),
        ({"shape": "box", "size": ["min(1)", 1, 1]}, "min does not take 1 arguments"),
        ({"shape": "box", "size": ["1e308*10", 1, 1]}, "is inf, no finite number"),
        ({"shape": "box", "size": ["-" * 1500 + "1", 1, 1]}, "has 1,501 characters"),
        ({"shape": "box", "size": [1, 1, 1],
          "array": {"count": 2000, "step": [1, 0, 0], "count2": 2000, "step2": [0, 1, 0]}},
         "count 2000 makes 48,000,000 triangles"),
        ({"shape": "box", "size": [1, 1, 1], "ring": {"count": 1e300}}, "count must lie within 10,000"),
        ({"shape": "text", "text": "A" * 121, "height": 1}, "has 121 letters"),
        ({"shape": "text", "text": 5, "height": 1}, "text must be letters"),
        ({"shape": ["box"]}, "unknown shape"),
        ({"shape": "box", "size": [1, 1, 1], "tag": [3]}, "tag must be a word"),
        ({"shape": "box", "size": [1e-9, 1e-9, 1e-9]}, "no triangle of variant '' has an area"),
    ],
)  # fmt: skip
def test_a_prop_s_counts_are_bounded_before_anything_is_made_of_them(tmp_path, part, place):
    (tmp_path / "props").mkdir()
    (tmp_path / "materials.toml").write_text("")
    path = tmp_path / "props" / "x.toml"
    path.write_text(toml_dumped({"post": POST | {"parts": [{"role": "body"} | part]}}))
    with pytest.raises(AssetError) as refused:
        load_catalogue(tmp_path).instantiate("post", "post_000", np.random.default_rng(0))
    assert str(refused.value).startswith(f"{path}: [post]")
    assert place in str(refused.value)


FINGERPRINT = "f" * 64
FOLDER = "media/U_A_0/n"
ROW = recording_row(FOLDER)


@pytest.mark.parametrize(
    "rows",
    [
        [], {}, "x", [1], [[]], [{}], [ROW | {"more": 1}],
        [{k: v for k, v in ROW.items() if k != "fps"}],
        [ROW | {"bytes": "4"}], [ROW | {"bytes": 4.5}], [ROW | {"width": 10**30}],
        [ROW | {"flags": 5}],
        [ROW | {"ok": None}],
        [ROW | {"path": "../../front_rgb.mp4"}], [ROW | {"path": "media/U_A_0/n/.."}], [ROW | {"path": 5}],
        [ROW, ROW],
        [ROW | {"device": "\ud800"}], [ROW | {"view": ["front"]}],
    ],
)  # fmt: skip
def test_a_recording_json_of_other_types_is_rendered_again(tmp_path, rows):
    folder = tmp_path / FOLDER
    folder.mkdir(parents=True)
    (folder / "front_rgb.mp4").write_bytes(b"xxxx")
    note = folder / "recording.json"
    note.write_text(json.dumps({"fingerprint": FINGERPRINT, "recordings": [ROW]}))
    assert finished.find(open_root(tmp_path), FOLDER, FINGERPRINT) == [ROW]
    note.write_text(json.dumps({"fingerprint": FINGERPRINT, "recordings": rows}))
    assert finished.find(open_root(tmp_path), FOLDER, FINGERPRINT) is None
    for text in ("[" * 50_000, "[]", '"x"', "1" * 5000, '{"fingerprint": NaN}'):
        note.write_text(text)
        assert finished.find(open_root(tmp_path), FOLDER, FINGERPRINT) is None


def test_a_texture_that_asks_for_far_more_pixels_than_bytes_is_not_decoded(tmp_path):
    wide = Material("grass", (90, 130, 70), np.zeros((2, 5000, 3), np.uint8), 2.0)
    scene = rendered.courtyard()
    path = tmp_path / "x.glb"
    write_glb(scene, path)
    assert len(read_glb(path).instances) == len(scene.instances)
    write_glb(Scene(scene.name, scene.instances, scene.materials | {"grass": wide}, scene.bounds), path)
    with pytest.raises(AssetError, match="is no scene file of this program or is damaged") as refused:
        read_glb(path)
    assert "texture is too large" in str(refused.value.__cause__)
