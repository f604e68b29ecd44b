"""The packages that `make env` installs and no others, taken from the environment of the tests: what a user has."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())


def make_env_extras() -> list[str]:
    """The extras that `make env` installs, by the commands that it would call."""
    commands = subprocess.run(["make", "-Bn", "env"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return re.findall(r"-e '\.\[([\w,]+)\]'", commands)[0].split(",")


def plain_site(folder: Path, extras: Iterable[str] = (), packages: Iterable[str] = ()) -> Path:
    """Link what `make env` installs into a folder, and what more extras and packages bring."""
    # Read from the file: an editable install may have been made before the file was changed.
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    of_extra = project["optional-dependencies"]
    needs = [*project["dependencies"], *packages]
    needs += [need for extra in {*make_env_extras(), *extras} for need in of_extra[extra]]
    found = {(project["name"], "")}
    _close(needs, "", found)
    folder.mkdir(parents=True)
    for name in {name for name, _ in found}:
        with suppress(metadata.PackageNotFoundError):  # an extra that the tests' environment is without
            distribution = metadata.distribution(name)
            for top in {file.parts[0] for file in distribution.files or ()} - {".."}:
                if not (folder / top).exists():
                    (folder / top).symlink_to(distribution.locate_file(top))
    return folder


def _close(needs: Iterable[str], extra: str, found: set[tuple[str, str]]) -> None:
    """Add what the needs require, and what that requires in turn."""
    for need in map(Requirement, needs):
        if need.marker is None or need.marker.evaluate({"extra": extra}):
            for asked in {(need.name, one) for one in {"", *need.extras}} - found:
                found.add(asked)
                with suppress(metadata.PackageNotFoundError):
                    _close(metadata.requires(need.name) or (), asked[1], found)


def run_plain(site: Path, script: Path, cwd: Path) -> str:
    """Run a script, and the processes that it starts, with the packages of a folder alone; gives what it prints."""
    env = os.environ | {"PYTHONPATH": f"{site}{os.pathsep}{ROOT}", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-S", script], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def as_script(text: str) -> str:
    """A script whose work the processes that it starts do not begin again; ``-S`` has left out `help`."""
    lines = ["import site", "site.sethelper()", *text.splitlines()]
    return "if __name__ == '__main__':\n" + "".join(f"    {line}\n" for line in lines)
