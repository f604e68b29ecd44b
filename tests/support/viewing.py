"""What the tests of `view` share: the command's own server."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

YARD = "U_Courtyard_0"


@contextmanager
def served(data: Path, scene: str | None = None, *, silent: bool = True) -> Iterator[str]:
    """Run ``aerialdojo-gen view``; gives the address of the page that it opens; Ctrl-C has to be a plain end."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "view", "--data", str(data), "--no-browser"]
    command += ["--scene", scene] if scene else []
    called, path = (scene, f"scenes/{scene}/") if scene else (r"\d+ scenes", "")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    url = re.fullmatch(rf"{called}: (http://127\.0\.0\.1:\d+/{path})  \(Ctrl-C ends it\)\n", line)
    assert url, line + process.communicate()[1]
    try:
        yield url[1]
    finally:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (0, "")
    assert not err or not silent, err
