"""`describe`: write every object's descriptions from its claims, as far as its pictures show what they claim."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from aerialdojo_gen.annotations.claims import SceneClaims, claims_from_json
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.language.sides import WRITTEN
from aerialdojo_gen.annotations.language.writer import Text, Writer
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.sections import DescribeConfig
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.store.schemas import DESCRIPTIONS
from aerialdojo_gen.store.tables import from_rows


def run(job: Job, config: DescribeConfig) -> Output:
    """Write a scene's texts, a person's first; each fits nothing else of its category, landmark and direction."""
    objects, landmarks = job.read("objects").to_pylist(), job.read("landmarks").to_pylist()
    shown = {row["object_id"]: set(row["parts_shown"]) for row in job.read("references").to_pylist()}
    vocabulary = Vocabulary.of(job.scene_model(), load_catalogue(job.roots.scene_assets))
    marks = [Landmark(id=m["landmark_id"], name=m["name"], node=m["mesh_node"]) for m in landmarks]
    claims = SceneClaims(vocabulary, marks)
    writer = Writer(claims, [mark.name for mark in marks], job.seed, job.stage)
    rows: list[dict[str, Any]] = []
    counts = {"written by a person": 0, "with fewer texts": 0}
    for item in objects:
        own = claims_from_json(item["claims"])
        texts = writer.texts(
            claims.geometry.index[item["mesh_node"]], own, shown[item["object_id"]], config.paraphrases
        )
        counts["with fewer texts"] += len(texts) < config.paraphrases
        if item["description"]:
            counts["written by a person"] += 1
            texts = [Text(WRITTEN, item["description"], (), item["description"], False), *texts]
        if not texts:
            raise AnnotationError(
                f"{job.scene}: nothing that can be said of {item['mesh_node']} (object {item['object_id']}) tells it "
                "from others of its category: write its description, or choose another object: "
                f"{command('annotate', scene=job.scene)}"
            )
        ids = {"scene": job.scene, "object_id": item["object_id"]}
        rows += [ids | {"paraphrase_id": k} | asdict(text) for k, text in enumerate(texts)]
    return Output({"descriptions": from_rows(DESCRIPTIONS, rows)}, len(objects), len(rows), counts)
