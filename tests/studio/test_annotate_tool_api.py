"""The annotation tool's web API by itself: what it answers, what it refuses, what it never reaches."""

import io
import json
import math
import re
import zipfile

import numpy as np
import pytest
from starlette.testclient import TestClient
from support.pages import AUTHOR, YARD, yard_in

from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.studio.annotate.coco import write_coco
from aerialdojo_gen.studio.annotate.server import STATIC, TokenGate, make_app, serve_session
from aerialdojo_gen.studio.annotate.session import AnnotationSession, open_session
from aerialdojo_gen.studio.annotate.storage import Storage


class Tool(TestClient):
    """What a page asks the tool: changes are of the document as it is, unless another version is given."""

    @property
    def version(self):
        return self.get("/api/document").json()["version"]

    def ask(self, path, version=None, **more):
        return self.post(path, json=AUTHOR | more, headers={"If-Match": f'"{version or self.version}"'})

    def operate(self, version=None, do="change", kind="objects", **what):
        return self.ask("/api/operations", version, operation={"do": do, "kind": kind, **what})

    def change(self, version=None, **fields):
        """Change the first object, the red delivery van."""
        return self.operate(version, id=0, fields=fields)


def refused(answer, why, status=400):
    return (answer.status_code, why in answer.json()["error"]) == (status, True)


@pytest.fixture(scope="module")
def yard(project, tmp_path_factory) -> AnnotationSession:
    place = yard_in(project, tmp_path_factory.mktemp("yard"))
    yard = open_session(YARD, *open_pipeline(place.pipeline, place.data))
    yield yard
    yard.anchors.close()


@pytest.fixture(scope="module")
def app(yard):
    return make_app(yard)


@pytest.fixture
def desk(yard, project, tmp_path) -> AnnotationSession:
    """The yard with annotations of the test's own."""
    (tmp_path / f"{YARD}.json").write_bytes((project / "annotations" / "smoke" / f"{YARD}.json").read_bytes())
    yard.storage = Storage(tmp_path, YARD)
    return yard


@pytest.fixture
def tool(desk, app) -> Tool:
    return Tool(app, base_url="http://127.0.0.1", raise_server_exceptions=False)


def test_the_document_says_where_everything_is_as_the_task_will(tool):
    document = tool.get("/api/document").json()
    van = document["objects"][0]
    assert (van["name"], van["landmark"], van["direction"]) == ("red delivery van", "traffic light", "east")
    assert (van["lacks"], van["anchor"], document["faults"]) == ([], None, [])
    (mark,) = document["landmarks"]
    offsets = [np.subtract(e["position_m"], mark["position_m"]) for e in document["objects"]]
    octants = [round(np.degrees(np.arctan2(y, x)) / 45.0) % 8 for x, y, _ in offsets]
    assert [e["direction"] for e in document["objects"]] == [DIRECTIONS[k] for k in octants]
    answer = tool.get("/api/document", headers={"If-None-Match": f'"{document["version"]}"'})
    assert (answer.status_code, answer.content) == (304, b"")


def test_a_change_is_answered_when_it_is_on_disk(tool, desk):
    path, first, text = desk.storage.path, tool.version, desk.storage.path.read_bytes()
    path.write_bytes(text[: len(text) // 2])  # as an editor leaves it for a moment: the page tries again
    assert refused(tool.change(first, name="crimson van"), "not JSON", 503)
    path.write_bytes(text)
    answer = tool.change(first, name="crimson van")
    assert answer.headers["etag"] == f'"{answer.json()["version"]}"'
    assert '"crimson van"' in path.read_text()
    assert answer.json()["undo"] == "name of object 0 (crimson van)"
    undone = tool.ask("/api/undo").json()
    assert (undone["version"], undone["undo"], undone["redo"]) == (first, None, "name of object 0 (crimson van)")


def test_the_second_is_shown_the_conflict(tool, desk):
    seen = tool.version
    tool.change(seen, name="first")
    answer = tool.change(seen, name="second")
    assert answer.status_code == 412
    body = answer.json()
    assert body["state"]["objects"][0]["name"] == "first"
    assert [(c["who"], c["edits"][0]["after"]["name"]) for c in body["changes"]] == [("Ada", "first")]
    assert '"second"' not in desk.storage.path.read_text()
    operation = {"do": "change", "kind": "objects", "id": 0, "fields": {"name": "x"}}
    assert refused(tool.post("/api/operations", json=AUTHOR | {"operation": operation}), "If-Match")
    assert refused(tool.operate(do="remove", id=4711), "object 4711 no longer exists", 409)


def test_the_checks_of_the_import_while_typing(tool, desk):
    def faults(do="change", **what):
        return tool.ask("/api/draft", operation={"do": do, "kind": "objects", **what}).json()["faults"]

    before = desk.storage.path.read_bytes()
    true = "A red delivery van with a white stripe, parked behind the brick partition in the corner of the yard."
    assert faults(id=0, fields={"description": true}) == []
    # Two walls stand southeast of the traffic light.
    wall = {"node": "wall_000", "category": "wall", "name": "wall", "description": "A wall."}
    (fault,) = faults("add", fields=wall)
    assert fault["field"] == "description"
    assert fault["message"].startswith("ambiguous: it fits wall_007 as well, southeast of the same landmark")
    assert desk.storage.path.read_bytes() == before


def test_a_pick_is_the_first_thing_on_the_mesh(tool, desk):
    for instance in desk.scene.instances[1:12]:
        top = instance.centroid + np.array([0, 0, 60.0])
        distance, k = desk._rays.first_hit(top, np.array([[0.0, 0.0, -1.0]]))
        found = tool.post("/api/pick", json={"origin_m": top.tolist(), "direction": [0.0, 0.0, -1.0]}).json()
        assert found["node"] == desk.scene.instances[k[0]].node
        assert found["point_m"][2] == pytest.approx(top[2] - distance[0], abs=1e-3)
    assert tool.post("/api/pick", json={"origin_m": [0, 0, 5], "direction": [0, 0, 1]}).json() is None
    assert tool.post("/api/pick", json={"origin_m": [0, 0, 5], "direction": [0, 0, 0]}).status_code == 400


@pytest.mark.slow
def test_candidates_are_those_that_the_stage_will_find_and_one_is_chosen(tool, desk):
    found = tool.get("/api/objects/0/anchors").json()
    assert len(found) == 3
    centre = desk.scene["delivery_van_000"].centroid
    for anchor in found:
        assert anchor["faults"] == []
        assert anchor["surface_distance_m"] == pytest.approx(1.0, abs=2e-3)
        facing = math.degrees(math.atan2(*(centre - anchor["position_m"])[[1, 0]]))
        assert (facing - anchor["yaw_deg"] + 180) % 360 - 180 == pytest.approx(0, abs=0.1)
        place = dict(zip("xyz", anchor["position_m"], strict=True))
        picture = decode_rgb(tool.get("/api/picture", params=place | {"yaw_deg": anchor["yaw_deg"]}).content)
        assert picture.shape == (320, 320, 3)
        assert picture.std() > 20
        u0, v0, u1, v1 = anchor["box_px"]
        assert 0 <= u0 < u1 <= 320
        assert 0 <= v0 < v1 <= 320
    chosen = {k: found[1][k] for k in ("position_m", "yaw_deg")}
    van = tool.change(anchor=chosen).json()["objects"][0]
    assert (van["anchor"], van["lacks"]) == (chosen, [])
    assert tool.change(anchor=None).json()["objects"][0]["anchor"] is None


def test_an_anchor_placed_by_hand_is_held_against_the_world(tool, desk):
    def viewpoint(place, **more):
        return tool.post("/api/objects/0/viewpoint", json={"position_m": place, **more}).json()

    centre = desk.scene["delivery_van_000"].centroid
    eye = (centre + np.array([-9.0, 2.0, 6.0])).tolist()
    good = viewpoint(eye, snap=True)
    assert good["faults"] == []
    assert good["surface_distance_m"] == pytest.approx(1.0, abs=2e-3)
    away, wanted = np.array(good["position_m"]) - centre, np.array(eye) - centre
    np.testing.assert_allclose(away / np.linalg.norm(away), wanted / np.linalg.norm(wanted), atol=1e-3)
    far = [500.0, 0.0, 3.0]
    for place, why in ((centre.tolist(), "in collision"), (eye, "too far"), (far, "outside the flight volume")):
        assert any(why in fault for fault in viewpoint(place)["faults"]), why
        assert refused(tool.change(anchor={"position_m": place, "yaw_deg": 0.0}), "invalid anchor")
    turned = viewpoint(good["position_m"], yaw_deg=good["yaw_deg"] + 180)
    assert any("does not see" in fault for fault in turned["faults"])


def test_export_and_import_give_the_same_bytes(tool, desk):
    path, before = desk.storage.path, desk.storage.path.read_bytes()
    answer = tool.get("/api/export")
    assert answer.content == before
    assert f'filename="{YARD}.json"' in answer.headers["content-disposition"]
    assert tool.ask("/api/import", text=before.decode()).json()["done"] is None
    other = json.loads(before)
    other["objects"] = other["objects"][2:]
    text = json.dumps(other, indent=2, ensure_ascii=False) + "\n"
    tool.ask("/api/import", text=text)
    assert path.read_text() == text
    tool.ask("/api/undo")
    assert path.read_bytes() == before
    for wrong, why in (("{}", "missing"), (text.replace(YARD, "U_Mall_0"), "of scene 'U_Mall_0'"), ("", "not JSON")):
        assert refused(tool.ask("/api/import", text=wrong), why), wrong
    assert path.read_bytes() == before


def test_the_coco_export_boxes_what_the_pictures_show(tool, desk, tmp_path):
    packed = tool.get("/api/coco").content
    archive = zipfile.ZipFile(io.BytesIO(packed))
    document = json.loads(archive.read("instances.json"))
    entries = {entry.id: entry for entry in desk.storage.load().annotations.objects}
    images = {image["id"]: image for image in document["images"]}
    assert images.keys() == entries.keys()
    names = {category["id"]: category["name"] for category in document["categories"]}
    for box in document["annotations"]:
        image = images[box["image_id"]]
        left, top, width, height = box["bbox"]
        assert 0 <= left <= left + width <= image["width"]
        assert 0 <= top <= top + height <= image["height"]
        assert 16 <= box["area"] <= width * height
        assert names[box["category_id"]] == entries[box["object_id"]].category
    assert {b["object_id"] for b in document["annotations"] if b["object_id"] == b["image_id"]} == entries.keys()
    for image in images.values():
        picture = decode_rgb(archive.read(f"images/{image['file_name']}"))
        assert picture.shape == (image["height"], image["width"], 3)
    path = write_coco(desk, tmp_path / "new" / "boxes.zip")
    assert [p.name for p in path.parent.iterdir()] == ["boxes.zip"]
    assert path.read_bytes() == packed


def test_what_an_entry_cannot_be_is_refused(tool):
    assert refused(tool.change(description="x" * 2001), "2000", 422)
    for node in ("../../etc/passwd", "delivery_van_000/../x", "nothing"):
        assert refused(tool.operate(do="add", fields={"node": node, "name": "x"}), "no node")
    described = tool.operate(do="add", kind="landmarks", fields={"description": "A."})
    assert refused(described, "a landmark has no description")


WEB = STATIC.parents[1] / "web" / "static"


def test_scripts_in_names_are_names(tool):
    script = '</script><img src=x onerror="alert(1)"><b>${7*7}</b>&amp;'
    answer = tool.change(name=script)
    assert answer.json()["objects"][0]["name"] == script
    assert "application/json" in answer.headers["content-type"]
    signed = tool.ask("/api/undo", who="\u0000\u0007 <i>Eve</i>\n")
    assert signed.json()["done"]["who"] == "<i>Eve</i>"
    # The pages have no way to make markup of a text.
    markup = r"innerHTML|outerHTML|insertAdjacentHTML|setHTMLUnsafe|DOMParser|document\.write|\beval\b|new Function"
    for path in [*STATIC.glob("*.js"), *WEB.glob("*.js")]:
        assert not re.search(markup, path.read_text()), path


def test_the_pages_ask_for_nothing_from_outside(tool):
    for path in [*STATIC.glob("*.*"), *WEB.glob("*.*")]:
        outside = re.findall(r"https?://(?!www\.w3\.org/)[^\s\"'`]+", path.read_text())
        assert not outside, (path, outside)
    for link in re.findall(r'(?:src|href)="(/[^"]+)"', tool.get("/").text):
        assert tool.get(link).status_code == 200, link


def test_other_machines_are_served_if_asked_for_and_need_the_token(tool, desk):
    assert tool.get("/", headers={"Host": "lab-pc:8080"}).status_code == 403
    app = make_app(desk, any_host=True)
    app.add_middleware(TokenGate, token="secret-token")
    outside = Tool(app, base_url="http://lab-pc:8080", follow_redirects=False)
    for path in ("/", "/api/document", "/static/scene.js", "/?token=wrong", "/?token=", "/?token=%ff"):
        answer = outside.get(path)
        assert (answer.status_code, "token" in answer.text) == (401, True), path
    entry = outside.get("/?token=secret-token")
    assert (entry.status_code, entry.headers["location"]) == (303, "/")
    assert "HttpOnly; SameSite=Strict" in entry.headers["set-cookie"]
    assert outside.get("/").status_code == 200
    for origin, status in (("http://evil.example", 403), ("http://lab-pc:8080", 200)):
        outside.headers["Origin"] = origin
        assert outside.change("x" if status == 403 else tool.version, name="x").status_code == status


def test_an_address_that_is_none_or_several_scenes_are_refused(desk, project, tmp_path):
    with pytest.raises(UsageError, match="--host nowhere: give an IPv4 address"):
        serve_session(desk, port=0, host="nowhere", browser=False, say=print)
    place = yard_in(project, tmp_path)
    for name, why in (("U_*", "annotate one at a time"), ("u_courtyard_0", "U_Courtyard_0")):
        with pytest.raises(UsageError, match=why):
            open_session(name, *open_pipeline(place.pipeline, place.data))
