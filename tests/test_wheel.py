"""A wheel and a checkout make the same files, so that either goes on with what the other began."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile

import pytest
from packaging.requirements import Requirement
from support.releases import files_of


@pytest.fixture(scope="module")
def unpacked(project, tmp_path_factory):
    """The wheel, built by its own backend and laid out as pip lays it out."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site-packages")
    # Machine code goes by the digests of its sources: what is compiled already is not compiled again.
    for kernels in (project / "aerialdojo_gen").rglob("__pycache__/kernels"):
        shutil.copytree(kernels, folder / "site-packages" / kernels.relative_to(project))
    return folder / "site-packages"


# Commands one after the other in one process; what each says on stderr is parted from the next by a line.
COMMANDS = """
import json, sys
from aerialdojo_gen.cli import app
print(app.__file__)
for words in json.loads(sys.argv[1]):
    sys.argv[1:] = words
    try:
        app.main()
    except SystemExit as ended:
        print(ended.code or 0)
    print("--", file=sys.stderr)
"""


def python(site, cwd, program, *given):
    """Run a program with the wheel's package; gives what it prints to standard output and standard error."""
    done = subprocess.run(
        [sys.executable, "-c", program, *given],
        cwd=cwd, env=os.environ | {"PYTHONPATH": str(site)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_a_wheel_finds_nothing_to_do_after_a_checkout_and_makes_the_same_bytes(unpacked, smoke, tmp_path):
    data, package = tmp_path / "data", unpacked / "aerialdojo_gen"
    shutil.copytree(smoke, data)
    # What the checkout wrote is the wheel's own, and a pipeline's name is as good as its path.
    # And what the wheel writes is the checkout's own, to the last bit.
    pipeline = package / "_shipped" / "pipelines" / "smoke.toml"
    how = ["--pipeline", str(pipeline), "--data", str(data), "--workers", "1", "--force"]
    stages = [[stage, *how] for stage in ("build-scenes", "filter", "split")]
    commands = [
        ["run", "smoke", "--data", str(data), "--verbose"],
        *stages,
        ["stats", "--data", str(tmp_path / "none")],
    ]
    out, err = python(unpacked, unpacked, COMMANDS, json.dumps(commands))
    assert out.split() == [str(package / "cli" / "app.py"), "0", "0", "0", "0", "1"], err
    first, *others, last, _ = err.split("--\n")
    lines = [line for line in first.splitlines() if " rows in, " in line]
    assert len(lines) == 10
    assert all("; nothing to do; " in line for line in lines), first
    assert all("2 of 2 shards computed" in said for said in others)
    shards = sorted(path.relative_to(smoke) for path in smoke.rglob("*") if path.is_file())
    assert [path for path in shards if (data / path).read_bytes() != (smoke / path).read_bytes()] == []
    # Where no release is, the wheel advises what it has.
    assert last.endswith("or make one with aerialdojo-gen run aerialdojo-200k\n")


def test_a_wheel_carries_the_checkouts_pipelines_recipes_plans_and_annotations(unpacked, project):
    for name in ("annotations", "pipelines", "scene_assets"):
        assert files_of(unpacked / "aerialdojo_gen" / "_shipped" / name) == files_of(project / name), name


@pytest.mark.parametrize(
    ("version", "there", "not_there"), [("3.11", "pybullet", "moderngl"), ("3.12", "moderngl", "pybullet"),
                                        ("3.13", "moderngl", "pybullet")]
)  # fmt: skip
def test_there_is_a_renderer_for_every_python(project, version, there, not_there):
    """PyBullet has wheels up to 3.11: later it is an extra, and OpenGL comes in its place."""
    known = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found = {one.name for one in map(Requirement, known["dependencies"])
             if one.marker is None or one.marker.evaluate({"python_version": version})}  # fmt: skip
    assert there in found
    assert not_there not in found
    assert Requirement(*known["optional-dependencies"]["pybullet"]).name == "pybullet"
    assert f"Programming Language :: Python :: {version}" in known["classifiers"]


def test_without_pybullet_opengl_draws_and_who_asks_for_pybullet_gets_a_line(project):
    text = """
import sys
sys.modules["pybullet"] = None  # as where it is not installed
from aerialdojo_gen.rendering.backend import choose_renderer
assert choose_renderer("auto").name == "gl"
from aerialdojo_gen.rendering.gallery import look_at
from aerialdojo_gen.rendering.backend import probe_scene
assert look_at(probe_scene(), (-6, -6, 6), (0, 0, 1), 32, 24).std() > 5
from aerialdojo_gen.base.errors import RenderError
try:
    choose_renderer("pybullet")
except RenderError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", text], cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert "pip install 'aerialdojo-gen[pybullet]'" in done.stdout
