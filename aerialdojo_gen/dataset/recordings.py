"""Recordings that belong to no trajectory of the release."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import PurePosixPath

from aerialdojo_gen.dataset.contents import release_scenes
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root

_MEDIA, _NOTE = "media", "recording.json"


def orphans(where: Where) -> list[str]:
    """List the folders of recordings, relative to the data root, whose trajectories the release does not have."""
    root = open_root(where)
    released = set(release_scenes(root))
    by_scene: dict[str, list[PurePosixPath]] = {}
    for name in root.list(_MEDIA, f"*/*/{_NOTE}"):
        folder = PurePosixPath(name).parent
        by_scene.setdefault(folder.parent.name, []).append(folder)
    found = []
    for scene, folders in by_scene.items():
        routes: Collection[str] = _routes(where, scene) if scene in released else ()
        found += [str(folder) for folder in folders if folder.name not in routes]
    return sorted(found)


def prune(where: Where) -> list[str]:
    """Remove the folders that `orphans` lists; returns them. StoreError as there, or where a run holds the data."""
    root = open_root(where)
    with root.lock():
        gone = orphans(root)
        for folder in gone:
            root.delete(folder)
        for scene in {folder.rpartition("/")[0] for folder in gone}:
            if not root.list(scene):
                root.delete(scene)
    return gone


def _routes(where: Where, scene: str) -> set[str]:
    tables = (store.read_scene(where, f"routes/{side}", scene, ["nav_id"]) for side in ("train", "test"))
    return {nav_id for table in tables for nav_id in table["nav_id"].to_pylist()}
