"""Fingerprints: what a shard was made from, as one hash."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path

from aerialdojo_gen import store
from aerialdojo_gen.config import Pipeline
from aerialdojo_gen.errors import AssetError
from aerialdojo_gen.stage import Roots, Stage


@lru_cache(maxsize=4096)
def _file_digest(path: Path, _size: int, _mtime_ns: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal; AssetError where it is missing."""
    try:
        stat = path.stat()
    except OSError as error:
        raise AssetError(f"cannot read {path}: {error.strerror}") from None
    return _file_digest(path, stat.st_size, stat.st_mtime_ns)


def scene_fingerprint(stage: Stage, pipeline: Pipeline, roots: Roots, scene: str) -> str:
    """Hash all that the shards of a scene depend on.

    Inputs count by their content, not by their own fingerprint: where an upstream stage ran again and wrote the
    same rows, nothing downstream is stale.

    Parameters
    ----------
    stage : Stage
        The stage that writes.
    pipeline : Pipeline
        Its section, the seed and the embodiment count.
    roots : Roots
        Where the inputs and assets are.
    scene : str
        Name of the scene.

    Returns
    -------
    str
        Hexadecimal SHA-256.

    Raises
    ------
    StoreError, AssetError
        An input or an asset is missing or damaged.
    """
    schemas = {
        name: [str(field) for field in store.LAYOUT[name].spec.schema] for name in (*stage.writes, *stage.reads)
    }
    package = Path(__file__).parent
    facts = {
        "stage": stage.name,
        "version": stage.version,
        "scene": scene,
        "seed": pipeline.seed,
        "embodiment": pipeline.embodiment.model_dump(mode="json"),
        "config": pipeline.section(stage.name).model_dump(mode="json"),
        "schemas": schemas,
        "inputs": {table: store.content(roots.data, table, scene) for table in stage.reads},
        # Names relative to their folder, so that a checkout elsewhere has the same fingerprints.
        "assets": [[_short(path, roots, package), file_digest(path)] for path in stage.sources(roots, scene)],
    }
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=4096)
def _short(path: Path, roots: Roots, package: Path) -> str:
    for root in (roots.recipes, roots.scene_assets, roots.annotations, package):
        if path.is_relative_to(root):
            return str(path.relative_to(root))
    return path.name
