"""The annotation page in a real browser: a foreign mesh up to tasks; two tabs at odds; a killed server."""

import contextlib
import http.client
import itertools
import json
import math
import os
import signal
import socket
import threading
import urllib.request

import pyarrow.compute as pc
import pytest
from support import annotating, foreign
from support import browser as chrome
from support.annotate_page import Page, entries
from support.browser import until

from aerialdojo_gen.dataset.build import run_pipeline
from aerialdojo_gen.geometry.frames import compass_direction
from aerialdojo_gen.imports.command import add_scene
from aerialdojo_gen.imports.import_mesh import MeshOptions
from aerialdojo_gen.store import shards as store

NAME = "Helsinki"
WORDS = ("one", "two", "three")
UNLABELLED = """
  const named = (e) => e.labels?.length || e.getAttribute("aria-label") || e.textContent.trim();
  return [...document.querySelectorAll("input, select, textarea, button, progress, [role=application]")]
    .filter((e) => !named(e)).map((e) => e.outerHTML);
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A block of Helsinki, as add-scene makes it of OpenStreetMap's buildings."""
    folder = tmp_path_factory.mktemp("helsinki")
    foreign.helsinki(folder / "helsinki.glb")
    return add_scene(NAME, folder / "helsinki.glb", folder / "mine", MeshOptions(crop_m=(628.0, 97.0, 70.0)))


def roof(house):
    x, y, _ = house.centroid
    return x, y, house.bounds[1, 2]


def told_apart(scene):
    """The house in the middle, and three near it whose colour no other has in their direction."""
    houses = sorted(
        (i for i in scene.instances if i.category == "building"), key=lambda i: math.hypot(*i.centroid[:2])
    )
    mark, *others = houses
    looks = [(compass_direction(*(i.centroid - mark.centroid)[:2]), i.attributes["colour"]) for i in others]
    return [mark, *[i for i, look in zip(others, looks, strict=True) if looks.count(look) == 1][:3]]


def test_a_foreign_mesh_is_annotated_in_the_browser_and_becomes_tasks(browser, scene, project, tmp_path):
    data = tmp_path / "data"
    mark, *targets = told_apart(scene.scene)
    bounds = scene.scene.bounds.tolist()
    with annotating.served(project, NAME, scene.pipeline, data) as (url, _):
        page = Page(browser, url)
        page.one("#who").send_keys("Ada")
        assert page.text("#objects .empty").startswith("none yet")
        # A landmark: pick, L, a name.
        page.click_at(roof(mark), bounds)
        until("the pick", lambda: page.all("#make-landmark"))
        assert page.text("#panel .node") == mark.node
        page.press("l")
        until("the fields", lambda: page.all("#field-name"))
        page.write("name", "corner house")
        page.leave()
        page.saved()
        assert entries(scene.annotations, "landmarks") == [{"id": 0, "name": "corner house", "node": mark.node}]
        # Objects: pick, O, a name, a description; a warning while typing; an anchor by key.
        for k, house in enumerate(targets):
            page.click_at(roof(house), bounds)
            until(
                "the pick", lambda house=house: page.all("#panel .node") and page.text("#panel .node") == house.node
            )
            page.press("o")
            until("the fields", lambda: page.all("#field-description"))
            page.write("name", f"<b>{WORDS[k]}</b> house")
            page.write("description", "A building at x=3")
            until("a warning while typing", lambda: "coordinates" in page.text("#faults-description"))
            page.write(
                "description",
                f"A {house.attributes['colour']} building, the number {WORDS[k]} here.",
            )
            until("no warning", lambda: page.text("#faults-description") == "")
            page.leave()
            page.saved()
            page.press("n")
            until("candidates", lambda: len(page.all(".anchors button")) == 3)
            page.press("2")
            until("the choice", lambda: "chosen" in page.text(".anchors button:nth-child(2)"))
            page.saved()
            page.leave()
        assert page.text("#progress-text") == "3 of 3 objects done"
        assert browser.execute_script(UNLABELLED) == []
        written = scene.annotations.read_text()
        # Reload: it is all there.
        browser.refresh()
        page.ready()
        assert page.text("#progress-text") == "3 of 3 objects done"
        names = [item.get_property("textContent") for item in page.all("#objects .name")]
        assert names == [f"<b>{word}</b> house" for word in WORDS]
        page.click("#objects li:nth-child(2) button")
        until(
            "the choice",
            lambda: (
                [c.get_attribute("aria-pressed") for c in page.all(".anchors button")] == ["false", "true", "false"]
            ),
        )
        assert page.text("#panel .task").startswith("As the task will say it<b>two</b> house, ")
        assert scene.annotations.read_text() == written
        # By keys alone: to the view, above the middle of the scene, pick what is there.
        page.leave()
        assert not page.all("#panel .node")
        for _ in range(40):
            page.press("\ue004")
            if browser.switch_to.active_element.tag_name == "canvas":
                break
        page.press("t")
        page.press(" ")
        until("a pick by keys", lambda: page.all("#panel .node"))
        # Undo outlives the reload, redo brings it back.
        page.leave()
        page.press("\ue009z\ue000")
        until("undone", lambda: page.text("#progress-text").endswith(" · 1 anchor chosen by the sampler"))
        page.press("\ue009\ue008z\ue000")
        until("redone", lambda: page.text("#progress-text") == "3 of 3 objects done")
        assert scene.annotations.read_text() == written
        assert chrome.errors(browser) == []
    run_pipeline(scene.pipeline, data, stages=["filter"], scenes=[NAME], workers=1)
    anchors = store.read_scene(data, "anchors", NAME).to_pylist()
    assert {a["object_id"]: a["selected_by"] for a in anchors if a["selected"]} == dict.fromkeys(
        range(3), "annotation"
    )
    assert pc.sum(store.read_scene(data, "verdicts", NAME)["keep"]).as_py() >= 1


def rename_on_and_on(url, answered):
    """Change an object's name again and again, as another program, until nobody answers."""
    with contextlib.suppress(OSError, http.client.HTTPException):
        version = json.loads(urllib.request.urlopen(url + "api/document").read())["version"]
        for n in itertools.count():
            operation = {"do": "change", "kind": "objects", "id": 1, "fields": {"name": f"thing {n}"}}
            body = json.dumps({"who": "Robot", "client": "robot", "operation": operation}).encode()
            headers = {"Content-Type": "application/json", "If-Match": version}
            answer = urllib.request.urlopen(urllib.request.Request(url + "api/operations", body, headers))
            version = json.loads(answer.read())["version"]
            answered.append(n)


@pytest.fixture(scope="module")
def yard(project, tmp_path_factory):
    folder = tmp_path_factory.mktemp("yard")
    pipeline = annotating.yard_pipeline(project, folder)
    return pipeline, folder / "data", folder / "annotations" / f"{annotating.YARD}.json"


def test_two_tabs_at_odds_and_a_server_killed_in_the_middle_of_a_save(browser, yard, project):
    pipeline, data, annotations = yard
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with annotating.served(project, annotating.YARD, pipeline, data, port) as (url, process):
        first = Page(browser, url)
        one = browser.current_window_handle
        browser.switch_to.new_window("tab")
        second, two = Page(browser, url), browser.current_window_handle

        def begin(page):
            page.click('#objects li[data-key="objects-0"] button')
            until("the fields", lambda: page.all("#field-name"))
            page.one("#field-name").click()

        # Both have the field open; the first saves.
        begin(second)
        browser.switch_to.window(one)
        begin(first)
        first.write("name", "crimson van")
        first.leave()
        first.saved()
        # The second writes something else: it is shown both, and nothing is overwritten.
        browser.switch_to.window(two)
        second.write("name", "scarlet van")
        second.press("\ue004")
        until("the conflict", lambda: browser.execute_script("return document.getElementById('conflict').open"))
        assert "crimson van" in second.text("#conflict")
        assert "scarlet van" in second.text("#conflict")
        assert entries(annotations)[0]["name"] == "crimson van"
        second.one("#keep-theirs").click()
        until("theirs", lambda: second.one("#field-name").get_property("value") == "crimson van")
        # What does not overlap is merged, and said.
        second.one("#field-description").click()
        browser.switch_to.window(one)
        begin(first)
        first.write("name", "ruby van")
        first.leave()
        first.saved()
        browser.switch_to.window(two)
        second.write("description", "A red delivery van in the corner of the yard, of which there is one.")
        second.press("\ue004")
        second.saved()
        until(
            "both",
            lambda: (
                (entries(annotations)[0]["name"], "of which" in entries(annotations)[0]["description"])
                == ("ruby van", True)
            ),
        )

        # The server is killed; what is typed meanwhile is kept, and saved when there is a server again.
        second.leave()
        begin(second)
        answered = []
        saving = threading.Thread(target=rename_on_and_on, args=(url, answered))
        saving.start()
        until("saves under way", lambda: len(answered) >= 5)
        os.kill(process.pid, signal.SIGKILL)
        saving.join()
        process.wait()
        on_disk = entries(annotations)[1]["name"]
        assert on_disk in (f"thing {len(answered) - 1}", f"thing {len(answered)}")
        second.write("name", "van of the night")
        second.press("\ue004")
        until("said that it is not saved", lambda: "not saved" in second.text("#saved"))
        assert entries(annotations)[0]["name"] == "ruby van"
    with annotating.served(project, annotating.YARD, pipeline, data, port):
        second.saved()
        assert entries(annotations)[0]["name"] == "van of the night"
        browser.switch_to.window(one)
        until("the other tab sees it", lambda: "van of the night" in first.text("#objects"))
        lines = [json.loads(line) for line in annotations.with_suffix(".history.jsonl").read_text().splitlines()]
        assert lines[-1]["what"] == "name of object 0 (van of the night)"
        assert all(a["after"] == b["before"] for a, b in itertools.pairwise(lines))
    browser.switch_to.window(two)
    browser.close()
    browser.switch_to.window(one)
