"""The command line, called in this process."""

from __future__ import annotations

import logging
import sys

import pytest

from aerialdojo_gen.cli import app as cli


def said(capsys, *arguments: object) -> tuple[int, str, str]:
    """Run a command; gives its exit code, and what it prints to standard output and standard error."""
    before, sys.argv = sys.argv, ["aerialdojo-gen", *map(str, arguments)]
    # What Python prints where nobody set logging up: pytest has, so that it would be taken for pytest's report.
    log, handler = logging.getLogger("aerialdojo_gen"), logging.StreamHandler(sys.stderr)
    log.addHandler(handler)
    try:
        with pytest.raises(SystemExit) as ended:
            cli.main()
    finally:
        log.removeHandler(handler)
        sys.argv = before
    told = capsys.readouterr()
    return int(ended.value.code or 0), told.out, told.err
