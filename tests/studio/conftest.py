"""What the tests of the pages share: one server of `view`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.viewing import served


@pytest.fixture(scope="session")
def view_url(smoke: Path) -> Iterator[str]:
    """The start page's address of a server of the whole smoke release."""
    with served(smoke) as url:
        yield url
