"""The annotation page in a real browser: a foreign mesh up to tasks; two tabs at odds; a server that dies."""

import contextlib
import itertools
import json
import socket
import threading
import time

import httpx
import pyarrow.compute as pc
import pytest
from support import browser as chrome
from support import foreign
from support.browser import until
from support.pages import NAMELESS, YARD, Page, Place, entries, serving, yard_in

from aerialdojo_gen.dataset.build import run_pipeline
from aerialdojo_gen.imports.command import add_scene
from aerialdojo_gen.imports.import_mesh import MeshOptions
from aerialdojo_gen.store import shards as store

NAME = "Village"
WORDS = ("one", "two", "three")
# Of axe's rules: listitem, aria-allowed-role, and what may stand in a label.
MISPLACED = """
  const wrong = [];
  for (const item of document.querySelectorAll("li")) {
    const list = item.parentElement, role = list.getAttribute("role");
    if (!["UL", "OL"].includes(list.tagName) || !["list", null].includes(role)) wrong.push(item.outerHTML);
  }
  for (const list of document.querySelectorAll("ul[role], ol[role], label ul, label div")) wrong.push(list.outerHTML);
  return wrong;
"""
# Every text of the status, with what was unsaved when it was said; how often the page comes to ask for news.
WATCH = """
  window.said = [];
  const status = document.getElementById("saved");
  const unsaved = () => JSON.parse(sessionStorage.getItem("aerialdojo-annotate-queue-" + arguments0) ?? "[]").length;
  new MutationObserver(() => window.said.push([status.textContent, unsaved()])).observe(status, { childList: true });
""".replace("arguments0", json.dumps(YARD))
TICKS = """
  const later = window.setTimeout;
  window.ticks = 0;
  window.setTimeout = (what, ms, ...rest) => { window.ticks += ms === 1500; return later(what, ms, ...rest); };
"""
# Whether an element is on the screen, as wide and high as it is.
INSIDE = """
  const b = document.querySelector(arguments[0]).getBoundingClientRect();
  return b.left >= 0 && b.top >= 0 && b.right <= innerWidth + 0.5 && b.bottom <= innerHeight + 0.5 && b.width > 0;
"""


def roof(house):
    x, y, _ = house.centroid
    return x, y, house.bounds[1, 2]


def test_a_foreign_mesh_is_annotated_in_the_browser_and_becomes_tasks(browser, project, tmp_path):
    foreign.village().export(tmp_path / "village.glb")
    scene = add_scene(NAME, tmp_path / "village.glb", tmp_path / "mine", MeshOptions())
    place = Place(NAME, scene.pipeline, tmp_path / "data", scene.annotations)
    mark = scene.scene["clock_tower_0000"]
    targets = [scene.scene[f"house_{k:04d}"] for k in (2, 3, 4)]  # each alone in its direction
    bounds = scene.scene.bounds.tolist()
    with serving(*place.command) as served:
        page = Page(browser, served.url)
        page.one("#who").send_keys("Ada")
        assert page.text("#objects .empty").startswith("none yet")
        # A landmark: pick, L, a name.
        page.click_at(roof(mark), bounds)
        until("the pick", lambda: page.all("#make-landmark"))
        assert page.text("#panel .node") == mark.node
        page.press("l")
        until("the fields", lambda: page.all("#field-name"))
        page.write("name", "old tower")
        page.leave()
        page.saved()
        assert entries(scene.annotations, "landmarks") == [{"id": 0, "name": "old tower", "node": mark.node}]
        # Objects: pick, O, a name, a description; a warning while typing; an anchor by key.
        for word, house in zip(WORDS, targets, strict=True):
            page.click_at(roof(house), bounds)
            until("the pick", lambda node=house.node: page.all("#panel .node") and page.text("#panel .node") == node)
            page.press("o")
            until("the fields", lambda: page.all("#field-description"))
            page.write("name", f"<b>{word}</b> house")
            page.write("description", "A house at x=3")
            until("a warning while typing", lambda: "coordinates" in page.text("#faults-description"))
            page.write("description", f"A {house.attributes['colour']} house, the number {word} here.")
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
        assert browser.execute_script(NAMELESS) == []
        written = scene.annotations.read_text()
        # Reload: it is all there.
        browser.refresh()
        page.ready()
        assert page.text("#progress-text") == "3 of 3 objects done"
        names = [item.get_property("textContent") for item in page.all("#objects .name")]
        assert names == [f"<b>{word}</b> house" for word in WORDS]
        page.click("#objects li:nth-child(2) button")
        pressed = "return [...document.querySelectorAll('.anchors button')].map((b) => b.ariaPressed)"
        until("the choice", lambda: browser.execute_script(pressed) == ["false", "true", "false"])
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
    run_pipeline(scene.pipeline, place.data, stages=["filter"], scenes=[NAME], workers=1)
    anchors = store.read_scene(place.data, "anchors", NAME).to_pylist()
    chosen = {a["object_id"]: a["selected_by"] for a in anchors if a["selected"]}
    assert chosen == dict.fromkeys(range(3), "annotation")
    assert pc.sum(store.read_scene(place.data, "verdicts", NAME)["keep"]).as_py() >= 1


class Yard:
    """The yard's annotations, and its server, always on one port, which may die and be started again."""

    def __init__(self, place):
        self.annotations, self._place = place.annotations, place
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self._running, self._served = contextlib.ExitStack(), None

    def start(self):
        if self._served is None:
            self._served = self._running.enter_context(serving(*self._place.command, "--port", self.port))
            self.url = self._served.url

    def kill(self):
        self._served.process.kill()
        self.close()
        self._served = None

    def close(self):
        self._running.close()


@pytest.fixture(scope="module")
def yard(project, tmp_path_factory):
    with contextlib.closing(Yard(yard_in(project, tmp_path_factory.mktemp("yard")))) as yard:
        yield yard


@pytest.fixture
def page(browser, yard):
    yard.start()
    page = Page(browser, yard.url)
    chrome.errors(browser)  # those of servers that died before
    return page


def select(page, number=0):
    page.click(f'#objects li[data-key="objects-{number}"] button')
    until("the fields", lambda: page.all("#field-name"))


def test_the_page_keeps_its_shape_its_selection_and_what_is_typed(browser, page, yard):
    annotations = yard.annotations
    browser.delete_all_cookies()  # who somebody was in another test
    browser.refresh()
    page.ready()
    # No anchor is lacking: the sampler chooses it, and the page says so.
    count = len(entries(annotations))
    assert page.text("#progress-text") == f"{count} of {count} objects done · anchors chosen by the sampler"
    assert "lacks" not in page.text("#objects")
    page.one("#who").send_keys("Ada Lovelace\ue007")
    select(page, 1)
    until("the candidates", lambda: len(page.all(".anchors button")) == 3)
    assert "sampler" in page.text(".anchors button:nth-child(1)")
    assert browser.execute_script(MISPLACED) == []
    browser.execute_script(
        "localStorage.clear()"
    )  # another start may take another port, which has a store of its own
    browser.refresh()
    page.ready()
    assert not page.one("#who").is_displayed()
    assert page.text("#who-name") == "Ada Lovelace"
    assert page.text("#panel h2") == "Object 1"
    assert page.one("#field-name").get_property("value") == entries(annotations)[1]["name"]
    # What is too long is not cut: it stays, and says why it is not saved.
    before, long = annotations.read_bytes(), "A bench. " + "very " * 450 + "long."
    page.one("#field-description").click()
    browser.execute_script(
        "const f = document.querySelector('#field-description'); f.value = arguments[0];"
        "f.dispatchEvent(new Event('input')); f.dispatchEvent(new Event('change'));", long,
    )  # fmt: skip
    until("the warning", lambda: f"{len(long)} characters, 2000 at most" in page.text("#faults-description"))
    select(page, 0)
    assert "not saved" in page.text("#saved")
    assert "object 1, description too long" in page.text("#saved")
    select(page, 1)
    assert page.one("#field-description").get_property("value") == long
    assert annotations.read_bytes() == before
    page.write("description", "A short one.")
    page.leave()
    page.saved()
    assert entries(annotations)[1]["description"] == "A short one."
    line = json.loads(annotations.with_suffix(".history.jsonl").read_text().splitlines()[-1])
    assert line["who"] == "Ada Lovelace"
    assert chrome.errors(browser) == []


def rename_on_and_on(url, answered):
    """Change an object's name again and again, as another program, until nobody answers."""
    with httpx.Client(base_url=url) as client, contextlib.suppress(httpx.HTTPError):
        version = client.get("api/document").json()["version"]
        for n in itertools.count():
            operation = {"do": "change", "kind": "objects", "id": 1, "fields": {"name": f"thing {n}"}}
            body = {"who": "Robot", "client": "robot", "operation": operation}
            version = client.post("api/operations", json=body, headers={"If-Match": version}).json()["version"]
            answered.append(n)


def conflict_open(driver):
    return driver.execute_script("return document.getElementById('conflict').open")


def answer_nonsense(port, still):
    """Be a server of another kind on the port: what it says is no reason to forget a change."""
    answers = [
        b"HTTP/1.1 500 No\r\nConnection: close\r\n\r\nInternal", b"HTTP/1.1 200 OK\r\n\r\n{}", b"",
        b"HTTP/1.1 401 No\r\nConnection: close\r\n\r\nopen the address", b"HTTP/1.1 200 OK\r\n\r\n<html>",
    ]  # fmt: skip
    heard, end = 0, time.monotonic() + 120
    with socket.create_server(("127.0.0.1", port)) as other:
        other.settimeout(0.2)
        while heard < len(answers):
            assert time.monotonic() < end
            with contextlib.suppress(TimeoutError):
                client, _ = other.accept()
                with client, contextlib.suppress(OSError):
                    client.recv(65536)
                    client.sendall(answers[heard])
                    heard += 1
            assert still()


def test_two_tabs_at_odds_while_a_server_is_killed_in_the_middle_of_a_save_and_another_one_answers(
    browser, page, yard
):
    annotations, first, one = yard.annotations, page, browser.current_window_handle
    browser.switch_to.new_window("tab")
    second, two = Page(browser, yard.url), browser.current_window_handle

    def begin(page, number=0):
        select(page, number)
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
    until("the conflict", lambda: conflict_open(browser))
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
    merged = "A red delivery van in the corner of the yard, of which there is one."
    second.write("description", merged)
    second.press("\ue004")
    second.saved()
    until("both", lambda: entries(annotations)[0]["description"] == merged)
    assert entries(annotations)[0]["name"] == "ruby van"
    # The first hears of a name that it is about to write itself, and the server is killed.
    second.leave()
    begin(second)
    browser.switch_to.window(one)
    begin(first, 2)
    document = json.loads(annotations.read_text())  # as an editor changes it
    document["objects"][2]["name"] = "vermilion thing"
    annotations.write_text(json.dumps(document, indent=2) + "\n")
    until("their name", lambda: "vermilion thing" in first.text("#objects"))
    browser.execute_script(WATCH)
    answered = []
    saving = threading.Thread(target=rename_on_and_on, args=(yard.url, answered))
    saving.start()
    until("saves under way", lambda: len(answered) >= 5)
    yard.kill()
    saving.join()
    on_disk = entries(annotations)[1]["name"]
    assert on_disk in (f"thing {len(answered) - 1}", f"thing {len(answered)}")
    first.write("name", "scarlet thing")
    first.press("\ue004")
    until("the conflict", lambda: conflict_open(browser))
    # What is typed meanwhile is kept, and saved when there is a server again.
    browser.switch_to.window(two)
    second.write("name", "van of the night")
    second.press("\ue004")
    until("said that it is not saved", lambda: "not saved" in second.text("#saved"))
    # The page says so, and its panel stays where it was.
    until("lost", lambda: "does not answer" in second.text("#saved"))
    for selector in ("#panel", "#saved", "#show-help", "#remove", "#field-description"):
        assert browser.execute_script(INSIDE, selector), selector
    answer_nonsense(yard.port, lambda: second.text("#saved") != "saved")
    assert entries(annotations)[0]["name"] == "ruby van"
    yard.start()
    second.saved()
    assert entries(annotations)[0]["name"] == "van of the night"
    # Twice the first comes to where it would ask the server, which is there again.
    browser.switch_to.window(one)
    browser.execute_script(TICKS)
    until("two ticks", lambda: browser.execute_script("return window.ticks") >= 2)
    assert first.text("#saved") != "saved"
    assert conflict_open(browser)
    assert entries(annotations)[2]["name"] == "vermilion thing"
    first.one("#use-mine").click()
    first.saved()
    assert entries(annotations)[2]["name"] == "scarlet thing"
    said = browser.execute_script("return window.said")
    assert [text for text, unsaved in said if text == "saved" and unsaved] == []
    assert not conflict_open(browser)
    assert "van of the night" in first.text("#objects")
    lines = [json.loads(line) for line in annotations.with_suffix(".history.jsonl").read_text().splitlines()]
    assert lines[-2]["what"] == "name of object 0 (van of the night)"
    assert all(a["after"] == b["before"] for a, b in itertools.pairwise(lines))
    browser.switch_to.window(two)
    browser.close()
    browser.switch_to.window(one)
