"""A new stage is a module, a schema and a row of the registry, and nothing else: CONTRIBUTING's example, run."""

import os
import re
import shutil
import subprocess
import sys
from collections import Counter

import pyarrow.parquet as pq

SCENE = "U_Courtyard_0"


def replaced(path, old, new):
    text = path.read_text()
    assert text.count(old) == 1, (path, old)
    path.write_text(text.replace(old, new))


def test_a_new_stage_is_a_module_a_schema_and_a_row(project, smoke, tmp_path):
    module, schema, row = re.findall(r"```python\n(.*?)```", (project / "CONTRIBUTING.md").read_text(), re.DOTALL)[:3]
    # A checkout of which only the package is a copy, with its bytecode, and two tables of the smoke run.
    without = shutil.ignore_patterns("kernels")
    package = shutil.copytree(project / "aerialdojo_gen", tmp_path / "aerialdojo_gen", ignore=without)
    for folder in ("scene_assets", "annotations", "pipelines"):
        (tmp_path / folder).symlink_to(project / folder)
    for folder in ("meshes", "scenes"):
        shutil.copytree(smoke / folder, tmp_path / "data" / folder)
    (package / "pipeline" / "stages" / "work" / "count_things.py").write_text(module)
    staged = package / "store" / "schemas" / "staged.py"
    names = re.search(r"STAGED = \(([^)]*)\)", staged.read_text())[1]
    replaced(staged, f"STAGED = ({names})", f"{schema}\n\nSTAGED = ({names}, THING_COUNTS)")
    replaced(package / "pipeline" / "registry.py", "\n)  # fmt: skip", f"\n    {row.strip()},\n)")

    options = f"--scene {SCENE} --data data --workers 1 --pipeline pipelines/smoke.toml".split()
    env = os.environ | {"PYTHONPATH": str(tmp_path), "COLUMNS": "200"}
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "count-things", *options]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # Of the stages before nothing is stale; that the new one follows its own code, test_code_digest tells.
    assert re.findall(r"(\S+): .* (\d+) of 1 shards computed", done.stderr) == [("count-things", "1")]
    rows = pq.read_table(tmp_path / "data" / "thing_counts" / SCENE).to_pylist()
    (scene,) = pq.read_table(smoke / "scenes" / SCENE).to_pylist()
    assert sum(row["things"] for row in rows) == scene["n_instances"]
    assert len(rows) == scene["n_categories"] == len(Counter(row["category"] for row in rows))
