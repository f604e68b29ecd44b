"""Checks of numbers: a scene's against the paper's, the release's against its card and the table of splits."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.paper_figures import inventory, splits
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.dataset.validate.parts import Release
from aerialdojo_gen.dataset.validate.registry import Outcome
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import SETTINGS, SUBSETS

# The paper's summed length of all routes is met to within this share, where all of its scenes are there.
_PATH_SHARE = 0.005
_SPLIT = ("tasks", "routes")
_NO_PAPER_COUNTS = "the pipeline has no paper_counts"


@dataclass
class SceneCounts:
    """What a scene of the release holds, for the counts of the whole."""

    scene: str  # Name
    complete: bool  # Whether all of its tables could be read
    rows: Counter[tuple[str, str]] = field(default_factory=Counter)  # Rows by table (tasks, routes) and folder
    routes: Counter[tuple[str, str]] = field(default_factory=Counter)  # Routes by folder and setting
    path_m: float = 0.0  # Summed length of the routes, metres
    images: tuple[str, ...] = ()  # Ids of the reference images


def count_scene(data: SceneData, complete: bool) -> SceneCounts:
    """Count what a scene holds."""
    counts = SceneCounts(data.scene, complete)
    for rows in (data[name] for name in _SPLIT if name in data.tables):
        folders = [rows.parts[k].split("/")[-2] for k in rows.part_of]
        counts.rows.update((rows.name, folder) for folder in folders)
        if rows.name == "routes":
            counts.routes.update(zip(folders, map(str, rows.texts("setting")), strict=True))
            counts.path_m = float(np.nansum(data.paths.length_m))
    if "objects" in data.tables:
        counts.images = tuple(text for text in data["objects"].texts("reference_image_id") if text)
    return counts


def scene_counts(data: SceneData, counts: SceneCounts) -> Outcome:
    """Hold a scene's landmarks, objects and tasks by setting and subset to the paper's, where the paper has it."""
    outcome = Outcome("scene_counts", "counts")
    paper_scene = inventory().get(data.scene)
    if paper_scene is None:
        outcome.skipped = "no scene of the paper"
    elif not data.pipeline.split.paper_counts:
        outcome.skipped = _NO_PAPER_COUNTS
    elif not counts.complete:
        outcome.skipped = "the scene cannot be read"
    if paper_scene is None or outcome.skipped:
        return outcome
    from aerialdojo_gen.pipeline.stages.work.candidate_policy import train_quotas

    trains = train_quotas(data.scene, inventory(), splits())
    side = store.partition(data.scene)
    pairs = {name: (len(data[name]), getattr(paper_scene, name)) for name in ("landmarks", "objects")}
    for setting in SETTINGS:
        for subset, n in (("train", trains[setting]), ("test", paper_scene.tasks[setting] - trains[setting])):
            pairs[f"{subset} {setting} tasks"] = counts.routes[f"{side}_{subset}", setting], n
    outcome.rows = len(pairs)
    for name, (found, n) in pairs.items():
        if found != n:
            outcome.fault(f"{found:,}", f"{n:,}", scene=data.scene, key=name)
    return outcome


def whole_counts(
    release: Release, totals: Sequence[SceneCounts], pipeline: Pipeline, every_scene: bool
) -> list[Outcome]:
    """Check what needs all scenes together."""
    partial = "" if all(counts.complete for counts in totals) else "a scene cannot be read"
    partial = partial if every_scene else "only some scenes were selected"
    missing = len(set(inventory()) - {counts.scene for counts in totals})
    no_paper = f"{missing} of the paper's {len(inventory())} scenes are not in it" if missing else ""
    no_paper = partial or (no_paper if pipeline.split.paper_counts else _NO_PAPER_COUNTS)
    checks = {split_counts: no_paper, path_total: no_paper, card_counts: partial, image_id_shared: partial}
    outcomes = [Outcome(judge.__name__, "counts", skipped=reason) for judge, reason in checks.items()]
    for outcome, judge in zip(outcomes, checks, strict=True):
        if not outcome.skipped:
            judge(outcome, release, totals)
    return outcomes


def split_counts(outcome: Outcome, _release: Release, totals: Sequence[SceneCounts]) -> None:
    """All scenes together have the paper's numbers of train and test tasks, and its total."""
    for (side, subset), settings in splits().items():
        folder = f"{side.lower()}_{subset}"
        for setting, n in settings.items():
            outcome.rows += 1
            found = sum(counts.routes[folder, setting] for counts in totals)
            if found != n:
                outcome.fault(f"{found:,}", f"{n:,}", part=f"routes/{folder}", key=f"{setting} tasks")


def path_total(outcome: Outcome, _release: Release, totals: Sequence[SceneCounts]) -> None:
    """The routes' summed length is the paper's to within 0.5 %."""
    found, expected = sum(one.path_m for one in totals), sum(scene.path_m for scene in inventory().values())
    outcome.rows = 1
    if abs(found - expected) > _PATH_SHARE * expected:
        stated = f"{found / 1000:,.1f} km", f"{expected / 1000:,.1f} km to within {_PATH_SHARE:.1%}"
        outcome.fault(*stated, table="routes")


def card_counts(outcome: Outcome, release: Release, totals: Sequence[SceneCounts]) -> None:
    """The dataset card tells the numbers that are there."""
    card, machine = (_text(release, name) for name in ("README.md", "croissant.json"))
    if card is None:
        outcome.rows = 1
        outcome.fault("no file", "the dataset card", part="README.md")
        return
    # Rows of `tasks` and `routes` by split: the card's table of splits, and the descriptions of record sets.
    table = re.findall(r"^\| `(\w+)` \| (\d[\d,]*) \| (\d[\d,]*) \|", card, re.MULTILINE)
    named = (("README.md", split, pair) for split, *numbers in table for pair in zip(_SPLIT, numbers, strict=True))
    stated = [(file, name, split, n) for file, split, (name, n) in named if split in SUBSETS]
    if machine is not None:
        try:
            described = {one["name"]: one["description"] for one in loads_json(machine)["recordSet"]}
            for name in _SPLIT:
                rows = re.findall(r"(\w+) \((\d[\d,]*) rows\)", described.get(name, ""))
                stated += [("croissant.json", name, split, n) for split, n in rows]
        except (ValueError, KeyError, TypeError):
            outcome.fault("no record sets", "a Croissant description", part="croissant.json")
    for file, name, split, n in stated:
        outcome.rows += 1
        found = sum(counts.rows[name, split] for counts in totals)
        if int(n.replace(",", "")) != found:
            outcome.fault(f"{n} rows told", f"{found:,}", table=name, part=file, key=split)
    if not outcome.rows:
        outcome.skipped = "neither card nor croissant.json tells the rows of the splits"


def _text(release: Release, relative: str) -> str | None:
    try:
        path = release.root.local_copy(release.name(relative))
    except FileNotFoundError:
        return None
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else None


def image_id_shared(outcome: Outcome, _release: Release, totals: Sequence[SceneCounts]) -> None:
    """A picture's id stands in one scene."""
    first: dict[str, str] = {}
    for counts in totals:
        for image_id in counts.images:
            outcome.rows += 1
            if first.setdefault(image_id, counts.scene) != counts.scene:
                key, found = f"reference_image_id={image_id}", f"of {first[image_id]} too"
                outcome.fault(found, "one scene", scene=counts.scene, table="objects", key=key)
