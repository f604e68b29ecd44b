"""Stage ``annotate-import``: checks an annotation file against its scene and makes tables of it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pyarrow as pa

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.format import Annotations, Fault, parse_annotations
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.config.sections import AnnotateImportConfig
from aerialdojo_gen.base.errors import AnnotationError, UsageError
from aerialdojo_gen.base.paper_figures import paper_counts
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.store.schemas import CHOSEN_ANCHORS, LANDMARKS, OBJECTS


def run(job: Job, config: AnnotateImportConfig) -> Output:
    """Import the landmarks and target objects of one scene (paper, section on annotation)."""
    path = job.roots.annotations / f"{job.scene}.json"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise UsageError(f"no annotations of {job.scene}: {path} does not exist") from None
    except UnicodeDecodeError as error:
        raise AnnotationError(f"{path} is not UTF-8: {error}") from None
    source = parse_annotations(text)
    vocabulary = Vocabulary.of(job.scene_model(), load_catalogue(job.roots.scene_assets))
    counts = paper_counts().get(job.scene) if config.paper_counts else None
    checked = SourceCheck(source, vocabulary, counts)
    if checked.faults or checked.claims is None:
        raise AnnotationError(_report(path, checked.faults))
    tables = annotation_tables(source.annotations, checked.claims)
    landmarks, chosen = tables["landmarks"].num_rows, tables["chosen_anchors"].num_rows
    unchecked = sum(map(len, checked.unchecked.values()))
    rows = landmarks + tables["objects"].num_rows
    return Output(
        tables, rows, rows, {"landmarks": landmarks, "chosen_anchors": chosen, "unchecked_words": unchecked}
    )


def annotation_tables(annotations: Annotations, claims: SceneClaims) -> dict[str, pa.Table]:
    """Make the tables `landmarks`, `objects` and `chosen_anchors` of annotations that are right."""
    scene = claims.scene
    landmarks = sorted(annotations.landmarks, key=lambda entry: entry.id)
    landmark_rows = [
        {"scene": scene.name, "landmark_id": e.id, "name": e.name, "mesh_node": e.node}
        | _xyz("{}_m", scene[e.node].centroid)
        for e in landmarks
    ]
    object_rows, chosen_rows = [], []
    for entry in sorted(annotations.objects, key=lambda entry: entry.id):
        instance, i = scene[entry.node], claims.geometry.index[entry.node]
        bearing = claims.bearings[i]
        assert bearing is not None, f"{scene.name}, object {entry.id}: unchecked annotations"
        ids = {"scene": scene.name, "object_id": entry.id}
        object_rows.append(
            {
                **ids,
                **{name: getattr(entry, name) for name in ("name", "category", "description")},
                "mesh_node": entry.node,
                **_xyz("{}_m", instance.centroid),
                **_xyz("size_{}_m", instance.bounds[1] - instance.bounds[0]),
                "landmark_id": landmarks[bearing.landmark].id,
                "direction": bearing.direction,
                "claims": json.dumps([claim.to_json() for claim in claims.of(i)], ensure_ascii=False),
                "shape": instance.shape or None,
                "shape_held_out": instance.held_out if instance.shape else None,
            }
        )
        if (anchor := entry.anchor) is not None:
            yaw_rad = math.radians(anchor.yaw_deg)
            chosen_rows.append({**ids, **_xyz("{}_m", anchor.position_m), "yaw_rad": yaw_rad})
    rows = ((LANDMARKS, landmark_rows), (OBJECTS, object_rows), (CHOSEN_ANCHORS, chosen_rows))
    return {spec.name: pa.Table.from_pylist(own, schema=spec.schema) for spec, own in rows}


def _xyz(name: str, values: Any) -> dict[str, float]:
    return {name.format(axis): float(value) for axis, value in zip("xyz", values, strict=True)}


def _report(path: Path, faults: list[Fault]) -> str:
    lines = "\n".join(f"  {path.name}:{fault}".replace(":line ", ":", 1) for fault in faults)
    return f"{path}: {len(faults)} fault{'s' if len(faults) != 1 else ''}, nothing imported\n{lines}"
