"""An annotation session: one scene's annotations with everything that the page shows."""

from __future__ import annotations

import contextlib
import itertools
import json
import re
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.format import Anchor, Annotations, Object, format_annotations, parse_annotations
from aerialdojo_gen.annotations.phrases import spoken
from aerialdojo_gen.annotations.relations import nearest_landmark
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import AerialDojoError, UsageError, disk_error
from aerialdojo_gen.base.paper_figures import paper_counts
from aerialdojo_gen.imports.forms import is_unnamed
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.scenes.build import cut_out
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.recipe import Cut, load_imported
from aerialdojo_gen.store.atomic import atomic_write
from aerialdojo_gen.store.staging import scratch_folder
from aerialdojo_gen.studio.annotate.anchors import AnchorService
from aerialdojo_gen.studio.annotate.document import (
    Add,
    Change,
    ConflictError,
    Operation,
    apply,
    describe_entry,
    edits_of,
    find,
)
from aerialdojo_gen.studio.annotate.storage import Author, History, Record, State, Storage
from aerialdojo_gen.studio.web.payload import scene_payload

_MAX_CHANGES = 200
_PATH = re.compile(r"^(landmarks|objects)\[(\d+)\](?:\.(\w+))?")
_MENTION = re.compile(r"\b(landmarks|objects)\[(\d+)\]")
_BOX_HEAD = "\n[[imported.cuts]]\n"


class AnnotationSession:
    """The operations behind the page's requests."""

    def __init__(self, name: str, pipeline: Pipeline, roots: ProjectPaths) -> None:
        self.storage = Storage(roots.annotations, name)
        self.storage.load()
        self._pipeline, self._roots = pipeline, roots
        self._catalogue = load_catalogue(roots.scene_assets)
        self._counts = paper_counts().get(name) if pipeline.annotate_import.paper_counts else None
        self._lock = threading.RLock()  # the geometry caches results
        self._open_scene()

    def _open_scene(self, commit: Callable[[], None] = lambda: None) -> None:
        """Load the scene, run `commit`, and only then replace the previous scene."""
        name, pipeline = self.storage.scene, self._pipeline
        job = Job("annotate", name, 0, 1, pipeline.seed, pipeline.embodiment, self._roots)
        scene = job.scene_model(keep=2)  # a picture of the previous scene may be in progress
        payload, describer = scene_payload(scene), Describer(Vocabulary(scene, self._catalogue), self._counts)
        rays = ray_caster(scene)
        commit()
        self.scene: Scene = scene
        self.payload, self._describer, self._rays = payload, describer, rays
        self._described: tuple[str, dict[str, Any]] | None = None
        self.anchors = AnchorService(scene, pipeline, self._roots)

    # Reading.

    def facts(self) -> dict[str, Any]:
        """Return what does not change: name, bounds and categories with their words."""
        categories = {instance.category for instance in self.scene.instances}
        words = {category: self._catalogue.names.get(category, spoken(category)) for category in categories}
        if self.scene.imported:
            words |= {category: self._catalogue.names[category] for category in self._catalogue.targets}
        return {
            "scene": self.scene.name,
            "imported": self.scene.imported,
            "bounds_m": self.scene.bounds.tolist(),
            "categories": dict(sorted(words.items())),
            "standoff_m": self.anchors.config.standoff_m,
            "picture_px": self.anchors.size,
            "file": self.storage.path.name,
            "wanted": self._counts,
        }

    def document(self, client: str = "", state: State | None = None) -> dict[str, Any]:
        """Return the annotations with positions, faults, and what the tab `client` can undo."""
        state = state or self.storage.load()
        with self._lock:
            undo, redo = self._history().stacks(client)
            if self._described is None or self._described[0] != state.version:
                self._described = (state.version, self._describer.describe(state.annotations))
            return {
                "scene": self.scene.name,
                "version": state.version,
                **self._described[1],
                "undo": undo[-1].what if undo else None,
                "redo": redo[-1].what if redo else None,
            }

    def draft(self, operation: Operation) -> dict[str, Any]:
        """Return an entry as it would be after an operation: the check while somebody types."""
        annotations = self.storage.load().annotations
        edits = edits_of(operation, annotations, 2**31 - 1)
        with self._lock:
            described = self._describer.describe(apply(annotations, edits))
        entry_id = 2**31 - 1 if isinstance(operation, Add) else operation.id
        return next((e for e in described[operation.kind] if e["id"] == entry_id), {})

    # Changes.

    def change(self, version: str, author: Author, operation: Operation) -> dict[str, Any]:
        """Apply an operation and save it; see `Storage.change`."""
        fields = {} if operation.do == "remove" else operation.fields.set_values()
        if fields.get("node", "") and fields["node"] not in self.scene:
            raise AerialDojoError(f"no node {fields['node']!r} in the scene")
        if fields.get("anchor") is not None and isinstance(operation, Change):
            self._check_anchor(operation.id, fields["anchor"])
        return self.saved(self.storage.change(version, author, operation), author)

    def saved(self, done: tuple[State, Record | None], author: Author) -> dict[str, Any]:
        """Return the annotations after a change of the storage."""
        state, record = done
        return self.document(author.client, state) | {"done": record.model_dump(mode="json") if record else None}

    def changes_since(self, version: str) -> list[dict[str, Any]]:
        """Return the changes after a version."""
        return [record.model_dump(mode="json") for record in self._history().since(version)][-50:]

    def history(self) -> list[dict[str, Any]]:
        """Return the last changes, newest first."""
        return [record.model_dump(mode="json") for record in reversed(self._history().records[-_MAX_CHANGES:])]

    def _history(self) -> History:
        self.storage.history.refresh()
        return self.storage.history

    # Picking, and anchors.

    def pick(self, origin_m: Sequence[float], direction: Sequence[float]) -> dict[str, Any] | None:
        """Return the first hit of a ray (world, metres): node, category, point, bearing; None if there is none."""
        ray = np.asarray([direction], dtype=np.float64)
        if not 1e-9 < float(np.linalg.norm(ray)) < 1e9:
            raise AerialDojoError("a ray needs a direction")
        distance, k = self._rays.first_hit(np.asarray(origin_m, dtype=np.float64), ray)
        if k[0] < 0:
            return None
        point = np.asarray(origin_m) + float(distance[0]) * ray[0] / np.linalg.norm(ray[0])
        return self.about(self._rays.nodes[int(k[0])]) | {"point_m": point.round(3).tolist()}

    def about(self, node: str) -> dict[str, Any]:
        """Return what the mesh says about a node."""
        instance, imported = self.scene[node], load_imported(self._recipe)
        return {
            "node": node,
            "category": instance.category,
            "word": self._catalogue.names.get(instance.category, spoken(instance.category)),
            "attributes": instance.attributes,
            "boxed": imported is not None and node in {cut.node for cut in imported.cuts},
            "size_m": np.ptp(instance.bounds, axis=0).round(2).tolist(),
            **self._describer.place(node),
            **self._describer.bearing(self.storage.load().annotations, node),
        }

    def object(self, object_id: int) -> Object:
        """Return an object whose node is in the scene; `UsageError` if there is none."""
        match = find(self.storage.load().annotations, "objects", object_id)
        if match is None or not isinstance(match[1], Object) or match[1].node not in self.scene:
            raise UsageError(f"there is no object {object_id} with a node in the scene")
        return match[1]

    # Boxes, where an imported mesh has no node for a thing.

    def cut(self, low_m: Sequence[float], high_m: Sequence[float], category: str) -> dict[str, Any]:
        """Make a node of what lies in a box (corners in world metres); imported scenes only."""
        if load_imported(self._recipe) is None:
            raise AerialDojoError(
                "this scene is built from a recipe, every thing in it has a node: boxes are not needed"
            )
        slug = re.sub(r"[^a-z0-9]+", "_", category.lower()).strip("_")[:60]
        if not slug:
            raise AerialDojoError("a category is required")
        low, high = np.minimum(low_m, high_m).round(3), np.maximum(low_m, high_m).round(3)
        with self._lock, self.storage.locked():
            node = next(n for k in itertools.count() if (n := f"{slug}_{k:03d}") not in self.scene)
            cut = Cut(node=node, category=slug, low_m=tuple(low.tolist()), high_m=tuple(high.tolist()))
            cut_out(self.scene, (cut,))
            keys = "".join(f"{key} = {json.dumps(value)}\n" for key, value in cut.model_dump(mode="json").items())
            self._rebuild(self._recipe.read_text(encoding="utf-8") + _BOX_HEAD + keys)
        return self.about(node)

    def uncut(self, node: str) -> None:
        """Remove a box; `AerialDojoError` if its node is annotated, or no box made it."""
        annotations = self.storage.load().annotations
        if node in {e.node for e in annotations.landmarks} | {e.node for e in annotations.objects}:
            raise AerialDojoError(f"{node} is annotated: remove its entry first")
        with self._lock, self.storage.locked():
            head, *boxes = self._recipe.read_text(encoding="utf-8").split(_BOX_HEAD)
            kept = [box for box in boxes if f"node = {json.dumps(node)}\n" not in box]
            if len(kept) == len(boxes):
                raise AerialDojoError(f"{node} was not created by a box")
            self._rebuild(_BOX_HEAD.join([head, *kept]))

    @property
    def _recipe(self) -> Path:
        return self._roots.recipes / f"{self.storage.scene}.toml"

    def _rebuild(self, recipe: str) -> None:
        with _staged(self._roots, self.storage.scene, recipe) as roots:
            build(self.storage.scene, self._pipeline, roots)
        before = self.anchors
        self._open_scene(commit=lambda: _write(self._recipe, recipe))
        before.close()

    def _check_anchor(self, object_id: int, anchor: Anchor) -> None:
        try:
            entry = self.object(object_id)
        except UsageError as error:
            raise ConflictError(str(error)) from None
        _, faults = self.anchors.check_viewpoint(
            entry, np.array(anchor.position_m), float(np.radians(anchor.yaw_deg))
        )
        if faults:
            raise AerialDojoError(f"invalid anchor: {'; '.join(faults)}")

    def export(self) -> bytes:
        """Return the annotation file, byte for byte, or an empty one."""
        state = self.storage.load()
        return (state.text or format_annotations(state.annotations)).encode("utf-8")


def open_session(name: str, pipeline: Pipeline, roots: ProjectPaths) -> AnnotationSession:
    """Open a scene for annotation, building its mesh if it is stale."""
    from aerialdojo_gen.pipeline.runner import chosen_scenes

    scenes = chosen_scenes(pipeline, roots, [name])
    if len(scenes) > 1:
        raise UsageError(f"{name} are {len(scenes)} scenes ({', '.join(scenes[:3])}, ...): annotate one at a time")
    build(scenes[0], pipeline, roots)
    return AnnotationSession(scenes[0], pipeline, roots)


def build(scene: str, pipeline: Pipeline, roots: ProjectPaths) -> None:
    """Bring a scene's mesh up to date with its recipe."""
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.pipeline.progress import Reporter

    runner.run(runner.stages_named(("build-scenes",)), [scene], pipeline, roots, reporter=Reporter(quiet=True))


@contextlib.contextmanager
def _staged(roots: ProjectPaths, scene: str, text: str) -> Iterator[ProjectPaths]:
    """Lay a changed recipe out for a build, with the scene's own mesh beside it: one that fails replaces none."""
    with contextlib.ExitStack() as held:
        try:
            folder = held.enter_context(scratch_folder())
            (folder / f"{scene}.toml").write_text(text, encoding="utf-8")
            (folder / f"{scene}.glb").symlink_to((roots.recipes / f"{scene}.glb").resolve())
        except OSError as error:
            raise disk_error(error, Path(tempfile.gettempdir())) from error
        yield replace(roots, recipes=folder)


def _write(recipe: Path, text: str) -> None:
    atomic_write(recipe.parent, recipe.name, text)


class Describer:
    """Describes annotations of one scene as JSON; not thread-safe."""

    def __init__(self, vocabulary: Vocabulary, counts: tuple[int, int] | None) -> None:
        self._scene, self._vocabulary, self._counts = vocabulary.scene, vocabulary, counts

    def describe(self, annotations: Annotations) -> dict[str, Any]:
        """Describe all entries: ``landmarks``, ``objects`` (each with its ``faults``) and ``faults`` of the file."""
        source = parse_annotations(format_annotations(annotations))
        faults: dict[tuple[str, int], list[dict[str, str]]] = {}
        general = []
        faulty = SourceCheck(source, self._vocabulary, self._counts).faults
        for fault in faulty:
            message = _MENTION.sub(
                lambda m: describe_entry(m[1], getattr(annotations, m[1])[int(m[2])]), fault.message
            )
            at = _PATH.match(fault.path)
            if at is None:
                general.append(message)
            else:
                faults.setdefault((at[1], int(at[2])), []).append({"field": at[3] or "", "message": message})
        landmarks = [
            {**entry.model_dump(), **self.place(entry.node), "faults": faults.get(("landmarks", k), [])}
            for k, entry in enumerate(annotations.landmarks)
        ]
        objects = [
            self._object(annotations, entry, faults.get(("objects", k), []))
            for k, entry in enumerate(annotations.objects)
        ]
        return {"landmarks": landmarks, "objects": objects, "faults": general}

    def _object(self, annotations: Annotations, entry: Object, faults: list[dict[str, str]]) -> dict[str, Any]:
        lacks = [key for key in ("name", "category") if not getattr(entry, key).strip()]
        lacks += ["person"] if is_unnamed(entry.node, entry.category) else []
        lacks += ["check"] if any(fault["field"] not in lacks for fault in faults) else []
        return {
            **entry.model_dump(),
            "description": entry.description or "",
            **self.place(entry.node),
            **self.bearing(annotations, entry.node),
            "faults": faults,
            "lacks": lacks,
        }

    def place(self, node: str) -> dict[str, Any]:
        """Middle of a node's box, ``position_m``; None where the scene has no such node."""
        position_m = self._scene[node].centroid.round(3).tolist() if node in self._scene else None
        return {"position_m": position_m}

    def bearing(self, annotations: Annotations, node: str) -> dict[str, Any]:
        """Nearest ``landmark`` and ``direction`` of a node, as the task will state them; None where there is none."""
        marks = [m for m in sorted(annotations.landmarks, key=lambda m: m.id) if m.node in self._scene]
        places = np.array([self._scene[m.node].centroid for m in marks]).reshape(-1, 3)
        nearest = nearest_landmark(self._scene[node].centroid, places) if node in self._scene else None
        if nearest is None:
            return {"landmark": None, "direction": None}
        return {"landmark": marks[nearest.landmark].name, "direction": nearest.direction}
