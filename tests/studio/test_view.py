"""`view`: the payload is the scene, and the server answers this machine alone, with what the release holds."""

import json
import re
import signal
import socket
import struct
from collections import Counter
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import urlopen

import cv2
import numpy as np
import pytest
from fastapi import Response
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.testclient import TestClient
from support.pages import YARD, serving
from support.rendered import MATERIALS, block

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.dataset.lookup import ReleasedScene
from aerialdojo_gen.dataset.release import open_release
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.studio.view.scenes import route_detail, route_points, scene_index
from aerialdojo_gen.studio.view.server import view_app
from aerialdojo_gen.studio.web.payload import scene_payload
from aerialdojo_gen.studio.web.serving import local_app, open_socket

SCENE = f"/scenes/{YARD}/"


def unpacked(payload):
    """The payload's header and triangles: {node: sorted rows of material colour or layer, nine coordinates}."""
    (length,) = struct.unpack_from("<I", payload)
    header, base = json.loads(payload[4 : 4 + length]), 4 + length

    def array(view, dtype):
        assert (base + view["offset"]) % 4 == 0
        return np.frombuffer(payload, dtype, view["bytes"] // np.dtype(dtype).itemsize, base + view["offset"])

    triangles = {}
    for group in header["groups"]:
        position = array(group["position"], "<f4").reshape(-1, 3)
        index = array(group["index"], "<u4").reshape(-1, 3)
        ranges = array(group["ranges"], "<u4").reshape(-1, 3)
        assert [*ranges[:, 1], len(index)] == [0, *np.cumsum(ranges[:, 2])]
        if "colour" in group:
            looks = map(tuple, array(group["colour"], np.uint8).reshape(-1, 4)[index[:, 0], :3])
        else:
            uvl = array(group["uv"], "<f4").reshape(-1, 3)
            layers = [
                cv2.imdecode(array(v, np.uint8), cv2.IMREAD_COLOR)[..., ::-1].tobytes() for v in group["layers"]
            ]
            looks = ((layers[int(uvl[c[0], 2])], tuple(map(tuple, uvl[c, :2]))) for c in index)
        for node, look, corners in zip(np.repeat(ranges[:, 0], ranges[:, 2]), looks, position[index], strict=True):
            triangles.setdefault(header["nodes"][node]["node"], Counter())[look, tuple(corners.ravel())] += 1
    return header, triangles


def expected(scene):
    found = {}
    for item, part in ((one, part) for one in scene.instances for part in one.parts):
        material = scene.materials[part.material]
        for face in part.faces:
            look = tuple(material.colour)
            if material.texture is not None:
                uv = part.uv[face].astype(np.float32) * np.float32([1, -1])
                look = (material.texture.tobytes(), tuple(map(tuple, uv)))
            corners = tuple(part.vertices[face].astype(np.float32).ravel())
            found.setdefault(item.node, Counter())[look, corners] += 1
    return found


corner = st.tuples(*[st.floats(-50, 50, width=32).map(float)] * 3)
blocks = st.lists(st.tuples(corner, st.sampled_from(sorted(MATERIALS))), min_size=1, max_size=6)


@given(blocks)
@settings(max_examples=15)
def test_the_payload_is_the_scene(chosen):
    items = tuple(
        block(f"b{k}", low, tuple(v + 1.0 for v in low), material) for k, (low, material) in enumerate(chosen)
    )
    scene = Scene("U_Any_0", items, MATERIALS, np.array([[-60.0, -60, 0], [60, 60, 60]]))
    payload = scene_payload(scene)
    header, triangles = unpacked(payload)
    assert triangles == expected(scene)
    assert header["n_triangles"] == scene.n_triangles == sum(sum(rows.values()) for rows in triangles.values())
    # All flat colours draw together, and all textures of a size: the calls do not grow with the materials.
    assert len(header["groups"]) <= 2
    assert payload == scene_payload(scene)


# ---- the server ----


@pytest.fixture(scope="module")
def client(smoke):
    return TestClient(view_app(smoke), base_url="http://127.0.0.1")


@pytest.fixture(scope="module")
def release(smoke):
    return open_release(smoke)


def test_foreign_hosts_and_origins_are_refused_and_ones_own_is_not(client):
    for host in ("evil.example", "127.0.0.1.evil.example", "127.0.0.1:81", "localhost:1", "", "[::1]"):
        answer = client.get(f"{SCENE}api/index", headers={"host": host})
        assert (answer.status_code, YARD in answer.text) == (403, False), host
    for origin in ("http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:9"):
        assert client.get(f"{SCENE}api/index", headers={"origin": origin}).status_code == 403, origin
    for site in ("cross-site", "same-site"):
        assert client.get(f"{SCENE}api/index", headers={"sec-fetch-site": site}).status_code == 403, site
    for headers in ({}, {"origin": "http://127.0.0.1"}, {"host": "localhost", "origin": "http://localhost"}):
        assert client.get(f"{SCENE}api/index", headers=headers).status_code == 200, headers


def test_every_answer_has_the_security_headers(client):
    for path in ("/", "/static/view.js", f"{SCENE}api/index", "/nothing"):
        headers = client.get(path).headers
        policy = dict(rule.split(" ", 1) for rule in headers["content-security-policy"].split("; "))
        assert policy["default-src"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
        assert re.fullmatch(r"'self' 'sha256-[A-Za-z0-9+/=]+'", policy["script-src"])
        assert policy["connect-src"] == policy["style-src"] == "'self'"
        assert headers["x-content-type-options"] == "nosniff"
    assert client.get("/", headers={"host": "evil.example"}).headers["x-content-type-options"] == "nosniff"


def test_large_bodies_are_refused_before_they_are_read():
    app = local_app("view.html", "x", max_body_bytes=1000)

    @app.post("/api/size")
    def size() -> Response:
        return Response("taken")

    client = TestClient(app, base_url="http://127.0.0.1")
    assert client.post("/api/size", content=b"x" * 1000).text == "taken"
    assert client.post("/api/size", content=b"x" * 1001).status_code == 413
    assert client.post("/api/size", headers={"content-length": "99999999999"}).status_code == 413  # unread
    assert client.post("/api/size", headers={"content-length": "-1"}).status_code == 413
    assert client.post("/api/size", content=iter([b"x" * 2000])).status_code == 411


def test_the_index_and_the_ways_are_the_release(smoke, client):
    scene = ReleasedScene(smoke, YARD)
    index = client.get(f"{SCENE}api/index").json()
    assert index == json.loads(json.dumps(scene_index(scene)))
    routes = scene.routes.to_pylist()
    assert index["routes"]["nav_id"] == [row["nav_id"] for row in routes]
    assert set(index["routes"]["split"]) == {"id_train", "id_test"}
    assert all(sorted(kinds) == ["image", "semantic"] for kinds in index["routes"]["modality"])
    assert len(index["objects"]) == len(scene.objects)
    assert len(index["anchors"]) == len(scene.anchors)
    raw = client.get(f"{SCENE}api/routes/points").content
    assert raw == route_points(scene)
    (n,) = struct.unpack_from("<I", raw)
    offsets = np.frombuffer(raw, "<u4", n + 1, 4)
    points = np.frombuffer(raw, "<f4", offset=8 + 4 * n).reshape(-1, 3)
    assert (n, offsets[0], offsets[-1]) == (len(routes), 0, len(points))
    for k, row in enumerate(routes):
        way = points[offsets[k] : offsets[k + 1]].astype(np.float64)
        poses = np.column_stack([row["x_m"], row["y_m"], row["z_m"]])
        assert np.allclose(way[[0, -1]], poses[[0, -1]], atol=1e-4)
        length = np.linalg.norm(np.diff(way, axis=0), axis=1)
        assert (length > 0).all()
        assert length.sum() == pytest.approx(row["length_m"], abs=1e-3)
    for row in scene.objects:
        assert client.get(f"{SCENE}api/objects/{row['object_id']}/image").content == row["reference_image"]


def test_a_routes_clearance_is_its_certificates(smoke, client):
    scene = ReleasedScene(smoke, YARD)
    for row in scene.routes.slice(0, 12).to_pylist():
        detail = client.get(f"{SCENE}api/routes/{row['nav_id']}").json()
        assert detail == json.loads(json.dumps(route_detail(scene, row["nav_id"])))
        least = min(detail["clearance_m"])
        # The certificate is the least over the whole way; samples every half metre miss at most a quarter of one.
        assert row["min_clearance_m"] - 2e-3 <= min(least, 5.0) <= row["min_clearance_m"] + 0.25
        assert len(detail["poses"]) == len(detail["actions"]) == len(row["action"])
        assert {task["task_id"][-2:] for task in detail["tasks"]} == {"-s", "-i"}


def asked(client, **query):
    answer = client.get("/api/tasks", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_the_scenes_are_the_releases(client, release):
    told = client.get("/api/release").json()
    assert [scene["scene"] for scene in told["scenes"]] == release.scenes
    assert len(release.scenes) >= 2
    for scene in told["scenes"]:
        name = scene["scene"]
        assert scene["n_routes"] == release.routes(scene=name).num_rows
        assert scene["n_objects"] == release.objects(scene=name).num_rows
        page = client.get(f"/scenes/{name}/")
        assert page.headers["content-type"].startswith("text/html")
        assert client.get(f"/scenes/{name}/api/index").json()["scene"]["scene"] == name


def test_tasks_are_found_by_filters(client, release):
    routes = release.routes().to_pylist()
    every = asked(client, most=200)
    assert every["total"] == len(routes)
    pages = [asked(client, offset=at, most=200)["tasks"] for at in range(0, len(routes), 200)]
    assert sorted(task["nav_id"] for page in pages for task in page) == sorted(route["nav_id"] for route in routes)
    objects = {(row["scene"], row["object_id"]): row for row in release.objects().to_pylist()}
    by_id = {route["nav_id"]: route for route in routes}
    for task in every["tasks"]:
        route = by_id[task["nav_id"]]
        target = objects[route["scene"], route["target_object_id"]]
        assert all(task[key] == target[key] for key in ("name", "description", "direction"))
        assert (task["scene"], task["setting"], task["split"]) == (route["scene"], route["setting"], route["split"])
        assert task["length_m"] == pytest.approx(route["length_m"], abs=1e-3)
    for choice in ({"split": "id_test"}, {"setting": "standard"}, {"scene": YARD, "setting": "base"}):
        wanted = [r for r in routes if all(r[key] == value for key, value in choice.items())]
        assert 0 < len(wanted) <= len(routes)
        assert asked(client, **choice)["total"] == len(wanted), choice
    lengths = [task["length_m"] for task in asked(client, order="length_m", descending=True, most=200)["tasks"]]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == pytest.approx(max(r["length_m"] for r in routes), abs=1e-3)


def test_tasks_are_found_by_words_in_any_order_and_by_id(client, release):
    routes = release.routes(scene=YARD).to_pylist()
    objects = {row["object_id"]: row for row in release.objects(scene=YARD).to_pylist()}
    target = objects[routes[0]["target_object_id"]]
    words = target["name"].upper().split()
    found = asked(client, scene=YARD, words=" ".join(reversed(words)), most=200)
    assert found["total"] >= sum(r["target_object_id"] == target["object_id"] for r in routes) > 0
    for task in found["tasks"]:
        text = " ".join(str(task[key]) for key in ("name", "category", "description", "landmark")).lower()
        assert all(word.lower() in text.replace("_", " ") for word in words)
    assert asked(client, words="no such thing anywhere")["total"] == 0
    for suffix in ("", "-s", "-i"):
        one = asked(client, words=routes[0]["nav_id"] + suffix)
        assert [task["nav_id"] for task in one["tasks"]] == [routes[0]["nav_id"]]


def test_pictures_are_those_of_the_release(view_url, client, release):
    row = release.objects(scene=YARD).to_pylist()[0]
    answer = client.get(f"{SCENE}api/objects/{row['object_id']}/thumb")
    small = decode_rgb(answer.content)
    assert max(small.shape) <= 224
    assert len(answer.content) < len(row["reference_image"]) / 2
    whole = decode_rgb(row["reference_image"])
    wanted = cv2.resize(whole, small.shape[1::-1], interpolation=cv2.INTER_AREA).astype(float)
    assert np.abs(small - wanted).mean() < 6
    # By a process of its own: a renderer of this one would outlive the test, in a thread of the server.
    pictures = [urlopen(f"{view_url}scenes/{name}/picture").read() for name in release.scenes[:2]]
    assert all(len(np.unique(decode_rgb(picture).reshape(-1, 3), axis=0)) > 500 for picture in pictures)
    assert pictures[0] != pictures[1]


def test_what_is_not_there_is_named_or_refused(smoke, client, release, tmp_path):
    answer = client.get(f"{SCENE}api/routes/U_Courtyard_0-000000000000")
    assert answer.status_code == 404
    assert answer.json()["error"].startswith("no navigation task 'U_Courtyard_0-000000000000': did you mean 'U_Court")
    for path, status, why in (
        ("/scenes/U_Nowhere_0/", 404, "U_Nowhere_0"),
        ("/scenes/U_Nowhere_0/picture", 404, "U_Nowhere_0"),
        (f"{SCENE}api/objects/9999/thumb", 404, "9999"),
        (f"{SCENE}api/objects/9999/image", 404, "9999"),
        (f"{SCENE}api/objects/x/image", 422, "malformed"),
        ("/api/tasks?order=x", 404, "tasks are ordered by nav_id, length_m"),
        ("/api/tasks?scene=U_Nowhere_0", 404, "U_Nowhere_0"),
        ("/api/tasks?offset=-1", 422, "malformed"),
    ):
        answer = client.get(path)
        assert (answer.status_code, why in answer.json()["error"]) == (status, True), answer.text
    # Of several scenes those alone that are shown.
    one = TestClient(view_app(smoke, [YARD]), base_url="http://127.0.0.1")
    assert [scene["scene"] for scene in one.get("/api/release").json()["scenes"]] == [YARD]
    assert {task["scene"] for task in asked(one, most=200)["tasks"]} == {YARD}
    other = next(name for name in release.scenes if name != YARD)
    assert one.get(f"/scenes/{other}/api/index").status_code == 404
    with pytest.raises(UsageError, match="did you mean 'U_Courtyard_0'"):
        view_app(smoke, ["U_Courtyard0"])
    with pytest.raises(StoreError, match="there is no release in"):
        view_app(tmp_path, [YARD])


# ---- the command ----


def test_a_taken_port_is_named():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(UsageError, match=f"port {port}: Address already in use; leave --port out"):
            open_socket(port)


def test_the_server_listens_on_the_loopback_alone(view_url):
    port = urlsplit(view_url).port
    listening = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    here = [row[1] for row in listening if row[3] == "0A" and int(row[1].partition(":")[2], 16) == port]
    assert here == [f"0100007F:{port:04X}"]


@pytest.mark.kill
def test_an_ignored_ctrl_c_stays_ignored_and_a_termination_is_a_plain_end(smoke):
    asked = ("view", "--scene", YARD, "--data", smoke)
    with serving(*asked, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) as page:
        assert re.fullmatch(rf"{YARD}: http://127\.0\.0\.1:\d+{SCENE}  \(Ctrl-C .*\)\n", page.line)
        with urlopen(page.url, timeout=60) as answer:
            assert answer.status == 200
        # Its handlers are there once it answers.
        ignored = re.search(r"SigIgn:\s*([0-9a-f]+)", Path(f"/proc/{page.process.pid}/status").read_text())[1]
        assert int(ignored, 16) >> (signal.SIGINT - 1) & 1
        page.process.send_signal(signal.SIGTERM)
        assert page.process.wait(60) == -signal.SIGTERM
        assert page.process.stderr.read() == ""
