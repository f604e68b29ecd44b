"""The package's words, rooms, and sizes of files and functions: retired names stay away, nothing grows too large."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import aerialdojo_gen

PACKAGE = Path(aerialdojo_gen.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 400
MAX_PARAMETERS, MAX_FUNCTION_LINES = 10, 80
# Parameters of the kit's builders are the keys of a plan's entry; compiled kernels take plain numbers and arrays.
EXEMPT_DECORATORS = re.compile(r"njit|intrinsic|(site|ground|part)_builder")
# The environment's options, all by name and all public. Those of a command, in `cli/`, are free as well.
MANY_PARAMETERS = {"benchmark/env.py __init__"}
ROOMS = {
    "annotations", "base", "benchmark", "cli", "dataset", "exchange", "geometry", "imports", "learning", "pipeline",
    "planning", "rendering", "scenes", "store", "studio",
}  # fmt: skip
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
    "valid_looks", "want_meshes", "worth_joining", "worth_tables",
)  # fmt: skip


def banned_in(text: str) -> set[str]:
    return set(re.findall(rf"\b(?:{'|'.join(BANNED)})\b", text))


def test_retired_words_stay_away():
    assert banned_in("class Rung: pass\nrung = step_back_m") == {"Rung"}
    found = {path.relative_to(PACKAGE).as_posix(): banned_in(path.read_text(encoding="utf-8")) for path in FILES}
    assert not {name: sorted(words) for name, words in found.items() if words}


def test_there_are_fifteen_rooms():
    assert {init.parent.name for init in PACKAGE.glob("*/__init__.py")} == ROOMS
    assert len(ROOMS) == 15


def test_files_can_be_read_at_a_sitting():
    lengths = {path.relative_to(PACKAGE).as_posix(): len(path.read_text("utf-8").splitlines()) for path in FILES}
    assert len(lengths) > 100
    assert not {name: lines for name, lines in lengths.items() if lines > MAX_LINES}


def outgrown(source: str) -> Iterator[str]:
    """Names of the functions with too many parameters or lines."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        given = node.args
        parameters = [*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))]
        lines = node.end_lineno - node.lineno + 1
        exempt = any(EXEMPT_DECORATORS.match(ast.unparse(one)) for one in node.decorator_list)
        if not exempt and (len(parameters) > MAX_PARAMETERS or lines > MAX_FUNCTION_LINES):
            yield node.name


def test_functions_can_be_read_at_a_glance():
    many, long = f"def many({', '.join('abcdefghij')}, *k): pass\n", "def long():\n" + "    pass\n" * 80
    assert list(outgrown(many + "@njit(cache=True)\n" + many + long)) == ["many", "long"]
    assert list(outgrown(many.replace(", *k", "") + long.replace("    pass\n", "", 1))) == []
    found = {(path.relative_to(PACKAGE), name) for path in FILES for name in outgrown(path.read_text("utf-8"))}
    assert {f"{path.as_posix()} {name}" for path, name in found if path.parts[0] != "cli"} == MANY_PARAMETERS
