"""What the tests of scenes share."""

import pytest
from support import layout_checks

from aerialdojo_gen.scenes.catalogue import Catalogue


@pytest.fixture(scope="session")
def catalogue() -> Catalogue:
    """The catalogue that ships."""
    return layout_checks.catalogue()
