"""Simplex noise, whose functions Numba compiles too: loaded after Numba knows where machine code can be kept."""

from __future__ import annotations

import aerialdojo_gen.base.kernels  # noqa: F401

# isort: split
from opensimplex import OpenSimplex  # noqa: TID251 - all other modules take it from here

__all__ = ["OpenSimplex"]
