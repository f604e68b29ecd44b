"""Commands that messages advise, to be pasted: quoted, with the pipeline and the data directory that were given."""

from __future__ import annotations

import os
import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

PROGRAM = "aerialdojo-gen"
# Commands that do not take both --pipeline and --data.
_TAKES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("add-map", "add-scene", "add-terrain", "config", "leaderboard", "vary"), ()),
    "annotate-draft": ("pipeline",),
    **dict.fromkeys(
        ("export", "import-benchmark", "pull", "push-to-hub", "report", "run", "show", "train", "view"), ("data",)
    ),
}


@dataclass(frozen=True)
class CliContext:
    """What a user gave on the command line, or to the library, and has to give again."""

    pipeline: str = ""  # As written; empty where nothing was
    data: str = ""
    program: str = PROGRAM  # What the command line is called as here


_CURRENT = [CliContext()]


def current_context() -> CliContext:
    """Return what has been given."""
    return _CURRENT[0]


def update_context(*, pipeline: object = None, data: object = None) -> None:
    """Keep what the user wrote, for the messages of this process; None leaves what is kept."""
    new = {key: str(value) for key, value in (("pipeline", pipeline), ("data", data)) if value is not None}
    _CURRENT[0] = replace(_CURRENT[0], **new)


def reset_context(called_as: str = "") -> None:
    """Forget what was given, at the start of a command."""
    _CURRENT[0] = CliContext(program=program(called_as) or _CURRENT[0].program)


def program(called_as: str) -> str:
    """Say how the command line is called: by its name where a shell finds it by that, else by its path."""
    if Path(called_as).name != PROGRAM:
        return ""
    found = shutil.which(PROGRAM)
    if found and Path(found).resolve() == Path(called_as).resolve():
        return PROGRAM
    # As one would type it in the working directory.
    relative = os.path.relpath(called_as)
    return called_as if relative.startswith("..") or not Path(called_as).is_absolute() else relative


@contextmanager
def use_context(context: CliContext) -> Iterator[None]:
    """Give advice for what somebody else was given, for the length of the block: a worker process."""
    before = _CURRENT[0]
    _CURRENT[0] = context
    try:
        yield
    finally:
        _CURRENT[0] = before


def command(verb: str, *words: object, **options: object) -> str:
    """Say a command so that it can be pasted into a shell."""
    context = current_context()
    for key, own in (("pipeline", context.pipeline), ("data", context.data)):
        if own and key in _TAKES.get(verb, ("pipeline", "data")):
            options.setdefault(key, own)
    parts = [context.program, verb, *map(str, words)]
    for key, value in options.items():
        if value is None or value is False:
            continue
        parts.append(f"--{key.replace('_', '-')}")
        if value is not True:
            parts.append(str(value))
    return " ".join(shlex.quote(part) for part in parts)
