"""Boxes: how a thing gets a node where a foreign mesh has none."""

import contextlib
import fcntl
import http.client
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
import trimesh
from starlette.testclient import TestClient
from support import annotating
from support.browser import until
from support.hills import CELL_M, Hills

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.cli.common import open_pipeline
from aerialdojo_gen.dataset.build import run_pipeline
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
SHED_BOX = {"low_m": SHED[0], "high_m": SHED[1], "category": "shed"}


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
    cut = cut_out(scene, (Cut(node="shed_000", category="shed", low_m=SHED[0], high_m=SHED[1]),))
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
        cut_out(cut, (Cut(node="shed_000", category="shed", low_m=SHED[0], high_m=SHED[1]),))
    with pytest.raises(AssetError, match="holds no triangle"):
        cut_out(scene, (Cut(node="air_000", category="air", low_m=(0, 0, 50), high_m=(1, 1, 51)),))


@pytest.mark.pipeline
def test_what_is_boxed_out_is_annotated_becomes_an_object_and_can_be_put_back(terrain, tmp_path):
    pipeline, roots = open_pipeline(terrain.pipeline, tmp_path / "data")
    recipe = roots.recipes / "Scan.toml"
    before = recipe.read_bytes()
    desk = open_session("Scan", pipeline, roots)
    client = TestClient(make_app(desk), base_url="http://127.0.0.1")
    made = []
    for category, (low, high) in {"Garden shed": SHED, "tower": ([-12, -10, 0.05], [-8.5, -6.5, 20])}.items():
        box = {"low_m": high, "high_m": low, "category": category}  # the corners in any order
        answer = client.post("/api/boxes", json=box)
        assert answer.status_code == 200, answer.text
        made.append(answer.json()["node"])
    assert made == ["garden_shed_000", "tower_000"]
    top = client.post("/api/pick", json={"origin_m": [5.0, 5.0, 20.0], "direction": [0.0, 0.0, -1.0]}).json()
    assert (top["node"], top["boxed"]) == ("garden_shed_000", True)
    document = client.get("/api/document").json()
    for kind, fields in (
        ("landmarks", {"name": "tower", "node": "tower_000"}),
        (
            "objects",
            {"name": "shed", "node": "garden_shed_000", "category": "garden_shed", "description": "A low shed."},
        ),
    ):
        body = {"who": "Ada", "client": "a", "operation": {"do": "add", "kind": kind, "fields": fields}}
        document = client.post("/api/operations", json=body, headers={"If-Match": document["version"]}).json()
    assert document["objects"][0]["faults"] == []
    assert (document["objects"][0]["landmark"], document["objects"][0]["direction"]) == ("tower", "northeast")
    assert len(client.get("/api/objects/0/anchors").json()) == 3
    run_pipeline(terrain.pipeline, roots.data, stages=["anchor-sample"], scenes=["Scan"], workers=1)
    refused = client.delete("/api/boxes/garden_shed_000")
    assert (refused.status_code, "is annotated" in refused.json()["error"]) == (400, True)
    body = {"who": "Ada", "client": "a", "operation": {"do": "remove", "kind": "objects", "id": 0}}
    client.post("/api/operations", json=body, headers={"If-Match": document["version"]})
    assert client.delete("/api/boxes/garden_shed_000").status_code == 200
    assert client.delete("/api/boxes/garden_shed_000").status_code == 400
    scene = build_scene(recipe, load_catalogue(roots.scene_assets))
    assert "garden_shed_000" not in scene
    assert "tower_000" in scene
    again = client.post("/api/pick", json={"origin_m": [5.0, 5.0, 20.0], "direction": [0.0, 0.0, -1.0]}).json()
    assert again["node"] == scene.instances[0].node or not again["boxed"]
    body["operation"] = {"do": "remove", "kind": "landmarks", "id": 0}
    client.post("/api/operations", json=body, headers={"If-Match": client.get("/api/document").json()["version"]})
    assert client.delete("/api/boxes/tower_000").status_code == 200
    assert recipe.read_bytes() == before
    empty = client.post("/api/boxes", json={"low_m": [0, 0, 50], "high_m": [1, 1, 51], "category": "air"})
    assert (empty.status_code, "holds no triangle" in empty.json()["error"]) == (400, True)
    assert recipe.read_bytes() == before
    desk.anchors.close()


HOLDER = """
import fcntl, sys
with open(sys.argv[1], "a") as file:
    fcntl.flock(file, fcntl.LOCK_EX)
    print("held", flush=True)
    sys.stdin.read()
"""


@contextlib.contextmanager
def held_by_another(path: Path):
    """Have another process hold a lock."""
    command = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        yield
        holder.stdin.close()


def asked(url, path, body=None, method=None):
    """Ask a real server; gives status and answer."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url + path, data, {"Content-Type": "application/json"}, method=method)
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def taken(path: Path):
    """Whether somebody holds a lock."""
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


@contextlib.contextmanager
def killed_while_it_builds(url, process):
    """Ask a server for the box in another thread, and kill the server after the block."""

    def ask():
        with contextlib.suppress(OSError, http.client.HTTPException):
            asked(url, "api/boxes", SHED_BOX)

    asking = threading.Thread(target=ask)
    asking.start()
    yield
    os.kill(process.pid, signal.SIGKILL)
    asking.join()


@pytest.mark.kill
def test_a_box_that_cannot_be_built_and_a_server_that_is_killed_leave_the_recipe_as_it_was(
    terrain, project, tmp_path
):
    data, recipe = tmp_path / "data", terrain.pipeline.parent / "scenes" / "Scan.toml"
    assets, pipeline = tmp_path / "scene_assets", tmp_path / "pipeline.toml"
    shutil.copytree(project / "scene_assets", assets, ignore=shutil.ignore_patterns("scenes", "smoke"))
    pipeline.write_text(
        f'name = "mine"\nseed = 7\nscene_assets = "{assets}"\nrecipes = "{recipe.parent}"\n'
        f'annotations = "{tmp_path / "annotations"}"\n[annotate-import]\npaper_counts = false\n'
    )
    materials, before = assets / "materials.toml", recipe.read_bytes()
    with annotating.served(project, "Scan", pipeline, data) as (url, process):
        with held_by_another(data / ".lock"):
            for _ in range(2):
                status, answer = asked(url, "api/boxes", SHED_BOX)
                assert (status, "another run is writing" in answer["error"]) == (400, True), answer
                assert recipe.read_bytes() == before
        made = asked(url, "api/boxes", SHED_BOX)
        assert (made[0], made[1]["node"]) == (200, "shed_000")
        boxed = recipe.read_bytes()
        with held_by_another(data / ".lock"):
            assert asked(url, "api/boxes/shed_000", method="DELETE")[0] == 400
        assert recipe.read_bytes() == boxed
        # The scene that the page has is still the one of the recipe.
        top = {"origin_m": [5.0, 5.0, 20.0], "direction": [0.0, 0.0, -1.0]}
        assert asked(url, "api/pick", top)[1]["node"] == "shed_000"
        assert asked(url, "api/boxes/shed_000", method="DELETE") == (200, {})
        assert recipe.read_bytes() == before
        # In the middle of the build: it hangs, for want of somebody who writes into the pipe that it reads.
        materials.rename(tmp_path / "kept.toml")
        os.mkfifo(materials)
        with killed_while_it_builds(url, process):
            until("the build", lambda: taken(data / ".lock"))
    (tmp_path / "kept.toml").replace(materials)
    assert recipe.read_bytes() == before
    with annotating.served(project, "Scan", pipeline, data) as (url, process):
        assert asked(url, "api/boxes", SHED_BOX)[1]["node"] == "shed_000"
        assert asked(url, "api/boxes/shed_000", method="DELETE") == (200, {})
        assert recipe.read_bytes() == before
        assert not list(SCRATCH.rglob("Scan.toml"))
        # As soon as the new scene is in the store: whole or not at all.
        shard = data / "scenes" / "Scan" / "part-00000.parquet"
        was = shard.stat().st_ino
        with killed_while_it_builds(url, process):
            end = time.monotonic() + 60
            while shard.stat().st_ino == was:
                assert time.monotonic() < end
    assert recipe.read_bytes() == before or recipe.read_bytes().count(b"shed_000") == 1
