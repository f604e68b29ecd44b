"""Fingerprints: a hash of everything a shard depends on."""

from __future__ import annotations

import hashlib
import json
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from aerialdojo_gen.base import paper_figures
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.config.shared import Section
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.stage import SOURCE_FOLDERS, ProjectPaths, Stage
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.files import file_digest


def scene_fingerprint(stage: Stage, pipeline: Pipeline, roots: ProjectPaths, scene: str) -> str:
    """Hash all that a scene's shards depend on: code, configuration, and inputs by their content."""
    # Not by the inputs' fingerprints: where an earlier stage writes the same rows again, nothing after it is stale.
    code = stage_code(stage.name, stage.idle(pipeline.section(stage.name)))
    # The paper's figures are next to the package in a checkout, inside it in a wheel.
    figures = paper_figures.files() if "aerialdojo_gen.base.paper_figures" in code.parts else []
    sources = [*stage.sources(roots, scene), *figures]
    facts = {
        "stage": stage.name,
        "code": code.digest,
        "scene": scene,
        "seed": pipeline.seed,
        "embodiment": pipeline.embodiment.model_dump(mode="json"),
        "config": _values(pipeline.section(stage.name)),
        "inputs": {table: store.content(roots.data, table, scene) for table in stage.reads},
        "assets": [[_short(path, roots), _digest(path)] for path in sources],
    }
    texts = {name: json.dumps(value, sort_keys=True) for name, value in facts.items()}
    texts["schemas"] = _schemas((*stage.writes, *stage.reads))
    # As json.dumps would write it; the schemas are long, and the same for all scenes.
    whole = ", ".join(f'"{name}": {texts[name]}' for name in sorted(texts))
    return hashlib.sha256(f"{{{whole}}}".encode()).hexdigest()


@lru_cache(maxsize=4096)
def _short(path: Path, roots: ProjectPaths) -> str:
    """Return a file's path relative to its source folder: the same in every checkout and in a wheel."""
    for name in SOURCE_FOLDERS:
        folder = getattr(roots, name)
        if path.is_relative_to(folder):
            return f"{name}/{path.relative_to(folder).as_posix()}"
    return path.name


def _digest(path: Path) -> str:
    try:
        return file_digest(path)
    except OSError as error:
        raise AssetError(f"cannot read {path}: {error.strerror}") from None


def _values(section: Section) -> dict[str, Any]:
    """Values of a section, without paths: files count by their bytes."""

    def without_paths(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: without_paths(inner) for key, inner in value.items() if not isinstance(inner, Path)}
        return value

    values: dict[str, Any] = without_paths(section.model_dump())
    return values


@cache
def _schemas(tables: tuple[str, ...]) -> str:
    return json.dumps({name: _described(name) for name in tables}, sort_keys=True)


def _described(table: str) -> list[Any]:
    spec = store.LAYOUT[table].spec
    fields = [
        [str(field), sorted((k.decode(), v.decode()) for k, v in (field.metadata or {}).items())]
        for field in spec.schema
    ]
    return [fields, spec.key, spec.clusters, spec.plain]
