"""Tables, all of one look on a terminal: a title, heads, a rule, rows; figures to the right, words to the left.

What is wider than the terminal goes on below: words are wrapped in their column, and columns that do not fit beside
each other follow in a block of their own under the same first column.
"""

from __future__ import annotations

import itertools
import shutil
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

# Of output that goes nowhere in particular; a terminal, or COLUMNS in the environment, says otherwise.
_WIDTH = 80
_NARROWEST = 40
# A column of words is not made narrower than this, if it is that wide at all.
_MIN_WORDS = 24

BEST, SECOND = "best", "second"


@dataclass(frozen=True)
class Column:
    """A column."""

    head: str  # Its heading
    group: str = ""  # Heading over this column and its neighbours of the same group; empty for none
    words: bool = False
    joined: bool = False  # Whether it says something of the column before it, and is shown beside that


@dataclass(frozen=True)
class TextTable:
    """A table of text."""

    stub: str  # Head of the first column, which names the rows
    columns: Sequence[Column]
    rows: Sequence[tuple[str, Sequence[str]]]  # sequence of (str, sequence of str)
    title: str = ""  # What it shows; empty for none
    notes: Sequence[str] = ()  # What must be known to read it
    sections: Mapping[int, str] = field(default_factory=dict)
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)  # `BEST` or `SECOND`, by row and cell

    @property
    def groups(self) -> list[tuple[str, tuple[str, ...]]]:
        """Neighbouring columns under one heading: it, and the headings of the columns."""
        found = itertools.groupby(self.columns, key=lambda column: column.group)
        return [(group, tuple(column.head for column in part)) for group, part in found]

    def lines(self, width: int | None = None) -> list[str]:
        """Write the table."""
        body = _Body(self, width)
        out = [self.title] if self.title else []
        for n, block in enumerate(body.blocks()):
            out += [""] if n else []
            out += body.lines(block)
        return [*out, *(line for note in self.notes for line in wrapped(note, width))]


def terminal_width() -> int:
    """Columns of the terminal that standard output goes to: COLUMNS where it is set, 80 where there is none."""
    return max(_NARROWEST, shutil.get_terminal_size((_WIDTH, 24)).columns)


def wrapped(text: str, width: int | None, indent: str = "") -> list[str]:
    """Break a text at its blanks into lines of a width; what follows the first begins with `indent`."""
    return [text] if width is None else textwrap.wrap(text, width, subsequent_indent=indent) or [""]


def facts(pairs: Sequence[tuple[str, str]], width: int | None = None) -> list[str]:
    """Write what is known of one thing: a name and a text a line, the texts below each other and wrapped."""
    over = max((len(name) for name, _ in pairs), default=0) + 2
    lines = []
    for name, text in pairs:
        first, *rest = wrapped(text, None if width is None else max(width - over, _MIN_WORDS))
        lines += [f"{name.ljust(over)}{first}", *(" " * over + line for line in rest)]
    return lines


class _Body:
    """Heads and rows, laid out in blocks."""

    def __init__(self, table: TextTable, width: int | None) -> None:
        self.table, self.width = table, width
        self.indent = "  " if table.sections else ""
        self.stub = max(len(table.stub), *(len(self.indent + label) for label, _ in table.rows), 0)
        self.full = [
            max(len(column.head), *(len(cells[k]) for _, cells in table.rows), 0)
            for k, column in enumerate(table.columns)
        ]
        self.least = [
            min(full, max(_MIN_WORDS, len(column.head))) if column.words and width is not None else full
            for column, full in zip(table.columns, self.full, strict=True)
        ]

    def blocks(self) -> list[list[int]]:
        """Share columns out over blocks that fit; groups are kept together where they fit by themselves."""
        together: list[list[int]] = []
        for k, column in enumerate(self.table.columns):
            if k and (column.joined or (column.group and column.group == self.table.columns[k - 1].group)):
                together[-1].append(k)
            else:
                together.append([k])
        blocks: list[list[int]] = [[]]
        for group in together:
            if blocks[-1] and not self._fits(blocks[-1] + group):
                blocks.append([])
            for k in group:
                if blocks[-1] and not self._fits([*blocks[-1], k]):
                    blocks.append([])
                blocks[-1].append(k)
        return blocks

    def _fits(self, block: list[int]) -> bool:
        return self.width is None or self._breadth(block, self.least) <= self.width

    def _spans(self, block: list[int]) -> list[list[int]]:
        """Divide a block's columns by the group that they belong to."""
        return [list(span) for _, span in itertools.groupby(block, lambda k: self.table.columns[k].group)]

    def _breadth(self, block: list[int], widths: Sequence[int]) -> int:
        return self.stub + sum(
            3 + max(sum(widths[k] for k in span) + 2 * (len(span) - 1), len(self.table.columns[span[0]].group))
            for span in self._spans(block)
        )

    def lines(self, block: list[int]) -> list[str]:
        """Write a block."""
        columns, table = self.table.columns, self.table
        widths = list(self.least)
        for k in block:
            # Words take what room there is, the first column of them first.
            room = widths[k] if self.width is None else widths[k] + self.width - self._breadth(block, widths)
            widths[k] = min(self.full[k], max(widths[k], room))
        top, firsts = " " * self.stub, set()
        for span in self._spans(block):
            firsts.add(span[0])
            # A group's head may be wider than its columns together: the last of them gives way.
            inner = sum(widths[k] for k in span) + 2 * (len(span) - 1)
            group = columns[span[0]].group
            widths[span[-1]] += max(0, len(group) - inner)
            top += "   " + group.center(max(inner, len(group)))

        def written(label: str, cells: Sequence[str]) -> list[str]:
            parts = {k: wrapped(cells[k], widths[k]) if columns[k].words else [cells[k]] for k in block}
            made = []
            for n in range(max(map(len, parts.values()), default=1)):
                text = (label if n == 0 else "").ljust(self.stub)
                for k in block:
                    part = parts[k][n] if n < len(parts[k]) else ""
                    blank = " " * (widths[k] - len(part))
                    text += ("   " if k in firsts else "  ") + (part + blank if columns[k].words else blank + part)
                made.append(text.rstrip())
            return made

        rows: list[str] = []
        breadth = 0
        for i, (label, cells) in enumerate(table.rows):
            rows += [table.sections[i]] if i in table.sections else []
            # A row whose cells all went to another block says nothing here.
            if label.strip() or any(cells[k].strip() for k in block):
                lines = written(self.indent + label, cells)
                rows += lines
                breadth = max(breadth, *map(len, lines))
        heads = [*([top.rstrip()] if top.strip() else []), *written(table.stub, [c.head for c in columns])]
        return [*heads, "-" * max(breadth, *map(len, heads)), *rows]
