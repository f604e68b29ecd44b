"""The paper's sample of tasks: two maps a family, 50 test tasks of each map and setting, named in the release.

The paper's Tables 4 and 5 are of eight maps with 49 to 100 tasks each (docs/report.md); it does not name them. This
sample is drawn by rule, so that everyone who has the release flies the same tasks.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.base.safe_parse import read_json
from aerialdojo_gen.dataset.contents import FOLDER, existing_scenes, scenes_in_release, write_document
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.layout import partition
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import FAMILIES

PROTOCOLS = ("paper",)
SAMPLE = f"{FOLDER}/protocol.json"
# Of the paper's Tables 4 and 5.
_SETTINGS = ("base", "standard")
_MAPS_PER_FAMILY, _TASKS_PER_MAP = 2, 50
_PER_GOAL = _TASKS_PER_MAP // len(MODALITIES)
_COLUMNS = ("task_id", "family", "setting", "modality")
_ABOUT = (
    "The paper's protocol: an ID and an OOD map of every family, of each map 50 test tasks of Base and 50 of "
    "Standard, half of them with image goals. evaluate --protocol paper flies them, report --protocol paper scores "
    "them."
)


@dataclass(frozen=True)
class Sample:
    """The tasks of a protocol."""

    tasks: Mapping[str, Mapping[str, tuple[str, ...]]]  # Ids of test tasks by scene and setting

    def ids(self, scenes: Collection[str] | None = None) -> frozenset[str]:
        """Return the ids of tasks in some scenes; of all where absent."""
        kept = (own for scene, own in self.tasks.items() if scenes is None or scene in scenes)
        return frozenset(task_id for own in kept for ids in own.values() for task_id in ids)

    def of(self, scene: str, rows: pa.Table) -> pa.Table:
        """Choose a scene's rows of `tasks`; StoreError where a task of the sample is not among the test rows."""
        ids = self.ids((scene,))
        found = rows.filter(pc.is_in(rows["task_id"], pa.array(sorted(ids), pa.string())))
        if found.num_rows != len(ids):
            raise StoreError(
                f"{SAMPLE} names {len(ids) - found.num_rows:,} tasks of {scene} that are no test tasks of the "
                f"release: run {command('split')}, which writes it anew"
            )
        return found

    def shortfall(self, scenes: Collection[str]) -> str:
        """Say in one line what the paper's sample has that these scenes do not; empty if they have all of it."""
        maps = [scene for scene in self.tasks if scene in scenes]
        flown, whole = len(self.ids(maps)), len(FAMILIES) * _MAPS_PER_FAMILY * len(_SETTINGS) * _TASKS_PER_MAP
        if flown == whole:
            return ""
        none = [family for letter, family in FAMILIES.items() if not any(m.startswith(f"{letter}_") for m in maps)]
        lacking = f", none of {', '.join(none)}" if none else ""
        return (
            f"smaller than the paper's sample: {len(maps)} of {len(FAMILIES) * _MAPS_PER_FAMILY} maps{lacking}; "
            f"{flown:,} of {whole:,} tasks"
        )


def check_protocol(name: str | None) -> str:
    """Return a protocol's name, empty for none; UsageError for an unknown one."""
    check_known("no protocol", [name] if name else [], PROTOCOLS)
    return name or ""


def draw_sample(data: Where) -> Sample:
    """Draw the sample of a release: the same for the same tasks, whatever the order and number of its scenes' parts.

    Of a family's ID maps, and of its OOD maps, it is one of those that have enough test tasks of every setting and
    goal, else the one that has most.
    """
    root = open_root(data)
    best: dict[tuple[str, str], tuple[tuple[int, int], str, dict[str, tuple[str, ...]]]] = {}
    for scene in scenes_in_release(root):
        rows = store.read_scene(root, "tasks/test", scene, _COLUMNS).to_pydict()
        if not rows["task_id"]:
            continue
        drawn = _draw(rows)
        fewest = min(len(drawn.get((setting, goal), ())) for setting in _SETTINGS for goal in MODALITIES)
        place = -fewest, rng.rank(0, "protocol", scene)
        tasks = {s: tuple(sorted(i for goal in MODALITIES for i in drawn.get((s, goal), ()))) for s in _SETTINGS}
        key = rows["family"][0], partition(scene)
        if any(tasks.values()) and (key not in best or place < best[key][0]):
            best[key] = place, scene, {setting: ids for setting, ids in tasks.items() if ids}
    return Sample({scene: tasks for _, scene, tasks in sorted(best.values(), key=lambda chosen: chosen[1])})


def _draw(rows: Mapping[str, Sequence[str]]) -> dict[tuple[str, str], list[str]]:
    """Draw a scene's tasks by setting and goal."""
    pools: dict[tuple[str, str], list[str]] = {}
    for task_id, setting, goal in zip(rows["task_id"], rows["setting"], rows["modality"], strict=True):
        pools.setdefault((setting, goal), []).append(task_id)
    return {kind: sorted(pool, key=lambda i: rng.rank(0, "protocol", i))[:_PER_GOAL] for kind, pool in pools.items()}


def write_sample(data: Where) -> None:
    """Write ``release/protocol.json`` from what the release holds."""
    found = {"protocol": "paper", "about": _ABOUT, "tasks": draw_sample(data).tasks}
    write_document(data, SAMPLE, json.dumps(found, indent=1) + "\n")


def read_sample(data: Where) -> Sample:
    """Read the sample of a release; that of an older one, which does not name it, is drawn."""
    root = open_root(data)
    if not root.exists(SAMPLE):
        return draw_sample(root)
    found = read_json(root.local_copy(SAMPLE))
    tasks = found.get("tasks") if isinstance(found, dict) else None
    if not isinstance(tasks, dict) or not all(map(_well_formed, tasks.values())):
        raise StoreError(f"{root.at(SAMPLE)} is damaged: run {command('split')}, which writes it anew")
    return Sample({scene: {s: tuple(ids) for s, ids in own.items()} for scene, own in tasks.items()})


def _well_formed(own: object) -> bool:
    """Whether a scene's part of the file holds lists of ids by setting."""
    return isinstance(own, dict) and all(
        isinstance(ids, list) and all(isinstance(task_id, str) for task_id in ids) for ids in own.values()
    )


def sample_shortfall(data: Where) -> str:
    """Say in one line what the paper's sample has that a release does not; empty if it has all of it."""
    return read_sample(data).shortfall(existing_scenes(data))
