"""What the benches share: the shipped scenes, a command line, and CPU time."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Scene

ROOT = Path(__file__).resolve().parents[2]
ASSETS = ROOT / "scene_assets"
PIPELINE = load_pipeline(ROOT / "pipelines/aerialdojo-200k.toml")
T = TypeVar("T")


def built(name: str) -> Scene:
    return build_scene(ASSETS / "scenes" / f"{name}.toml", load_catalogue(ASSETS))


def job_of(stage: str, scene: str, data: Path) -> Job:
    """A stage's work on a scene of a dataset."""
    paths = ProjectPaths(data, ASSETS, ASSETS / "scenes", ROOT / "annotations")
    return Job(stage, scene, 0, 1, PIPELINE.seed, PIPELINE.embodiment, paths)


def options_of(doc: str | None, **defaults: Any) -> argparse.Namespace:
    """Options of a command line, each of its default's type: a list's take several values."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in defaults.items():
        several = isinstance(value, list | tuple)
        kind = str if several or value is None else type(value)
        parser.add_argument(f"--{name.replace('_', '-')}", type=kind, default=value, nargs="*" if several else None)
    return parser.parse_args()


def cpu_s(work: Callable[..., T], *args: Any) -> tuple[float, T]:
    """CPU seconds of some work, and what it returns."""
    begun = time.process_time()
    found = work(*args)
    return time.process_time() - begun, found


def median_s(work: Callable[[], object], times: int = 3) -> float:
    """Median CPU seconds of some work."""
    return float(np.median([cpu_s(work)[0] for _ in range(times)]))


def best_ms(work: Callable[[], object], times: int = 3) -> float:
    """CPU milliseconds of the best of some runs."""
    return 1e3 * min(cpu_s(work)[0] for _ in range(times))
