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
    for rows in (data[name] for name in ("tasks", "routes") if name in data.tables):
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
    if paper_scene is None or not data.pipeline.split.paper_counts:
        outcome.skipped = "no scene of the paper" if paper_scene is None else "the pipeline has no paper_counts"
        return outcome
    if not counts.complete:
        outcome.skipped = "the scene cannot be read"
        return outcome
    from aerialdojo_gen.pipeline.stages.work.candidate_policy import train_quotas

    trains = train_quotas(data.scene, inventory(), splits())
    side = store.partition(data.scene)
    expected = {"landmarks": paper_scene.landmarks, "objects": paper_scene.objects}
    found = {"landmarks": len(data["landmarks"]), "objects": len(data["objects"])}
    for setting in SETTINGS:
        for subset, n in (("train", trains[setting]), ("test", paper_scene.tasks[setting] - trains[setting])):
            expected[f"{subset} {setting} tasks"] = n
            found[f"{subset} {setting} tasks"] = counts.routes[f"{side}_{subset}", setting]
    for name, n in expected.items():
        outcome.rows += 1
        if found[name] != n:
            outcome.fault(f"{found[name]:,}", f"{n:,}", scene=data.scene, key=name)
    return outcome


def whole_counts(
    release: Release, totals: Sequence[SceneCounts], pipeline: Pipeline, every_scene: bool
) -> list[Outcome]:
    """Check what needs all scenes together."""
    partial = "" if all(counts.complete for counts in totals) else "a scene cannot be read"
    partial = partial if every_scene else "only some scenes were selected"
    paper = partial or _not_the_papers(totals, pipeline)
    outcomes = [Outcome(name, "counts", skipped=paper if name in _OF_PAPER else partial) for name in WHOLE_CHECKS]
    for outcome, judge in zip(outcomes, (_splits, _path, _card, _images), strict=True):
        if not outcome.skipped:
            judge(outcome, release, totals)
    return outcomes


WHOLE_CHECKS = {
    "split_counts": "All scenes together have the paper's numbers of train and test tasks, and its total.",
    "path_total": "The routes' summed length is the paper's to within 0.5 %.",
    "card_counts": "The dataset card tells the numbers that are there.",
    "image_id_shared": "A picture's id stands in one scene.",
}
_OF_PAPER = ("split_counts", "path_total")


def _splits(outcome: Outcome, _release: Release, totals: Sequence[SceneCounts]) -> None:
    for (side, subset), settings in splits().items():
        folder = f"{side.lower()}_{subset}"
        for setting, n in settings.items():
            outcome.rows += 1
            found = sum(counts.routes[folder, setting] for counts in totals)
            if found != n:
                outcome.fault(f"{found:,}", f"{n:,}", part=f"routes/{folder}", key=f"{setting} tasks")


def _path(outcome: Outcome, _release: Release, totals: Sequence[SceneCounts]) -> None:
    found, expected = sum(one.path_m for one in totals), sum(scene.path_m for scene in inventory().values())
    outcome.rows = 1
    if abs(found - expected) > _PATH_SHARE * expected:
        stated = f"{found / 1000:,.1f} km", f"{expected / 1000:,.1f} km to within {_PATH_SHARE:.1%}"
        outcome.fault(*stated, table="routes")


def _card(outcome: Outcome, release: Release, totals: Sequence[SceneCounts]) -> None:
    card = _text(release, "README.md")
    if card is None:
        outcome.rows = 1
        outcome.fault("no file", "the dataset card", part="README.md")
        return
    stated = _of_card(card)
    machine = _text(release, "croissant.json")
    if machine is not None:
        try:
            stated += _of_croissant(machine)
        except (ValueError, KeyError, TypeError):
            outcome.fault("no record sets", "a Croissant description", part="croissant.json")
    for file, table, folder, n in stated:
        outcome.rows += 1
        found = sum(counts.rows[table, folder] for counts in totals)
        if n != found:
            outcome.fault(f"{n:,} rows told", f"{found:,}", table=table, part=file, key=folder)
    if not outcome.rows:
        outcome.skipped = "neither card nor croissant.json tells the rows of the splits"


def _text(release: Release, relative: str) -> str | None:
    try:
        path = release.root.local_copy(release.name(relative))
    except FileNotFoundError:
        return None
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else None


def _of_card(text: str) -> list[tuple[str, str, str, int]]:
    """Rows of `tasks` and `routes` by split, as the card's table of splits has them."""
    found = re.findall(r"^\| `(\w+)` \| ([\d,]+) \| ([\d,]+) \|", text, re.MULTILINE)
    counted = [(folder, ("tasks", a), ("routes", b)) for folder, a, b in found if folder in SUBSETS]
    return [("README.md", t, folder, int(n.replace(",", ""))) for folder, *both in counted for t, n in both]


def _of_croissant(text: str) -> list[tuple[str, str, str, int]]:
    """Rows of `tasks` and `routes` by split, as croissant.json describes its record sets."""
    described = {one["name"]: one["description"] for one in loads_json(text)["recordSet"]}
    return [
        ("croissant.json", table, folder, int(n.replace(",", "")))
        for table in ("tasks", "routes")
        for folder, n in re.findall(r"(\w+) \(([\d,]+) rows\)", described.get(table, ""))
    ]


def _images(outcome: Outcome, _release: Release, totals: Sequence[SceneCounts]) -> None:
    first: dict[str, str] = {}
    for counts in totals:
        for image_id in counts.images:
            outcome.rows += 1
            if first.setdefault(image_id, counts.scene) != counts.scene:
                key, found = f"reference_image_id={image_id}", f"of {first[image_id]} too"
                outcome.fault(found, "one scene", scene=counts.scene, table="objects", key=key)


def _not_the_papers(totals: Sequence[SceneCounts], pipeline: Pipeline) -> str:
    if not pipeline.split.paper_counts:
        return "the pipeline has no paper_counts"
    missing = len(set(inventory()) - {counts.scene for counts in totals})
    return f"{missing} of the paper's {len(inventory())} scenes are not in it" if missing else ""
