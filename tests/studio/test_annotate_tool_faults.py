"""The annotation page where things go wrong: servers that die at the worst moment, long texts, a reload."""

import contextlib
import json
import os
import signal
import socket
import time

import pytest
from support import annotating
from support import browser as chrome
from support.annotate_page import Page, entries
from support.browser import until

# Every text of the status, with what was unsaved when it was said.
WATCH = """
  window.said = [];
  const status = document.getElementById("saved");
  const unsaved = () => JSON.parse(sessionStorage.getItem("aerialdojo-annotate-queue-" + arguments0) ?? "[]").length;
  new MutationObserver(() => window.said.push([status.textContent, unsaved()])).observe(status, { childList: true });
""".replace("arguments0", json.dumps(annotating.YARD))
# Counts how often the page has come to where it asks for news.
TICKS = """
  const later = window.setTimeout;
  window.ticks = 0;
  window.setTimeout = (what, ms, ...rest) => { window.ticks += ms === 1500; return later(what, ms, ...rest); };
"""
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


@pytest.fixture
def yard(project, tmp_path):
    pipeline = annotating.yard_pipeline(project, tmp_path)
    return pipeline, tmp_path / "data", tmp_path / "annotations" / f"{annotating.YARD}.json"


def free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def select(page, number=0):
    page.click(f'#objects li[data-key="objects-{number}"] button')
    until("the fields", lambda: page.all("#field-name"))


def rename_on_disk(annotations, name):
    """Change the first object's name as an editor does."""
    document = json.loads(annotations.read_text())
    document["objects"][0]["name"] = name
    annotations.write_text(json.dumps(document, indent=2) + "\n")


def opened(driver):
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


def test_nothing_says_saved_while_a_conflict_is_open_servers_die_and_others_answer(browser, yard, project):
    pipeline, data, annotations = yard
    port = free_port()
    served = lambda: annotating.served(project, annotating.YARD, pipeline, data, port)  # noqa: E731
    with served() as (url, process):
        page = Page(browser, url)
        select(page)
        page.one("#field-name").click()
        rename_on_disk(annotations, "crimson van")
        until("their name", lambda: "crimson van" in page.text("#objects"))
        browser.execute_script(WATCH)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        page.write("name", "scarlet van")
        page.press("\ue004")
        until("the conflict", lambda: opened(browser))
    with served() as (url, process):
        # Twice the page comes to where it would ask the server, which is there again.
        browser.execute_script(TICKS)
        until("two ticks", lambda: browser.execute_script("return window.ticks") >= 2)
        assert page.text("#saved") != "saved"
        assert entries(annotations)[0]["name"] == "crimson van"
        assert opened(browser)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    page.one("#use-mine").click()
    until("said that it is not saved", lambda: "not saved" in page.text("#saved"))
    answer_nonsense(port, lambda: page.text("#saved") != "saved")
    with served():
        page.saved()
        assert entries(annotations)[0]["name"] == "scarlet van"
    assert [
        text for text, unsaved in browser.execute_script("return window.said") if text == "saved" and unsaved
    ] == []
    assert not opened(browser)


def inside(driver, selector):
    """Whether an element is on the screen, as wide and high as it is."""
    box = driver.execute_script(
        "const b = document.querySelector(arguments[0]).getBoundingClientRect();"
        "return [b.left, b.top, b.right, b.bottom]", selector,
    )  # fmt: skip
    width, height = driver.execute_script("return [innerWidth, innerHeight]")
    return box[0] >= 0 and box[1] >= 0 and box[2] <= width + 0.5 and box[3] <= height + 0.5 and box[2] > box[0]


def test_the_page_keeps_its_shape_its_selection_and_what_is_typed(browser, yard, project):
    pipeline, data, annotations = yard
    with annotating.served(project, annotating.YARD, pipeline, data) as (url, _):
        page = Page(browser, url)
        chrome.errors(browser)  # those of servers that died before
        # No anchor is lacking: the sampler chooses it, and the page says so.
        count = len(entries(annotations))
        assert page.text("#progress-text") == f"{count} of {count} objects done · anchors chosen by the sampler"
        assert "lacks" not in page.text("#objects")
        page.one("#who").send_keys("Ada Lovelace\ue007")
        select(page, 1)
        assert not page.one("#who").is_displayed()
        assert page.text("#who-name") == "Ada Lovelace"
        until("the candidates", lambda: len(page.all(".anchors button")) == 3)
        assert "sampler" in page.text(".anchors button:nth-child(1)")
        assert browser.execute_script(MISPLACED) == []
        browser.refresh()
        page.ready()
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
        select(page, 1)
    # The server is gone: the page says so, and its panel stays where it was.
    until("lost", lambda: "does not answer" in page.text("#saved"))
    for selector in ("#panel", "#saved", "#show-help", "#remove", "#field-description"):
        assert inside(browser, selector), selector
    with annotating.served(project, annotating.YARD, pipeline, data) as (url, _):
        # On another port the name is known still.
        page = Page(browser, url)
        assert page.text("#who-name") == "Ada Lovelace"
        assert not page.one("#who").is_displayed()
