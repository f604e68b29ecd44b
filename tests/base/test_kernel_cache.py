"""Machine code that is kept: never older than the sources that it was made of, and wherever this user can write."""

import os
import shutil
import stat
import subprocess
import sys
import time
import zipfile

import pytest

# Two modules of a copy of the package: a kernel, and a function that it calls, of a module without kernels.
CALLED = """
from aerialdojo_gen.base.kernels import njit
@njit
def called():
    return 1
"""
KERNEL = """
from aerialdojo_gen.base.called import called
from aerialdojo_gen.base.kernels import njit
@njit(cache=True)
def kernel():
    return called()
"""
CALL = "from aerialdojo_gen.base.kernel import kernel; print(kernel())"
PACK = """
import sys
from pathlib import Path
from aerialdojo_gen.pipeline.executors.ray_worker import pack
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
# Append to every module that importing one has loaded, and see whether the folder's name tells.
UNSEEN = """
import importlib, sys
from pathlib import Path
from aerialdojo_gen.base import kernel_cache
source = Path(importlib.import_module("aerialdojo_gen.planning.attempt").__file__)
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
    package = shutil.copytree(
        project / "aerialdojo_gen", tmp_path / "aerialdojo_gen", ignore=shutil.ignore_patterns("__pycache__")
    )
    (package / "base" / "called.py").write_text(CALLED)
    (package / "base" / "kernel.py").write_text(KERNEL)
    return package


def python(package, code, *args, fails=False, **variables):
    environment = {name: text for name, text in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1", **variables}
    done = subprocess.run(
        [sys.executable, "-c", code, *args], env=environment, cwd=package.parent, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == fails, done.stderr
    return done.stderr if fails else done.stdout


def compiled(folder):
    return {p.relative_to(folder): p.stat().st_mtime_ns for p in folder.rglob("*.nbc")}


@pytest.mark.slow
def test_a_stage_is_to_be_compiled_until_it_has_machine_code(package):
    assert python(package, UNCOMPILED) == "['filter', 'split']\n['split']\n"


@pytest.mark.slow
def test_a_caller_of_a_changed_function_is_compiled_again(package, tmp_path):
    assert python(package, CALL) == "1\n"
    first = compiled(package)
    assert first
    assert python(package, CALL) == "1\n"
    assert compiled(package) == first, "what is compiled is used again"
    # As where a user cannot write beside the package: what is compiled there is taken over.
    assert python(package, CALL, NUMBA_CACHE_DIR=str(tmp_path / "mine")) == "1\n"
    taken = compiled(tmp_path / "mine")
    assert {(p.name, when) for p, when in taken.items()} == {(p.name, when) for p, when in first.items()}
    (package / "base" / "called.py").write_text(CALLED.replace("1", "7"))
    # Nobody has used the old folder for two days.
    (unused,) = package.glob("base/__pycache__/kernels/kernel-*")
    recent = shutil.copytree(unused, unused.with_name("kernel-recent"))
    os.utime(unused, (old := time.time() - 2 * 24 * 3600, old))
    assert python(package, CALL) == "7\n"
    assert not unused.exists()
    assert recent.exists(), "a process that has begun may use it"
    # To the machines of a cluster goes what was compiled of these sources.
    python(package, PACK, str(tmp_path / "pack.zip"))
    with zipfile.ZipFile(tmp_path / "pack.zip") as archive:
        archive.extractall(tmp_path / "node")
    there = compiled(tmp_path / "node" / "aerialdojo_gen")
    assert there.keys() == {path for path in compiled(package) if recent.name not in path.parts} != set()
    assert python(tmp_path / "node" / "aerialdojo_gen", CALL) == "7\n"
    assert compiled(tmp_path / "node" / "aerialdojo_gen") == there


@pytest.mark.slow
def test_every_source_of_a_module_counts(package):
    seen = python(package, UNSEEN)
    assert len(seen.splitlines()) > 10
    assert "UNSEEN" not in seen


@pytest.mark.slow
def test_where_package_and_home_cannot_be_written_a_private_folder_is_used(package, tmp_path):
    """Files in the place of folders: permissions do not bind who runs tests as root."""
    (package / "base" / "__pycache__").touch()
    (tmp_path / "tmp").mkdir()
    place = {"HOME": os.devnull, "XDG_CACHE_HOME": "", "TMPDIR": str(tmp_path / "tmp")}
    assert python(package, CALL, **place) == "1\n"
    (own,) = (tmp_path / "tmp").glob("aerialdojo-gen-*")
    assert stat.S_IMODE(own.stat().st_mode) == 0o700
    first = compiled(own)
    assert first
    assert python(package, CALL, **place) == "1\n"
    assert compiled(own) == first
    # A folder that others can write may hold anybody's code.
    own.chmod(0o777)
    last = python(package, CALL, fails=True, **place).splitlines()[-1]
    assert "UsageError: no place for compiled code: " in last
    assert "/base/__pycache__, " in last
    assert "NUMBA_CACHE_DIR" in last
