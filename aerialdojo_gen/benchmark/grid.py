"""Tables of scores: columns of measures, a row per agent, best values marked; as text, Markdown and LaTeX."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.benchmark.metrics import METRICS, Score

HEADS = {"sr": "SR ↑", "sr_view": "SR-view ↑", "osr": "OSR ↑", "spl": "SPL ↑", "dts_m": "DTS ↓", "cr": "CR ↓"}
NONE = "–"
BEST, SECOND = "best", "second"


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str  # What it shows
    stub: str  # Heading of the first column
    groups: tuple[tuple[str, tuple[str, ...]], ...]  # Groups of columns: heading, headings of the columns
    rows: tuple[tuple[str, tuple[str, ...]], ...]  # tuple of (str, tuple of str)
    notes: tuple[str, ...] = ()  # Printed below it
    sections: Mapping[int, str] = field(default_factory=dict)
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)  # `BEST` or `SECOND`, by row and cell


@dataclass(frozen=True)
class Measure:
    """A column of a table of scores."""

    head: str  # Its heading
    metric: str
    signed: bool = False  # Whether it is a difference: printed with its sign, never marked as best

    def text(self, value: float) -> str:
        """Format a value: two decimals, as the paper has them; a dash for NaN."""
        if math.isnan(value):
            return NONE
        shown = f"{self.printed(value):{'+' if self.signed else ''}.2f}"
        return shown.replace("-", "−")

    def printed(self, value: float) -> float:
        """Return a value in the unit and with the digits in which it is printed; never a negative zero."""
        return round(value if self.metric == "dts_m" else 100.0 * value, 2) + 0.0

    @property
    def direction(self) -> int:
        """1 if higher is better, -1 if lower is, 0 for differences."""
        return 0 if self.signed else -1 if self.metric in ("dts_m", "cr") else 1


MEASURES = tuple(Measure(HEADS[metric], metric) for metric in METRICS)


@dataclass(frozen=True)
class Row:
    """A row of a table of scores."""

    label: str  # First column
    values: tuple[float, ...]  # One per measure: fractions and metres; NaN for unknown
    section: str = ""  # Heading of its section; empty for none
    rank_group: str | None = ""
    spreads: tuple[float, ...] = ()  # Deviation of every value, or empty
    intervals: tuple[tuple[float, float], ...] = ()  # Interval of every value, or empty; printed in an extra row
    leading_cells: tuple[str, ...] = ()  # Cells of leading columns that are no measures


def measures_of(known: bool, metrics: Sequence[str] = METRICS) -> tuple[Measure, ...]:
    """Select measures by metric; SR-view only if any run logs it."""
    return tuple(m for m in MEASURES if m.metric in metrics and (known or m.metric != "sr_view"))


def values_of(score: Score | None, measures: Sequence[Measure]) -> tuple[float, ...]:
    """Return the measures of a score; NaN if there is none."""
    return tuple(math.nan if score is None else float(getattr(score, m.metric)) for m in measures)


def score_table(
    title: str,
    stub: str,
    groups: Sequence[tuple[str, Sequence[Measure]]],
    lines: Sequence[Row],
    notes: Sequence[str] = (),
    leading_cells: tuple[str, ...] = (),
) -> Table:
    """Make a table from rows of scores."""
    measures = [m for _, part in groups for m in part]
    rows: list[tuple[str, tuple[str, ...]]] = []
    sections: dict[int, str] = {}
    row_of: list[int] = []
    above = ""
    for line in lines:
        if line.section != above:
            sections[len(rows)] = above = line.section
        row_of.append(len(rows))
        cells = [m.text(v) for m, v in zip(measures, line.values, strict=True)]
        for k, spread in enumerate(line.spreads):
            if not math.isnan(spread):
                cells[k] += f" ± {measures[k].text(spread)}"
        rows.append((line.label, (*line.leading_cells, *cells)))
        if any(not math.isnan(low) for low, _ in line.intervals):
            shown = tuple(_interval(m, *ends) for m, ends in zip(measures, line.intervals, strict=True))
            rows.append(("", ("",) * len(leading_cells) + shown))
    marks = {
        (row_of[i], len(leading_cells) + k): mark
        for k, measure in enumerate(measures)
        for i, mark in _marks(measure, lines, k).items()
    }
    heads = [(head, tuple(m.head for m in part)) for head, part in groups]
    if leading_cells:
        heads.insert(0, ("", leading_cells))
    return Table(title, stub, tuple(heads), tuple(rows), tuple(notes), sections, marks)


def section_heads(groups: Sequence[str]) -> dict[int, str]:
    """Headings of sections, by the row that each begins at."""
    return {k: group for k, group in enumerate(groups) if group != (groups[k - 1] if k else "")}


def _interval(measure: Measure, low: float, high: float) -> str:
    return NONE if math.isnan(low) else f"{measure.text(low)}–{measure.text(high)}"


def _marks(measure: Measure, lines: Sequence[Row], k: int) -> dict[int, str]:
    """Find the best and second best of a column per rank group, as printed: equal figures share a mark."""
    if not measure.direction:
        return {}
    groups: dict[str, list[tuple[float, int]]] = {}
    for i, line in enumerate(lines):
        if line.rank_group is not None and not math.isnan(line.values[k]):
            value = measure.direction * measure.printed(line.values[k])
            groups.setdefault(line.rank_group, []).append((value, i))
    marks = {}
    for ranked in groups.values():
        levels = sorted({value for value, _ in ranked}, reverse=True)
        # All equal: no best.
        if len(levels) < 2:
            continue
        for value, i in ranked:
            if value == levels[0]:
                marks[i] = BEST
            # Of two values the second is the last.
            elif value == levels[1] and len(levels) > 2:
                marks[i] = SECOND
    return marks


_SIGNS = {BEST: "¹", SECOND: "²"}


def as_text(table: Table, width: int | None = None) -> str:
    """Format a table for a terminal; the best has ¹, the second ²."""
    columns = [Column(name, group) for group, names in table.groups for name in names]
    heads = [column.head for column in columns]
    cells = [list(row) for _, row in table.rows]
    bare = {k for i, k in table.marks if " ± " not in cells[i][k]}
    for i, line in enumerate([heads, *cells]):
        for k in range(len(heads)):
            sign = _SIGNS.get(table.marks.get((i - 1, k), ""), " ")
            # The mark belongs to the mean: it replaces the blank behind it.
            line[k] = line[k].replace(" ± ", f"{sign}± ") if " ± " in line[k] else line[k] + sign * (k in bare)
    return "\n".join(
        TextTable(
            table.stub,
            [replace(column, head=head) for column, head in zip(columns, heads, strict=True)],
            [(label, row) for (label, _), row in zip(table.rows, cells, strict=True)],
            table.title,
            table.notes,
            table.sections,
        ).lines(width)
    )


def legend(tables: Sequence[Table]) -> str:
    """Explain the marks in terminal tables; empty if there are none."""
    if not any(table.marks for table in tables):
        return ""
    return "¹ best, ² second of those compared; the oracle, which is given the route, is not."


def as_markdown(table: Table) -> str:
    """Format a table in Markdown; a column's heading includes its group's, as Markdown has no groups."""
    heads = [table.stub, *(f"{group}: {name}" if group else name for group, names in table.groups for name in names)]
    rule = ["---", *["---:"] * (len(heads) - 1)]
    lines = [f"**{_plain(table.title)}**", "", _pipes(map(_plain, heads)), _pipes(rule)]
    marks = {BEST: "**{}**", SECOND: "<ins>{}</ins>"}
    for i, (label, cells) in enumerate(table.rows):
        if i in table.sections:
            lines.append(_pipes([f"*{_plain(table.sections[i])}*", *[""] * (len(heads) - 1)]))
        shown = [marks.get(table.marks.get((i, k), ""), "{}").format(_plain(cell)) for k, cell in enumerate(cells)]
        lines.append(_pipes([_plain(label), *shown]))
    notes = [_plain(note) for note in table.notes]
    if table.marks:
        notes.append("Bold: best; underlined: second.")
    return "\n".join([*lines, *(f"\n{note}" for note in notes)])


def _pipes(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _plain(text: str) -> str:
    for sign in "\\|*_<>`[]":
        text = text.replace(sign, "\\" + sign)
    return text


def as_latex(table: Table) -> str:
    """Format a table in LaTeX, for the package booktabs."""
    columns = "l" + "".join("r" * len(names) for _, names in table.groups)
    notes = [*table.notes, *(["Bold: best; underlined: second."] if table.marks else [])]
    lines = [r"\begin{table}", r"\centering", r"\caption{" + _tex(" ".join((table.title + ".", *notes))) + "}"]
    lines += [r"\begin{tabular}{" + columns + "}", r"\toprule"]
    if any(group for group, _ in table.groups):
        heads = [rf"\multicolumn{{{len(names)}}}{{c}}{{{_tex(group)}}}" for group, names in table.groups]
        lines.append(" & ".join(["", *heads]) + r" \\")
        k, rules = 2, []
        for group, names in table.groups:
            rules += [rf"\cmidrule(lr){{{k}-{k + len(names) - 1}}}"] if group else []
            k += len(names)
        lines.append(" ".join(rules))
    lines.append(" & ".join(map(_tex, [table.stub, *(n for _, names in table.groups for n in names)])) + r" \\")
    lines.append(r"\midrule")
    marks = {BEST: r"\textbf{", SECOND: r"\underline{"}
    for i, (label, cells) in enumerate(table.rows):
        if i in table.sections:
            lines += [r"\midrule"] if i else []
            lines.append(rf"\multicolumn{{{len(columns)}}}{{l}}{{\emph{{{_tex(table.sections[i])}}}}} \\")
        shown = [
            marks[table.marks[i, k]] + _tex(cell) + "}" if (i, k) in table.marks else _tex(cell)
            for k, cell in enumerate(cells)
        ]
        row = " & ".join([_tex(label), *shown])
        # A leading bracket would be read as an argument of the previous row's end.
        lines.append(("{}" if row.startswith(("[", "*")) else "") + row + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}"])


_TEX = {
    **{c: "\\" + c for c in "&%$#_{}"}, "\\": r"\textbackslash{}", "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", "±": r"$\pm$", "↑": r"$\uparrow$", "↓": r"$\downarrow$", "–": "--", "−": "$-$",
    "→": r"$\to$", "×": r"$\times$", "κ": r"$\kappa$", "≥": r"$\geq$", "≤": r"$\leq$", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}",
}  # fmt: skip


def _tex(text: str) -> str:
    return "".join(_TEX.get(c, c) for c in text)


FORMATS = {"terminal": as_text, "markdown": as_markdown, "latex": as_latex}
