"""Generate aerial object-goal-search datasets from 3D scenes, on an ordinary machine.

The package is a staged pipeline: every stage reads and writes Parquet tables (see `aerialdojo_gen.store.schemas`)
and is both a command of `aerialdojo-gen` and a plain function over tables.
"""

from aerialdojo_gen.common.version import __version__

__all__ = ["__version__"]
