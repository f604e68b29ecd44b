"""A real browser for the tests of the pages."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from support import chores

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")


@contextmanager
def chromium(what: str) -> Iterator[Any]:
    """Start a headless Chromium with a window of 1024 × 576; skips where there is none, saying what is not tested."""
    if CHROMIUM is None or DRIVER is None:
        pytest.skip(f"no Chromium here: {what} is NOT tested (apt-get install chromium chromium-driver)")
    from selenium import webdriver

    profile = tempfile.mkdtemp(prefix="aerialdojo-chromium-")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless=new", "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--no-first-run", "--enable-unsafe-swiftshader", "--window-size=1024,576", f"--user-data-dir={profile}",
        # Pages of its address line, which a start would load: a second each.
        "--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup",
        *(["--no-sandbox"] if os.geteuid() == 0 else []),
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    try:
        screen = {"width": 1024, "height": 576, "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        yield driver
    finally:
        driver.quit()
        shutil.rmtree(profile, ignore_errors=True)


def as_new(driver: Any) -> None:
    """Leave the browser one empty window, no cookie, and nothing in its logs."""
    first, *others = driver.window_handles
    for handle in others:
        driver.switch_to.window(handle)
        driver.close()
    driver.switch_to.window(first)
    driver.get("about:blank")
    driver.execute_cdp_cmd("Network.clearBrowserCookies", {})
    for log in ("browser", "performance"):
        driver.get_log(log)


def until(what: str, test: Callable[[], Any], seconds: float = 60.0) -> Any:
    """Wait until a test gives something true, and give it; what the page is just building anew counts as not yet."""
    from selenium.common import exceptions

    not_yet = (
        exceptions.NoSuchElementException, exceptions.StaleElementReferenceException,
        exceptions.ElementNotInteractableException,
    )  # fmt: skip

    def tried() -> Any:
        with contextlib.suppress(*not_yet):
            return test()

    return chores.until(tried, seconds, f"{what}: not within {seconds} s")


def errors(driver: Any) -> list[str]:
    """What the page complained of on the console, less the driver's own performance hints."""
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]
