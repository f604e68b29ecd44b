"""The table of stages, in order, and what a stage decides before it runs: source files, shards, checks.

A stage's work is `run` of its module in `aerialdojo_gen.pipeline.stages.work`. Nothing heavy is imported here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.rendering.resolve_config import renderer_choices, resolve_renderer, unused_renderers
from aerialdojo_gen.scenes.catalogue_files import catalogue_files
from aerialdojo_gen.scenes.plans import HEIGHTS_SUFFIX

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import AnchorSampleConfig, PlanConfig, RenderConfig, SplitConfig
    from aerialdojo_gen.store.root import DataRoot


def scene_sources(roots: ProjectPaths, scene: str) -> list[Path]:
    """List a scene's plan, the mesh or the heights next to it, materials and catalogue."""
    beside = (roots.recipes / f"{scene}{suffix}" for suffix in (".glb", HEIGHTS_SUFFIX))
    return [
        roots.recipes / f"{scene}.toml",
        *(path for path in beside if path.is_file()),
        *catalogue_sources(roots, scene),
    ]


def annotation_sources(roots: ProjectPaths, scene: str) -> list[Path]:
    """List the annotation file and the catalogue; AssetError if the file is missing."""
    if missing := missing_annotations(roots, scene):
        raise AssetError(missing)
    return [_annotation_file(roots, scene), *catalogue_files(roots.scene_assets)]


def catalogue_sources(roots: ProjectPaths, _scene: str) -> list[Path]:
    """List the files of the catalogue and its materials."""
    return [roots.scene_assets / "materials.toml", *catalogue_files(roots.scene_assets)]


def missing_annotations(roots: ProjectPaths, scene: str) -> str:
    """Explain that a scene has no annotation file, and how to make one; empty if it has."""
    file = _annotation_file(roots, scene)
    if file.is_file():
        return ""
    return (
        f"{scene} has no annotations: {file} is missing; draft them: {command('annotate-draft', scene)} "
        f"or make them by hand: {command('annotate', scene=scene)}"
    )


def _annotation_file(roots: ProjectPaths, scene: str) -> Path:
    return roots.annotations / f"{scene}.json"


def resolve_clip(config: AnchorSampleConfig, _say: Callable[[str], None]) -> AnchorSampleConfig:
    """Add the digest of the CLIP model's files if the CLIP scorer has a weight."""
    if config.clip is None or not config.weights.clip:
        return config
    from aerialdojo_gen.pipeline.scoring.clip import digest

    return config.model_copy(update={"clip": config.clip.model_copy(update={"sha256": digest(config.clip)})})


def idle_scorers(config: AnchorSampleConfig) -> tuple[str, ...]:
    """Name the modules of scorers without a weight."""
    return tuple(
        f"aerialdojo_gen.pipeline.scoring.{name}" for name in ("clip", "vlm") if not getattr(config.weights, name)
    )


def plan_parts(data: DataRoot, scene: str, config: PlanConfig) -> int:
    """Count a scene's shards: `targets_per_part` targets each, or one if its candidates are compared."""
    from aerialdojo_gen.pipeline.stages.work.candidate_policy import policy_of
    from aerialdojo_gen.store import shards

    if policy_of(scene, config.quota, seed=0).compares:
        return 1
    return -(-shards.count_rows(data, "objects", scene) // config.targets_per_part)


def render_parts(data: DataRoot, scene: str, config: RenderConfig) -> int:
    """Count a scene's shards: `trajectories_per_part` recordings each."""
    from aerialdojo_gen.rendering.sample import n_parts

    return n_parts(data, scene, config)


def check_pools(data: DataRoot, scenes: Sequence[str], config: SplitConfig) -> None:
    """Raise a PoolError if the paper's counts are required and there are too few candidates."""
    if config.paper_counts:
        from aerialdojo_gen.pipeline.stages.work.candidate_pool import require_pools

        require_pools(data, scenes)


STAGES: tuple[Stage, ...] = (
    Stage(
        "build-scenes", "Build the scenes' meshes from their plans.",
        reads=(), writes=("scenes",), sources=scene_sources, seconds=(4.0, 0.0),
    ),
    Stage(
        "annotate-import", "Check the annotations against the scenes and import them.",
        reads=("scenes",), writes=("landmarks", "objects", "chosen_anchors"),
        sources=annotation_sources, missing_input=missing_annotations, seconds=(0.5, 0.0),
    ),
    Stage(
        "anchor-sample", "Find viewpoints 1 m from each object that see it.",
        reads=("scenes", "objects", "chosen_anchors"), writes=("anchors", "viewpoints"),
        resolve_config=resolve_clip, idle=idle_scorers, seconds=(1.0, 0.1),
    ),
    Stage(
        "reference-images", "Render each object's picture from its selected anchor.",
        reads=("scenes", "objects", "anchors"), writes=("references",),
        resolve_config=resolve_renderer, choices=renderer_choices, idle=unused_renderers, seconds=(1.0, 0.1),
    ),
    Stage(
        "describe", "Write each object's descriptions from what its pictures show.",
        reads=("scenes", "landmarks", "objects", "references"), writes=("descriptions",),
        sources=catalogue_sources, seconds=(0.5, 0.01),
    ),
    Stage(
        "pair-objects", "Pair start anchors with targets: the candidate tasks.",
        reads=("scenes", "objects", "anchors"), writes=("pairs",), seconds=(0.1, 0.005),
    ),
    Stage(
        "plan", "Plan a collision-free reference trajectory for every candidate.",
        reads=("scenes", "objects", "anchors", "pairs"), writes=("plans",),
        parts=plan_parts, memory_mb=1700, seconds=(1.0, 0.4),
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
        check=check_pools, seconds=(0.2, 0.005), barrier=True,
    ),
    Stage(
        "render", "Record four RGB-D views along trajectories of the release.",
        reads=("scenes", "routes/train", "routes/test"), writes=("recordings", "frames"),
        parts=render_parts, resolve_config=resolve_renderer, choices=renderer_choices, idle=unused_renderers,
        seconds=(10.0, 0.0), barrier=True,
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
