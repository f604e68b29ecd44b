"""The page of `view` in a real browser: it shows the scene, and does what its controls say."""

import re

import cv2
import numpy as np
import pytest
from selenium.webdriver import ActionChains
from support.browser import errors, until
from support.pages import NAMELESS, YARD, draw, texts

from aerialdojo_gen.dataset.lookup import ReleasedScene
from aerialdojo_gen.rendering.gallery import look_at


def screenshot(driver):
    png = np.frombuffer(driver.get_screenshot_as_png(), dtype=np.uint8)
    return cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1].astype(int)


def canvas(driver):
    """What the browser shows once it stands still, (H, W, 3) sRGB."""
    # Reading a pixel waits for the graphics: without that, a slow machine shows the frame before.
    driver.execute_async_script(
        "const done = arguments[0], gl = page.view.renderer.getContext();"
        "requestAnimationFrame(() => { page.view.draw();"
        " gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));"
        " requestAnimationFrame(done); })"
    )
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


@pytest.fixture
def bare(yard):
    """The page, which shows the scene alone."""
    for layer in ("routes", "objects", "landmarks"):
        yard.execute_script(f"page.view.setVisible('{layer}', false)")
    return yard


def test_the_page_shows_the_scene_in_the_projects_colours(smoke, yard):
    yard.execute_script(
        "for (const name of [...page.view.layers.keys()]) page.view.setVisible(name, false);"
        "page.view.overlay.style.display = 'none'"
    )
    shown = view_of(yard, canvas(yard))
    yard.execute_script("page.view.overlay.style.display = ''")
    eye, target, fov = yard.execute_script(
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


def test_layers_are_switched_on_and_off(yard):
    def switched(layer):
        yard.execute_script("document.querySelector(`[data-layer=${arguments[0]}]`).click()", layer)
        return view_of(yard, canvas(yard))

    def marked(picture):
        return [np.abs(picture[y, x] - [250, 204, 21]).max() < 25 for x, y in inside]

    before = switched("routes")
    places = yard.execute_script(
        "const p = [0, 0, 0];"
        "return page.index.objects.map((o) => page.view.project(o.position, 0, p) && [p[0], p[1]])"
    )
    height, width = before.shape[:2]
    inside = [(int(x), int(y)) for x, y in places if 8 < x < width - 8 and 8 < y < height - 8]
    assert len(inside) >= 5
    assert sum(marked(before)) >= len(inside) - 1  # a landmark's label may lie over one
    assert not any(marked(switched("objects")))
    assert np.array_equal(switched("objects"), before)
    assert (switched("anchors") != before).any(axis=2).sum() > 200


def click(driver, x, y):
    element = driver.execute_script("return page.view.canvas")
    size = element.rect
    ActionChains(driver, duration=0).move_to_element_with_offset(
        element, round(x - size["width"] / 2), round(y - size["height"] / 2)
    ).click().perform()


def test_a_route_is_picked_by_a_click(yard):
    # One route alone, seen freely: the click can mean nothing else.
    nav = yard.execute_script("return page.index.routes.nav_id[page.index.routes.setting.length - 1]")
    yard.execute_script(
        "const k = page.routes.row.get(arguments[0]); page.routes.wanted = () => [k];"
        "for (const name of ['objects', 'landmarks']) page.view.setVisible(name, false)", nav,
    )  # fmt: skip
    draw(yard)
    x, y = yard.execute_async_script(
        """
        const [nav, done] = arguments, view = page.view;
        page.routes.ways.then((ways) => {
          const way = ways(page.routes.row.get(nav)), p = [0, 0, 0];
          const middle = [0, 1, 2].map((j) => (way[j] + way[3 + j]) / 2);
          view.focusOn(middle, { distance: 9 });
          view.draw();
          view.project(middle, 0, p);
          done([p[0], p[1]]);
        });""",
        nav,
    )
    click(yard, x, y)
    until("the panel names the route", lambda: texts(yard, "#picked-route") == [nav])
    assert yard.execute_script("return location.hash") == f"#route={nav}"
    (facts,) = texts(yard, "#panel")
    k = yard.execute_script("return page.routes.row.get(arguments[0])", nav)
    length = yard.execute_script("return page.index.routes.length_m[arguments[0]]", k)
    assert f"{length:.2f} m" in facts
    assert f"{nav}-s" in facts
    assert errors(yard) == []


def test_dragging_in_fly_mode_turns_the_camera_on_the_spot(yard):
    yard.execute_script("page.mode('fly'); page.view.controls.lookFrom([0, 0, 12], [0, 20, 12])")
    canvas_of = yard.execute_script("return page.view.canvas")
    ActionChains(yard, duration=50).move_to_element(canvas_of).click_and_hold().move_by_offset(100, 0).perform()
    ActionChains(yard).release().perform()
    eye, ahead = yard.execute_script(
        "const c = page.view.camera, e = c.matrixWorld.elements; c.updateMatrixWorld();"
        "return [c.position.toArray(), [-e[8], -e[9], -e[10]]]"
    )
    # The scene follows the hand: pulled to the right, it lets one look to the left, to the west of north.
    assert eye == pytest.approx([0, 0, 12])
    assert ahead[0] < -0.2
    assert ahead[2] == pytest.approx(0.0, abs=1e-6)


def test_an_object_is_picked_by_a_click_on_its_mesh(bare):
    picture = "const i = document.querySelector('#panel img'); return i.complete && i.naturalWidth"
    for item in bare.execute_script("return page.index.objects.slice(0, 3)"):
        bare.execute_script("page.letGo(); page.view.focusOn(arguments[0]); page.view.draw()", item["mesh_node"])
        spot = bare.execute_script(
            """for (let y = 30; y < page.view.height; y += 9) for (let x = 30; x < page.view.width; x += 9)
                 if (page.view.pickNode(x, y)?.node === arguments[0]) return [x, y];
               return null;""",
            item["mesh_node"],
        )
        assert spot, f"{item['name']} is not to be seen"
        click(bare, *spot)
        (panel,) = texts(bare, "#panel")
        assert item["name"] in panel
        assert item["description"] in panel
        assert until("the reference image", lambda: bare.execute_script(picture)) >= 300


def test_what_is_picked_keeps_its_colours(bare):
    item = bare.execute_script("return page.index.objects[0]")
    bare.execute_script("page.view.focusOn(arguments[0])", item["mesh_node"])
    before = view_of(bare, canvas(bare))
    own = bare.execute_script(
        """const found = [];
           for (let y = 4; y < page.view.height; y += 6) for (let x = 4; x < page.view.width; x += 6)
             if (page.view.pickNode(x, y)?.node === arguments[0]) found.push([x, y]);
           return found;""",
        item["mesh_node"],
    )
    bare.execute_script("page.pickObject(arguments[0])", item["object_id"])
    after = view_of(bare, canvas(bare))
    changed = (before != after).any(axis=2)
    # The frame is there, and only its edges lie over the object.
    assert changed.sum() > 300
    assert np.mean([changed[y, x] for x, y in own]) < 0.12
    assert bare.execute_script("return page.view.layers.has('frame')")
    bare.execute_script("page.letGo()")
    assert not bare.execute_script("return page.view.layers.has('frame')")


def test_filters_count_as_the_release_does(smoke, yard):
    routes = ReleasedScene(smoke, YARD).routes.to_pylist()
    target = routes[0]["target_object_id"]
    for choice, wanted in (
        ({"split": "id_test"}, [r for r in routes if r["split"] == "id_test"]),
        ({"target": str(target)}, [r for r in routes if r["target_object_id"] == target]),
        ({"target": str(target), "split": "id_train", "modality": "image"},
         [r for r in routes if (r["target_object_id"], r["split"]) == (target, "id_train")]),
        ({"setting": "long_horizon"}, [r for r in routes if r["setting"] == "long_horizon"]),
    ):  # fmt: skip
        draw(yard, **{"setting": "", "split": "", "modality": "", "target": ""} | choice)
        drawn = yard.execute_script("return page.view.layers.get('routes').routes.map((r) => r.id)")
        assert sorted(drawn) == sorted(r["nav_id"] for r in wanted), choice
        assert texts(yard, "#n-routes") == [f"{len(wanted):,}"]


def test_keys(yard):
    place = "return page.view.camera.position.toArray()"
    click(yard, 5, 5)
    before = yard.execute_script(place)
    ActionChains(yard).key_down("d").perform()
    until("a move", lambda: np.linalg.norm(np.subtract(yard.execute_script(place), before)) > 0.2)
    ActionChains(yard).key_up("d").perform()
    after = yard.execute_script(place)
    assert after[2] == pytest.approx(before[2])
    ActionChains(yard).send_keys("t").perform()
    canvas(yard)
    assert re.search(r"Looking (0|360) degrees", texts(yard, ".scene-compass title")[0])
    ActionChains(yard).send_keys("f").perform()
    assert yard.execute_script("return page.view.controls.mode") == "fly"


def test_every_control_has_a_name(yard):
    assert yard.execute_script(NAMELESS) == []
