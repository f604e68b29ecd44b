"""The package's words, sizes of files and functions, and who imports what."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest

import aerialdojo_gen

PACKAGE = Path(aerialdojo_gen.__file__).parent
PYPROJECT = next(p for folder in Path(__file__).parents if (p := folder / "pyproject.toml").is_file())
LINT = Path(sys.executable).with_name("lint-imports")
MAX_LINES = 400
MAX_PARAMETERS, MAX_FUNCTION_LINES = 10, 80
# Parameters of the kit's builders are the keys of a plan's entry; compiled kernels take plain numbers and arrays.
EXEMPT_DECORATORS = re.compile(r"njit|intrinsic|(site|ground|part)_builder")
# The environment's options, all by name and all public. Those of a command, in `cli/`, are free as well.
MANY_PARAMETERS = {"benchmark/env.py __init__"}
# Names that were replaced by standard terms; none is to come back, in code or in prose.
BANNED = (
    "Asked", "Board", "Chain", "Desk", "Drafter", "Examination", "Expectation", "Given", "KeptFields", "KnownFooters",
    "Link", "Parting", "Rung", "Skinner", "TELLABLE", "TOLD_OF_DIFFICULTY", "TOLD_OF_SPLITS", "Teller", "Thought",
    "Waiting", "Wanted", "adopt", "as_given", "calling", "clarity", "digest_ahead", "footers_known", "fronting",
    "furnish", "keep_infos", "leads_out", "luck", "mends", "near_enough", "read_ahead", "redrawn", "seen_share",
    "set_out", "shut_in", "squeeze", "step_back", "too_deep", "trouble", "unready", "wade", "wild", "_told",
    "after_all", "astray", "desk", "ASKED_JPEG", "FoundTask", "Guesses", "LocationWords", "MIN_TRUE_LOOKS",
    "MOST_GUESSES", "RelationWords", "SECONDS_A_GUESS", "TELLS_WEIGHT", "Tally", "_understood", "catalogue_looks",
    "check_tell", "conduct_cells", "files_there", "foresee", "keep_fields", "keep_scene", "keep_traceback",
    "map_things", "missing_tells", "names_again", "parse_looks", "parts_there", "put_back", "relation_words",
    "relief_things", "rivals", "scenes_there", "seen_table", "settled_z", "tallies", "tally", "tally_of",
    "telling_m", "tells_difficulty", "tells_of", "things_on", "told_by_image", "true_looks", "understand",
    "valid_looks", "want_meshes", "worth_joining", "worth_tables", "Looked", "Roots", "Skins", "remembered",
)  # fmt: skip


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


class Source(NamedTuple):
    """A file of the package, its path in it, and what is found in its tree, which is walked once."""

    path: str
    text: str
    outgrown: list[str]  # Functions with too many parameters or lines
    imported: set[str]  # Absolute names of modules, wherever they are imported


def read(path: str, text: str) -> Source:
    outgrown, imported = [], set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            parameters = [
                *given.posonlyargs,
                *given.args,
                *given.kwonlyargs,
                *filter(None, (given.vararg, given.kwarg)),
            ]
            lines = node.end_lineno - node.lineno + 1
            exempt = any(EXEMPT_DECORATORS.match(ast.unparse(one)) for one in node.decorator_list)
            if not exempt and (len(parameters) > MAX_PARAMETERS or lines > MAX_FUNCTION_LINES):
                outgrown.append(node.name)
        elif isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            imported |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "import_module":
            imported |= {one.value for one in node.args if isinstance(one, ast.Constant)}
    return Source(path, text, outgrown, imported)


@pytest.fixture(scope="module")
def sources() -> list[Source]:
    return [
        read(path.relative_to(PACKAGE).as_posix(), path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")
    ]


def banned_in(text: str) -> set[str]:
    return set(re.findall(rf"\b(?:{'|'.join(BANNED)})\b", text))


def test_retired_words_stay_away(sources):
    assert banned_in("class Rung: pass\nrung = step_back_m") == {"Rung"}
    assert not {one.path: sorted(found) for one in sources if (found := banned_in(one.text))}


def test_files_and_functions_can_be_read_at_a_sitting(sources):
    assert len(sources) > 100
    assert not {one.path: lines for one in sources if (lines := len(one.text.splitlines())) > MAX_LINES}
    many, long = f"def many({', '.join('abcdefghij')}, *k): pass\n", "def long():\n" + "    pass\n" * 80
    assert read("", many + "@njit(cache=True)\n" + many + long).outgrown == ["many", "long"]
    assert read("", many.replace(", *k", "") + long.replace("    pass\n", "", 1)).outgrown == []
    found = {f"{one.path} {name}" for one in sources for name in one.outgrown if not one.path.startswith("cli/")}
    assert found == MANY_PARAMETERS


def lint(package):
    """What import-linter says of a copy of the package, by this checkout's contracts."""
    command = [LINT, "--no-cache", "--no-logo", "--config", PYPROJECT]
    env = os.environ | {"PYTHONPATH": str(package.parent)}
    return subprocess.run(command, cwd=package.parent, env=env, capture_output=True, text=True, check=False)


def test_the_contracts_hold_and_an_arrow_that_goes_up_breaks_them(tmp_path):
    copied = tmp_path / "aerialdojo_gen"
    shutil.copytree(PACKAGE, copied, ignore=shutil.ignore_patterns("__pycache__"))
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


def test_libraries_are_imported_where_they_belong(sources):
    found = {
        name: {s.path for s in sources if any(f"{m}.".startswith(f"{name}.") for m in s.imported)} for name in ONLY
    }
    for name, allowed in ONLY.items():
        assert all(where.startswith(allowed) for where in found[name]), (name, found[name])
    assert found["fcl"] == {"planning/collision.py"}
    assert found["moderngl"]
    assert found["pyarrow.parquet"]


def test_what_is_a_dependency_is_imported(sources):
    declared = tomllib.loads(PYPROJECT.read_text())["project"]["dependencies"]
    modules = {"opencv-python-headless": "cv2", "python-fcl": "fcl"}
    found = {module.partition(".")[0] for one in sources for module in one.imported}
    names = [re.split(r"[^\w-]", requirement)[0] for requirement in declared]
    assert {name for name in names if modules.get(name, name) not in found} == set()


def test_pybullet_and_language_models_packages_are_loaded_by_who_asks_for_them():
    code = (
        "import sys\n"
        "from aerialdojo_gen.rendering import backend, casters, checks, gl, picture, raycast\n"
        "from aerialdojo_gen.pipeline.stages.work import anchor_sample, reference_images, render\n"
        "from aerialdojo_gen.benchmark import observations\n"
        "from aerialdojo_gen.benchmark.llm import protocols\n"
        "assert not {'pybullet', 'openai', 'anthropic'} & set(sys.modules)\n"
        "from aerialdojo_gen.rendering import world\n"
        "assert 'pybullet' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
