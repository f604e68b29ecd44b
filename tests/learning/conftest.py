"""What the trainings of the tests have in common."""

import pytest


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A folder of what is drawn for the trainings of a module."""
    return tmp_path_factory.mktemp("drawn")
