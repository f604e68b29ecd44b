"""What the tests of the pages share: one server of `view`, and its page of the yard."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.pages import YARD, draw, ready, serving


@pytest.fixture(scope="session")
def view_url(smoke: Path) -> Iterator[str]:
    """The start page's address of a server of the whole smoke release."""
    with serving("view", "--data", smoke) as page:
        yield page.url
    assert page.out == ""


@pytest.fixture
def yard(browser: Any, view_url: str) -> Any:
    """The page of the yard, with nothing left of what another test has selected or put in place of its own."""
    address = f"{view_url}scenes/{YARD}/"
    if browser.current_url.partition("#")[0] != address:
        browser.get(address)
        ready(browser)
    browser.execute_script(
        """page.routes.ways = (window.real ??= page.routes.ways); delete page.routes.wanted;
        page.letGo(); page.mode("orbit"); page.view.home(); page.tabs.show("panel");
        page.view.setVisible("scene", true);
        for (const box of document.querySelectorAll("[data-layer]")) {
          box.checked = box.dataset.layer !== "anchors";
          page.setLayer(box.dataset.layer, box.checked);
        }"""
    )
    draw(browser, setting="", split="", modality="", target="", colour="setting", most="")
    return browser
