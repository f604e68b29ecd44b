"""The descriptions that a task may have: its own, or one of its target's drawn for an episode."""

from __future__ import annotations

from functools import lru_cache

from aerialdojo_gen.annotations.language.sides import of_side
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

CHOICES = ("task", "random")


def check_paraphrase(choice: str) -> str:
    """Return the choice; UsageError for an unknown one."""
    if choice not in CHOICES:
        raise UsageError(unknown("no choice of paraphrase", choice, CHOICES))
    return choice


@lru_cache(maxsize=100)
def texts_of_tasks(root: DataRoot, scene: str, subset: str) -> dict[str, tuple[str, ...]]:
    """Read the texts that tasks of a subset may have, by navigation task: of test tasks those that are held out."""
    objects = store.read_stored(root, "release/objects", scene, ("object_id", "paraphrases"))
    if "paraphrases" not in objects.column_names:
        raise StoreError(f"the objects of {scene} in {root}/release have no paraphrases: an older version made them")
    texts = {
        row["object_id"]: tuple(text["text"] for text in of_side(row["paraphrases"], held_out=subset == "test"))
        for row in objects.to_pylist()
    }
    routes = store.read_scene(root, f"routes/{subset}", scene, ("nav_id", "target_object_id"))
    return {row["nav_id"]: texts[row["target_object_id"]] for row in routes.to_pylist()}
