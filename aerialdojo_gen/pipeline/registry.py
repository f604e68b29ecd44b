"""The stages, in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from aerialdojo_gen.config.sections import RENDERERS
from aerialdojo_gen.errors import AssetError
from aerialdojo_gen.pipeline.stage import Roots, Stage
from aerialdojo_gen.scenes.catalogue_files import catalogue_files
from aerialdojo_gen.store import shards as store


def _scene_sources(roots: Roots, scene: str) -> list[Path]:
    mesh = roots.recipes / f"{scene}.glb"
    return [
        roots.recipes / f"{scene}.toml",
        *([mesh] if mesh.is_file() else []),
        roots.scene_assets / "materials.toml",
        *catalogue_files(roots.scene_assets),
    ]


def _annotation_sources(roots: Roots, scene: str) -> list[Path]:
    file = roots.annotations / f"{scene}.json"
    if not file.is_file():
        raise AssetError(
            f"{scene} has no annotations: {file} is missing; draft them (aerialdojo-gen annotate-draft {scene}) "
            f"or make them by hand (aerialdojo-gen annotate --scene {scene})"
        )
    return [file, *catalogue_files(roots.scene_assets)]


def _plan_parts(data: Path, scene: str, config: Any) -> int:
    return -(-store.count_rows(data, "objects", scene) // config.targets_per_part)


def _enough_for_the_paper(data: Path, scenes: Sequence[str], config: Any) -> None:
    if config.paper_counts:
        from aerialdojo_gen.release.pool import require_pools

        require_pools(data, scenes)


def _render_parts(data: Path, scene: str, config: Any) -> int:
    from aerialdojo_gen.rendering.sample import n_parts

    return n_parts(data, scene, config)


def _settle_renderer(config: Any, say: Callable[[str], None]) -> Any:
    from aerialdojo_gen.rendering.backend import choose_renderer

    choice = choose_renderer(config.renderer)
    say(choice.why)
    return config.model_copy(update={"renderer": choice.name})


def _renderers(config: Any) -> list[Any]:
    names = RENDERERS if config.renderer == "auto" else (config.renderer,)
    return [config.model_copy(update={"renderer": name}) for name in names]


def _settle_scorers(config: Any, _say: Callable[[str], None]) -> Any:
    if config.clip is None or not config.weights.clip:
        return config
    from aerialdojo_gen.scoring.clip import digest

    return config.model_copy(update={"clip": config.clip.model_copy(update={"sha256": digest(config.clip)})})


_UPSTREAM_OF_SPLIT = ("scenes", "landmarks", "objects", "anchors", "references", "pairs", "plans", "verdicts")

STAGES: tuple[Stage, ...] = (
    Stage(
        "build-scenes", "Build the scenes' meshes from their recipes.", (), ("scenes",), sources=_scene_sources
    ),
    Stage(
        "annotate-import", "Check the annotations against the scenes and import them.",
        ("scenes",), ("landmarks", "objects", "chosen_anchors"), sources=_annotation_sources,
    ),
    Stage(
        "anchor-sample", "Find viewpoints 1 m from each object that see it.",
        ("scenes", "objects", "chosen_anchors"), ("anchors",), settle=_settle_scorers,
    ),
    Stage(
        "reference-images", "Render each object's picture from its selected anchor.",
        ("scenes", "objects", "anchors"), ("references",), settle=_settle_renderer, choices=_renderers,
    ),
    Stage(
        "pair-objects", "Pair start anchors with targets: the candidate tasks.",
        ("objects", "anchors"), ("pairs",),
    ),
    Stage(
        "plan", "Plan a collision-free reference trajectory for every candidate.",
        ("scenes", "objects", "anchors", "pairs"), ("plans",), parts=_plan_parts, memory_mb=1500,
    ),
    Stage(
        "filter", "Keep the candidates that make tasks, with a reason for every rejection.",
        ("pairs", "plans"), ("verdicts",),
    ),
    Stage(
        "split", "Write the release: tasks, routes, objects, train and test.",
        _UPSTREAM_OF_SPLIT,
        ("tasks/train", "tasks/test", "routes/train", "routes/test",
         "release/scenes", "release/landmarks", "release/objects", "release/anchors"),
        check=_enough_for_the_paper,
    ),
    Stage(
        "render", "Record four RGB-D views along trajectories of the release.",
        ("scenes", "routes/train", "routes/test"), ("recordings", "frames"), parts=_render_parts,
        settle=_settle_renderer, choices=_renderers, digests=("recordings", "path", "sha256"),
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
