"""The texts of the stage `describe` and of the release that they go into."""

import pytest

from aerialdojo_gen.annotations.claims import SceneClaims, claims_from_json
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.language.sides import WRITTEN, of_side
from aerialdojo_gen.annotations.language.writer import Writer
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.context import open_scene
from aerialdojo_gen.scenes.stored import mesh_file
from aerialdojo_gen.store import shards
from aerialdojo_gen.store.root import open_root

pytestmark = pytest.mark.pipeline

SCENE = "U_Courtyard_1"


def rows_of(smoke, table):
    return shards.read_scene(smoke, table, SCENE).to_pylist()


@pytest.fixture(scope="module")
def claims(smoke, project):
    row = rows_of(smoke, "scenes")[0]
    scene = open_scene(mesh_file(open_root(smoke), row["mesh_path"]), row["mesh_sha256"]).scene
    marks = [Landmark(id=m["landmark_id"], name=m["name"], node=m["mesh_node"]) for m in rows_of(smoke, "landmarks")]
    return SceneClaims(Vocabulary(scene, load_catalogue(project / "scene_assets")), marks)


def test_parts_that_no_picture_shows_are_not_said(smoke, claims):
    writer = Writer(claims, [], 1, "describe")
    parts = 0
    for item in rows_of(smoke, "objects"):
        i = claims.geometry.index[item["mesh_node"]]
        own = claims_from_json(item["claims"])
        # Of the others, such as "longer than a car", the whole is the part.
        named = {look.phrase for look in claims.vocabulary.appearances_of(claims.scene.instances[i]) if look.parts}
        for text in writer.texts(i, own, set(), 5):
            assert not any(own[k].kind == "part" and own[k].key in named for k in text.claims)
        parts += sum(own[k].key in named for text in writer.texts(i, own, None, 5) for k in text.claims)
    assert parts > 0


def test_a_text_by_a_person_stands_for_all_tasks():
    made = [{"level": "normal", "held_out": held, "text": str(held)} for held in (True, False)]
    assert [one["text"] for one in of_side(made, held_out=True)] == ["True"]
    written = {"level": WRITTEN, "held_out": False, "text": "by hand"}
    assert of_side([written, *made], held_out=True) == of_side([written, *made], held_out=False) == [written]
    assert of_side(made[1:], held_out=True) == made[1:]
