"""A digest of a release's scenes, which a trained policy depends on."""

from __future__ import annotations

import hashlib
import json

from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root


def release_fingerprint(data: Where) -> str:
    """SHA-256, hexadecimal, of the names and meshes of a release's scenes."""
    root = open_root(data)
    facts = [
        store.read_scene(root, "release/scenes", scene, ("scene", "mesh_sha256")).to_pylist()
        for scene in scenes_in_release(root)
    ]
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
