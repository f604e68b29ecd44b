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
    stub: str  # Head of the first column
    groups: tuple[tuple[str, tuple[str, ...]], ...]  # Groups of columns: their head, and the heads of the columns
    rows: tuple[tuple[str, tuple[str, ...]], ...]  # tuple of (str, tuple of str)
    notes: tuple[str, ...] = ()  # What must be known to read it
    sections: Mapping[int, str] = field(default_factory=dict)
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)  # `BEST` or `SECOND`, by row and cell


@dataclass(frozen=True)
class Measure:
    """A column of a table of scores."""

    head: str  # Its heading
    metric: str
    signed: bool = False  # Whether it is a difference: printed with its sign, and none is the best

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
        """1 where more is better, -1 where less is, 0 for differences."""
        return 0 if self.signed else -1 if self.metric in ("dts_m", "cr") else 1


MEASURES = tuple(Measure(HEADS[metric], metric) for metric in METRICS)


@dataclass(frozen=True)
class Row:
    """A line of a table of scores."""

    label: str  # First column
    values: tuple[float, ...]  # A value a measure: fractions and metres; NaN where there is none
    section: str = ""  # Heading that it stands under; empty for none
    rivals: str | None = ""
    spreads: tuple[float, ...] = ()  # ± of every value, or empty
    intervals: tuple[tuple[float, float], ...] = ()  # Interval of every value, or empty; printed in a row of its own
    before: tuple[str, ...] = ()  # Cells of columns that are no measures, and stand first


def measures_of(known: bool, metrics: Sequence[str] = METRICS) -> tuple[Measure, ...]:
    """Take measures by their metrics; SR-view only where it is known of any run."""
    return tuple(m for m in MEASURES if m.metric in metrics and (known or m.metric != "sr_view"))


def values_of(score: Score | None, measures: Sequence[Measure]) -> tuple[float, ...]:
    """Take the measures out of a score; NaN where there is none."""
    return tuple(math.nan if score is None else float(getattr(score, m.metric)) for m in measures)


def score_table(
    title: str,
    stub: str,
    groups: Sequence[tuple[str, Sequence[Measure]]],
    lines: Sequence[Row],
    notes: Sequence[str] = (),
    before: tuple[str, ...] = (),
) -> Table:
    """Write lines of scores as a table."""
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
        rows.append((line.label, (*line.before, *cells)))
        if any(not math.isnan(low) for low, _ in line.intervals):
            shown = tuple(_interval(m, *ends) for m, ends in zip(measures, line.intervals, strict=True))
            rows.append(("", ("",) * len(before) + shown))
    marks = {
        (row_of[i], len(before) + k): mark
        for k, measure in enumerate(measures)
        for i, mark in _marks(measure, lines, k).items()
    }
    heads = [(head, tuple(m.head for m in part)) for head, part in groups]
    if before:
        heads.insert(0, ("", before))
    return Table(title, stub, tuple(heads), tuple(rows), tuple(notes), sections, marks)


def _interval(measure: Measure, low: float, high: float) -> str:
    return NONE if math.isnan(low) else f"{measure.text(low)}–{measure.text(high)}"


def _marks(measure: Measure, lines: Sequence[Row], k: int) -> dict[int, str]:
    """Find the best and the second best of a column among rivals, as they are printed: equal figures share a mark."""
    if not measure.direction:
        return {}
    races: dict[str, list[tuple[float, int]]] = {}
    for i, line in enumerate(lines):
        if line.rivals is not None and not math.isnan(line.values[k]):
            value = measure.direction * measure.printed(line.values[k])
            races.setdefault(line.rivals, []).append((value, i))
    marks = {}
    for race in races.values():
        levels = sorted({value for value, _ in race}, reverse=True)
        # Where all are alike there is no best.
        if len(levels) < 2:
            continue
        for value, i in race:
            if value == levels[0]:
                marks[i] = BEST
            # The last is second only in name.
            elif value == levels[1] and len(levels) > 2:
                marks[i] = SECOND
    return marks


_SIGNS = {BEST: "¹", SECOND: "²"}


def as_text(table: Table, width: int | None = None) -> str:
    """Write a table for a terminal; the best has ¹, the second ²."""
    columns = [Column(name, group) for group, names in table.groups for name in names]
    heads = [column.head for column in columns]
    cells = [list(row) for _, row in table.rows]
    bare = {k for i, k in table.marks if " ± " not in cells[i][k]}
    for i, line in enumerate([heads, *cells]):
        for k in range(len(heads)):
            sign = _SIGNS.get(table.marks.get((i - 1, k), ""), " ")
            # The mean is what is marked: the sign takes the place of the blank behind it.
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
    """Say what the marks in tables for a terminal mean; empty where there are none."""
    if not any(table.marks for table in tables):
        return ""
    return "¹ best, ² second of those compared; the oracle, which is given the route, is not."


def as_markdown(table: Table) -> str:
    """Write a table in Markdown; a column's head has its group's, for Markdown knows no groups."""
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
    """Write a table in LaTeX, for the package booktabs."""
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
        # What begins with a bracket would be an argument of the end of the row above it.
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
