"""Objects with their reference pictures, from the pipeline's tables if they exist, else from the release."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Any

from aerialdojo_gen.annotations.language.sides import described
from aerialdojo_gen.base.names import choose_scenes
from aerialdojo_gen.dataset.contents import existing_parts, no_release
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.shards import read_scene, shards


def scenes_with_pictures(where: Where, patterns: Sequence[str] | None = None) -> list[str]:
    """List the scenes that have reference pictures."""
    root = open_root(where)
    folders = {PurePosixPath(path).name for path in root.list("references")}
    staged = {scene for scene in folders if shards(root, "references", scene)}
    there = sorted(staged | set(existing_parts(root)["release/objects"]))
    if not there:
        raise no_release(root)
    return choose_scenes(patterns, there)


def pictured_objects(where: Where, scene: str) -> list[dict[str, Any]]:
    """Read a scene's objects with their pictures: rows of `objects`, `descriptions` and `references` together."""
    root = open_root(where)
    if not shards(root, "references", scene):
        rows: list[dict[str, Any]] = read_scene(root, "release/objects", scene).to_pylist()
        return rows
    table = described(read_scene(root, "objects", scene), read_scene(root, "descriptions", scene))
    objects = {row["object_id"]: row for row in table.to_pylist()}
    return [objects[row["object_id"]] | row for row in read_scene(root, "references", scene).to_pylist()]
