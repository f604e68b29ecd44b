"""The package's words, rooms and file lengths: retired names stay away, and nothing outgrows its place."""

import re
from pathlib import Path

import aerialdojo_gen

PACKAGE = Path(aerialdojo_gen.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 400
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
    "after_all", "astray", "desk",
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
