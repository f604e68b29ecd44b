"""A wheel and a checkout make the same files, so that either goes on with what the other began."""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile

import pytest
from packaging.requirements import Requirement


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


def run(site, *args):
    done = subprocess.run(
        [sys.executable, "-m", "aerialdojo_gen.cli", *map(str, args)],
        cwd=site, env=os.environ | {"PYTHONPATH": str(site)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_a_wheel_finds_nothing_to_do_after_a_checkout_and_makes_the_same_bytes(unpacked, smoke, tmp_path):
    data, package = tmp_path / "data", unpacked / "aerialdojo_gen"
    shutil.copytree(smoke, data)
    where = "import aerialdojo_gen; print(aerialdojo_gen.__file__)"
    env = os.environ | {"PYTHONPATH": str(unpacked)}
    found = subprocess.run([sys.executable, "-c", where], cwd=unpacked, env=env, capture_output=True, text=True)
    assert found.stdout.strip() == str(package / "__init__.py")

    # What the checkout wrote is the wheel's own, and a pipeline's name is as good as its path.
    pipeline = package / "_shipped" / "pipelines" / "smoke.toml"
    said = run(unpacked, "run", "smoke", "--data", data, "--verbose").splitlines()
    stages = [line for line in said if " rows in, " in line]
    assert len(stages) == 10
    assert all("; nothing to do; " in line for line in stages), said

    # And what the wheel writes is the checkout's own, to the last bit.
    how = ("--pipeline", pipeline, "--data", data, "--workers", "1", "--force")
    for stage in ("build-scenes", "filter", "split"):
        assert "2 of 2 shards computed" in run(unpacked, stage, *how)
    shards = sorted(path.relative_to(smoke) for path in smoke.rglob("*") if path.is_file())
    assert [path for path in shards if (data / path).read_bytes() != (smoke / path).read_bytes()] == []


def test_every_pipeline_that_is_shipped_goes_by_its_name(unpacked, project):
    env = os.environ | {"PYTHONPATH": str(unpacked)}
    names = sorted(path.stem for path in (project / "pipelines").glob("*.toml"))
    assert {"smoke", "aerialdojo-200k"} <= set(names)
    text = "import sys; from aerialdojo_gen.dataset.build import open_pipeline as o; "
    text += "print(*[o(name, 'd')[0].name for name in sys.argv[1:]])"
    done = subprocess.run(
        [sys.executable, "-c", text, *names], cwd=unpacked, env=env, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == names


def test_a_recipe_that_is_shipped_goes_by_its_name_anywhere(unpacked, project, tmp_path):
    text = "import sys; from aerialdojo_gen.learning.recipe import load_recipe as o\n"
    text += "for name in sys.argv[1:]: print(o(name).model_dump_json())"
    env = os.environ | {"PYTHONPATH": str(unpacked)}

    def read(*given):
        return subprocess.run(
            [sys.executable, "-c", text, *given], cwd=tmp_path, env=env, capture_output=True, text=True, check=False
        )

    done = read("imitation", "imitation.toml", str(project / "pipelines" / "baselines" / "imitation.toml"))
    assert len(done.stdout.splitlines()) == 3, done.stderr
    assert len(set(done.stdout.splitlines())) == 1
    (tmp_path / "imitation").write_text('name = "mine"\n')  # a file goes before a name
    assert '"name":"mine"' in read("imitation").stdout
    told = read("imitatoin").stderr
    assert (
        "no recipe imitatoin; by name, as in aerialdojo-gen train imitation: adapt, adapt-mall, blind, imitation"
        in told
    )


def test_where_no_release_is_the_wheel_advises_what_it_has(unpacked, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "aerialdojo_gen.cli", "stats", "--data", str(tmp_path / "none")],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(unpacked)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.endswith("or make one with aerialdojo-gen run aerialdojo-200k\n")


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
