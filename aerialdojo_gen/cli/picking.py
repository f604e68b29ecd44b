"""One scene of several: by its name, by a glob that fits it alone, or picked from a list on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TextIO

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import choose_scenes, closest


def given_scene(position: str | None, option: str | None) -> str | None:
    """Return the scene that is named by position or by ``--scene``."""
    if position and option and position != option:
        raise UsageError(f"two scenes, {position} and --scene {option}: name one")
    return position or option


def pick_scene(given: str | None, known: Sequence[str], ask: TextIO | None = None, tell: TextIO | None = None) -> str:
    """Choose one of the scenes there are."""
    ask, tell = ask or sys.stdin, tell or sys.stderr
    fitting = choose_scenes([given] if given else None, known)
    if len(fitting) == 1:
        return fitting[0]
    if not (ask.isatty() and tell.isatty()):
        shown = ", ".join(fitting[:5]) + (" …" if len(fitting) > 5 else "")
        raise UsageError(f"{len(fitting)} scenes fit{f' {given!r}' if given else ''}: name one: {shown}")
    print("\n".join(_listed(fitting)), file=tell)
    while True:
        print(f"scene (1 to {len(fitting)}, or a name): ", end="", file=tell, flush=True)
        answer = ask.readline()
        if not answer:
            raise UsageError("no scene was picked")
        word = answer.strip()
        if word.isascii() and word.isdigit() and 1 <= int(word[:6]) <= len(fitting):
            return fitting[int(word) - 1]
        if near := [name for name in fitting if name == word] or closest(word, fitting):
            return near[0]


def _listed(names: Sequence[str], columns: int = 3) -> list[str]:
    """Number names in columns that are read downwards."""
    rows = -(-len(names) // columns)
    width = max(map(len, names)) + 1
    cells = [f"{k + 1:3} {name:{width}}" for k, name in enumerate(names)]
    return ["".join(cells[row::rows]).rstrip() for row in range(rows)]
