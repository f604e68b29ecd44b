"""A table of our figures and the paper's, for a terminal, Markdown and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from aerialdojo_gen.base import text_table
from aerialdojo_gen.base.text_table import TextTable

Figure = int | float | None
_PAPERS = "paper's"


@dataclass(frozen=True)
class Column:
    """A column of figures."""

    name: str  # Heading
    unit: str = ""  # Unit of the figures, empty for counts
    exact: bool = True
    digits: int = 1  # Of a measure, after the point

    def show(self, figure: Figure) -> str:
        """Format a figure; a dash if there is none."""
        if figure is None:
            return "–"
        return f"{figure:,}" if isinstance(figure, int) else f"{figure:,.{self.digits}f}"


@dataclass(frozen=True)
class Row:
    """Our figures of a thing, and the paper's where it has them (None where not), a figure a column."""

    name: str
    ours: tuple[Figure, ...]
    theirs: tuple[Figure, ...]


@dataclass(frozen=True)
class Comparison:
    """A table with a title."""

    title: str  # What it shows
    key: str  # Heading of the rows' names
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()  # What must be known to read it

    @property
    def unlike(self) -> int:
        """How many figures that are to be the paper's are not."""
        return sum(len(self._differing(row)) for row in self.rows)

    @property
    def compared(self) -> int:
        """How many figures that are to be the paper's there are."""
        return sum(len(self._comparable(row)) for row in self.rows)

    def _comparable(self, row: Row) -> list[int]:
        return [k for k, column in enumerate(self.columns) if column.exact and row.theirs[k] is not None]

    def _differing(self, row: Row) -> list[int]:
        return [k for k in self._comparable(row) if row.ours[k] != row.theirs[k]]

    def _split(self, k: int) -> bool:
        """Whether the paper's figures of a column have a column of their own."""
        return not self.columns[k].exact and any(row.theirs[k] is not None for row in self.rows)

    def _heads(self) -> list[str]:
        heads = [self.key]
        for k, column in enumerate(self.columns):
            heads += [column.name, _PAPERS] if self._split(k) else [column.name]
        return heads

    def _cells(self, row: Row, bracket: bool = False) -> list[str]:
        differing, cells = self._differing(row), [row.name]
        for k, (ours, theirs) in enumerate(zip(row.ours, row.theirs, strict=True)):
            show = self.columns[k].show
            if self._split(k):
                cells += [show(ours), show(theirs)]
            else:
                cells.append(show(ours) + (f" (paper: {show(theirs)})" if bracket and k in differing else ""))
        return cells

    def terminal(self, width: int | None = None) -> list[str]:
        """Lines for a terminal of a width; below a row the figures in which the paper differs."""
        rows = []
        for row in self.rows:
            rows.append(self._cells(row))
            if differing := self._differing(row):
                below = ["  in the paper"]
                for k, theirs in enumerate(row.theirs):
                    below += ["", ""] if self._split(k) else [self.columns[k].show(theirs) if k in differing else ""]
                rows.append(below)
        stub, *heads = self._heads()
        columns = [text_table.Column(head, joined=head == _PAPERS) for head in heads]
        named = [(name, cells) for name, *cells in rows]
        return TextTable(stub, columns, named, self.title, self._verdict()).lines(width)

    def _verdict(self) -> list[str]:
        if not self.compared:
            return [*self.notes]
        if not self.unlike:
            return [*self.notes, f"All {self.compared:,} counts are the paper's."]
        return [*self.notes, f"{self.unlike:,} of {self.compared:,} counts are not the paper's."]

    def markdown(self) -> list[str]:
        """Lines of Markdown; a count that is not the paper's has the paper's in brackets."""
        cells = [self._cells(row, bracket=True) for row in self.rows]
        return _markdown(self.title, self._heads(), "---:|", cells, self._verdict())

    def as_json(self) -> dict[str, Any]:
        """Return title, notes, units by column, and a row's figures by column, ours and the paper's."""
        names = [column.name for column in self.columns]
        rows = [
            {"name": row.name, "ours": dict(zip(names, row.ours, strict=True)), "paper": None}
            | ({} if set(row.theirs) == {None} else {"paper": dict(zip(names, row.theirs, strict=True))})
            for row in self.rows
        ]
        units = {column.name: column.unit for column in self.columns}
        return {"title": self.title, "key": self.key, "units": units, "rows": rows, "notes": self._verdict()}

    def records(self) -> list[list[str]]:
        """One record per figure: table, row, column, unit, ours, paper; empty if there is none."""
        return [
            [self.title, row.name, column.name, column.unit, *("" if f is None else repr(f) for f in (ours, theirs))]
            for row in self.rows
            for column, ours, theirs in zip(self.columns, row.ours, row.theirs, strict=True)
        ]


@dataclass(frozen=True)
class Listing:
    """A table of words, as the paper prints it."""

    title: str  # What it shows
    heads: tuple[str, ...]  # Headings; the first column names the rows
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()  # What must be known to read it

    def terminal(self, width: int | None = None) -> list[str]:
        """Lines for a terminal of a width."""
        columns = [text_table.Column(head, words=True) for head in self.heads[1:]]
        named = [(name, cells) for name, *cells in self.rows]
        return TextTable(self.heads[0], columns, named, self.title, self.notes).lines(width)

    def markdown(self) -> list[str]:
        """Lines of Markdown."""
        return _markdown(self.title, self.heads, "---|", self.rows, self.notes)

    def as_json(self) -> dict[str, Any]:
        """Return title, notes, and the cells of each row by their heading."""
        rows = [dict(zip(self.heads, row, strict=True)) for row in self.rows]
        return {"title": self.title, "key": self.heads[0], "rows": rows, "notes": [*self.notes]}

    def records(self) -> list[list[str]]:
        """One record a cell, as `Comparison.records` has them; all of it is the paper's but the last row."""
        return [
            [self.title, row[0], head, "", *((cell, "") if row is self.rows[-1] else ("", cell))]
            for row in self.rows
            for head, cell in zip(self.heads[1:], row[1:], strict=True)
        ]


def _markdown(
    title: str, heads: Sequence[str], rule: str, rows: Sequence[Sequence[str]], notes: Sequence[str]
) -> list[str]:
    """Lines of Markdown; `rule` is below every heading but the first."""
    table = ["| " + " | ".join(cells) + " |" for cells in (heads, *rows)]
    return [f"### {title}", "", table[0], "|---|" + rule * (len(heads) - 1), *table[1:], "", *notes]


def as_csv(tables: Sequence[Comparison | Listing]) -> str:
    """Write tables as one CSV text in long form: a line a figure."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["table", "row", "column", "unit", "ours", "paper"])
    for table in tables:
        writer.writerows(table.records())
    return text.getvalue()


def as_markdown(tables: Sequence[Comparison | Listing]) -> str:
    """Write tables one below the other as Markdown."""
    return "\n\n".join("\n".join(table.markdown()).rstrip() for table in tables) + "\n"
