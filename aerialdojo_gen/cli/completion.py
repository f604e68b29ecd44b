"""What a shell offers after a tab: scenes, pipelines and agents beside commands and options."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import typer

from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.store.root import open_root


def shipped_pipelines() -> list[str]:
    """Return the names of the pipelines that come with the program."""
    return sorted(file.stem for file in (home() / "pipelines").glob("*.toml"))


def pipelines(incomplete: str) -> list[str]:
    """Offer the names of the pipelines that come with the program, and files in reach of what is written."""
    return [name for name in [*shipped_pipelines(), *_files(incomplete)] if name.startswith(incomplete)]


def scenes(ctx: typer.Context, incomplete: str) -> list[str]:
    """Offer the scenes of the pipeline that is named, else of the release in the data directory, else all recipes."""
    return [name for name in _scenes(ctx) if name.startswith(incomplete)]


def agents(incomplete: str) -> list[str]:
    """Offer the agents that come with the program."""
    from aerialdojo_gen.benchmark.agents.load import BUILT_IN

    return [name for name in BUILT_IN if name.startswith(incomplete)]


def _scenes(ctx: typer.Context) -> list[str]:
    from aerialdojo_gen.base.errors import AerialDojoError

    # A tab is no place for an error's line.
    with contextlib.suppress(AerialDojoError, OSError):
        pipeline, data = ctx.params.get("pipeline"), str(ctx.params.get("data") or "")
        if pipeline:
            from aerialdojo_gen.dataset.build import open_pipeline
            from aerialdojo_gen.pipeline.runner import known_scenes

            return known_scenes(open_pipeline(pipeline, "data")[1].recipes)
        if "://" not in data and (released := _released(Path(data or "data"))):
            return released
    return sorted(file.stem for file in (home() / "scene_assets" / "scenes").glob("*.toml"))


def _released(data: Path) -> list[str]:
    from aerialdojo_gen.dataset.contents import existing_scenes

    return list(existing_scenes(open_root(data))) if data.is_dir() else []


def _files(incomplete: str) -> Iterator[str]:
    folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    with contextlib.suppress(OSError):
        for entry in sorted(folder.iterdir()):
            shown = str(entry) if folder != Path() or not incomplete.startswith("./") else f"./{entry}"
            if entry.suffix == ".toml":
                yield shown
            elif entry.is_dir() and any(entry.glob("*.toml")):
                yield f"{shown}/"
