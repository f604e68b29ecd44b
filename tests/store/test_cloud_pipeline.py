"""The smoke pipeline on an S3 server, killed half-way: the same tables, meshes and recordings as on a local disk."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.command_line import called
from support.s3_server import upload

from aerialdojo_gen.dataset.contents import existing_scenes
from aerialdojo_gen.pipeline.registry import STAGES, upstream
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root

BOTH = ["U_Courtyard_0", "U_Courtyard_1"]


ANCHORED = ("meshes", "scenes", "landmarks", "objects", "chosen_anchors", "anchors", "viewpoints")


@pytest.mark.parametrize(
    ("command", "scenes", "given", "begun"),
    [
        (["plan", "--pipeline", "smoke"], BOTH[:1], ANCHORED, "pairs"),
        pytest.param(["run", "smoke"], BOTH, (), "objects", marks=pytest.mark.nightly),
    ],
    ids=["plans of one", "all of both"],
)
def test_a_killed_run_goes_on_and_gives_what_a_local_one_gives(
    cloud: str, smoke: Path, project: Path, command: list[str], scenes: list[str], given: tuple[str, ...], begun: str
) -> None:
    arguments, lease = [*command, *scenes, "--data", cloud], {"AERIALDOJO_LEASE_S": "3"}
    stages = [stage.name for stage in (STAGES if command[0] == "run" else upstream(command[0]))]
    root, local = open_root(cloud), open_root(smoke)
    upload(root, smoke, given)
    program = [sys.executable, "-m", "aerialdojo_gen.cli", *arguments, "--workers", str(len(scenes))]
    killed = subprocess.Popen(program, cwd=project, env=os.environ | lease, stderr=subprocess.DEVNULL)
    try:
        while not root.list(begun, "*/*"):
            assert killed.poll() is None, "it ended by itself"
            root.refresh()
            time.sleep(0.1)
    finally:
        killed.kill()
        killed.wait()
    done = called(*arguments, "--workers", "1", cwd=project, **lease)
    assert done.returncode == 0, done.stderr
    root.refresh()
    assert existing_scenes(root) == (scenes if "split" in stages else [])
    for table, place in store.LAYOUT.items():
        for scene in scenes if place.command in stages else []:
            assert store.content(root, table, scene) == store.content(local, table, scene), (table, scene)
    for scene in scenes:
        assert root.digest(f"meshes/{scene}.glb", reread=True) == local.digest(f"meshes/{scene}.glb")
        for row in store.read_scene(root, "recordings", scene).to_pylist() if "render" in stages else []:
            assert root.is_whole(row["path"], row["bytes"], row["sha256"], reread=True)
    again = called(*arguments, "--workers", "1", cwd=project, **lease)
    assert again.returncode == 0, again.stderr
    assert f"nothing to do: all {len(stages)} stages are up to date" in again.stderr, again.stderr
