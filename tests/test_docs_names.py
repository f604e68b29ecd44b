"""Names and paths of the package that documents and docstrings speak of exist.

And the page of the paper's elements: 126 of them, each with a state and with links that lead somewhere.
"""

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


PAGE = ROOT / "docs/paper.md"
ROW = re.compile(r"^\| (\d+) \| (.+?) \| (.+?) \| (.*?) ?\| (.+) \|$", re.MULTILINE)
LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)([^)#\s]*)(?:#([^)]+))?\)")
DEPARTURE = r"\[[^\]]+\]\(departures\.md#[\w-]+\)"
STATE = re.compile(rf"right(; {DEPARTURE})?|{DEPARTURE}|\[needs a model\]\(#results-of-multimodal-models\)")


@cache
def defined(module: Path, imports: bool = False) -> set[str]:
    """Names of a module: functions, classes, constants, what classes define as Class.name, and what it imports."""

    def names(body, before=""):
        for node in body:
            if isinstance(node, ast.If):
                yield from names([*node.body, *node.orelse], before)
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                yield before + node.name
                yield from names(node.body, f"{node.name}.") if isinstance(node, ast.ClassDef) else ()
            elif isinstance(node, ast.Import | ast.ImportFrom):
                yield from ((alias.asname or alias.name).partition(".")[0] for alias in node.names if imports)
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            for target in targets:
                parts = target.elts if isinstance(target, ast.Tuple) else [target]
                yield from (before + part.id for part in parts if isinstance(part, ast.Name))

    return set(names(ast.parse(module.read_text(encoding="utf-8")).body))


def resolves(dotted: str) -> bool:
    """Follow a dotted name as far as it is packages and modules, then as names in the last of them."""
    at, parts = PACKAGE, dotted.split(".")[1:]
    while parts and (at / parts[0]).is_dir():
        at, parts = at / parts[0], parts[1:]
    module = at / "__init__.py"
    if parts and (at / f"{parts[0]}.py").is_file():
        module, parts = at / f"{parts[0]}.py", parts[1:]
    return not parts or parts[0] in {*defined(module, imports=True), "__all__", "__file__", "__version__"}


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


@cache
def anchors(page):
    """What a link may end in: the page's headings, as GitHub and the site write them."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def faults(text):
    """Links of the page that lead nowhere."""
    for words, path, anchor in LINK.findall(text):
        at = (PAGE.parent / path).resolve() if path else PAGE
        name = words.strip("`") if words.startswith("`") else None
        if not at.is_relative_to(ROOT) or not at.is_file():
            yield f"{path}: no such file"
        elif anchor and anchor not in anchors(at):
            yield f"{path}#{anchor}: no such heading"
        elif name and at.suffix == ".py" and name not in defined(at):
            yield f"{path} defines no {name}"
        elif name and at.suffix != ".py" and not re.search(rf"\b{name}\b", at.read_text("utf-8")):
            yield f"{path} has no {name}"


def test_every_link_leads_to_a_file_and_to_the_name_or_heading_in_it():
    text = PAGE.read_text(encoding="utf-8")
    assert len(LINK.findall(text)) > 126
    assert list(faults(text)) == []


def test_a_link_that_leads_nowhere_is_found():
    there = "../aerialdojo_gen/planning/certify.py"
    assert list(faults(f"[`certify`]({there}) [departs](departures.md#approach) [`numba`](../pyproject.toml)")) == []
    wrong = f"[`certified`]({there}) [departs](departures.md#nothing) [page](none.md) [`numbas`](../pyproject.toml)"
    assert len(list(faults(wrong))) == len(LINK.findall(wrong))


def test_there_are_126_elements_each_with_a_state_and_a_place():
    rows = ROW.findall(PAGE.read_text(encoding="utf-8"))
    assert [int(number) for number, *_ in rows] == list(range(1, 127))
    assert not [row[0] for row in rows if not STATE.fullmatch(row[2])]
    assert not [row[0] for row in rows if not LINK.search(row[4])]
    assert [row[0] for row in rows if "needs a model" in row[2]] == ["107"]
