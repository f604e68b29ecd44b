"""Names and paths of the package that documents and docstrings speak of exist."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
PACKAGE = ROOT / "aerialdojo_gen"
# What is past is named as it was.
PAGES = sorted(
    {p for p in ROOT.glob("*.md") if p.name != "CHANGELOG.md"}
    | {*ROOT.glob("docs/*.md"), ROOT / "scene_assets/README.md", ROOT / "annotations/README.md"}
)
SOURCES = sorted(PACKAGE.rglob("*.py"))
DOTTED = re.compile(r"\baerialdojo_gen(?:\.[A-Za-z_]\w*)+")
SLASHED = re.compile(r"\baerialdojo_gen/[\w./-]*[\w/]")
# `config/sections.py`, `terrain.py`: of the package, or of the checkout.
FILE = re.compile(r"`([\w./-]*\w\.(?:py|toml))`")
FENCED = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)


@cache
def defined(path: Path) -> dict[str, ast.AST]:
    """What a module or package defines or imports at its top, conditions included."""
    names: dict[str, ast.AST] = {}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names |= {(alias.asname or alias.name).partition(".")[0]: node for alias in node.names}
        elif isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.setdefault(node.name, node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {target.id: node for target in targets if isinstance(target, ast.Name)}
    return names


def resolves(dotted: str) -> bool:
    """Follow a dotted name as far as it is packages and modules, then as names in the last of them."""
    at, parts = PACKAGE, dotted.split(".")[1:]
    while parts and (at / parts[0]).is_dir():
        at, parts = at / parts[0], parts[1:]
    module = at / "__init__.py"
    if parts and (at / f"{parts[0]}.py").is_file():
        module, parts = at / f"{parts[0]}.py", parts[1:]
    return not parts or parts[0] in {*defined(module), "__all__", "__file__", "__version__"}


def test_names_are_told_from_what_is_no_name():
    assert resolves("aerialdojo_gen.base.names.unknown")
    assert resolves("aerialdojo_gen.open_release")
    assert not resolves("aerialdojo_gen.base.names.known_scenes")
    assert not resolves("aerialdojo_gen.tasks.store")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_names_exists(page):
    text = page.read_text(encoding="utf-8")
    prose = FENCED.sub("", text)
    wrong = {name for name in DOTTED.findall(prose) if not resolves(name)}
    wrong |= {path for path in SLASHED.findall(prose) if "<" not in path and not (ROOT / path).exists()}
    for path in FILE.findall(prose):
        if "/" in path:
            if not any((top / path).exists() for top in (PACKAGE, ROOT, page.parent)):
                wrong.add(path)
        elif path.endswith(".py") and not any(PACKAGE.rglob(path)) and not any((ROOT / "tests").rglob(path)):
            wrong.add(path)
    assert not wrong


def test_what_sources_name_exists():
    wrong = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in SOURCES
        for name in DOTTED.findall(path.read_text(encoding="utf-8"))
        if not resolves(name)
    }
    assert not wrong


def test_the_tree_of_contributing_is_the_packages(project):
    text = (project / "CONTRIBUTING.md").read_text(encoding="utf-8")
    tree = re.search(r"^    aerialdojo_gen/\n((?:      .*\n)+)", text, re.MULTILINE)
    assert tree
    listed = [name for line in tree[1].splitlines() for name in re.findall(r"([a-z_]+)/", line[:26])]
    assert len(listed) == len(set(listed))
    assert set(listed) == {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
