"""What is installed and run from elsewhere is named by its content, not by a name that can be given anew."""

import re
import tomllib

import pytest

ACTION = re.compile(r"[\w.-]+/[\w./-]+@[0-9a-f]{40}")
IMAGE = re.compile(r"[\w./:-]+@sha256:[0-9a-f]{64}")


def test_actions_and_images_are_named_by_digest(project):
    workflows = "".join(p.read_text() for p in sorted((project / ".github" / "workflows").glob("*.yml")))
    actions = re.findall(r"uses: (\S+)", workflows)
    assert actions
    assert [name for name in actions if not ACTION.fullmatch(name)] == []
    images = re.findall(r"image: (\S+)", workflows)
    images += re.findall(r"^FROM (\S+)", (project / "Dockerfile").read_text(), re.M)
    assert len(images) == 4
    assert [name for name in images if not IMAGE.fullmatch(name)] == []


def test_every_package_is_pinned_with_hashes(project):
    entries = re.split(r"\n(?=\S)", (project / "constraints.txt").read_text().strip())
    assert len(entries) > 200
    pin = re.compile(r"[\w.-]+==[^\s;]+( ; [^\\]+)?( \\\n +--hash=sha256:[0-9a-f]{64})+")
    assert [entry.splitlines()[0] for entry in entries if not pin.fullmatch(entry)] == []


@pytest.mark.parametrize("python", ["3.11", "3.12", "3.13"])
def test_what_is_declared_is_pinned_within_its_range(project, python):
    from packaging.markers import default_environment
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    environment = default_environment() | {"python_version": python, "python_full_version": f"{python}.0"}
    declared = tomllib.loads((project / "pyproject.toml").read_text())
    pins = {}
    for line in re.findall(r"^(\S+==[^\\\n]+)", (project / "constraints.txt").read_text(), re.M):
        pin = Requirement(line)
        if pin.marker is None or pin.marker.evaluate(environment):
            pins[pin.name] = next(iter(pin.specifier)).version
    extras = declared["project"]["optional-dependencies"]
    wanted = [*declared["project"]["dependencies"], *extras["gl"], *extras["web"], *extras["dev"], *extras["docs"]]
    for requirement in map(Requirement, [*declared["build-system"]["requires"], *wanted]):
        name = canonicalize_name(requirement.name)
        if name != "aerialdojo-gen" and (requirement.marker is None or requirement.marker.evaluate(environment)):
            assert name in pins, requirement
            assert requirement.specifier.contains(pins[name]), requirement
    assert all("==" in requirement for requirement in declared["build-system"]["requires"])
