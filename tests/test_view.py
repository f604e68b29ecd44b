"""`view`: the payload is the scene, the server answers this machine alone, and the page does what it says."""

import http.client
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import chromium, errors, until
from fastapi import Response
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered import MATERIALS, block
from starlette.testclient import TestClient

from aerialdojo_gen.errors import StoreError, UsageError
from aerialdojo_gen.release.browse import ReleasedScene
from aerialdojo_gen.rendering.preview import look_at
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.schemas import ACTION_NAMES
from aerialdojo_gen.web import serving
from aerialdojo_gen.web.payload import scene_payload
from aerialdojo_gen.web.view import route_detail, route_points, scene_index, view_app

YARD = "U_Courtyard_0"


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
        look = array(group["colour"], np.uint8).reshape(-1, 4)[:, :3] if "colour" in group else None
        if look is None:
            uvl = array(group["uv"], "<f4").reshape(-1, 3)
            layers = [cv2.imdecode(array(v, np.uint8), cv2.IMREAD_COLOR)[..., ::-1] for v in group["layers"]]
        covered = 0
        for node, first, count in array(group["ranges"], "<u4").reshape(-1, 3):
            assert first == covered
            covered += count
            for corners in index[first : first + count]:
                if look is not None:
                    key = tuple(look[corners[0]])
                else:
                    key = (layers[int(uvl[corners[0], 2])].tobytes(), tuple(map(tuple, uvl[corners, :2])))
                triangles.setdefault(header["nodes"][node]["node"], []).append(
                    (key, tuple(position[corners].ravel()))
                )
        assert covered == len(index)
    return header, {node: Counter(found) for node, found in triangles.items()}


def expected(scene):
    found = {}
    for item in scene.instances:
        rows = found.setdefault(item.node, [])
        for part in item.parts:
            material = scene.materials[part.material]
            for face in part.faces:
                uv = part.uv[face].astype(np.float32) * np.float32([1, -1])
                key = (
                    tuple(material.colour)
                    if material.texture is None
                    else (material.texture.tobytes(), tuple(map(tuple, uv)))
                )
                rows.append((key, tuple(part.vertices[face].astype(np.float32).ravel())))
    return {node: Counter(rows) for node, rows in found.items()}


corner = st.tuples(*[st.floats(-50, 50, width=32).map(float)] * 3)
blocks = st.lists(st.tuples(corner, st.sampled_from(sorted(MATERIALS))), min_size=1, max_size=6)


@given(blocks)
@settings(max_examples=40, deadline=None)
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
    return TestClient(view_app(smoke, YARD), base_url="http://127.0.0.1")


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "127.0.0.1:81", "localhost:1", "", "[::1]"]
)
def test_foreign_hosts_are_refused(client, host):
    answer = client.get("/api/index", headers={"host": host})
    assert answer.status_code == 403
    assert YARD not in answer.text


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "https://127.0.0.1"},
        {"origin": "http://127.0.0.1:9"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_foreign_origins_are_refused(client, headers):
    assert client.get("/api/index", headers=headers).status_code == 403


def test_ones_own_origin_is_not_refused(client):
    for headers in ({}, {"origin": "http://127.0.0.1"}, {"host": "localhost", "origin": "http://localhost"}):
        assert client.get("/api/index", headers=headers).status_code == 200


def test_a_link_out_of_the_folder_is_not_followed(tmp_path, monkeypatch):
    outside, inside = tmp_path / "secret.txt", tmp_path / "static"
    outside.write_text("secret")
    inside.mkdir()
    (inside / "page.html").write_text("<p>page")
    (inside / "link.txt").symlink_to(outside)
    monkeypatch.setattr(serving, "STATIC", inside)
    client = TestClient(serving.local_app("page.html", "x"), base_url="http://127.0.0.1")
    assert client.get("/static/page.html").text == "<p>page"
    assert client.get("/static/link.txt").status_code == 404


def test_every_answer_has_the_security_headers(client):
    for path in ("/", "/static/view.js", "/api/index", "/nothing"):
        headers = client.get(path).headers
        policy = dict(rule.split(" ", 1) for rule in headers["content-security-policy"].split("; "))
        assert policy["default-src"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
        assert re.fullmatch(r"'self' 'sha256-[A-Za-z0-9+/=]+'", policy["script-src"])
        assert policy["connect-src"] == policy["style-src"] == "'self'"
        assert headers["x-content-type-options"] == "nosniff"
    assert client.get("/", headers={"host": "evil.example"}).headers["x-content-type-options"] == "nosniff"


def test_large_bodies_are_refused_before_they_are_read():
    app = serving.local_app("view.html", "x", max_body_bytes=1000)

    @app.post("/api/size")
    def size() -> Response:
        return Response("taken")

    client = TestClient(app, base_url="http://127.0.0.1")
    assert client.post("/api/size", content=b"x" * 1000).text == "taken"
    assert client.post("/api/size", content=b"x" * 1001).status_code == 413
    assert client.post("/api/size", headers={"content-length": "-1"}).status_code == 413
    assert client.post("/api/size", content=iter([b"x" * 2000])).status_code == 411


def test_what_does_not_exist_is_named(client):
    answer = client.get("/api/routes/U_Courtyard_0-000000000000")
    assert (answer.status_code, answer.json()) == (
        404, {"error": "no navigation task 'U_Courtyard_0-000000000000' in the release"},
    )  # fmt: skip
    assert client.get("/api/objects/9999/image").status_code == 404
    assert client.get("/api/objects/x/image").status_code == 422


def test_the_index_and_the_ways_are_the_release(smoke, client):
    scene = ReleasedScene(smoke, YARD)
    index = client.get("/api/index").json()
    assert index == json.loads(json.dumps(scene_index(scene)))
    routes = scene.routes.to_pylist()
    assert index["routes"]["nav_id"] == [row["nav_id"] for row in routes]
    assert set(index["routes"]["split"]) == {"id_train", "id_test"}
    assert all(sorted(kinds) == ["image", "semantic"] for kinds in index["routes"]["modality"])
    assert len(index["objects"]) == len(scene.objects)
    assert len(index["anchors"]) == len(scene.anchors)
    raw = client.get("/api/routes/points").content
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
        assert client.get(f"/api/objects/{row['object_id']}/image").content == row["reference_image"]


def test_a_routes_clearance_is_its_certificates(smoke, client):
    scene = ReleasedScene(smoke, YARD)
    for row in scene.routes.slice(0, 12).to_pylist():
        detail = client.get(f"/api/routes/{row['nav_id']}").json()
        assert detail == json.loads(json.dumps(route_detail(scene, row["nav_id"])))
        least = min(detail["clearance_m"])
        # The certificate is the least over the whole way; samples every half metre miss at most a quarter of one.
        assert row["min_clearance_m"] - 2e-3 <= min(least, 5.0) <= row["min_clearance_m"] + 0.25
        assert len(detail["poses"]) == len(detail["actions"]) == len(row["action"])
        assert {task["task_id"][-2:] for task in detail["tasks"]} == {"-s", "-i"}


# ---- the command ----


def test_what_is_missing_is_named(smoke, tmp_path):
    with pytest.raises(UsageError, match="did you mean U_Courtyard_0"):
        view_app(smoke, "U_Courtyard0")
    with pytest.raises(StoreError, match="there is no release in"):
        view_app(tmp_path, YARD)


def test_a_taken_port_is_named():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(UsageError, match=f"port {port}: Address already in use; leave --port out"):
            serving.open_socket(port)


@pytest.fixture(scope="module")
def server(smoke):
    """The command's own server; gives its address, and checks at last that Ctrl-C is a plain end."""
    command = [
        sys.executable,
        "-m",
        "aerialdojo_gen.cli",
        "view",
        "--data",
        str(smoke),
        "--scene",
        YARD,
        "--no-browser",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    url = re.fullmatch(rf"{YARD}: (http://127\.0\.0\.1:\d+/)  \(Ctrl-C ends it\)\n", line)
    assert url, line + process.communicate()[1]
    yield url[1]
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (0, "", "")


def test_the_server_listens_on_the_loopback_alone(server):
    port = int(server.rstrip("/").rpartition(":")[2])
    listening = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    here = [row[1] for row in listening if row[3] == "0A" and int(row[1].partition(":")[2], 16) == port]
    assert here == [f"0100007F:{port:04X}"]


@pytest.mark.parametrize(
    "path",
    [
        "/static/../serving.py",
        "/static/..%2fserving.py",
        "/static/%2e%2e/serving.py",
        "/static/%2e%2e%2fserving.py",
        "/static/..%5cserving.py",
        "/static/three/../../serving.py",
        "/static//etc/passwd",
        "/static/%2fetc%2fpasswd",
        "/static/../../../../../../../etc/passwd",
        "/../serving.py",
        "/static/",
        "/static/three",
        "/api/routes/..%2f..%2fscene",
    ],
)
def test_paths_do_not_escape(server, path):
    # Not httpx or a browser: they tidy the path up before they send it.
    connection = http.client.HTTPConnection("127.0.0.1", int(server.rstrip("/").rpartition(":")[2]))
    connection.request("GET", path)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    assert answer.status == 404, text
    assert "import" not in text
    assert "root:" not in text


@pytest.fixture(scope="module")
def page(server):
    """The page in a browser: (driver, address)."""
    with chromium("the page of view") as driver:
        driver.get(server)
        ready = "return document.body?.dataset.ready"
        assert until("the page is ready", lambda: driver.execute_script(ready)) == "yes"
        yield driver, server


def screenshot(driver):
    png = np.frombuffer(driver.get_screenshot_as_png(), dtype=np.uint8)
    return cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1].astype(int)


def canvas(driver):
    """What the browser shows once it stands still, (720, 1280, 3) sRGB."""
    driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    last = screenshot(driver)
    while not np.array_equal(last, now := screenshot(driver)):
        last = now
    return now


def view_of(driver, picture):
    box = driver.execute_script(
        "const b = page.view.canvas.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]"
    )
    left, top, width, height = (round(v) for v in box)
    return picture[top : top + height, left : left + width]


def fresh(driver):
    """Everything as it was when the page was loaded."""
    driver.execute_script(
        "page.letGo(); page.mode('orbit'); page.view.home();"
        "for (const id of ['setting', 'split', 'modality', 'target']) document.getElementById(id).value = '';"
        "document.getElementById('most').value = '';"
        "for (const box of document.querySelectorAll('[data-layer]'))"
        " { box.checked = box.dataset.layer !== 'anchors'; page.setLayer(box.dataset.layer, box.checked); }"
    )
    driver.execute_async_script("page.drawRoutes().then(arguments[0])")


def test_the_page_asks_nobody_else_and_has_no_errors(page):
    driver, url = page
    assert errors(driver) == []
    sent = [
        json.loads(entry["message"])["message"]["params"]
        for entry in driver.get_log("performance")
        if '"Network.requestWillBeSent"' in entry["message"]
    ]
    # The browser's own empty tab, before the page was asked for, is not the page's doing.
    asked = [event["request"]["url"] for event in sent if not event["documentURL"].startswith("chrome:")]
    assert {f"{url}api/scene", f"{url}api/index", f"{url}static/three/three.module.min.js"} <= set(asked)
    assert [other for other in asked if not other.startswith((url, "data:", "blob:"))] == []


def test_the_page_shows_the_scene_in_the_projects_colours(smoke, page):
    driver, _ = page
    fresh(driver)
    driver.execute_script(
        "for (const name of [...page.view.layers.keys()]) page.view.setVisible(name, false);"
        "page.view.overlay.style.display = 'none'"
    )
    shown = view_of(driver, canvas(driver))
    driver.execute_script("page.view.overlay.style.display = ''")
    eye, target, fov = driver.execute_script(
        "const v = page.view; return [v.camera.position.toArray(), v.controls.orbit.target.toArray(), v.camera.fov]"
    )
    height, width = shown.shape[:2]
    across = 2 * np.degrees(np.arctan(np.tan(np.radians(fov / 2)) * width / height))
    wanted = look_at(ReleasedScene(smoke, YARD).model, eye, target, width, height, across).astype(int)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 1000
    # Edges are smoothed and textures filtered here and not there: compare what both agree on at a coarser scale.
    small = [cv2.resize(p.astype(np.float32), (width // 8, height // 8), interpolation=cv2.INTER_AREA)
             for p in (shown, wanted)]  # fmt: skip
    difference = np.abs(small[0] - small[1])
    assert difference.mean() < 4.0
    assert np.quantile(difference, 0.99) < 40.0


def test_layers_are_switched_on_and_off(page):
    driver, _ = page
    fresh(driver)
    driver.execute_script("document.querySelector('[data-layer=routes]').click()")
    before = view_of(driver, canvas(driver))
    yellow = np.array([250, 204, 21])
    places = driver.execute_script(
        "const p = [0, 0, 0];"
        "return page.index.objects.map((o) => page.view.project(o.position, 0, p) && [p[0], p[1]])"
    )
    height, width = before.shape[:2]
    inside = [(int(x), int(y)) for x, y in places if 8 < x < width - 8 and 8 < y < height - 8]
    assert len(inside) >= 5
    marked = [np.abs(before[y, x] - yellow).max() < 25 for x, y in inside]
    assert sum(marked) >= len(inside) - 1  # a landmark's label may lie over one
    driver.execute_script("document.querySelector('[data-layer=objects]').click()")
    after = view_of(driver, canvas(driver))
    assert not any(np.abs(after[y, x] - yellow).max() < 25 for x, y in inside)
    driver.execute_script("document.querySelector('[data-layer=objects]').click()")
    assert np.array_equal(view_of(driver, canvas(driver)), before)
    driver.execute_script("document.querySelector('[data-layer=anchors]').click()")
    assert (view_of(driver, canvas(driver)) != before).any(axis=2).sum() > 200


def click(driver, x, y):
    from selenium.webdriver import ActionChains

    element = driver.execute_script("return page.view.canvas")
    size = element.rect
    ActionChains(driver, duration=0).move_to_element_with_offset(
        element, round(x - size["width"] / 2), round(y - size["height"] / 2)
    ).click().perform()


def test_a_route_is_picked_by_a_click(page):
    driver, _ = page
    fresh(driver)
    # One route alone, seen freely: the click can mean nothing else.
    nav = driver.execute_script("return page.index.routes.nav_id[page.index.routes.setting.length - 1]")
    driver.execute_script(
        "const k = page.rows.get(arguments[0]); page.wanted = () => [k];"
        "for (const name of ['objects', 'landmarks']) page.view.setVisible(name, false)", nav,
    )  # fmt: skip
    driver.execute_async_script("page.drawRoutes().then(arguments[0])")
    x, y = driver.execute_async_script(
        """
        const [nav, done] = arguments, view = page.view;
        page.ways.then((ways) => {
          const way = ways(page.rows.get(nav)), p = [0, 0, 0];
          const middle = [0, 1, 2].map((j) => (way[j] + way[3 + j]) / 2);
          view.focusOn(middle, { distance: 9 });
          view.draw();
          view.project(middle, 0, p);
          done([p[0], p[1]]);
        });""",
        nav,
    )
    click(driver, x, y)
    told = "return document.getElementById('picked-route')?.textContent"
    heading = until("the panel names the route", lambda: driver.execute_script(told))
    driver.execute_script("delete page.wanted")
    assert heading == nav
    assert driver.execute_script("return location.hash") == f"#route={nav}"
    facts = driver.execute_script("return document.getElementById('panel').textContent")
    k = driver.execute_script("return page.rows.get(arguments[0])", nav)
    length = driver.execute_script("return page.index.routes.length_m[arguments[0]]", k)
    assert f"{length:.2f} m" in facts
    assert f"{nav}-s" in facts
    assert errors(driver) == []


def test_flying_along_looks_as_the_drone_looks(smoke, page):
    driver, url = page
    row = ReleasedScene(smoke, YARD).routes.to_pylist()[4]
    # The address of a route opens it.
    driver.get(f"{url}#route={row['nav_id']}")
    driver.refresh()
    until("the page is ready", lambda: driver.execute_script("return document.body?.dataset.ready"))
    assert driver.execute_script("return document.getElementById('picked-route').textContent") == row["nav_id"]
    driver.execute_script("document.getElementById('ride').click()")
    for k in (0, len(row["action"]) // 2, len(row["action"]) - 1):
        driver.execute_script(
            "const s = document.getElementById('step'); s.value = arguments[0];"
            "s.dispatchEvent(new Event('input'))", k,
        )  # fmt: skip
        eye, ahead, fov = driver.execute_script(
            "const c = page.view.camera, e = c.matrixWorld.elements; c.updateMatrixWorld();"
            "return [c.position.toArray(), [-e[8], -e[9], -e[10]], c.fov]"
        )
        assert eye == pytest.approx([row["x_m"][k], row["y_m"][k], row["z_m"][k]], abs=1e-3)
        assert ahead == pytest.approx([np.cos(row["yaw_rad"][k]), np.sin(row["yaw_rad"][k]), 0.0], abs=1e-3)
        assert fov == 90
        doing = driver.execute_script("return document.getElementById('doing').textContent")
        assert doing.startswith(ACTION_NAMES[row["action"][k]])
    driver.execute_script("page.letGo()")
    assert driver.execute_script("return page.view.camera.fov") == 60


def test_dragging_in_fly_mode_turns_the_camera_on_the_spot(page):
    from selenium.webdriver import ActionChains

    driver, _ = page
    fresh(driver)
    driver.execute_script("page.mode('fly'); page.view.controls.lookFrom([0, 0, 12], [0, 20, 12])")
    canvas_of = driver.execute_script("return page.view.canvas")
    ActionChains(driver, duration=50).move_to_element(canvas_of).click_and_hold().move_by_offset(100, 0).perform()
    ActionChains(driver).release().perform()
    eye, ahead = driver.execute_script(
        "const c = page.view.camera, e = c.matrixWorld.elements; c.updateMatrixWorld();"
        "return [c.position.toArray(), [-e[8], -e[9], -e[10]]]"
    )
    # The scene follows the hand: pulled to the right, it lets one look to the left, to the west of north.
    assert eye == pytest.approx([0, 0, 12])
    assert ahead[0] < -0.2
    assert ahead[2] == pytest.approx(0.0, abs=1e-6)


def test_an_object_is_picked_by_a_click_on_its_mesh(page):
    driver, _ = page
    fresh(driver)
    for layer in ("routes", "objects", "landmarks"):
        driver.execute_script(f"page.view.setVisible('{layer}', false)")
    picture = "const i = document.querySelector('#panel img'); return i.complete && i.naturalWidth"
    for item in driver.execute_script("return page.index.objects.slice(0, 3)"):
        driver.execute_script("page.letGo(); page.view.focusOn(arguments[0]); page.view.draw()", item["mesh_node"])
        spot = driver.execute_script(
            """for (let y = 30; y < page.view.height; y += 9) for (let x = 30; x < page.view.width; x += 9)
                 if (page.view.pickNode(x, y)?.node === arguments[0]) return [x, y];
               return null;""",
            item["mesh_node"],
        )
        assert spot, f"{item['name']} is not to be seen"
        click(driver, *spot)
        panel = driver.execute_script("return document.getElementById('panel').textContent")
        assert item["name"] in panel
        assert item["description"] in panel
        assert until("the reference image", lambda: driver.execute_script(picture)) >= 300


def test_filters_count_as_the_release_does(smoke, page):
    driver, _ = page
    fresh(driver)
    routes = ReleasedScene(smoke, YARD).routes.to_pylist()
    target = routes[0]["target_object_id"]
    for choice, wanted in (
        ({"split": "id_test"}, [r for r in routes if r["split"] == "id_test"]),
        ({"target": str(target)}, [r for r in routes if r["target_object_id"] == target]),
        ({"target": str(target), "split": "id_train", "modality": "image"},
         [r for r in routes if (r["target_object_id"], r["split"]) == (target, "id_train")]),
        ({"setting": "long_horizon"}, [r for r in routes if r["setting"] == "long_horizon"]),
    ):  # fmt: skip
        driver.execute_script(
            "for (const id of ['setting', 'split', 'modality', 'target']) {"
            " const s = document.getElementById(id); s.value = arguments[0][id] ?? '';"
            " s.dispatchEvent(new Event('change')); }",
            choice,
        )
        driver.execute_async_script("page.drawRoutes().then(arguments[0])")
        drawn = driver.execute_script("return page.view.layers.get('routes').routes.map((r) => r.id)")
        assert sorted(drawn) == sorted(r["nav_id"] for r in wanted), choice
        assert driver.execute_script("return document.getElementById('n-routes').textContent") == f"{len(wanted):,}"


def test_search_and_keys(page):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    driver, _ = page
    fresh(driver)
    name = driver.execute_script("return page.index.objects[2].name")
    ActionChains(driver).send_keys("/").send_keys(name).send_keys(Keys.ENTER).perform()
    assert name == driver.execute_script("return document.querySelector('#panel h2').textContent")
    click(driver, 5, 5)
    before = driver.execute_script("return page.view.camera.position.toArray()")
    place = "return page.view.camera.position.toArray()"
    ActionChains(driver).key_down("d").perform()
    until("a move", lambda: np.linalg.norm(np.subtract(driver.execute_script(place), before)) > 0.2)
    ActionChains(driver).key_up("d").perform()
    after = driver.execute_script(place)
    assert after[2] == pytest.approx(before[2])
    ActionChains(driver).send_keys("t").perform()
    canvas(driver)
    heading = driver.execute_script("return document.querySelector('.scene-compass title').textContent")
    assert re.search(r"Looking (0|360) degrees", heading)
    ActionChains(driver).send_keys("f").perform()
    assert driver.execute_script("return page.view.controls.mode") == "fly"


def test_every_control_has_a_name(page):
    driver, _ = page
    nameless = driver.execute_script(
        "return [...document.querySelectorAll('input, select, button')].filter((e) =>"
        " !(e.labels?.length || e.textContent.trim() || e.getAttribute('aria-label'))).map((e) => e.outerHTML)"
    )
    assert nameless == []


def test_names_from_files_stay_text(page):
    driver, _ = page
    fresh(driver)
    driver.execute_script(
        """const object = page.index.objects[0], was = { ...object };
        Object.assign(object, { name: "<img src=x onerror=window.hit=1>",
          description: "<script>window.hit=1</script>" });
        page.pickObject(object.object_id); window.told = document.getElementById('panel').textContent;
        Object.assign(object, was);"""
    )
    time.sleep(0.2)
    assert driver.execute_script("return window.hit ?? null") is None
    assert "<img src=x onerror=window.hit=1>" in driver.execute_script("return window.told")
