"""`make env` that is killed while it makes the environment: the next one makes it."""

import os
import shutil
import signal
import subprocess
import sys

import pytest
from support.chores import until


@pytest.mark.kill
@pytest.mark.nightly
def test_an_environment_that_was_killed_in_its_making_is_made_anew(project, tmp_path):
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(project / name, tmp_path)
    # Nothing is to be installed: without an index both installers end at once.
    offline = {
        "UV_OFFLINE": "1",
        "UV_NO_CACHE": "1",
        "PIP_NO_INDEX": "1",
        "PIP_FIND_LINKS": "",
        "PIP_CONFIG_FILE": os.devnull,
    }
    command = ["make", "env", f"PYTHON={sys.executable}"]

    def start():
        return subprocess.Popen(
            command, cwd=tmp_path, env=os.environ | offline, text=True, start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip

    process = start()
    python = tmp_path / ".venv" / "bin" / "python"
    until(lambda: python.exists() or process.poll() is not None, 300)
    os.killpg(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    pip = [python, "-m", "pip", "--version"]
    assert subprocess.run(pip, capture_output=True).returncode != 0, "killed before pip was there"
    said, _ = start().communicate(timeout=600)
    assert subprocess.run(pip, capture_output=True).returncode == 0, said
    assert "No module named pip" not in said
    assert "error: a package could not be installed, see above" in said
