"""Two scenes from nothing to their tasks: their tables and meshes are those of the golden file, row by row.

A change that is meant to change data changes `release.sha256` in the same commit (`digests.py` says how).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from golden.digests import digests

from aerialdojo_gen.base.rng import generator

# One of each family, with few tasks; their meshes have the same bytes on every machine that was tried. Two a day:
# `make nightly` compares the whole release.
SCENES = ("D_Flood_1", "I_Harbor_1", "N_Snowfield_0", "U_ParkingLot_1")
# What is drawn depends on the renderer and on Mesa's version, and descriptions on what the pictures show.
DRAWN = ("references/", "descriptions/", "release/objects/", "tasks/")


@pytest.mark.pipeline
def test_two_scenes_have_the_golden_rows(project: Path, tmp_path: Path) -> None:
    scenes = generator(int(os.environ["SAMPLE_SEED"]), "golden").choice(SCENES, 2, replace=False).tolist()
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "run", "pipelines/aerialdojo-200k.toml", *scenes]
    done = subprocess.run(
        [*command, "--data", str(tmp_path), "--workers", "1", "--quiet"],
        cwd=project, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    lines = Path(__file__).with_name("release.sha256").read_text().splitlines()
    golden = {what: digest for digest, what in map(str.split, lines)}
    made = {what: digest for digest, what in digests(tmp_path) if not what.startswith(DRAWN)}
    assert {what.rpartition("/")[2].removesuffix(".glb") for what in made} == set(scenes)
    assert len(made) == 2 * 16
    assert [what for what in made if made[what] != golden[what]] == []
