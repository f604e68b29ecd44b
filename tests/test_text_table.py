"""Tables on a terminal: figures to the right, words wrapped, what does not fit below."""

import os
import re

import pytest

from aerialdojo_gen.base.text_table import Column, TextTable, facts, terminal_width

FIGURES = TextTable(
    "scene",
    [Column("tasks"), Column("km"), Column("paper's", joined=True), Column("least", "clearance"),
     Column("mean", "clearance")],
    [("U_Mall_0", ["1,234", "5.6", "7.8", "0.25", "1.5"]), ("all", ["1", "2", "3", "4", "5"])],
    "A title", ["A note on what the figures are, which is as long as a note may be."],
)  # fmt: skip
WORDS = TextTable(
    "check",
    [Column("of", words=True), Column("faults"), Column("not checked", words=True)],
    [("route_length", ["routes", "0", ""]), ("mesh_digest", ["scenes", "3", "no meshes were asked for, " * 4])],
)


def test_one_look():
    assert FIGURES.lines() == [
        "A title",
        "                                  clearance",
        "scene      tasks   km  paper's   least  mean",
        "--------------------------------------------",
        "U_Mall_0   1,234  5.6      7.8    0.25   1.5",
        "all            1    2        3       4     5",
        "A note on what the figures are, which is as long as a note may be.",
    ]


# A column of words keeps 24 columns.
@pytest.mark.parametrize(
    ("table", "width"),
    [*((FIGURES, width) for width in (28, 32, 40, 60, 80)), *((WORDS, width) for width in (45, 60, 80))],
)
def test_no_line_is_wider_and_no_cell_is_lost(table, width):
    lines = table.lines(width)
    assert max(map(len, lines)) <= width
    text = re.sub(r"\s+", " ", " ".join(lines))
    for label, cells in table.rows:
        for cell in (label, *cells):
            assert all(word in text for word in cell.split())


def test_columns_that_belong_together_stay_together():
    blocks = "\n".join(FIGURES.lines(32)).split("\n\n")
    assert len(blocks) > 1
    assert all(("km" in block) == ("paper's" in block) for block in blocks)
    assert all(("least" in block) == ("mean" in block) for block in blocks)
    assert all("U_Mall_0" in block for block in blocks)


def test_words_are_wrapped_under_their_head():
    lines = WORDS.lines(60)
    at = lines[0].index("not checked")
    wrapped = lines[-3:]
    assert all(line[at - 1] == " " and line[at] != " " for line in wrapped)
    assert WORDS.lines(None)[-1].count("no meshes") == 4


def test_facts_stand_below_each_other():
    assert facts([("a", "one two three four five six seven"), ("longer", "x")], 36) == [
        "a       one two three four five six",
        "        seven",
        "longer  x",
    ]


def test_the_width_is_the_terminals(monkeypatch):
    monkeypatch.setenv("COLUMNS", "132")
    assert terminal_width() == 132
    monkeypatch.setenv("COLUMNS", "3")
    assert terminal_width() == 40
    monkeypatch.delenv("COLUMNS")
    if not os.isatty(1):
        assert terminal_width() == 80
