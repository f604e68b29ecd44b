"""All that is fuzzed, by name: what reads a file or an answer from outside.

A target's call raises what it raises; nothing but an `AerialDojoError` is right.
"""

from __future__ import annotations

from fuzzing import imports, meshes, scenes, tables
from fuzzing.cases import Target

TARGETS: dict[str, Target] = {**scenes.TARGETS, **meshes.TARGETS, **imports.TARGETS, **tables.TARGETS}
