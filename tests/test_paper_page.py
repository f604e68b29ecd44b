"""The page of the paper's elements: 126 of them, each with a state and with links that lead somewhere."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
PAGE = ROOT / "docs/paper.md"
ROW = re.compile(r"^\| (\d+) \| (.+?) \| (.+?) \| (.*?) ?\| (.+) \|$", re.MULTILINE)
LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)([^)#\s]*)(?:#([^)]+))?\)")
DEPARTURE = r"\[[^\]]+\]\(departures\.md#[\w-]+\)"
STATE = re.compile(rf"right(; {DEPARTURE})?|{DEPARTURE}|\[needs a model\]\(#results-of-multimodal-models\)")


@cache
def anchors(page):
    """What a link may end in: the page's headings, as GitHub and the site write them."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head.lower()).strip().replace(" ", "-") for head in heads}


@cache
def defined(module):
    """Names of a module: functions, classes, constants, and what classes define, as Class.name."""

    def names(body, before=""):
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                yield before + node.name
            if isinstance(node, ast.ClassDef):
                yield from names(node.body, f"{node.name}.")
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            for target in targets:
                parts = target.elts if isinstance(target, ast.Tuple) else [target]
                yield from (before + part.id for part in parts if isinstance(part, ast.Name))

    return set(names(ast.parse(module.read_text(encoding="utf-8")).body))


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
