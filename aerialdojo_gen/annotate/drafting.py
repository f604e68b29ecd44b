"""The twin of ``annotate-draft``: draft a scene's annotations from things that a drone can reach and see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

from aerialdojo_gen.annotations.draft import Choice, draft_annotations
from aerialdojo_gen.annotations.format import write_annotations
from aerialdojo_gen.common.paper import paper_counts
from aerialdojo_gen.config.pipeline import Pipeline
from aerialdojo_gen.errors import UsageError
from aerialdojo_gen.layouts.build import build_scene
from aerialdojo_gen.pipeline.stage import Job, Roots
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.stages.work.anchor_sample import candidates_of
from aerialdojo_gen.stages.work.anchor_world import World


def draft_scene(
    name: str,
    pipeline: Pipeline,
    roots: Roots,
    *,
    n_landmarks: int | None = None,
    n_objects: int | None = None,
    choice: Choice | None = None,
    landmarks: tuple[str, ...] = (),
    seed: int = 0,
    force: bool = False,
) -> Path:
    """Draft a scene's annotations and write them to the folder of annotations.

    Parameters
    ----------
    name : str
        Name of the scene; its recipe is built anew.
    pipeline, roots
        Configuration and folders.
    n_landmarks, n_objects : int, optional
        How many of each; the paper's numbers for the scene where absent.
    choice : Choice, optional
        Where objects are taken from and how many of a kind; its `eligible` is set here.
    landmarks : tuple of str
        Nodes that are to be landmarks; the rest is chosen among the catalogue's landmarks.
    seed : int
        The same seed gives the same draft.
    force : bool
        Overwrite an existing file.

    Returns
    -------
    Path
        The annotation file.

    Raises
    ------
    UsageError
        The file exists, or the paper does not know the scene and no number was given.
    AnnotationError
        The scene has too few landmarks or too few things that can be reached, seen and told apart.
    """
    path = roots.annotations / f"{name}.json"
    if path.exists() and not force:
        raise UsageError(f"{path} exists: --force overwrites it")
    known = paper_counts().get(name, (n_landmarks, n_objects))
    wanted = (n_landmarks or known[0], n_objects or known[1])
    if wanted[0] is None or wanted[1] is None:
        raise UsageError(f"the paper has no scene {name}: give --landmarks and --objects")
    catalogue = load_catalogue(roots.scene_assets)
    scene = build_scene(roots.recipes / f"{name}.toml", catalogue)
    choice = replace(choice or Choice(), eligible=reachable_nodes(scene, pipeline, roots))
    annotations = draft_annotations(scene, catalogue, wanted[0], wanted[1], seed, choice, landmarks)
    write_annotations(annotations, path)
    return path


def reachable_nodes(scene: Scene, pipeline: Pipeline, roots: Roots) -> Callable[[str], bool]:
    """Make the test whether a node has a full shortlist of anchors (each node is asked once)."""
    config = pipeline.anchor_sample
    world = World.of(scene, pipeline.embodiment.radius_m, config.margin_m)
    job = Job("anchor-sample", scene.name, 0, 1, pipeline.seed, pipeline.embodiment, roots)

    @cache
    def eligible(node: str) -> bool:
        x, y, z = (float(v) for v in scene[node].centroid)
        item = {"object_id": 0, "mesh_node": node, "x_m": x, "y_m": y, "z_m": z}
        found, _, _ = candidates_of(item, world, job, config)
        return found is not None and len(found.seeing(config.min_visible_fraction)) >= config.shortlist

    return eligible
