"""What several test files share."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from support.planting import Planted


@pytest.fixture(scope="session")
def project() -> Path:
    """The checkout's folder."""
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def smoke(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data directory of a whole run of pipelines/smoke.toml, shared by the test processes of a session."""
    # xdist's processes have one parent folder in common: the first to come makes the data, the others wait.
    shared = tmp_path_factory.getbasetemp().parent if os.environ.get("PYTEST_XDIST_WORKER") else None
    data = (shared or tmp_path_factory.getbasetemp()) / "smoke-data"
    with data.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        command = [sys.executable, "-m", "aerialdojo_gen.cli", "run", "pipelines/smoke.toml", "--data", str(data)]
        done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    return data


@pytest.fixture
def planted(smoke: Path, tmp_path: Path) -> Planted:
    """A copy of the smoke run's release and meshes, to plant faults in; its scene is U_Courtyard_0."""
    from support.planting import Planted

    shutil.copytree(smoke / "release", tmp_path / "data" / "release")
    shutil.copytree(smoke / "meshes", tmp_path / "data" / "meshes")
    return Planted(tmp_path / "data", "U_Courtyard_0")
