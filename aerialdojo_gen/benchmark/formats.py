"""A table written out: for a terminal, in Markdown, in LaTeX."""

from __future__ import annotations

from collections.abc import Iterable

from aerialdojo_gen.benchmark.tables import Table


def as_text(table: Table) -> str:
    """Write a table for a terminal."""
    heads = [table.stub, *(name for _, names in table.groups for name in names)]
    lines = [[label, *cells] for label, cells in table.rows]
    widths = [max(len(line[k]) for line in [heads, *lines]) for k in range(len(heads))]
    starts, top = 1, " " * widths[0]
    for group, names in table.groups:
        # A group's head may be wider than its columns together: the last of them gives way.
        span = sum(widths[starts : starts + len(names)]) + 2 * (len(names) - 1)
        widths[starts + len(names) - 1] += max(0, len(group) - span)
        top += "   " + group.center(max(span, len(group)))
        starts += len(names)
    out = [table.title, top.rstrip()] if top.strip() else [table.title]
    firsts = {0}
    k = 1
    for _, names in table.groups:
        firsts.add(k)
        k += len(names)
    for line in [heads, *lines]:
        text = line[0].ljust(widths[0])
        for k in range(1, len(line)):
            text += ("   " if k in firsts else "  ") + line[k].rjust(widths[k])
        out.append(text.rstrip())
    out.insert(len(out) - len(lines), "-" * max(map(len, out)))
    return "\n".join([*out, *table.notes])


def as_markdown(table: Table) -> str:
    """Write a table in Markdown; a column's head has its group's, for Markdown knows no groups."""
    heads = [table.stub, *(f"{group}: {name}" if group else name for group, names in table.groups for name in names)]
    lines = [f"**{_plain(table.title)}**", "", _pipes(heads), _pipes(["---", *["---:"] * (len(heads) - 1)])]
    lines += [_pipes([label, *cells]) for label, cells in table.rows]
    return "\n".join([*lines, *(f"\n{_plain(note)}" for note in table.notes)])


def _pipes(cells: Iterable[str]) -> str:
    return "| " + " | ".join(_plain(cell) for cell in cells) + " |"


def _plain(text: str) -> str:
    for sign in "\\|*_<>`[]":
        text = text.replace(sign, "\\" + sign)
    return text


def as_latex(table: Table) -> str:
    """Write a table in LaTeX, for the package booktabs."""
    columns = "l" + "".join("r" * len(names) for _, names in table.groups)
    lines = [r"\begin{table}", r"\centering", r"\caption{" + _tex(" ".join((table.title + ".", *table.notes))) + "}"]
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
    lines += [" & ".join(map(_tex, [label, *cells])) + r" \\" for label, cells in table.rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}"])


_TEX = {
    **{c: "\\" + c for c in "&%$#_{}"}, "\\": r"\textbackslash{}", "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", "±": r"$\pm$", "↑": r"$\uparrow$", "↓": r"$\downarrow$", "–": "--",
}  # fmt: skip


def _tex(text: str) -> str:
    return "".join(_TEX.get(c, c) for c in text)


FORMATS = {"terminal": as_text, "markdown": as_markdown, "latex": as_latex}
