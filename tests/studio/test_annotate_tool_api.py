"""The annotation tool's web API by itself: what it answers, what it refuses, what it never reaches."""

import io
import json
import math
import re
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient
from support import annotating
from support.annotating import AUTHOR, YARD

from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.cli.common import open_pipeline
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.studio.annotate.coco import write_coco
from aerialdojo_gen.studio.annotate.server import STATIC, TokenGate, make_app, serve_session
from aerialdojo_gen.studio.annotate.session import AnnotationSession, open_session
from aerialdojo_gen.studio.annotate.storage import Storage


@pytest.fixture(scope="module")
def yard(project, tmp_path_factory) -> AnnotationSession:
    folder = tmp_path_factory.mktemp("yard")
    pipeline, roots = open_pipeline(annotating.yard_pipeline(project, folder), folder / "data")
    desk = open_session(YARD, pipeline, roots)
    yield desk
    desk.anchors.close()


@pytest.fixture
def desk(yard, project, tmp_path) -> AnnotationSession:
    """The yard with annotations of the test's own."""
    (tmp_path / f"{YARD}.json").write_bytes((project / "annotations" / "smoke" / f"{YARD}.json").read_bytes())
    yard.storage = Storage(tmp_path, YARD)
    return yard


@pytest.fixture(scope="module")
def app(yard):
    return make_app(yard)


@pytest.fixture
def client(desk, app) -> TestClient:
    return TestClient(app, base_url="http://127.0.0.1", raise_server_exceptions=False)


def operate(client, version, **operation):
    return client.post(
        "/api/operations", json=AUTHOR | {"operation": operation}, headers={"If-Match": f'"{version}"'}
    )


def version_of(client):
    return client.get("/api/document").json()["version"]


def test_the_document_says_where_everything_is_as_the_task_will(client, desk):
    document = client.get("/api/document").json()
    van = document["objects"][0]
    assert (van["name"], van["landmark"], van["direction"]) == ("red delivery van", "traffic light", "east")
    assert (van["lacks"], van["anchor"]) == ([], None)
    assert document["faults"] == []
    (mark,) = document["landmarks"]
    offsets = [np.subtract(e["position_m"], mark["position_m"]) for e in document["objects"]]
    octants = [round(np.degrees(np.arctan2(y, x)) / 45.0) % 8 for x, y, _ in offsets]
    assert [e["direction"] for e in document["objects"]] == [DIRECTIONS[k] for k in octants]
    answer = client.get("/api/document", headers={"If-None-Match": f'"{document["version"]}"'})
    assert (answer.status_code, answer.content) == (304, b"")


def test_a_change_is_answered_when_it_is_on_disk(client, desk):
    first = version_of(client)
    answer = operate(client, first, do="change", kind="objects", id=0, fields={"name": "crimson van"})
    assert answer.status_code == 200
    assert answer.headers["etag"] == f'"{answer.json()["version"]}"'
    assert '"crimson van"' in desk.storage.path.read_text()
    assert answer.json()["undo"] == "name of object 0 (crimson van)"
    undone = client.post("/api/undo", json=AUTHOR, headers={"If-Match": answer.json()["version"]})
    assert undone.json()["version"] == first
    assert (undone.json()["undo"], undone.json()["redo"]) == (None, "name of object 0 (crimson van)")


def test_a_change_that_the_disk_does_not_take_may_be_sent_again(client, desk):
    seen, text = version_of(client), desk.storage.path.read_bytes()
    desk.storage.path.write_bytes(text[: len(text) // 2])  # as an editor leaves it for a moment
    answer = operate(client, seen, do="change", kind="objects", id=0, fields={"name": "crimson van"})
    assert (answer.status_code, "not JSON" in answer.json()["error"]) == (503, True)
    desk.storage.path.write_bytes(text)
    assert operate(client, seen, do="change", kind="objects", id=0, fields={"name": "crimson van"}).status_code == 200


def test_the_second_is_shown_the_conflict(client, desk):
    seen = version_of(client)
    operate(client, seen, do="change", kind="objects", id=0, fields={"name": "first"})
    answer = operate(client, seen, do="change", kind="objects", id=0, fields={"name": "second"})
    assert answer.status_code == 412
    body = answer.json()
    assert body["state"]["objects"][0]["name"] == "first"
    assert [(c["who"], c["edits"][0]["after"]["name"]) for c in body["changes"]] == [("Ada", "first")]
    assert '"second"' not in desk.storage.path.read_text()
    operation = {"do": "change", "kind": "objects", "id": 0, "fields": {"name": "x"}}
    unversioned = client.post("/api/operations", json=AUTHOR | {"operation": operation})
    assert (unversioned.status_code, "If-Match" in unversioned.json()["error"]) == (400, True)
    gone = operate(client, body["state"]["version"], do="remove", kind="objects", id=4711)
    assert (gone.status_code, gone.json()["error"]) == (409, "object 4711 no longer exists")


def test_the_checks_of_the_import_while_typing(client, desk):
    def said(text, entry_id=0):
        operation = {"do": "change", "kind": "objects", "id": entry_id, "fields": {"description": text}}
        return [
            f["message"] for f in client.post("/api/draft", json=AUTHOR | {"operation": operation}).json()["faults"]
        ]

    before = desk.storage.path.read_bytes()
    assert (
        said("A red delivery van with a white stripe, parked behind the brick partition in the corner of the yard.")
        == []
    )
    own = desk.scene["delivery_van_000"].attributes["colour"]
    other = next(c for i in desk.scene.instances if (c := i.attributes.get("colour", own)) != own)
    assert said(f"A {other} delivery van.") == [f"{other!r} is not so of delivery_van_000"]
    assert any("full stop" in text for text in said("A red delivery van"))
    assert any("node names are not allowed" in text for text in said("The thing delivery_van_000."))
    # Two walls stand southeast of the traffic light.
    wall = {"node": "wall_000", "category": "wall", "name": "wall", "description": "A wall."}
    operation = {"do": "add", "kind": "objects", "fields": wall}
    (fault,) = client.post("/api/draft", json=AUTHOR | {"operation": operation}).json()["faults"]
    assert fault["field"] == "description"
    assert fault["message"].startswith("ambiguous: it fits wall_007 as well, southeast of the same landmark")
    assert desk.storage.path.read_bytes() == before


def test_a_pick_is_the_first_thing_on_the_mesh(client, desk):
    for instance in desk.scene.instances[1:12]:
        top = instance.centroid + np.array([0, 0, 60.0])
        body = {"origin_m": top.tolist(), "direction": [0.0, 0.0, -1.0]}
        distance, k = desk._rays.first_hit(top, np.array([[0.0, 0.0, -1.0]]))
        found = client.post("/api/pick", json=body).json()
        assert found["node"] == desk.scene.instances[k[0]].node
        assert found["point_m"][2] == pytest.approx(top[2] - distance[0], abs=1e-3)
    assert client.post("/api/pick", json={"origin_m": [0, 0, 5], "direction": [0, 0, 1]}).json() is None
    assert client.post("/api/pick", json={"origin_m": [0, 0, 5], "direction": [0, 0, 0]}).status_code == 400


@pytest.mark.slow
def test_candidates_are_those_that_the_stage_will_find_and_one_is_chosen(client, desk):
    found = client.get("/api/objects/0/anchors").json()
    assert len(found) == 3
    scene: Scene = desk.scene
    for anchor in found:
        assert anchor["faults"] == []
        assert anchor["surface_distance_m"] == pytest.approx(1.0, abs=2e-3)
        centre = scene["delivery_van_000"].centroid
        facing = math.degrees(math.atan2(*(centre - anchor["position_m"])[[1, 0]]))
        assert (facing - anchor["yaw_deg"] + 180) % 360 - 180 == pytest.approx(0, abs=0.1)
        x, y, z = anchor["position_m"]
        png = client.get("/api/picture", params={"x": x, "y": y, "z": z, "yaw_deg": anchor["yaw_deg"]})
        picture = cv2.imdecode(np.frombuffer(png.content, np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (320, 320, 3)
        assert picture.std() > 20
        u0, v0, u1, v1 = anchor["box_px"]
        assert 0 <= u0 < u1 <= 320
        assert 0 <= v0 < v1 <= 320
    chosen = {k: found[1][k] for k in ("position_m", "yaw_deg")}
    answer = operate(client, version_of(client), do="change", kind="objects", id=0, fields={"anchor": chosen})
    assert answer.json()["objects"][0]["anchor"] == chosen
    assert answer.json()["objects"][0]["lacks"] == []


def test_an_anchor_placed_by_hand_is_held_against_the_world(client, desk):
    centre = desk.scene["delivery_van_000"].centroid
    eye = (centre + np.array([-9.0, 2.0, 6.0])).tolist()
    good = client.post("/api/objects/0/viewpoint", json={"position_m": eye, "snap": True}).json()
    assert good["faults"] == []
    assert good["surface_distance_m"] == pytest.approx(1.0, abs=2e-3)
    away = np.array(good["position_m"]) - centre
    np.testing.assert_allclose(
        away / np.linalg.norm(away), (np.array(eye) - centre) / np.linalg.norm(np.array(eye) - centre), atol=1e-3
    )
    for place, why in (
        (centre.tolist(), "in collision"),
        (eye, "too far"),
        ([500.0, 0.0, 3.0], "outside the flight volume"),
    ):
        facts = client.post("/api/objects/0/viewpoint", json={"position_m": place}).json()
        assert any(why in fault for fault in facts["faults"]), why
        fields = {"anchor": {"position_m": place, "yaw_deg": 0.0}}
        refused = operate(client, version_of(client), do="change", kind="objects", id=0, fields=fields)
        assert (refused.status_code, "invalid anchor" in refused.json()["error"]) == (400, True)
    turned = {"position_m": good["position_m"], "yaw_deg": good["yaw_deg"] + 180}
    assert any("does not see" in f for f in client.post("/api/objects/0/viewpoint", json=turned).json()["faults"])


def test_export_and_import_give_the_same_bytes(client, desk):
    before = desk.storage.path.read_bytes()
    answer = client.get("/api/export")
    assert answer.content == before
    assert f'filename="{YARD}.json"' in answer.headers["content-disposition"]
    seen = version_of(client)
    same = client.post("/api/import", json=AUTHOR | {"text": before.decode()}, headers={"If-Match": seen})
    assert (same.status_code, same.json()["done"]) == (200, None)
    other = json.loads(before)
    other["objects"] = other["objects"][2:]
    text = json.dumps(other, indent=2, ensure_ascii=False) + "\n"
    taken = client.post("/api/import", json=AUTHOR | {"text": text}, headers={"If-Match": seen}).json()
    assert desk.storage.path.read_text() == text
    client.post("/api/undo", json=AUTHOR, headers={"If-Match": taken["version"]})
    assert desk.storage.path.read_bytes() == before
    for wrong, why in (("{}", "missing"), (text.replace(YARD, "U_Mall_0"), "of scene 'U_Mall_0'"), ("", "not JSON")):
        answer = client.post("/api/import", json=AUTHOR | {"text": wrong}, headers={"If-Match": seen})
        assert (answer.status_code, why in answer.json()["error"]) == (400, True), wrong
    assert desk.storage.path.read_bytes() == before


def test_the_coco_export_boxes_what_the_pictures_show(client, desk, tmp_path):
    archive = zipfile.ZipFile(io.BytesIO(client.get("/api/coco").content))
    document = json.loads(archive.read("instances.json"))
    objects = desk.storage.load().annotations.objects
    assert {image["id"] for image in document["images"]} == {entry.id for entry in objects}
    names = {category["id"]: category["name"] for category in document["categories"]}
    own = set()
    for box in document["annotations"]:
        image = next(i for i in document["images"] if i["id"] == box["image_id"])
        left, top, width, height = box["bbox"]
        assert left >= 0
        assert top >= 0
        assert left + width <= image["width"]
        assert top + height <= image["height"]
        assert 16 <= box["area"] <= width * height
        entry = next(e for e in objects if e.id == box["object_id"])
        assert names[box["category_id"]] == entry.category
        own |= {entry.id} if box["object_id"] == box["image_id"] else set()
    assert own == {entry.id for entry in objects}
    for image in document["images"]:
        png = cv2.imdecode(np.frombuffer(archive.read(f"images/{image['file_name']}"), np.uint8), cv2.IMREAD_COLOR)
        assert png.shape == (image["height"], image["width"], 3)
    path = write_coco(desk, tmp_path / "new" / "boxes.zip")
    assert sorted(p.name for p in path.parent.iterdir()) == ["boxes.zip"]
    assert path.read_bytes() == client.get("/api/coco").content


# What is refused.


def test_other_sites_change_nothing(client, desk):
    operation = {"do": "remove", "kind": "objects", "id": 0}
    before = desk.storage.path.read_bytes()
    for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example", "Origin": "http://evil.example"}):
        sent = headers | {"If-Match": version_of(client)}
        answer = client.post("/api/operations", json=AUTHOR | {"operation": operation}, headers=sent)
        assert (answer.status_code, client.get("/", headers=headers).status_code) == (403, 403)
    assert desk.storage.path.read_bytes() == before


def test_a_text_that_is_too_long_and_a_node_that_is_not_in_the_scene_are_refused(client):
    long = operate(client, version_of(client), do="change", kind="objects", id=0, fields={"description": "x" * 2001})
    assert (long.status_code, "2000" in long.json()["error"]) == (422, True)
    for node in ("../../etc/passwd", "delivery_van_000/../x", "nothing"):
        answer = operate(client, version_of(client), do="add", kind="objects", fields={"node": node, "name": "x"})
        assert (answer.status_code, "no node" in answer.json()["error"]) == (400, True)


SCRIPT = '</script><img src=x onerror="alert(1)"><b>${7*7}</b>&amp;'


def test_scripts_in_names_are_names(client, desk):
    answer = operate(client, version_of(client), do="change", kind="objects", id=0, fields={"name": SCRIPT})
    assert answer.json()["objects"][0]["name"] == SCRIPT
    assert "application/json" in answer.headers["content-type"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert json.loads(desk.storage.path.read_text())["objects"][0]["name"] == SCRIPT
    signed = client.post(
        "/api/undo",
        json={"who": "\u0000\u0007 <i>Eve</i>\n", "client": "tab-1"},
        headers={"If-Match": answer.json()["version"]},
    )
    assert signed.json()["done"]["who"] == "<i>Eve</i>"
    # The page has no way to make markup of a text, and the policy none to run it.
    for path in sorted(STATIC.glob("*.js")):
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function", path.read_text()
        ), path
    policy = client.get("/").headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy


def test_the_page_asks_for_nothing_from_outside(client):
    page = client.get("/").text
    for path in [*STATIC.glob("*.*"), *(Path(STATIC).parents[1] / "web" / "static").glob("*.*")]:
        outside = re.findall(r"https?://(?!www\.w3\.org/)[^\s\"'`]+", path.read_text())
        assert not outside, (path, outside)
    for link in re.findall(r'(?:src|href)="(/[^"]+)"', page):
        assert client.get(link).status_code == 200, link


def test_other_machines_need_the_token(desk):
    app = make_app(desk, any_host=True)
    app.add_middleware(TokenGate, token="secret-token")
    outside = TestClient(app, base_url="http://lab-pc:8080", follow_redirects=False)
    for path in ("/", "/api/document", "/static/scene.js", "/?token=wrong", "/?token=", "/?token=%ff"):
        answer = outside.get(path)
        assert (answer.status_code, "token" in answer.text) == (401, True), path
    entry = outside.get("/?token=secret-token")
    assert (entry.status_code, entry.headers["location"]) == (303, "/")
    assert "HttpOnly; SameSite=Strict" in entry.headers["set-cookie"]
    assert outside.get("/").status_code == 200
    operation = {"do": "change", "kind": "objects", "id": 0, "fields": {"name": "x"}}
    headers = {"If-Match": outside.get("/api/document").json()["version"], "Origin": "http://evil.example"}
    assert outside.post("/api/operations", json=AUTHOR | {"operation": operation}, headers=headers).status_code == 403
    headers["Origin"] = "http://lab-pc:8080"
    assert outside.post("/api/operations", json=AUTHOR | {"operation": operation}, headers=headers).status_code == 200


def test_an_address_that_is_none_is_named(desk):
    with pytest.raises(UsageError, match="--host nowhere: give an IPv4 address"):
        serve_session(desk, port=0, host="nowhere", browser=False, say=print)


def test_several_scenes_at_once_are_refused(project, tmp_path):
    pipeline, roots = open_pipeline(annotating.yard_pipeline(project, tmp_path), tmp_path / "data")
    with pytest.raises(UsageError, match=r"annotate one at a time"):
        open_session("U_*", pipeline, roots)
    with pytest.raises(UsageError, match="U_Courtyard_0"):
        open_session("u_courtyard_0", pipeline, roots)
