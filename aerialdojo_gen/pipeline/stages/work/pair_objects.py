"""`pair-objects`: candidate tasks, every start anchor with every other object's selected anchor (paper: pairs)."""

from __future__ import annotations

import math
from itertools import compress

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.sections import PairObjectsConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.rays import instance_caster
from aerialdojo_gen.geometry.start_visibility import start_visibility
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.rendering.casters import triangle_caster
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.store.schemas import PAIRS, VIEWS

Floats = NDArray[np.float64]


def run(job: Job, config: PairObjectsConfig) -> Output:
    """Pair objects' anchors with others' selected one, but where no route could make a task (`length_bound_m`)."""
    anchors = job.read("anchors")
    object_id = anchors["object_id"].to_numpy()
    anchor_id = anchors["anchor_id"].to_numpy()
    position = np.column_stack([anchors[f"{a}_m"].to_numpy() for a in "xyz"])
    selected = np.flatnonzero(anchors["selected"].to_numpy(zero_copy_only=False))
    starting = np.flatnonzero(anchor_id < config.start_variants)

    s, t = (k.ravel() for k in np.meshgrid(starting, selected, indexing="ij"))
    distinct = object_id[s] != object_id[t]
    s, t = s[distinct], t[distinct]
    euclidean = np.linalg.norm(position[t] - position[s], axis=1)
    too_close = euclidean <= config.min_euclidean_m
    bound = length_bound_m(position[s], position[t], config.max_approach_m)
    too_far = ~too_close & (bound >= config.max_length_m)
    keep = ~(too_close | too_far)

    starts = zip(object_id[s].tolist(), anchor_id[s].tolist(), object_id[t].tolist(), strict=True)
    ids = [f"{start}_{anchor}__{target}" for start, anchor, target in compress(starts, keep.tolist())]
    order = np.array(sorted(range(len(ids)), key=ids.__getitem__), dtype=np.int64)
    s, t = s[keep][order], t[keep][order]
    starts_at = np.column_stack([position, wrap_angle_rad(anchors["yaw_rad"].to_numpy() + math.pi)])
    share, view = _seen_at_start(job, config, object_id[t], starts_at[s])
    table = pa.table(
        {
            "scene": pa.repeat(job.scene, len(order)),
            "pair_id": pa.array([ids[k] for k in order], pa.string()),
            "start_object_id": object_id[s],
            "start_anchor_id": anchor_id[s],
            "target_object_id": object_id[t],
            "euclidean_m": euclidean[keep][order],
            "target_visible_at_start": share,
            "visible_view_at_start": pa.array([VIEWS[k] if k >= 0 else None for k in view.tolist()], pa.string()),
        },
        schema=PAIRS.schema,
    )
    counts = {"too_close": int(too_close.sum()), "too_far": int(too_far.sum())}
    return Output({"pairs": table}, rows_in=len(keep), rows_out=table.num_rows, counts=counts)


def surface_points(scene: str, object_id: int, item: Instance, n: int) -> tuple[Floats, Floats]:
    """Draw the points of an object that starts are judged by, and their normals, (n, 3) each, world metres."""
    return Surface.of(item).sample_normals(n, generator(0, "pair-objects", scene, object_id))


def _seen_at_start(
    job: Job, config: PairObjectsConfig, targets: NDArray[np.int32], starts: Floats
) -> tuple[Floats, NDArray[np.int64]]:
    """Shares of the targets that are seen from start poses, (n,) float64, and by which view, (n,) int64 or -1."""
    share, view = np.zeros(len(targets)), np.full(len(targets), -1, dtype=np.int64)
    if not len(targets):
        return share, view
    scene = job.scene_model()
    caster, things = triangle_caster(scene), {item.node: item for item in scene.instances}
    objects = job.read("objects")
    nodes = dict(zip(objects["object_id"].to_pylist(), objects["mesh_node"].to_pylist(), strict=True))
    for target in np.unique(targets).tolist():
        item = things.get(nodes.get(target, ""))
        if item is None:
            raise StoreError(
                f"{job.scene}: object {target} is not in the scene's mesh: "
                f"run {command('annotate-import', scene=job.scene)}"
            )
        rows = np.flatnonzero(targets == target)
        points, _ = surface_points(job.scene, target, item, config.surface_points)
        share[rows], view[rows] = start_visibility(caster, instance_caster(item), points, starts[rows])
    return share, view


def length_bound_m(start: Floats, goal: Floats, max_approach_m: float) -> Floats:
    """Lower bound (n,), metres, of a route's length: level and vertical distance, less what an Approach may cut."""
    way = np.abs(goal - start)
    return np.asarray(np.hypot(way[:, 0], way[:, 1]) + way[:, 2] - (math.sqrt(2.0) - 1.0) * max_approach_m)
