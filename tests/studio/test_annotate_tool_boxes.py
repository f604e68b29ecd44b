"""Boxes: how a thing gets a node where a foreign mesh has none."""

import contextlib
import fcntl
import itertools
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from starlette.testclient import TestClient
from support.hills import CELL_M, Hills
from support.preload import killed_at

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.dataset.build import open_pipeline, run_pipeline
from aerialdojo_gen.imports.command import add_scene
from aerialdojo_gen.imports.import_mesh import MeshOptions
from aerialdojo_gen.scenes.build import build_scene, cut_out
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.recipe import Cut
from aerialdojo_gen.studio.annotate.server import make_app
from aerialdojo_gen.studio.annotate.session import open_session

# Where changed recipes are laid out for a build.
SCRATCH = Path(tempfile.gettempdir()) / f"aerialdojo-gen-{os.getuid()}"

SHED = ([2.5, 2.5, 0.05], [7.5, 7.5, 4.0])
AIR = ([0.0, 0.0, 50.0], [1.0, 1.0, 51.0])
FROM_ABOVE = {"origin_m": [5.0, 5.0, 20.0], "direction": [0.0, 0.0, -1.0]}


@pytest.fixture(scope="module")
def terrain(tmp_path_factory):
    """A scan: one surface, without a node, on which a shed and a tower stand out."""
    folder = tmp_path_factory.mktemp("terrain")
    x, y = np.meshgrid(np.arange(-20, 20.5, 0.5), np.arange(-20, 20.5, 0.5))
    z = np.where((np.abs(x - 5) < 2.1) & (np.abs(y - 5) < 2.1), 3.0, 0.0)
    z = np.where((np.abs(x + 10) < 1.1) & (np.abs(y + 8) < 1.1), 9.0, z)
    field = Hills(z, np.zeros((80, 80), dtype=bool))
    field.mesh().apply_scale((0.5 / CELL_M, 0.5 / CELL_M, 1)).apply_translation((-20, -20, 0)).export(
        folder / "scan.ply"
    )
    return add_scene("Scan", folder / "scan.ply", folder / "mine", MeshOptions())


def areas(scene):
    return sum(float(trimesh.Trimesh(i.vertices, i.faces, process=False).area) for i in scene.instances)


def test_a_box_takes_its_triangles_and_no_others(terrain):
    scene = terrain.scene
    box = Cut(node="shed_000", category="shed", low_m=SHED[0], high_m=SHED[1])
    cut = cut_out(scene, (box,))
    assert cut.n_triangles == scene.n_triangles
    assert areas(cut) == pytest.approx(areas(scene), rel=1e-12)
    shed = cut["shed_000"]
    middles = shed.vertices[shed.faces].mean(axis=1)
    assert ((middles >= SHED[0]) & (middles <= SHED[1])).all()
    others = np.concatenate([i.vertices[i.faces].mean(axis=1) for i in cut.instances if i.node != "shed_000"])
    assert not ((others >= SHED[0]) & (others <= SHED[1])).all(axis=1).any()
    assert shed.category == "shed"
    assert set(shed.attributes) == {"colour"}
    with pytest.raises(AssetError, match="name of an existing node"):
        cut_out(cut, (box,))


@contextlib.contextmanager
def held(path: Path):
    """Hold a lock, as another run does."""
    with path.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def box_of(category, low, high):
    return {"low_m": low, "high_m": high, "category": category}


@pytest.mark.pipeline
def test_what_is_boxed_out_is_annotated_becomes_an_object_and_can_be_put_back(terrain, tmp_path):
    pipeline, roots = open_pipeline(terrain.pipeline, tmp_path / "data")
    recipe = roots.recipes / "Scan.toml"
    before = recipe.read_bytes()
    desk = open_session("Scan", pipeline, roots)
    client = TestClient(make_app(desk), base_url="http://127.0.0.1")

    def refused(answer, why):
        assert (answer.status_code, why in answer.json()["error"]) == (400, True), answer.text

    def operate(version, **operation):
        body = {"who": "Ada", "client": "a", "operation": operation}
        return client.post("/api/operations", json=body, headers={"If-Match": version}).json()

    with held(tmp_path / "data" / ".lock"):
        refused(client.post("/api/boxes", json=box_of("shed", *SHED)), "another run is writing")
    refused(client.post("/api/boxes", json=box_of("air", *AIR)), "holds no triangle")
    assert recipe.read_bytes() == before
    made = []
    for category, (low, high) in {"Garden shed": SHED, "tower": ([-12, -10, 0.05], [-8.5, -6.5, 20])}.items():
        answer = client.post("/api/boxes", json=box_of(category, high, low))  # the corners in any order
        assert answer.status_code == 200, answer.text
        made.append(answer.json()["node"])
    assert made == ["garden_shed_000", "tower_000"]
    boxed = recipe.read_bytes()
    with held(tmp_path / "data" / ".lock"):
        refused(client.delete("/api/boxes/garden_shed_000"), "another run is writing")
    assert recipe.read_bytes() == boxed
    # The scene that the page has is still the one of the recipe.
    top = client.post("/api/pick", json=FROM_ABOVE).json()
    assert (top["node"], top["boxed"]) == ("garden_shed_000", True)
    mark = {"name": "tower", "node": "tower_000"}
    shed = {"name": "shed", "node": made[0], "category": "garden_shed", "description": "A low shed."}
    document = operate(client.get("/api/document").json()["version"], do="add", kind="landmarks", fields=mark)
    document = operate(document["version"], do="add", kind="objects", fields=shed)
    assert document["objects"][0]["faults"] == []
    assert (document["objects"][0]["landmark"], document["objects"][0]["direction"]) == ("tower", "northeast")
    assert len(client.get("/api/objects/0/anchors").json()) == 3
    run_pipeline(terrain.pipeline, roots.data, stages=["anchor-sample"], scenes=["Scan"], workers=1)
    refused(client.delete("/api/boxes/garden_shed_000"), "is annotated")
    document = operate(document["version"], do="remove", kind="objects", id=0)
    assert client.delete("/api/boxes/garden_shed_000").status_code == 200
    assert client.delete("/api/boxes/garden_shed_000").status_code == 400
    scene = build_scene(recipe, load_catalogue(roots.scene_assets))
    assert "garden_shed_000" not in scene
    assert "tower_000" in scene
    again = client.post("/api/pick", json=FROM_ABOVE).json()
    assert again["node"] == scene.instances[0].node or not again["boxed"]
    operate(document["version"], do="remove", kind="landmarks", id=0)
    assert client.delete("/api/boxes/tower_000").status_code == 200
    assert recipe.read_bytes() == before
    desk.anchors.close()


IMPORTS = """
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.studio.annotate.session import open_session
"""
BOX_OUT = f"""
import os, sys
from pathlib import Path
{IMPORTS}
here = Path(sys.argv[1])
open_session("Scan", *open_pipeline(here / "pipeline.toml", here / "data")).cut(*{SHED}, "shed")
os._exit(0)
"""


@pytest.mark.kill
def test_killed_at_any_rename_of_boxing_out_the_recipe_is_whole(terrain, tmp_path):
    def opened(folder):
        return open_session("Scan", *open_pipeline(folder / "pipeline.toml", folder / "data"))

    mine = shutil.copytree(terrain.pipeline.parent, tmp_path / "mine")
    opened(mine).anchors.close()
    before, boxed = (mine / "scenes" / "Scan.toml").read_bytes(), []
    with killed_at(BOX_OUT, IMPORTS, ONLY="rename renameat2") as run:
        for n in itertools.count(1):
            here = shutil.copytree(mine, tmp_path / str(n))
            ended, recipe = run(n, here), here / "scenes" / "Scan.toml"
            boxed.append(recipe.read_bytes() != before)
            assert recipe.read_bytes().count(b"shed_000") == boxed[-1]
            # Whoever comes next finds the scene of the recipe, and may change it.
            desk = opened(here)
            if not boxed[-1]:
                desk.cut(*SHED, "shed")
            desk.uncut("shed_000")
            desk.anchors.close()
            assert recipe.read_bytes() == before
            if not ended:
                break
    # The recipe comes last: what is killed in the build has left it alone.
    assert boxed == sorted(boxed)
    assert boxed.count(False) > 1
    assert boxed[-1]
    assert not list(SCRATCH.rglob("Scan.toml"))
