"""Which module may import which: the contracts in pyproject.toml hold, leave nothing out, and can fail."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import aerialdojo_gen

PACKAGE = Path(aerialdojo_gen.__file__).parent
PYPROJECT = next(p for folder in Path(__file__).parents if (p := folder / "pyproject.toml").is_file())
LINT = Path(sys.executable).with_name("lint-imports")

# Who may name a third-party module, also inside a function or by `importlib`. import-linter knows packages alone, and
# not what is imported by a name in a string.
ONLY = {
    "pyarrow.parquet": ("store/",),
    "pyarrow.dataset": ("store/",),
    "pybullet": ("rendering/",),
    "pybullet_data": ("rendering/",),
    "moderngl": ("rendering/",),
    "fcl": ("planning/collision.py",),
}


def lint(package):
    """What import-linter says of a copy of the package, by this checkout's contracts."""
    command = [LINT, "--no-cache", "--no-logo", "--config", PYPROJECT]
    env = os.environ | {"PYTHONPATH": str(package.parent)}
    return subprocess.run(command, cwd=package.parent, env=env, capture_output=True, text=True, check=False)


def imported(tree):
    """Absolute names of modules that a source imports, wherever it does."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "import_module":
            yield from (a.value for a in node.args if isinstance(a, ast.Constant))


@pytest.fixture(scope="module")
def of_files():
    """What every source of the package imports, by its path."""
    return {
        path.relative_to(PACKAGE).as_posix(): set(imported(ast.parse(path.read_bytes())))
        for path in PACKAGE.rglob("*.py")
    }


@pytest.fixture
def copied(tmp_path):
    for path in PACKAGE.rglob("*.py"):
        target = tmp_path / "aerialdojo_gen" / path.relative_to(PACKAGE)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return tmp_path / "aerialdojo_gen"


def test_the_contracts_hold_and_an_arrow_that_goes_up_breaks_them(copied):
    result = lint(copied)
    assert result.returncode == 0, result.stdout
    assert "0 broken" in result.stdout
    with (copied / "geometry" / "soup.py").open("a") as file:
        file.write("\n\ndef up():\n    from aerialdojo_gen.planning import collision\n\n    return collision\n")
    with (copied / "dataset" / "validate" / "descriptions.py").open("a") as file:
        file.write("\nimport fcl\n")
    result = lint(copied)
    assert result.returncode == 1
    assert "2 broken" in result.stdout
    assert "aerialdojo_gen.geometry is not allowed to import aerialdojo_gen.planning" in " ".join(
        result.stdout.split()
    )


def test_every_module_stands_in_a_layer():
    contracts = tomllib.loads(PYPROJECT.read_text())["tool"]["importlinter"]["contracts"]
    layers = next(c for c in contracts if c["type"] == "layers")["layers"]
    listed = {name.strip() for layer in layers for name in layer.split("|")}
    modules = {
        ".".join((p.parent if p.stem == "__init__" else p.with_suffix("")).relative_to(PACKAGE).parts)
        for p in PACKAGE.rglob("*.py")
    }
    # The package itself and `pipeline` itself import nothing of the package that stands in a layer above their users.
    left = {m for m in modules - {"", "pipeline"} if not any(f"{m}.".startswith(f"{name}.") for name in listed)}
    assert not left
    assert listed <= modules


def test_libraries_are_imported_where_they_belong(of_files):
    found = {name: set() for name in ONLY}
    for relative, modules in of_files.items():
        for module in modules:
            for name in ONLY:
                if f"{module}.".startswith(f"{name}."):
                    found[name].add(relative)
    for name, allowed in ONLY.items():
        assert all(where.startswith(allowed) for where in found[name]), (name, found[name])
    assert found["fcl"] == {"planning/collision.py"}
    assert found["moderngl"]
    assert found["pyarrow.parquet"]


def test_what_is_a_dependency_is_imported(of_files):
    declared = tomllib.loads(PYPROJECT.read_text())["project"]["dependencies"]
    modules = {"opencv-python-headless": "cv2", "python-fcl": "fcl"}
    found = {module.partition(".")[0] for modules in of_files.values() for module in modules}
    names = [re.split(r"[^\w-]", requirement)[0] for requirement in declared]
    unused = {name for name in names if modules.get(name, name) not in found}
    assert not unused


def test_pybullet_and_language_models_packages_are_loaded_by_who_asks_for_them():
    code = (
        "import sys\n"
        "from aerialdojo_gen.rendering import backend, casters, checks, gl, picture, raycast\n"
        "from aerialdojo_gen.pipeline.stages.work import anchor_sample, reference_images, render\n"
        "from aerialdojo_gen.benchmark import observations\n"
        "from aerialdojo_gen.benchmark.llm import anthropic_agent, openai_agent\n"
        "assert not {'pybullet', 'openai', 'anthropic'} & set(sys.modules)\n"
        "from aerialdojo_gen.rendering import world\n"
        "assert 'pybullet' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
