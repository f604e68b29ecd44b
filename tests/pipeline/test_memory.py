"""What stages declare as their memory, on the scene that takes most."""

import os
import subprocess
import sys

import pytest

from aerialdojo_gen.pipeline.registry import STAGES


@pytest.mark.nightly
def test_the_largest_scene_takes_no_more_memory_than_its_stages_declare(tmp_path):
    """One process makes U_Mall_0 up to `plan`, as a worker does that a cluster gives the largest declared memory."""
    declared_mb = max(stage.memory_mb for stage in STAGES)
    command = ["plan", "--scene", "U_Mall_0", "--pipeline", "pipelines/aerialdojo-200k.toml", "--workers", "1"]
    process = subprocess.Popen([sys.executable, "-m", "aerialdojo_gen.cli", *command, "--data", str(tmp_path)])
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0
    assert 300 < usage.ru_maxrss / 1024 <= declared_mb
