"""The smoke pipeline on an S3 server, killed half-way: the same tables, meshes and recordings as on a local disk."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.command_line import called

from aerialdojo_gen.dataset.contents import existing_scenes
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root

BOTH = ["U_Courtyard_0", "U_Courtyard_1"]


@pytest.mark.parametrize("scenes", [BOTH[:1], pytest.param(BOTH, marks=pytest.mark.nightly)], ids=["one", "both"])
def test_a_killed_run_goes_on_and_gives_what_a_local_one_gives(
    cloud: str, smoke: Path, project: Path, scenes: list[str]
) -> None:
    arguments, lease = ["run", "pipelines/smoke.toml", *scenes, "--data", cloud], {"AERIALDOJO_LEASE_S": "3"}
    root, local = open_root(cloud), open_root(smoke)
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *arguments, "--workers", "2"]
    killed = subprocess.Popen(command, cwd=project, env=os.environ | lease, stderr=subprocess.DEVNULL)
    try:
        while not root.list("anchors", "*/*"):
            assert killed.poll() is None, "it ended by itself"
            root.refresh()
            time.sleep(0.1)
    finally:
        killed.kill()
        killed.wait()
    done = called(*arguments, "--workers", "1", cwd=project, **lease)
    assert done.returncode == 0, done.stderr
    root.refresh()
    assert existing_scenes(root) == scenes
    for table, place in store.LAYOUT.items():
        for scene in scenes if place.command != "evaluate" else []:
            assert store.content(root, table, scene) == store.content(local, table, scene), (table, scene)
    for scene in scenes:
        assert root.digest(f"meshes/{scene}.glb", reread=True) == local.digest(f"meshes/{scene}.glb")
        for row in store.read_scene(root, "recordings", scene, ["path", "bytes", "sha256"]).to_pylist():
            assert root.is_whole(row["path"], row["bytes"], row["sha256"], reread=True)
    again = called(*arguments, "--workers", "1", cwd=project, **lease)
    assert again.returncode == 0, again.stderr
    assert "nothing to do: all 10 stages are up to date" in again.stderr, again.stderr
