"""A wheel and a checkout make the same files, so that either goes on with what the other began."""

import os
import shutil
import subprocess
import sys
import zipfile

import pytest


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

    # What the checkout wrote is the wheel's own.
    pipeline = package / "_shipped" / "pipelines" / "smoke.toml"
    said = run(unpacked, "run", pipeline, "--data", data).splitlines()
    stages = [line for line in said if " rows in, " in line]
    assert len(stages) == 9
    assert all("; nothing to do; " in line for line in stages), said

    # And what the wheel writes is the checkout's own, to the last bit.
    for stage in ("build-scenes", "filter", "split"):
        assert "2 of 2 shards computed" in run(unpacked, stage, "--pipeline", pipeline, "--data", data, "--force")
    shards = sorted(path.relative_to(smoke) for path in smoke.rglob("*") if path.is_file())
    assert [path for path in shards if (data / path).read_bytes() != (smoke / path).read_bytes()] == []
