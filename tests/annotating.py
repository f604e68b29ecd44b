"""What the tests of the annotation tool share: a yard at the desk, a real server, a real browser."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
YARD = "U_Courtyard_0"
AUTHOR = {"who": "Ada", "client": "tab-1"}


@contextmanager
def served(
    project: Path, scene: str, pipeline: Path, data: Path, port: int = 0
) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run ``aerialdojo-gen annotate``; gives the page's address and the process, which is ended at last."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "annotate", "--scene", scene, "--pipeline", str(pipeline),
               "--data", str(data), "--no-browser", "--port", str(port)]  # fmt: skip
    process = subprocess.Popen(command, cwd=project, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert found, line + (process.communicate(timeout=20)[0] or "")
        yield found[0], process
    finally:
        process.terminate()
        process.communicate(timeout=20)


def yard_pipeline(project: Path, folder: Path) -> Path:
    """Write a pipeline of the smoke yards whose annotations are a copy in a folder."""
    shutil.copytree(project / "annotations" / "smoke", folder / "annotations")
    path = folder / "pipeline.toml"
    path.write_text(
        f'name = "yards"\nseed = 7\nscene_assets = "{project / "scene_assets"}"\n'
        f'recipes = "{project / "scene_assets" / "smoke"}"\nannotations = "annotations"\n'
    )
    return path


@contextmanager
def chromium() -> Iterator[object]:
    """Start a headless Chromium with a window of 1280 × 720; skips, saying so, where there is none."""
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no Chromium here: the annotation page is NOT tested (apt-get install chromium chromium-driver)")
    from selenium import webdriver

    profile = tempfile.mkdtemp(prefix="aerialdojo-chromium-")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless=new", "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--no-first-run", "--enable-unsafe-swiftshader", "--window-size=1280,720", f"--user-data-dir={profile}",
        *(["--no-sandbox"] if os.geteuid() == 0 else []),
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    try:
        screen = {"width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        yield driver
    finally:
        driver.quit()
        shutil.rmtree(profile, ignore_errors=True)


def until(what, test, seconds: float = 40.0):
    """Wait until a test gives something true, and give it; what the page is just building anew counts as not yet."""
    from selenium.common.exceptions import NoSuchElementException, StaleElementReferenceException

    end = time.monotonic() + seconds
    while True:
        try:
            found = test()
        except (NoSuchElementException, StaleElementReferenceException):
            found = None
        if found:
            return found
        assert time.monotonic() < end, f"{what}: not within {seconds} s"
        time.sleep(0.05)
