"""Values as TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


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
