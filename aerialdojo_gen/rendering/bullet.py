"""PyBullet, imported without the line about its build that it prints to standard output."""

from __future__ import annotations

import ctypes
import os
import sys
from types import ModuleType


def _import_silently() -> ModuleType:
    sys.stdout.flush()
    saved, null = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        import pybullet as module

        # It prints through C's stdio, which would write the line only when its buffer is flushed, at exit say.
        ctypes.CDLL(None).fflush(None)
    finally:
        os.dup2(saved, 1)
        os.close(saved)
        os.close(null)
    result: ModuleType = module
    return result


pybullet = _import_silently()
