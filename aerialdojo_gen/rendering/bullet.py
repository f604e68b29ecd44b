"""PyBullet, imported without the line about its build that it prints to standard error."""

from __future__ import annotations

import ctypes
import os
import sys
from types import ModuleType

from aerialdojo_gen.base.errors import RenderError


def _import_silently() -> ModuleType:
    """Import PyBullet; RenderError where it is not installed: it has no wheel for Python 3.12 and later."""
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        import pybullet as module

        # C's stdio may hold the line back until after the descriptor is restored.
        ctypes.CDLL(None).fflush(None)
    except ImportError:
        raise RenderError(
            "the renderer pybullet lacks the package pybullet, which has wheels up to Python 3.11: take gl, or build "
            "it with a C++ compiler and Python's headers (pip install 'aerialdojo-gen[pybullet]')"
        ) from None
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
    result: ModuleType = module
    return result


pybullet = _import_silently()
