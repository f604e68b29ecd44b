"""Generate aerial object-goal-search datasets from 3D scenes, on an ordinary machine.

The package is a staged pipeline: every stage reads and writes Parquet tables (see `aerialdojo_gen.store.schemas`)
and is both a command of `aerialdojo-gen` and a plain function over tables. What is listed here is the public API,
with examples in docs/api.md; all else may change between versions.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.base.version import __version__

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.keys import config_keys
    from aerialdojo_gen.base.errors import AerialDojoError
    from aerialdojo_gen.benchmark.env import make_env
    from aerialdojo_gen.dataset.build import pipeline_status, run_pipeline
    from aerialdojo_gen.dataset.release import Release, open_release
    from aerialdojo_gen.exchange.hub import pull_release, push_to_hub
    from aerialdojo_gen.pipeline.template import init_config
    from aerialdojo_gen.planning.planner import Planner, plan
    from aerialdojo_gen.rendering.gl import GlRenderer
    from aerialdojo_gen.scenes.glb import read_glb

__all__ = [
    "AerialDojoError",
    "GlRenderer",
    "Planner",
    "Release",
    "__version__",
    "config_keys",
    "init_config",
    "make_env",
    "open_release",
    "pipeline_status",
    "plan",
    "pull_release",
    "push_to_hub",
    "read_glb",
    "run_pipeline",
]

# Imported when first asked for: with them come numba, FCL, OpenGL and PyArrow, and --help must not wait for those.
_HOMES = {
    "AerialDojoError": "aerialdojo_gen.base.errors",
    "GlRenderer": "aerialdojo_gen.rendering.gl",
    "Planner": "aerialdojo_gen.planning.planner",
    "Release": "aerialdojo_gen.dataset.release",
    "config_keys": "aerialdojo_gen.base.config.keys",
    "init_config": "aerialdojo_gen.pipeline.template",
    "make_env": "aerialdojo_gen.benchmark.env",
    "open_release": "aerialdojo_gen.dataset.release",
    "pipeline_status": "aerialdojo_gen.dataset.build",
    "plan": "aerialdojo_gen.planning.planner",
    "pull_release": "aerialdojo_gen.exchange.hub",
    "push_to_hub": "aerialdojo_gen.exchange.hub",
    "read_glb": "aerialdojo_gen.scenes.glb",
    "run_pipeline": "aerialdojo_gen.dataset.build",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
