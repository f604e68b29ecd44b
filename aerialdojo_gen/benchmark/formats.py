"""A table written out: for a terminal, in Markdown, in LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.benchmark.grid import BEST, SECOND, Table

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
