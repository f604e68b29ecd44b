"""The table of stages, in order. A stage's work is `run` of its module in `aerialdojo_gen.pipeline.stages.work`."""

from __future__ import annotations

from collections.abc import Iterator

from aerialdojo_gen.pipeline.stage import Stage
from aerialdojo_gen.pipeline.stages import hooks
from aerialdojo_gen.rendering.resolve_config import renderer_choices, resolve_renderer, unused_renderers

STAGES: tuple[Stage, ...] = (
    Stage(
        "build-scenes", "Build the scenes' meshes from their plans.",
        reads=(), writes=("scenes",), sources=hooks.scene_sources, seconds=(4.0, 0.0),
    ),
    Stage(
        "annotate-import", "Check the annotations against the scenes and import them.",
        reads=("scenes",), writes=("landmarks", "objects", "chosen_anchors"),
        sources=hooks.annotation_sources, missing_input=hooks.missing_annotations, seconds=(0.5, 0.0),
    ),
    Stage(
        "anchor-sample", "Find viewpoints 1 m from each object that see it.",
        reads=("scenes", "objects", "chosen_anchors"), writes=("anchors", "viewpoints"),
        resolve_config=hooks.resolve_clip, idle=hooks.idle_scorers, seconds=(1.0, 0.1),
    ),
    Stage(
        "reference-images", "Render each object's picture from its selected anchor.",
        reads=("scenes", "objects", "anchors"), writes=("references",),
        resolve_config=resolve_renderer, choices=renderer_choices, idle=unused_renderers, seconds=(1.0, 0.1),
    ),
    Stage(
        "describe", "Write each object's descriptions from what its pictures show.",
        reads=("scenes", "landmarks", "objects", "references"), writes=("descriptions",),
        sources=hooks.catalogue_sources, seconds=(0.5, 0.01),
    ),
    Stage(
        "pair-objects", "Pair start anchors with targets: the candidate tasks.",
        reads=("scenes", "objects", "anchors"), writes=("pairs",), seconds=(0.1, 0.005),
    ),
    Stage(
        "plan", "Plan a collision-free reference trajectory for every candidate.",
        reads=("scenes", "objects", "anchors", "pairs"), writes=("plans",),
        parts=hooks.plan_parts, memory_mb=1700, seconds=(1.0, 0.4),
    ),
    Stage(
        "filter", "Keep the candidates that make tasks, with a reason for every rejection.",
        reads=("scenes", "objects", "pairs", "plans"), writes=("verdicts",), seconds=(0.1, 0.005),
    ),
    Stage(
        "split", "Write the release: tasks, routes, objects, train and test.",
        reads=("scenes", "landmarks", "objects", "anchors", "viewpoints", "references", "descriptions", "pairs",
               "plans", "verdicts"),
        writes=("tasks/train", "tasks/test", "routes/train", "routes/test", "release/scenes", "release/landmarks",
                "release/objects", "release/anchors", "release/viewpoints"),
        check=hooks.check_pools, seconds=(0.2, 0.005), barrier=True,
    ),
    Stage(
        "render", "Record four RGB-D views along trajectories of the release.",
        reads=("scenes", "routes/train", "routes/test"), writes=("recordings", "frames"),
        parts=hooks.render_parts, resolve_config=resolve_renderer, choices=renderer_choices, idle=unused_renderers,
        digests=("recordings", "path", "sha256"), seconds=(10.0, 0.0), barrier=True,
    ),
)  # fmt: skip

BY_NAME = {stage.name: stage for stage in STAGES}


def upstream(name: str) -> Iterator[Stage]:
    """Yield the stages that `name` needs, in order, and then the stage itself."""
    needed = {name}
    tables: set[str] = set()
    for stage in reversed(STAGES):
        if stage.name in needed or tables & set(stage.writes):
            needed.add(stage.name)
            tables |= set(stage.reads)
    yield from (stage for stage in STAGES if stage.name in needed)
