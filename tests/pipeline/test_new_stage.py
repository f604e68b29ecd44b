"""A new stage is a module, a schema and a row of the registry, and nothing else: CONTRIBUTING's example, run."""

import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import aerialdojo_gen

PACKAGE = Path(aerialdojo_gen.__file__).parent
CHECKOUT = next(folder for folder in Path(__file__).parents if (folder / "pyproject.toml").is_file())
SCENE = "U_Courtyard_0"

# The example of CONTRIBUTING, as it stands there.
MODULE, SCHEMA, ROW = re.findall(r"```python\n(.*?)```", (CHECKOUT / "CONTRIBUTING.md").read_text(), re.DOTALL)[:3]


@pytest.fixture
def checkout(tmp_path):
    """A checkout of which only the package is a copy, with one stage more."""
    for path in PACKAGE.rglob("*"):
        if path.is_file() and path.suffix in (".py", ".toml", ".csv"):
            target = tmp_path / "aerialdojo_gen" / path.relative_to(PACKAGE)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    for folder in ("scene_assets", "annotations", "pipelines"):
        (tmp_path / folder).symlink_to(CHECKOUT / folder)
    package = tmp_path / "aerialdojo_gen"
    (package / "pipeline" / "stages" / "work" / "tally.py").write_text(MODULE)
    replaced(package / "store" / "schemas" / "staged.py", "STAGED = (", f"{SCHEMA}\n\nSTAGED = (")
    replaced(package / "store" / "schemas" / "staged.py", "VERDICTS)", "VERDICTS, TALLIES)")
    replaced(package / "pipeline" / "registry.py", "\n)\n\nBY_NAME", f"\n    {ROW.strip()},\n)\n\nBY_NAME")
    return tmp_path


def replaced(path, old, new):
    text = path.read_text()
    assert text.count(old) == 1, (path, old)
    path.write_text(text.replace(old, new))


def call(checkout, *args):
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *args]
    env = os.environ | {"PYTHONPATH": str(checkout), "COLUMNS": "200"}
    done = subprocess.run(command, cwd=checkout, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_a_new_stage_is_a_module_a_schema_and_a_row(checkout):
    tally = ("tally", "--scene", SCENE, "--data", "data", "--workers", "1", "--pipeline", "pipelines/smoke.toml")
    assert "1 of 1 shards computed" in call(checkout, *tally)
    rows = pq.read_table(checkout / "data" / "tallies" / SCENE).to_pylist()
    scenes = pq.read_table(checkout / "data" / "scenes" / SCENE).to_pylist()
    assert sum(row["things"] for row in rows) == scenes[0]["n_instances"]
    assert len(rows) == scenes[0]["n_categories"] == len(Counter(row["category"] for row in rows))
    # It follows its own code; that a line of the table of stages makes nothing stale, test_code_digest tells.
    module = checkout / "aerialdojo_gen" / "pipeline" / "stages" / "work" / "tally.py"
    replaced(module, '"things": n}', '"things": n + 1}')
    assert "tally: " in (said := call(checkout, *tally))
    assert said.count("1 of 1 shards computed") == 1
    assert pq.read_table(checkout / "data" / "tallies" / SCENE)["things"].to_pylist() == [
        r["things"] + 1 for r in rows
    ]
