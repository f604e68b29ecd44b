"""A table written out: for a terminal, in Markdown, in LaTeX."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from aerialdojo_gen.benchmark.grid import BEST, SECOND, Table

_SIGNS = {BEST: "¹", SECOND: "²"}
_ANSI = {BEST: "\x1b[1m", SECOND: "\x1b[4m"}
_OFF = "\x1b[0m"


def as_text(table: Table, width: int | None = None, ansi: bool = False) -> str:
    """Write a table for a terminal.

    Parameters
    ----------
    table : Table
    width : int, optional
        Columns of the terminal: what does not fit goes below, under the same first column.
    ansi : bool
        Whether the best is bold and the second underlined, as terminals do it; else they have ¹ and ².

    Returns
    -------
    str
        Lines without an end of the last.
    """
    heads = [name for _, names in table.groups for name in names]
    over = [group for group, names in table.groups for _ in names]
    lines: list[list[str]] = [heads, *(list(cells) for _, cells in table.rows)]
    if not ansi:
        bare = {k for i, k in table.marks if " ± " not in lines[i + 1][k]}
        for i, line in enumerate(lines):
            for k in range(len(heads)):
                sign = _SIGNS.get(table.marks.get((i - 1, k), ""), " ")
                # The mean is what is marked: the sign takes the place of the blank behind it.
                line[k] = line[k].replace(" ± ", f"{sign}± ") if " ± " in line[k] else line[k] + sign * (k in bare)
    widths = [max(len(line[k]) for line in lines) for k in range(len(heads))]
    indent = "  " if table.sections else ""
    stub = max(len(table.stub), *(len(indent + label) for label, _ in table.rows), 0)
    out = [table.title]
    for n, columns in enumerate(_blocks(over, widths, stub, width)):
        out += [""] if n else []
        out += _block(table, columns, heads, over, lines[1:], list(widths), stub, indent, ansi)
    return "\n".join([*out, *(part for note in table.notes for part in _wrapped(note, width))])


def legend(tables: Sequence[Table], ansi: bool = False) -> str:
    """Say what the marks in tables for a terminal mean; empty where there are none."""
    if not any(table.marks for table in tables):
        return ""
    what = "Bold: best; underlined: second" if ansi else "¹ best, ² second"
    return f"{what} of those compared; the oracle, which is given the way, is not."


def _blocks(over: list[str], widths: list[int], stub: int, width: int | None) -> Iterable[list[int]]:
    """Share columns out over blocks that fit; groups are kept together where they fit by themselves."""
    groups: list[list[int]] = []
    for k, group in enumerate(over):
        if k and group == over[k - 1]:
            groups[-1].append(k)
        else:
            groups.append([k])

    def fits(columns: list[int]) -> bool:
        return width is None or _breadth(columns, over, widths, stub) <= width

    block: list[int] = []
    for together in groups:
        if block and not fits(block + together):
            yield block
            block = []
        for k in together:
            if block and not fits([*block, k]):
                yield block
                block = []
            block.append(k)
    if block:
        yield block


def _spans(columns: list[int], over: list[str]) -> list[list[int]]:
    """Divide columns by the group that they belong to."""
    spans: list[list[int]] = []
    for n, k in enumerate(columns):
        if n and over[k] == over[columns[n - 1]]:
            spans[-1].append(k)
        else:
            spans.append([k])
    return spans


def _breadth(columns: list[int], over: list[str], widths: list[int], stub: int) -> int:
    total = stub
    for span in _spans(columns, over):
        total += 3 + max(sum(widths[k] for k in span) + 2 * (len(span) - 1), len(over[span[0]]))
    return total


def _block(
    table: Table, columns: list[int], heads: list[str], over: list[str], body: list[list[str]], widths: list[int],
    stub: int, indent: str, ansi: bool,
) -> list[str]:  # fmt: skip
    top, first = " " * stub, set()
    for span in _spans(columns, over):
        first.add(span[0])
        # A group's head may be wider than its columns together: the last of them gives way.
        inner = sum(widths[k] for k in span) + 2 * (len(span) - 1)
        widths[span[-1]] += max(0, len(over[span[0]]) - inner)
        top += "   " + over[span[0]].center(max(inner, len(over[span[0]])))

    def line(label: str, cells: list[str], row: int | None) -> str:
        text = label.ljust(stub)
        for k in columns:
            cell = cells[k].rjust(widths[k])
            if ansi and row is not None and (mark := table.marks.get((row, k))):
                cell = " " * (widths[k] - len(cells[k])) + _ANSI[mark] + cells[k] + _OFF
            text += ("   " if k in first else "  ") + cell
        return text.rstrip()

    out = [top.rstrip()] if top.strip() else []
    out.append(line(table.stub, heads, None))
    labels = [f"{indent}{label}" for label, _ in table.rows]
    shown = [(label, cells, i) for i, (label, cells) in enumerate(zip(labels, body, strict=True))]
    rule = "-" * max(map(len, [*out, *(line(label, cells, None) for label, cells, _ in shown)]))
    out.append(rule)
    for label, cells, i in shown:
        if i in table.sections:
            out.append(table.sections[i])
        # A row whose cells all went to another block says nothing here.
        if label.strip() or any(cells[k].strip() for k in columns):
            out.append(line(label, cells, i))
    return out


def _wrapped(note: str, width: int | None) -> list[str]:
    return [note] if width is None else textwrap.wrap(note, width) or [""]


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
