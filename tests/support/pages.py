"""The pages as their commands serve them, and what a person does on them in a real browser."""

from __future__ import annotations

import json
import math
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from support.browser import until

YARD = "U_Courtyard_0"
AUTHOR = {"who": "Ada", "client": "tab-1"}
# Elements that a screen reader has no name for.
NAMELESS = """
  const named = (e) => e.labels?.length || e.getAttribute("aria-label") || e.textContent.trim();
  return [...document.querySelectorAll("input, select, textarea, button, progress, [role=application]")]
    .filter((e) => !named(e)).map((e) => e.outerHTML);
"""


@dataclass
class Served:
    """A command that serves a page."""

    line: str  # The first that it printed
    url: str
    process: subprocess.Popen[str]
    out: str = ""  # What it printed besides, known at its end


@contextmanager
def serving(
    *arguments: object, program: Sequence[str] = ("-m", "aerialdojo_gen.cli"), **options: Any
) -> Iterator[Served]:
    """Run a command that serves a page; Ctrl-C is a plain end of it, unless the test has killed it."""
    command = [sys.executable, *program, *map(str, arguments), "--no-browser"]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | options
    process = subprocess.Popen(command, **options)
    try:
        line = process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found, line + (process.communicate(timeout=20)[1] or "")
        served = Served(line, found[0], process)
        yield served
    finally:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    served.out = out
    killed = process.returncode in (-signal.SIGKILL, -signal.SIGTERM)
    assert killed or (process.returncode, err or "") == (0, ""), err


class Place(NamedTuple):
    """What ``annotate`` is told to open."""

    scene: str
    pipeline: Path
    data: Path
    annotations: Path

    @property
    def command(self) -> list[object]:
        return ["annotate", "--scene", self.scene, "--pipeline", self.pipeline, "--data", self.data]


def yard_in(project: Path, folder: Path) -> Place:
    """The yard of a pipeline of the smoke yards whose annotations are a copy in a folder."""
    shutil.copytree(project / "annotations" / "smoke", folder / "annotations")
    pipeline = folder / "pipeline.toml"
    pipeline.write_text(
        f'name = "yards"\nseed = 7\nscene_assets = "{project / "scene_assets"}"\n'
        f'recipes = "{project / "scene_assets" / "smoke"}"\nannotations = "annotations"\n'
    )
    return Place(YARD, pipeline, folder / "data", folder / "annotations" / f"{YARD}.json")


def entries(annotations: Path, kind: str = "objects") -> list[dict[str, Any]]:
    return json.loads(annotations.read_text())[kind]


class Page:
    """What a person does on the annotation page, with mouse and keys."""

    def __init__(self, driver, url):
        self.driver = driver
        driver.get(url)
        self.ready()

    def ready(self):
        until("the page", lambda: self.one("body").get_attribute("data-ready") == "true")

    def one(self, selector):
        return self.driver.find_element("css selector", selector)

    def all(self, selector):
        return self.driver.find_elements("css selector", selector)

    def text(self, selector):
        return self.one(selector).get_property("textContent")

    def click(self, selector):
        until(selector, lambda: self.one(selector).click() is None)

    def press(self, keys):
        until("what has the focus", lambda: self.driver.switch_to.active_element.send_keys(keys) is None)

    def saved(self):
        until("saved", lambda: self.text("#saved") == "saved")

    def leave(self):
        """Out of any field, nothing selected."""
        self.press("\ue00c")
        self.press("\ue00c")

    def write(self, field, words):
        self.one(f"#field-{field}").send_keys("\ue009" + "a" + "\ue000", words)

    def click_at(self, point, bounds):
        """Click a point of the scene, seen from above."""
        from selenium.webdriver import ActionChains

        self.press("t")
        canvas = self.one("#view canvas")
        width, height = canvas.size["width"], canvas.size["height"]
        (x0, y0, _), (x1, y1, top) = bounds
        half = max(y1 - y0, (x1 - x0) / (width / height)) / 2
        away = top + 1.05 * half / math.tan(math.pi / 6) - point[2]
        scale = height / 2 / (away * math.tan(math.pi / 6))
        dx, dy = (point[0] - (x0 + x1) / 2) * scale, ((y0 + y1) / 2 - point[1]) * scale
        ActionChains(self.driver).move_to_element_with_offset(canvas, round(dx), round(dy)).click().perform()


def ready(driver: Any) -> None:
    """Wait for a page of `view` that has just been asked for."""
    state = "return document.body?.dataset.ready"
    assert until("the page is ready", lambda: driver.execute_script(state)) == "yes"


def draw(driver: Any, **choice: str) -> None:
    """Draw the routes of a scene's page anew, with other values of its fields."""
    driver.execute_async_script(
        "for (const [id, value] of Object.entries(arguments[0])) document.getElementById(id).value = value;"
        "page.routes.draw().then(arguments[1])", choice,
    )  # fmt: skip


def texts(driver: Any, selector: str) -> list[str]:
    """The texts of all elements of a selector."""
    script = "return [...document.querySelectorAll(arguments[0])].map((e) => e.textContent)"
    return driver.execute_script(script, selector)
