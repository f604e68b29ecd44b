"""Machine code that is kept: never older than the sources that it was made of, and wherever this user can write."""

import os
import re
import shutil
import stat
import subprocess
import sys
import time
import zipfile

import pytest

# `fly` calls `wrap_one_rad`, which another module defines that has no kernels of its own.
FLY = """
import numpy as np
from aerialdojo_gen.geometry.motion import fly
print(float(fly(np.array([0.0, 0.0, 0.0, 4.0]), np.array([1], np.int8))[0, 3]))
"""
PACK = """
import sys
from pathlib import Path
from aerialdojo_gen.pipeline.executors.bundled import pack
pack(Path(sys.argv[1]), [])
"""
# What a run says that it compiles, before and after.
UNCOMPILED = """
import numpy as np
from aerialdojo_gen.pipeline.runner import uncompiled
print(uncompiled(["filter", "split"]))
from aerialdojo_gen.geometry import surface
surface._distances(np.zeros((1, 3)), np.ones((1, 9)), np.zeros((1, 4)))
print(uncompiled(["filter", "split"]))
"""
WRAPPED = "-2.2831853071795862\n"
# Append to every module that importing one has loaded, and see whether the folder's name tells.
UNSEEN = """
import importlib, sys
from pathlib import Path
from aerialdojo_gen.base import kernel_cache
source = Path(importlib.import_module(sys.argv[1]).__file__)
for name, module in sorted(sys.modules.items()):
    path = Path(module.__file__ or "") if name.startswith("aerialdojo_gen.") else Path()
    if path.suffix != ".py" or path.name == "__init__.py" or name.startswith(("aerialdojo_gen.base.kernel",
                                                                              "aerialdojo_gen.base.version")):
        continue
    kernel_cache._read.cache_clear()
    before = kernel_cache.folder_name(source)
    path.write_text(path.read_text() + "# changed")
    kernel_cache._read.cache_clear()
    print(name, "seen" if kernel_cache.folder_name(source) != before else "UNSEEN")
"""


@pytest.fixture
def package(project, tmp_path):
    """A copy of the package without anything compiled."""
    return shutil.copytree(
        project / "aerialdojo_gen", tmp_path / "aerialdojo_gen", ignore=shutil.ignore_patterns("__pycache__")
    )


def python(package, code, *args, **variables):
    environment = {name: text for name, text in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1", **variables}
    return subprocess.run(
        [sys.executable, "-c", code, *args], env=environment, cwd=package.parent, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip


def fly(package, **variables):
    done = python(package, FLY, **variables)
    assert done.returncode == 0, done.stderr
    return done.stdout


def compiled(folder):
    return {p.relative_to(folder): p.stat().st_mtime_ns for p in folder.rglob("*.nbc")}


def test_a_stage_is_to_be_compiled_until_it_has_machine_code(package):
    done = python(package, UNCOMPILED)
    assert done.stdout == "['filter', 'split']\n['split']\n", done.stderr


@pytest.mark.slow
def test_a_caller_of_a_changed_function_is_compiled_again(package, tmp_path):
    assert fly(package) == WRAPPED
    first = compiled(package)
    assert first
    assert fly(package) == WRAPPED
    assert compiled(package) == first, "what is compiled is used again"
    # As where a user cannot write beside the package: what is compiled there is taken over.
    assert fly(package, NUMBA_CACHE_DIR=str(tmp_path / "mine")) == WRAPPED
    taken = compiled(tmp_path / "mine")
    assert {(p.name, when) for p, when in taken.items()} == {(p.name, when) for p, when in first.items()}
    frames = package / "geometry" / "frames.py"
    changed = re.sub(r"(def wrap_one_rad\(.*\n)", r"\1    return 7.0\n", source := frames.read_text())
    assert changed != source
    frames.write_text(changed)
    # Nobody has used one of the old folders for two days.
    (unused,) = package.glob("geometry/__pycache__/kernels/frames-*")
    os.utime(unused, (old := time.time() - 2 * 24 * 3600, old))
    assert fly(package) == "7.0\n"
    assert not unused.exists()
    second = compiled(package)
    assert first.keys() & second.keys(), "others stay: a process that has begun may use them"
    # To the machines of a cluster goes what was compiled of these sources.
    done = python(package, PACK, str(tmp_path / "pack.zip"))
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(tmp_path / "pack.zip") as archive:
        archive.extractall(tmp_path / "node")
    there = compiled(tmp_path / "node" / "aerialdojo_gen")
    assert there.keys() == second.keys() - first.keys()
    assert fly(tmp_path / "node" / "aerialdojo_gen") == "7.0\n"
    assert compiled(tmp_path / "node" / "aerialdojo_gen") == there


@pytest.mark.parametrize("module", ["aerialdojo_gen.planning.attempt", "aerialdojo_gen.rendering.world"])
def test_every_source_of_a_module_counts(package, module):
    done = python(package, UNSEEN, module)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) > 10
    assert "UNSEEN" not in done.stdout


@pytest.mark.slow
def test_where_package_and_home_cannot_be_written_a_private_folder_is_used(package, tmp_path):
    """Files in the place of folders: permissions do not bind who runs tests as root."""
    for folder in ("geometry", "base"):
        (package / folder / "__pycache__").touch()
    (tmp_path / "tmp").mkdir()
    place = {"HOME": os.devnull, "XDG_CACHE_HOME": "", "TMPDIR": str(tmp_path / "tmp")}
    assert fly(package, **place) == WRAPPED
    (own,) = (tmp_path / "tmp").glob("aerialdojo-gen-*")
    assert stat.S_IMODE(own.stat().st_mode) == 0o700
    first = compiled(own)
    assert first
    assert fly(package, **place) == WRAPPED
    assert compiled(own) == first
    # A folder that others can write may hold anybody's code.
    own.chmod(0o777)
    refused = python(package, FLY, **place)
    assert refused.returncode == 1
    assert refused.stdout == ""
    last = refused.stderr.splitlines()[-1]
    assert re.search(r"UsageError: no place for compiled code: .*/geometry/__pycache__, .*NUMBA_CACHE_DIR", last)
