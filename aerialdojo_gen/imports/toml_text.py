"""Write recipes as readable TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def recipe_text(head: Mapping[str, Any], parameters: Mapping[str, Any], comments: tuple[str, ...] = ()) -> str:
    """Write a recipe."""
    # File names may contain any character, newlines too.
    lines = ["# " + "".join(c if c.isprintable() else "?" for c in line) for line in comments]
    lines += [f"{key} = {toml_value(value)}" for key, value in head.items()]
    plain = {k: v for k, v in parameters.items() if not _tables(v) and not isinstance(v, Mapping)}
    lines += ["", "[parameters]", *(f"{key} = {toml_value(value)}" for key, value in plain.items())]
    for key, value in parameters.items():
        if isinstance(value, Mapping):
            lines += ["", f"[parameters.{key}]", *(f"{k} = {toml_value(v)}" for k, v in value.items())]
        elif _tables(value):
            for table in value:
                lines += ["", f"[[parameters.{key}]]", *(f"{k} = {toml_value(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def toml_value(value: Any) -> str:
    """Format a value: number, string, boolean, list or inline table."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{k} = {toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        if value and isinstance(value[0], list | tuple) and len(value[0]) > 8:
            return "[\n" + ",\n".join("  " + toml_value(row) for row in value) + ",\n]"
        if value and isinstance(value[0], Mapping):
            return "[\n" + ",\n".join("  " + toml_value(row) for row in value) + ",\n]"
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, float):
        return f"{value:.10g}" if value % 1 else f"{value:.1f}"
    if isinstance(value, str):
        # TOML supports all of JSON's escapes except the slash's, which is not used.
        return json.dumps(value.replace("\x7f", ""), ensure_ascii=False)
    return str(value)
