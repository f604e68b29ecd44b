"""The twin of ``annotate-draft``: draft a scene's annotations from things that a drone can reach and see."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

from aerialdojo_gen.annotations.draft import MAX_PER_CATEGORY, SCENERY, AnnotationDrafter, DraftOptions
from aerialdojo_gen.annotations.format import Annotations, write_annotations
from aerialdojo_gen.annotations.landmarks import choose_landmarks
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import AnnotationError, UsageError
from aerialdojo_gen.base.paper_figures import paper_counts
from aerialdojo_gen.imports.forms import is_unnamed
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.pipeline.stages.work.anchor_sample import candidates_of
from aerialdojo_gen.pipeline.stages.work.anchor_world import World
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Scene

log = logging.getLogger(__name__)

AUTO = "auto"
# Default number of objects: some hundred tasks.
_AUTO_OBJECTS = 20
_FEW_THINGS = 8
# A task needs a start and a target object.
MIN_OBJECTS = 2
_CAUSES = {
    "no_surface": "no surface 1 m away", "out_of_bounds": "outside the flight volume",
    "in_collision": "too close to something else", "unreachable": "shut in, or below ground",
    "not_visible": "hidden by something else",
}  # fmt: skip


def draft_scene(
    name: str, pipeline: Pipeline, roots: ProjectPaths, options: DraftOptions | None = None, *, force: bool = False,
    reporter: Reporter | None = None, scene: Scene | None = None,
) -> Path:  # fmt: skip
    """Draft a scene's annotations and write them to the annotations folder; builds the scene unless it is given."""
    path, reporter = roots.annotations / f"{name}.json", reporter or Reporter(quiet=True)
    options = options or DraftOptions()
    if path.exists() and not force:
        raise UsageError(f"{path} exists: --force overwrites it")
    counts = paper_counts().get(name)
    n_landmarks, n_objects = options.n_landmarks, options.n_objects
    exact = counts is not None and n_objects != AUTO
    most = n_objects if isinstance(n_objects, int) else counts[1] if counts and exact else _AUTO_OBJECTS
    catalogue = load_catalogue(roots.scene_assets)
    scene = scene or build_scene(roots.recipes / f"{name}.toml", catalogue)
    vocabulary = Vocabulary.of(scene, catalogue)
    targets = Counter(i.category for i, w in zip(scene.instances, vocabulary.words, strict=True) if w.target)
    if not targets:
        raise _nothing_to_draft(name, f"; not taken: {len(scene.instances):,} {SCENERY}")
    chosen_landmarks = choose_landmarks(
        vocabulary, n_landmarks or (counts[0] if counts else 2 if targets.total() >= _FEW_THINGS else 1),
        options.landmarks, at_most=n_landmarks is None and counts is None,
    )  # fmt: skip
    if options.max_per_category is None and scene.imported:
        options = replace(options, max_per_category=max(MAX_PER_CATEGORY, math.ceil(most / len(targets))))
    probe = AnnotationDrafter(vocabulary, chosen_landmarks, options)
    proposed = most if exact else min(most, probe.capacity())
    kinds = len({scene.instances[k].category for k in probe.things})
    if not proposed:
        raise _nothing_to_draft(name, probe.rejection_summary())
    reporter.line(
        f"{name}: {_plural(len(probe.things), 'thing')} of {_plural(kinds, 'kind')} to look for; up to "
        f"{_plural(proposed, 'object')} by {_plural(len(chosen_landmarks), 'landmark')} can be drafted"
    )
    # The bar counts objects found: most things are never tried, and the world is built before the first.
    rejecting = replace(options, reject=make_reject(scene, pipeline, roots))
    with reporter.bar("annotate-draft", proposed, unit="objects") as bar:
        drafter = AnnotationDrafter(vocabulary, chosen_landmarks, rejecting)
        objects = drafter.objects(proposed, bar.advance)
    _check_enough(name, len(objects), proposed, drafter.rejection_summary(), exact=exact)
    write_annotations(Annotations(name, chosen_landmarks, objects), path)
    unknown = sum(is_unnamed(entry.node, entry.category) for entry in objects)
    if unknown:
        log.warning(
            "%s: needs review: %d of %d objects are known by colour and form alone; name them (--names): %s",
            name, unknown, len(objects), command("annotate", scene=name),
        )  # fmt: skip
    counted = f"{_plural(len(chosen_landmarks), 'landmark')}, {_plural(len(objects), 'object')}"
    reporter.line(f"{name}: {counted}{drafter.rejection_summary()}")
    return path


def _check_enough(name: str, made: int, expected: int, why: str, *, exact: bool) -> None:
    """Raise an error for an empty or incomplete draft; warn of one smaller than proposed."""
    by_hand = f"add others by hand: {command('annotate', scene=name)}"
    if made == 0:
        raise _nothing_to_draft(name, why)
    if made < expected and exact:
        fewer = f"--objects {made} takes those, or " if made >= MIN_OBJECTS else ""
        raise AnnotationError(
            f"{name}: {expected} objects requested, {made} can be chosen and distinguished{why}: {fewer}{by_hand}"
        )
    if made < MIN_OBJECTS:
        log.warning("%s: a single object makes no task%s; %s", name, why, by_hand)
    elif made < expected:
        log.warning("%s: %d of %d objects can be chosen and distinguished%s; %s", name, made, expected, why, by_hand)


def _nothing_to_draft(name: str, why: str) -> AnnotationError:
    return AnnotationError(
        f"{name}: nothing in it can be drafted as an object{why}. Annotate it by hand, where a box (key B) cuts "
        f"a thing out of a surface: {command('annotate', scene=name)}"
    )


def _plural(n: int, what: str) -> str:
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def make_reject(scene: Scene, pipeline: Pipeline, roots: ProjectPaths) -> Callable[[str], str]:
    """Make the function that rejects nodes without a full shortlist of anchors, with the reason."""
    config = pipeline.anchor_sample
    world = World.of(scene, pipeline.embodiment.radius_m, config.margin_m)
    job = Job("anchor-sample", scene.name, 0, 1, pipeline.seed, pipeline.embodiment, roots)

    @cache
    def reject_reason(node: str) -> str:
        x, y, z = (float(v) for v in scene[node].centroid)
        item = {"object_id": 0, "mesh_node": node, "x_m": x, "y_m": y, "z_m": z}
        candidates, rejected, _ = candidates_of(item, world, job, config)
        visible = 0 if candidates is None else len(candidates.seeing(config.min_visible_fraction))
        if visible >= config.shortlist:
            return ""
        if candidates is not None:
            rejected["not_visible"] += len(candidates.positions_m) - visible
        cause = max(_CAUSES, key=lambda reason: rejected[reason])
        return f"without {config.shortlist} viewpoints at {config.standoff_m:g} m ({_CAUSES[cause]})"

    return reject_reason
