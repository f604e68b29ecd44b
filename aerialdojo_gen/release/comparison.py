"""A table that sets our figures beside the paper's, and what it looks like on a terminal, in Markdown and in CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

Figure = int | float | None


@dataclass(frozen=True)
class Column:
    """A column of figures.

    Attributes
    ----------
    name : str
        Heading.
    unit : str
        Unit of the figures, empty for counts.
    exact : bool
        Whether the figures are to be the paper's to the last digit; the others are shown side by side.
    """

    name: str
    unit: str = ""
    exact: bool = True


def _show(figure: Figure) -> str:
    """Format a figure, a measure to one digit after the point; a dash where there is none."""
    if figure is None:
        return "–"
    return f"{figure:,}" if isinstance(figure, int) else f"{figure:,.1f}"


@dataclass(frozen=True)
class Row:
    """Our figures of a thing, and the paper's where it has them (None where not), a figure a column."""

    name: str
    ours: tuple[Figure, ...]
    paper: tuple[Figure, ...]


@dataclass(frozen=True)
class Comparison:
    """A table with a title.

    Attributes
    ----------
    title : str
        What it shows.
    key : str
        Heading of the rows' names.
    columns : tuple of Column
    rows : tuple of Row
    """

    title: str
    key: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]

    @property
    def unlike(self) -> int:
        """How many figures that are to be the paper's are not."""
        return sum(len(self._differing(row)) for row in self.rows)

    @property
    def compared(self) -> int:
        """How many figures that are to be the paper's there are."""
        return sum(
            column.exact and paper is not None
            for row in self.rows
            for column, paper in zip(self.columns, row.paper, strict=True)
        )

    def _differing(self, row: Row) -> list[int]:
        return [
            k
            for k, (column, ours, paper) in enumerate(zip(self.columns, row.ours, row.paper, strict=True))
            if column.exact and paper is not None and ours != paper
        ]

    def _beside(self, k: int) -> bool:
        """Whether the paper's figures of a column have a column of their own."""
        return not self.columns[k].exact and any(row.paper[k] is not None for row in self.rows)

    def _heads(self) -> list[str]:
        heads = [self.key]
        for k, column in enumerate(self.columns):
            heads += [column.name, "paper's"] if self._beside(k) else [column.name]
        return heads

    def _cells(self, row: Row, bracket: bool = False) -> list[str]:
        differing, cells = self._differing(row), [row.name]
        for k, (ours, paper) in enumerate(zip(row.ours, row.paper, strict=True)):
            if self._beside(k):
                cells += [_show(ours), _show(paper)]
            else:
                cells.append(_show(ours) + (f" (paper: {_show(paper)})" if bracket and k in differing else ""))
        return cells

    def terminal(self) -> list[str]:
        """Lines for a terminal; under a row that is not the paper's, the paper's figures that differ."""
        lines = [self._heads()]
        for row in self.rows:
            lines.append(self._cells(row))
            if differing := self._differing(row):
                below = ["  in the paper"]
                for k, paper in enumerate(row.paper):
                    below += ["", ""] if self._beside(k) else [_show(paper) if k in differing else ""]
                lines.append(below)
        widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
        shown = [
            (line[0].ljust(widths[0]) + "".join(c.rjust(w + 2) for c, w in zip(line[1:], widths[1:], strict=True)))
            for line in lines
        ]
        rule = "-" * len(shown[0])
        return [self.title, shown[0].rstrip(), rule, *(line.rstrip() for line in shown[1:]), *self._verdict()]

    def _verdict(self) -> list[str]:
        if not self.compared:
            return []
        if not self.unlike:
            return [f"All {self.compared:,} counts are the paper's."]
        return [f"{self.unlike:,} of {self.compared:,} counts are not the paper's."]

    def markdown(self) -> list[str]:
        """Lines of Markdown; a count that is not the paper's has the paper's in brackets."""
        heads = self._heads()
        lines = [f"### {self.title}", "", "| " + " | ".join(heads) + " |", "|---|" + "---:|" * (len(heads) - 1)]
        lines += ["| " + " | ".join(self._cells(row, bracket=True)) + " |" for row in self.rows]
        return [*lines, "", *self._verdict()]

    def records(self) -> list[list[str]]:
        """One record a figure: table, row, column, unit, ours, paper; empty where there is none."""
        return [
            [self.title, row.name, column.name, column.unit, *("" if f is None else repr(f) for f in (ours, paper))]
            for row in self.rows
            for column, ours, paper in zip(self.columns, row.ours, row.paper, strict=True)
        ]


def as_csv(tables: Sequence[Comparison]) -> str:
    """Write tables as one CSV text in long form: a line a figure."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["table", "row", "column", "unit", "ours", "paper"])
    for table in tables:
        writer.writerows(table.records())
    return text.getvalue()


def as_markdown(tables: Sequence[Comparison]) -> str:
    """Write tables one below the other as Markdown."""
    return "\n\n".join("\n".join(table.markdown()).rstrip() for table in tables) + "\n"
