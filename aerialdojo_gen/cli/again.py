"""The command as it was given, with something more, to be pasted: what a message tells to do next."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.secrets import Secrets


def rerun_command(more: Sequence[str], *, without: Sequence[str] = (), data: str | None = None) -> str:
    """Return this process's command with all its options, so that a shell takes it as it stands."""
    kept = [argument for argument in sys.argv[1:] if argument not in without]
    if data is not None and os.environ.get("AERIALDOJO_DATA") and not _names(kept, "--data"):
        kept += ["--data", data]
    kept += [argument for argument in more if argument not in kept]
    called = cli_context.program(sys.argv[0])
    program = [called] if called else [sys.executable, "-m", "aerialdojo_gen.cli"]
    return Secrets().text(shlex.join([*program, *kept]))


def _names(arguments: Sequence[str], option: str) -> bool:
    return any(argument == option or argument.startswith(f"{option}=") for argument in arguments)
