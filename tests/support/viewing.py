"""What the tests of `view` share: the command's own server, and a scene's page in a browser."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from support.browser import until

YARD = "U_Courtyard_0"


@contextmanager
def served(data: Path) -> Iterator[str]:
    """Run ``aerialdojo-gen view``; gives the address of its start page; Ctrl-C has to be a plain end."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "view", "--data", str(data), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    url = re.fullmatch(r"\d+ scenes: (http://127\.0\.0\.1:\d+/)  \(Ctrl-C ends it\)\n", line)
    assert url, line + process.communicate()[1]
    try:
        yield url[1]
    finally:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (0, "", "")


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
    return driver.execute_script(
        "return [...document.querySelectorAll(arguments[0])].map((e) => e.textContent)", selector
    )
