"""The command line, called in this process."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.cli import app as cli


@contextlib.contextmanager
def _as_command(arguments: tuple[object, ...]):
    before, sys.argv = sys.argv, ["aerialdojo-gen", *map(str, arguments)]
    # What Python prints where nobody set logging up: pytest has, so that it would be taken for pytest's report.
    log, handler = logging.getLogger("aerialdojo_gen"), logging.StreamHandler(sys.stderr)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
        sys.argv = before


def said(capsys, *arguments: object) -> tuple[int, str, str]:
    """Run a command; gives its exit code, and what it prints to standard output and standard error."""
    with _as_command(arguments), pytest.raises(SystemExit) as ended:
        cli.main()
    told = capsys.readouterr()
    return int(ended.value.code or 0), told.out, told.err


def called(*arguments: object, cwd: Path = Path(), **env: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, with more environment variables; gives what a process of its own would."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.dict(os.environ, env), contextlib.chdir(cwd), contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err), _as_command(arguments),
        cli_context.use_context(cli_context.CliContext()), pytest.raises(SystemExit) as ended,
    ):  # fmt: skip
        cli.main()
    return subprocess.CompletedProcess(sys.argv, int(ended.value.code or 0), out.getvalue(), err.getvalue())
