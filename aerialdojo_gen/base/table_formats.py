"""Formats of a table: terminal, Markdown, LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from aerialdojo_gen.base.text_table import BEST, SECOND, TextTable

_SIGNS = {BEST: "¹", SECOND: "²"}


def as_text(table: TextTable, width: int | None = None) -> str:
    """Format a table for a terminal; the best has ¹, the second ²."""
    cells = [[column.head for column in table.columns], *(list(row) for _, row in table.rows)]
    bare = {k for i, k in table.marks if " ± " not in cells[i + 1][k]}
    for i, line in enumerate(cells):
        for k in range(len(line)):
            sign = _SIGNS.get(table.marks.get((i - 1, k), ""), " ")
            # The mark belongs to the mean: it replaces the blank behind it.
            line[k] = line[k].replace(" ± ", f"{sign}± ") if " ± " in line[k] else line[k] + sign * (k in bare)
    columns = [replace(column, head=head) for column, head in zip(table.columns, cells[0], strict=True)]
    rows = [(label, row) for (label, _), row in zip(table.rows, cells[1:], strict=True)]
    return "\n".join(replace(table, columns=columns, rows=rows).lines(width))


def legend(tables: Sequence[TextTable]) -> str:
    """Explain the marks in terminal tables; empty if there are none."""
    marked = any(table.marks for table in tables)
    return "¹ best, ² second of those compared; the oracle, which is given the route, is not." if marked else ""


def as_markdown(table: TextTable) -> str:
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


def as_latex(table: TextTable) -> str:
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
