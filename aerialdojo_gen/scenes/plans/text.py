"""Plans as TOML text: one key a line, lists wrapped, one blank line before an entry with a comment."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_WIDTH = 150


def plan_text(plan: Mapping[str, Any], comment: str = "", sections: Mapping[int, str] | None = None) -> str:
    """Write a plan; reading the text gives the same values.

    `sections` has the comments of the entries that a section begins with; those between follow without a blank line.
    """
    head = {key: value for key, value in plan.items() if key not in _TABLES and key != "site"}
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [line for key, value in head.items() for line in _pair(key, value)]
    for table in _TABLES:
        if plan.get(table):
            lines += ["", f"[{table}]", *(line for key, value in plan[table].items() for line in _pair(key, value))]
    for number, entry in enumerate(plan.get("site", ())):
        if sections is None or number in sections:
            lines.append("")
        if sections is not None and number in sections:
            lines.append(f"# {sections[number]}")
        lines += entry_lines(entry)
    return "\n".join(lines) + "\n"


def entry_lines(entry: Mapping[str, Any]) -> list[str]:
    """Write an entry; of a list of entries, each on a line, or on several with its longest list last."""
    if "entries" in entry:
        lines = [line for one in entry["entries"] for line in _listed(one)]
        return ["[[site]]", "entries = [", *lines, "]"]
    return ["[[site]]", *(line for key, value in entry.items() for line in _pair(key, value))]


def _listed(entry: Mapping[str, Any]) -> list[str]:
    if len(_inline(entry)) + 3 > _WIDTH:
        lists = {key: len(_inline(value)) for key, value in entry.items() if isinstance(value, list | tuple)}
        last = max(lists, key=lambda key: lists[key], default=None)
        order = sorted(entry, key=lambda key: key == last)
        entry = {key: entry[key] for key in order}
    *lines, end = _wrapped("", entry, "  ")
    return [*lines, f"{end},"]


_TABLES = (
    "world", "palette", "inventory", "origin", "moves", "floor_m", "lines", "areas", "fields", "placing", "ground",
)  # fmt: skip


def _pair(key: str, value: Any) -> Iterator[str]:
    yield from _wrapped(f"{_key(key)} = ", value, "")


def _wrapped(start: str, value: Any, indent: str) -> Iterator[str]:
    """Write a value on one line, or a list over several of as many items as fit, also one that ends a table."""
    text, end = _inline(value), "]"
    last = [*value.values()][-1] if isinstance(value, Mapping) and value else None
    if len(indent + start + text) > _WIDTH and isinstance(last, list | tuple):
        start, end, value = start + text.removesuffix(f"{_inline(last)} }}"), "] }", last
    if len(indent + start + text) <= _WIDTH or not isinstance(value, list | tuple):
        yield f"{indent}{start}{text}"
        return
    yield f"{indent}{start}["
    row = ""
    for item in value:
        first, *others = _wrapped("", item, f"{indent}  ")
        text = first.lstrip()
        if row and (others or len(indent) + 2 + len(row) + len(text) + 2 > _WIDTH):
            yield f"{indent}  {row.rstrip()}"
            row = ""
        if others:
            yield from (first, *others[:-1], f"{others[-1]},")
        else:
            row += f"{text}, "
    if row:
        yield f"{indent}  {row.rstrip()}"
    yield f"{indent}{end}"


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_inline(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_inline, value)) + "]"
    if isinstance(value, float) and value == int(value):
        return str(int(value))
    return repr(value)


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key)
