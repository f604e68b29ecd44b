"""Which pipeline made which scenes of a release, so that another pipeline does not overwrite them."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.dataset.contents import FOLDER, existing_scenes, write_document
from aerialdojo_gen.dataset.stats.tables import Made, in_paper_order, made_of
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root

_RECORD = "pipeline.json"
RECORD = f"{FOLDER}/{_RECORD}"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
# What does not change the release: folders of this machine, which scenes and stages are asked for, recordings.
_IRRELEVANT = {"name", "scenes", "stages", "render", "scene_assets", "recipes", "annotations"}


@dataclass(frozen=True)
class Maker:
    """A pipeline as a release knows it."""

    name: str = ""  # The pipeline's name; empty where the release does not say
    sha256: str = ""  # Of its settings, hexadecimal
    paper_counts: bool = field(default=True, compare=False)
    prefer_harder: float = field(default=0.0, compare=False)

    def __str__(self) -> str:
        """In words, for messages."""
        return f"pipeline {self.name!r}" if self.name else "a pipeline that it does not name"


def maker_of(pipeline: Pipeline) -> Maker:
    """Return a release's record of a pipeline."""
    settings = pipeline.model_dump(mode="json", exclude=_IRRELEVANT)
    settings["anchor_sample"].pop("clip")  # where the model's files lie
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
    return Maker(pipeline.name, digest, pipeline.split.paper_counts, pipeline.split.prefer_harder)


def pipeline_names(data: Where, folder: str = FOLDER) -> list[str]:
    """Return the names of the pipelines that made a release; none where it does not say."""
    names = {str(entry.get("name", "")) for entry in _recorded(open_root(data), f"{folder}/{_RECORD}".lstrip("/"))}
    # It may come from elsewhere, and is looked for as a file.
    return sorted(name for name in names if _NAME.fullmatch(name))


def _recorded(root: DataRoot, path: str = RECORD) -> list[dict[str, Any]]:
    """Read the record of a release's pipelines; empty if it is missing or damaged."""
    try:
        entries = json.loads(root.local_copy(path).read_text(encoding="utf-8"))["pipelines"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []
    return [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []


def makers(data: Where) -> dict[str, Maker]:
    """Return the makers of a release's scenes, by scene; one that the release does not know is `Maker()`."""
    root = open_root(data)
    known: dict[str, Maker] = {}
    try:
        for entry in _recorded(root):
            rules = (entry.get("paper_counts", True) is not False, float(entry.get("prefer_harder", 0.0)))
            maker = Maker(str(entry["name"]), str(entry["sha256"]), *rules)
            known |= dict.fromkeys(entry["scenes"], maker)
    except (ValueError, KeyError, TypeError):
        known = {}  # damaged: as if nothing were known, which is the cautious side
    return {scene: known.get(scene, Maker()) for scene in existing_scenes(root)}


def made_of_scenes(data: Where, scenes: Sequence[str]) -> list[Made]:
    """Count what a release has of scenes, in the paper's order, with the paper's figures if it follows them."""
    root = open_root(data)
    follow = {scene for scene, maker in makers(root).items() if maker.paper_counts}
    found = (made_of(root, scene) for scene in scenes)
    return in_paper_order([made if made.scene in follow else replace(made, paper_scene=None) for made in found])


def record_makers(data: Where, pipeline: Pipeline, scenes: Sequence[str]) -> None:
    """Record that a pipeline made these scenes of the release."""
    root = open_root(data)
    found = makers(root)
    found |= {scene: maker_of(pipeline) for scene in scenes if scene in found}
    entries = [
        vars(maker) | {"scenes": sorted(s for s in found if found[s] == maker)}
        for maker in sorted(set(found.values()) - {Maker()}, key=lambda maker: (maker.name, maker.sha256))
    ]
    text = json.dumps({"pipelines": entries}, indent=1) + "\n"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if root.local_copy(RECORD).read_text(encoding="utf-8") == text:
            return
    write_document(root, RECORD, text)


def check_replaced(data: Where, pipeline: Pipeline, scenes: Sequence[str], *, whole: bool) -> None:
    """Refuse to put a pipeline's release in the place of another one's."""
    root, mine = open_root(data), maker_of(pipeline)
    found = makers(root)
    removed = [scene for scene, maker in found.items() if whole and scene not in scenes and maker != mine]
    replaced = [scene for scene, maker in found.items() if scene in scenes and maker.name not in ("", mine.name)]
    lost = removed + replaced
    if not lost:
        return
    others = sorted({found[scene] for scene in lost}, key=lambda maker: maker.name)
    named = " and ".join(
        dict.fromkeys(str(m) + (" with other settings" if m.name == mine.name else "") for m in others)
    )
    parts = (("remove", removed), ("replace", replaced))
    what = " and ".join(f"{verb} {_listed(root, part)}" for verb, part in parts if part)
    names = {maker.name for maker in others} - {"", mine.name}
    own = f"give --pipeline {names.pop()}, " if len(names) == 1 else ""
    raise UsageError(
        f"the release in {root} was made by {named}: {mine} would {what}; {own}use another --data, "
        "or lose them with --replace"
    )


def _listed(root: DataRoot, scenes: list[str]) -> str:
    names = ", ".join(scenes[:4]) + (", …" if len(scenes) > 4 else "")
    tasks = 0
    for scene in scenes:
        with contextlib.suppress(StoreError):
            tasks += sum(store.count_rows(root, table, scene) for table in ("tasks/train", "tasks/test"))
    return f"{len(scenes)} scene{'s' * (len(scenes) > 1)} with {tasks:,} tasks ({names})"
