"""The pages of `view` as one looks around in a release: start page, search, list of routes, flight, many routes."""

import base64
import re

import cv2
import numpy as np
import pytest
from selenium.webdriver import ActionChains
from selenium.webdriver.common.keys import Keys
from support.browser import errors, until
from support.pages import YARD, draw, ready, texts

from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.dataset.release import open_release
from aerialdojo_gen.store.schemas import ACTION_NAMES


@pytest.fixture(scope="module")
def start(browser, view_url):
    browser.get(view_url)
    ready(browser)
    return browser


# ---- the start page ----


def test_the_start_page_shows_scenes_and_tasks_with_pictures_and_opens_one(smoke, start):
    release = open_release(smoke)
    assert texts(start, "#scenes strong") == release.scenes
    assert texts(start, "#n-tasks") == [f"{release.routes().num_rows:,}"]
    loaded = (
        "const all = [...document.querySelectorAll(arguments[0])];"
        "return all.every((i) => i.complete && i.naturalWidth > 100) && all.length"
    )
    assert until("pictures", lambda: start.execute_script(loaded, "#scenes img")) == len(release.scenes)
    start.find_element("css selector", f"#scenes [data-scene={YARD}] button").click()
    routes = release.routes(scene=YARD)["nav_id"].to_pylist()
    until("the tasks of the yard", lambda: texts(start, "#n-tasks") == [f"{len(routes):,}"])
    assert all(YARD in text for text in texts(start, "#tasks li"))
    until("goals", lambda: start.execute_script(loaded, "#tasks li:nth-child(-n+4) img") == 4)
    start.find_element("css selector", "#words").send_keys(f"{routes[3]}-i")
    until("the task", lambda: texts(start, "#n-tasks") == ["1"])
    assert errors(start) == []
    start.find_element("css selector", "#tasks li a").click()
    until("the scene", lambda: texts(start, "#title") == [YARD])
    ready(start)
    assert texts(start, "#picked-route") == [routes[3]]
    assert start.execute_script("return document.querySelector('#busy').hidden")


# ---- search ----


def test_search_takes_words_in_any_order_and_arrows_lead_into_what_is_found(yard):
    name = yard.execute_script("return page.index.objects.map((o) => o.name).find((n) => n.split(' ').length > 1)")
    ActionChains(yard).send_keys("/").perform()
    box = yard.switch_to.active_element
    box.send_keys(" ".join(reversed(name.lower().split())))
    found = texts(yard, "#results [role=option]")
    assert found[0].startswith(name)
    # Words begin where words begin: no "red" in "covered".
    assert yard.execute_script(
        "return import('/static/dom.js').then(({ hasWords }) =>"
        " [hasWords('A covered Red bench_03', ['red', 'ben', '03']), hasWords('covered', ['red'])])"
    ) == [True, False]
    assert len(found) >= 2
    box.send_keys(Keys.ARROW_DOWN)
    chosen = "return [...document.querySelectorAll('#results [aria-selected=true]')].map((e) => e.id)"
    assert yard.execute_script(chosen) == ["found-1"]
    assert box.get_attribute("aria-activedescendant") == "found-1"
    box.send_keys(Keys.ARROW_UP, Keys.ARROW_UP)
    assert yard.execute_script(chosen) == [f"found-{len(found) - 1}"]
    # The last one is the routes with these words.
    box.send_keys(Keys.ENTER)
    until("these routes", lambda: texts(yard, "#route-count") == [re.match(r"[\d,]+ routes", found[-1])[0]])
    assert yard.find_element("css selector", "#list").is_displayed()
    yard.execute_script("page.routes.words = []; page.list.find.value = ''")
    box.send_keys(Keys.ESCAPE)
    assert texts(yard, "#results li") == []


# ---- the list ----


def shown_in_list(driver):
    return driver.execute_script(
        "const box = document.getElementById('route-rows').getBoundingClientRect();"
        "return [...document.querySelectorAll('.route')].filter((r) => { const b = r.getBoundingClientRect();"
        " return b.bottom > box.top && b.top < box.bottom; }).map((r) => r.dataset.nav)"
    )


def test_the_list_holds_all_routes_sorted_makes_only_rows_in_sight_and_knows_keys(smoke, yard):
    routes = open_release(smoke).routes(scene=YARD).to_pylist()
    length = {row["nav_id"]: round(row["length_m"], 3) for row in routes}
    # What is drawn may be a sample: the list is whole.
    yard.find_element("css selector", "#tab-list").click()
    draw(yard, most="100")
    assert texts(yard, "#route-count") == [f"{len(routes):,} routes"]
    made = "return document.querySelectorAll('.route').length"
    assert 5 < yard.execute_script(made) < 40 < len(routes)
    ordered = sorted(length.values())
    assert [length[nav] for nav in shown_in_list(yard)] == ordered[: len(shown_in_list(yard))]
    seen, box = set(), yard.find_element("css selector", "#route-rows")
    for top in range(0, 46 * len(routes), box.get_property("clientHeight")):
        yard.execute_script("arguments[0].scrollTop = arguments[1]", box, top)
        yard.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
        seen.update(shown_in_list(yard))
        assert yard.execute_script(made) < 40
    assert seen == set(length)
    yard.find_element("css selector", "#route-turn").click()
    assert [length[nav] for nav in shown_in_list(yard)] == ordered[::-1][: len(shown_in_list(yard))]
    box.send_keys(Keys.HOME, Keys.END)
    *_, before, last = yard.execute_script("return page.list.sorted.map((k) => page.index.routes.nav_id[k])")
    assert last in shown_in_list(yard)
    box.send_keys(Keys.ARROW_UP, Keys.ENTER)
    until("the route", lambda: texts(yard, "#picked-route") == [before])
    assert yard.find_element("css selector", "#panel").is_displayed()
    yard.find_element("css selector", "#tab-list").click()
    marked = "return [...document.querySelectorAll('.route[aria-selected=true]')].map((r) => r.dataset.nav)"
    assert yard.execute_script(marked) == [before]
    yard.find_element("css selector", "#route-turn").click()


def test_the_panel_begins_at_its_top(yard):
    tops = yard.execute_script(
        """const panel = document.getElementById('panel'), [first, second] = page.index.objects;
        page.pickObject(first.object_id);
        panel.scrollTop = 200;
        const scrolled = panel.scrollTop;
        page.pickObject(second.object_id);
        return [scrolled, panel.scrollTop];"""
    )
    assert tops[0] > 100
    assert tops[1] == 0


# ---- flying along ----


def test_a_flight_looks_as_the_drone_looks_passes_between_poses_and_keeps_to_its_speed(smoke, yard, view_url):
    row = open_release(smoke).routes(scene=YARD).to_pylist()[5]
    # The address of a route opens it.
    yard.get(f"{view_url}scenes/{YARD}/#route={row['nav_id']}")
    yard.refresh()
    ready(yard)
    assert texts(yard, "#picked-route") == [row["nav_id"]]
    yard.execute_script("document.getElementById('ride').click()")
    middle = len(row["action"]) // 2
    yard.execute_script(
        "const s = document.getElementById('step'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))",
        middle,
    )
    assert texts(yard, "#doing")[0].startswith(ACTION_NAMES[row["action"][middle]])
    assert yard.execute_script("return page.view.camera.fov") == 90
    poses = np.column_stack([row[key] for key in ("x_m", "y_m", "z_m", "yaw_rad")])
    times = np.array(yard.execute_script("return page.flight.times"))
    assert (np.diff(times) > 0).all()
    # Half-way between two poses, the camera is half-way, and half turned the shorter way; it looks level.
    camera = (
        "page.flight.time = arguments[0]; page.flight.now(); const c = page.view.camera; c.updateMatrixWorld();"
        "const e = c.matrixWorld.elements; return [...c.position.toArray(), -e[8], -e[9], -e[10]]"
    )
    for k in range(0, len(poses) - 1, 3):
        x, y, z, ahead_x, ahead_y, ahead_z = yard.execute_script(camera, (times[k] + times[k + 1]) / 2)
        assert ahead_z == pytest.approx(0.0, abs=1e-3)
        assert [x, y, z] == pytest.approx((poses[k, :3] + poses[k + 1, :3]) / 2, abs=2e-3)
        turn = np.angle(np.exp(1j * (poses[k + 1, 3] - poses[k, 3])))
        heading = np.arctan2(ahead_y, ahead_x)
        assert abs(np.angle(np.exp(1j * (heading - poses[k, 3] - turn / 2)))) < 2e-3
    # Space plays: places lie on the way, also between poses, and pause holds one.
    yard.execute_script(
        "page.flight.time = 0; document.activeElement.blur(); window.flown = []; const show = page.flight.show;"
        "page.flight.show = (pose, k) => { flown.push([...pose, page.flight.time]); show(pose, k); }"
    )
    ActionChains(yard).send_keys(" ").perform()
    under_way = "return flown.length >= 6 && page.flight.time > page.flight.end / 4"
    until("flying", lambda: yard.execute_script(under_way))
    assert texts(yard, "#play") == ["Pause"]
    ActionChains(yard).send_keys(" ").perform()
    held = yard.execute_script("return page.flight.time")
    assert texts(yard, "#play") == ["Play"]
    flown = np.array(yard.execute_script("return flown"))
    assert (np.diff(flown[:, 4]) >= 0).all()
    expected = [np.interp(flown[:, 4], times, poses[:, j]) for j in range(3)]
    assert np.abs(flown[:, :3] - np.column_stack(expected)).max() < 1e-3
    assert min(np.abs(flown[:, None, :3] - poses[None, :, :3]).sum(axis=2).min(axis=1).max(), 1.0) > 0.01
    assert yard.execute_async_script("setTimeout(() => arguments[0](page.flight.time), 150)") == held
    # Twice the speed is twice the way in the same time: what a frame of 100 ms adds.
    steps = yard.execute_script(
        """const added = [], raf = window.requestAnimationFrame;
        for (const speed of [1, 8]) {
          let tick = null;
          window.requestAnimationFrame = (f) => { tick ??= f; return 0; };
          page.flight.time = 0;
          page.flight.speed = speed;
          const begun = performance.now();
          page.flight.play();
          window.requestAnimationFrame = () => 0;
          tick(begun + 100);
          const before = page.flight.time;
          tick(begun + 200);
          added.push(page.flight.time - before);
          page.flight.pause();
        }
        window.requestAnimationFrame = raf;
        page.view.pending = 0;
        return added;"""
    )
    assert steps == pytest.approx([0.1, 0.8], abs=1e-6)
    yard.execute_script("page.flight.speed = 8; page.flight.play()")
    until("the end", lambda: not yard.execute_script("return page.flight.playing"))
    assert yard.execute_script("return document.getElementById('step').value") == str(len(poses) - 1)
    assert yard.execute_script("page.letGo(); return page.view.camera.fov") == 60
    assert errors(yard) == []


# ---- thousands of routes ----

LAYER = "const layer = page.view.layers.get('routes');"
JOINED = "return layer.object.geometry.index.count / 2"


def test_many_routes_are_one_buffer_with_a_busy_sign(smoke, yard):
    routes = open_release(smoke).routes(scene=YARD)
    n = 20_000
    # The yard's routes again and again, each a little aside.
    yard.execute_script(
        """const n = page.index.routes.nav_id.length;
        page.routes.wanted = () => Array.from({ length: arguments[0] }, (_, k) => k % n);
        window.busy = [];
        const sign = document.getElementById('busy');
        new MutationObserver(() => busy.push([sign.hidden, sign.textContent.trim()])).observe(sign,
          { attributes: true, childList: true, subtree: true });""",
        n,
    )
    draw(yard, most="")
    told = yard.execute_script("return busy")
    assert [hidden for hidden, _ in told][-1] is True
    assert [False, f"Drawing {n:,} routes …"] in told
    kind, ids, calls, segments = yard.execute_script(
        LAYER + "const gl = page.view.renderer.info; for (const [name, other] of page.view.layers)"
        " if (name !== 'routes') other.object.visible = false;"
        "page.view.setVisible('scene', false); gl.autoReset = true; page.view.draw();"
        "const drawn = gl.render.calls; layer.object.visible = false; page.view.draw();"
        "const calls = drawn - gl.render.calls; layer.object.visible = true; page.view.setVisible('scene', true);"
        "return [layer.constructor.name, layer.routes.length, calls, layer.segments]"
    )
    assert (kind, ids, calls) == ("CrowdLayer", n, 1)
    assert segments >= n
    assert ids > routes.num_rows
    # While one moves fewer points are joined, and never more than a level allows; at rest all of them are.
    for most in (segments, 20_000, 5_000):
        assert 0.3 * most < yard.execute_script(f"{LAYER} layer.thin(arguments[0]); {JOINED}", most) <= most
    assert yard.execute_script(f"{LAYER} page.view.draw(); {JOINED}") == segments


def picture(driver, level=0):
    """What the view draws at a level of detail, (H, W, 3) sRGB."""
    shown = driver.execute_script(
        "const view = page.view; cancelAnimationFrame(view.pending); view.pending = 1; view.draw(arguments[0]);"
        "view.pending = 0; return view.canvas.toDataURL().split(',')[1]", level,
    )  # fmt: skip
    return decode_rgb(base64.b64decode(shown)).astype(np.float32)


def test_what_is_drawn_in_motion_stays_near_what_is_drawn_at_rest(yard):
    yard.execute_script("for (const name of page.view.layers.keys()) page.view.setVisible(name, false)")
    still, *moving = (cv2.resize(picture(yard, n), (48, 48), interpolation=cv2.INTER_AREA) for n in (0, 1, 3, 6))
    assert np.std(still) > 10
    for most, shot in zip((2.0, 5.0, 12.0), moving, strict=True):
        assert np.abs(shot - still).mean() < most


def test_what_is_picked_is_what_the_camera_sees_now(yard):
    """A frame may be drawn later: a click means the place where the camera is by then."""
    picked = yard.execute_script(
        """const { view, index } = page, seen = [];
        view.pending = 1;  // no frame from now on
        for (const { mesh_node: node } of index.objects.slice(0, 4)) {
          view.focusOn(node);
          const [x, y] = [view.width / 2, view.height / 2];
          const before = view.pickNode(x, y)?.node;
          view.draw();
          seen.push([before, view.pickNode(x, y)?.node]);
        }
        view.pending = 0;
        return seen;"""
    )
    assert all(before == after for before, after in picked)
    assert len({after for _, after in picked}) > 1


def test_the_pace_draws_less_of_slow_frames_and_more_of_quick_ones(yard):
    levels, most = yard.execute_async_script(
        """const done = arguments[0], real = performance.now;
        import("/static/pace.js").then(({ LEVELS, Pace }) => {
          const pace = new Pace(page.view.renderer.getContext(), 0), seen = [];
          let now = 0;
          performance.now = () => now;
          for (const [frames, took, later] of [[1, 300, 0], [9, 100, 0], [40, 60, 0], [40, 5, 0], [80, 5, 20000]]) {
            now += later;
            for (let k = 0; k < frames; k++) pace.learn(took);
            seen.push(pace.level);
          }
          performance.now = real;
          done([seen, LEVELS.length - 1]);
        });"""
    )
    # Two levels down at once, then to the last; not back to what was too slow a moment ago; later to the first.
    assert levels == [2, most, most, most, 0]


@pytest.mark.parametrize("turn", [False, True])
def test_where_routes_overlap_the_tightest_gives_the_colour(yard, turn):
    tight, wide = yard.execute_script(
        "const c = page.index.routes.min_clearance_m, all = [...c.keys()].sort((a, b) => c[a] - c[b]);"
        "return [all[0], all.at(-1)]"
    )
    # Two routes of one and the same way, many times, so that they are drawn as a crowd.
    yard.execute_script(
        """const [tight, wide, turn] = arguments, pair = turn ? [wide, tight] : [tight, wide];
        page.routes.ways = Promise.resolve(() => new Float32Array([-4, 0, 9, 4, 0, 9]));
        page.routes.wanted = () => Array.from({ length: 600 }, (_, k) => pair[k % 2]);
        for (const name of ['objects', 'landmarks']) page.view.setVisible(name, false);
        page.view.controls.lookFrom([0, -8, 11], [0, 0, 9]);""",
        tight, wide, turn,
    )  # fmt: skip
    draw(yard, colour="clearance", most="")
    assert "the tightest is on top" in texts(yard, "#legend")[0]
    yard.execute_script("page.view.setVisible('scene', false)")
    colours = yard.execute_async_script(
        """const [tight, wide, done] = arguments, clearance = page.index.routes.min_clearance_m;
        import("/static/colours.js").then(({ clearanceColour }) =>
          done([tight, wide].map((k) => clearanceColour(clearance[k]))));""",
        tight, wide,
    )  # fmt: skip
    shown, two = picture(yard), [np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) for colour in colours]
    above, below = ((np.abs(shown - colour).max(axis=2) < 3).sum() for colour in two)
    assert np.abs(two[0] - two[1]).sum() > 30
    assert above > 100
    assert below < 0.02 * above
