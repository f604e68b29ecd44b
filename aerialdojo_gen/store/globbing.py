"""Globs over names that are not files of this machine."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import translate


def matching(names: Iterable[str], pattern: str) -> set[str]:
    """Return the names, and the folders that they lie in, that match a glob as `Path.glob` does."""
    words = [re.compile(translate(part)) if part != "**" else None for part in pattern.split("/")]
    every = {"/".join(parts[:n]) for name in names for parts in [name.split("/")] for n in range(1, len(parts) + 1)}
    return {name for name in every if _matches(name.split("/"), words)}


def _matches(parts: list[str], words: list[re.Pattern[str] | None]) -> bool:
    if not words:
        return not parts
    if words[0] is None:
        return any(_matches(parts[n:], words[1:]) for n in range(len(parts) + (len(words) > 1)))
    return bool(parts) and words[0].fullmatch(parts[0]) is not None and _matches(parts[1:], words[1:])
