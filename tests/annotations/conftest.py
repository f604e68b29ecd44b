"""What the tests of annotations share."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue


@pytest.fixture(scope="session")
def catalogue(project: Path) -> Catalogue:
    return load_catalogue(project / "scene_assets")
