"""`split`: write a scene's part of the release (`tasks` for agents, `routes` for the evaluator only)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.annotations.language.sides import described, of_side
from aerialdojo_gen.base.config.sections import SplitConfig
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.pipeline.stages.work.candidate_policy import (
    Accepted,
    difficulty_level,
    policy_of,
    sampling_key,
    train_mask,
)
from aerialdojo_gen.scenes.worlds.world import is_world, world_of
from aerialdojo_gen.store.schemas import RELEASE_ANCHORS, RELEASE_OBJECTS, ROUTES, TASKS
from aerialdojo_gen.store.schemas.staged import DIFFICULTY, START_VIEW

_POSE = ("x_m", "y_m", "z_m", "yaw_rad")
_LISTS = (*_POSE, "action", "agent_action")
# 48 bits: two of the paper's 102,866 tasks collide once in 50,000 salts, which split reports.
_DIGEST_BYTES = 6


def key_of(salt: str | None, seed: int) -> bytes:
    """The key (32 bytes) of a release's ids; it is never stored."""
    text = f"seed {seed}" if salt is None else f"salt {salt}"
    return hashlib.blake2b(text.encode(), digest_size=32, person=b"aerialdojo-ids").digest()


def nav_id(scene: str, pair_id: str, key: bytes) -> str:
    """Id of a navigation task, which does not reveal the target as the pair's id does."""
    return f"{scene}-{_hex(f'{scene}/{pair_id}', key, b'nav')}"


def reference_id(scene: str, object_id: int, key: bytes) -> str:
    """Id of an object's picture, which does not reveal the object: ``ref_`` and 12 hexadecimal digits."""
    return "ref_" + _hex(f"{scene}/{object_id}", key, b"reference")


def held_out(scene: str, object_ids: Sequence[int], fraction: float, key: bytes) -> set[int]:
    """Choose a scene's objects that the split by objects holds out."""
    place = sorted(object_ids, key=lambda k: (_hex(f"{scene}/{k}", key, b"held out"), k))
    return set(place[: int(fraction * len(place) + 0.5)])


def _hex(text: str, key: bytes, kind: bytes) -> str:
    """Hash by a key: ids cannot be enumerated without the release's salt."""
    return hashlib.blake2b(text.encode(), digest_size=_DIGEST_BYTES, key=key, person=kind).hexdigest()


def _train_fraction(scene: str, out_of_distribution: bool, config: SplitConfig) -> float:
    """Share of a scene's tasks that train: all or none of a world's, whose seed decides."""
    if is_world(scene):
        return 1.0 if world_of(scene).side == "train" else 0.0
    return config.ood_train_fraction if out_of_distribution else config.id_train_fraction


def _take(table: pa.Table, key: str, ids: pa.ChunkedArray) -> pa.Table:
    """Rows of `table` whose `key` is `ids`, in the order of `ids`."""
    return table.take(pc.index_in(ids, value_set=table.column(key).combine_chunks()))


def routes_table(
    scene: str, kept: pa.Table, pairs: pa.Table, plans: pa.Table, goals: pa.Table, key: bytes
) -> pa.Table:
    """Make the routes of the kept candidates, without their lists: ``plan`` is the row of `plans` that has them."""
    plan = pc.index_in(kept.column("pair_id"), value_set=plans.column("pair_id").combine_chunks())
    pairs = _take(pairs, "pair_id", kept.column("pair_id"))
    plans = plans.drop_columns(list(_LISTS)).take(plan)
    # Without the pictures: every route would take a copy of its goal's.
    goal = _take(goals.select(["object_id", *_POSE]), "object_id", pairs.column("target_object_id"))
    pair_ids = kept.column("pair_id").to_pylist()
    columns: dict[str, Any] = {
        "nav_id": pa.array([nav_id(scene, p, key) for p in pair_ids], pa.string()),
        "scene": pa.repeat(scene, kept.num_rows),
        "setting": kept.column("setting"),
        **{name: pairs.column(name) for name in ("start_object_id", "start_anchor_id", "target_object_id")},
        **{f"goal_{name}": goal.column(name) for name in _POSE},
        **{name: pairs.column(name) for name in ("euclidean_m", *(field.name for field in START_VIEW))},
        "detour_ratio": pc.divide(plans.column("length_m"), pc.max_element_wise(pairs.column("euclidean_m"), 1e-12)),
        **{name: plans.column(name) for name in ("length_m", "n_actions", *(field.name for field in DIFFICULTY))},
        "min_clearance_m": plans.column("min_clearance_m"),
    }
    schema = pa.schema([field for field in ROUTES.schema if field.name not in _LISTS])
    routes = pa.table({name: columns[name] for name in schema.names}, schema=schema).append_column("plan", plan)
    routes = routes.append_column("action_budget", kept.column("action_budget"))
    routes = routes.append_column("sampling_key", pa.array([sampling_key(scene, p) for p in pair_ids], pa.string()))
    return routes.sort_by([(column, "ascending") for column in ROUTES.order])


def with_lists(routes: pa.Table, plans: pa.Table) -> pa.Table:
    """Give routes of `routes_table` their lists: after the draw, because they are most of what a route has."""
    lists = plans.select(_LISTS).take(routes.column("plan"))
    columns = {name: (lists if name in _LISTS else routes).column(name) for name in ROUTES.schema.names}
    return pa.table(columns, schema=ROUTES.schema).append_column("action_budget", routes.column("action_budget"))


def splits_of(routes: pa.Table, train: NDArray[np.bool_], out: set[int]) -> dict[str, pa.Array]:
    """`SPLIT_COLUMNS` (n,): whether routes' ends occur in training, and their side of the split by objects."""
    target, start = (routes.column(f"{end}_object_id").to_numpy() for end in ("target", "start"))
    # Two ids packed into one number.
    pose, pair = (start.astype(np.int64) << 32 | ids for ids in (routes.column("start_anchor_id").to_numpy(), target))
    gone = np.fromiter(out, dtype=np.int64, count=len(out))
    target_out, start_out = np.isin(target, gone), np.isin(start, gone)
    return {
        "target_seen_in_train": pa.array(np.isin(target, target[train])),
        "start_seen_in_train": pa.array(np.isin(pose, pose[train])),
        "pair_seen_in_train": pa.array(np.isin(pair, pair[train])),
        "target_split": pa.array(np.where(target_out | start_out, "test", "train").tolist(), pa.string()),
        "target_held_out": pa.array(target_out),
        "start_held_out": pa.array(start_out),
    }


def tasks_table(
    routes: pa.Table, train: NDArray[np.bool_], scene: dict[str, Any], objects: pa.Table, out: set[int]
) -> pa.Table:
    """Make both instances of every navigation task, 2n rows of `TASKS`."""
    n = routes.num_rows
    said, seen_frame = _said(routes, train, objects)
    # Without the texts: every task would take all of its target's with it.
    told = ["object_id", "name", "landmark", "direction", "reference_image_id", "step_back_m", "shape_held_out"]
    target = _take(objects.select(told), "object_id", routes.column("target_object_id"))
    nulls = pa.nulls(n, pa.string())
    seen_and_split = splits_of(routes, train, out) | {
        "frame_seen_in_train": seen_frame, "shape_seen_in_train": pc.invert(target.column("shape_held_out")),
    }  # fmt: skip
    instances = []
    for modality in ("image", "semantic"):
        columns: dict[str, Any] = {
            "task_id": pc.binary_join_element_wise(routes.column("nav_id"), modality[0], "-"),
            "nav_id": routes.column("nav_id"),
            "scene": routes.column("scene"),
            **{name: pa.repeat(scene[name], n) for name in ("family", "scene_type", "partition")},
            "subset": pc.if_else(pa.array(train), "train", "test"),
            "setting": routes.column("setting"),
            "modality": pa.repeat(modality, n),
            "action_budget": routes.column("action_budget"),
            **{f"start_{name}": pc.list_element(routes.column(name), 0) for name in _POSE},
            "target_name": target.column("name"),
            "landmark": target.column("landmark"),
            "direction": target.column("direction"),
            "description": said if modality == "semantic" else nulls,
            "reference_image_id": target.column("reference_image_id") if modality == "image" else nulls,
            "image_distance_m": target.column("step_back_m") if modality == "image" else pa.nulls(n, pa.float64()),
            **seen_and_split,
        }
        instances.append(pa.table(columns, schema=TASKS.schema))
    return pa.concat_tables(instances).sort_by([(key, "ascending") for key in TASKS.order])


def _said(routes: pa.Table, train: NDArray[np.bool_], objects: pa.Table) -> tuple[pa.Array, pa.Array]:
    """Choose every navigation task's description by its id, and say whether training tasks have such sentences."""
    paraphrases = dict(zip(objects["object_id"].to_pylist(), objects["paraphrases"].to_pylist(), strict=True))
    texts, seen = [], []
    targets, ids = routes["target_object_id"].to_pylist(), routes["nav_id"].to_pylist()
    for target, name, trains in zip(targets, ids, train.tolist(), strict=True):
        own = of_side(paraphrases[target], held_out=not trains)
        one = own[rank(0, "description", name) % len(own)]
        texts.append(one["text"])
        seen.append(not one["held_out"])
    return pa.array(texts, pa.string()), pa.array(seen, pa.bool_())


def _accepted(routes: pa.Table) -> Accepted:
    detour, visible = (
        routes.column(name).to_numpy(zero_copy_only=False).astype(np.float64)
        for name in ("plan_detour", "target_visible_at_start")
    )
    return Accepted(
        routes.column("sampling_key").to_pylist(),
        routes.column("setting").to_pylist(),
        routes.column("length_m").to_numpy(),
        difficulty_level(detour, visible),
    )


def run(job: Job, config: SplitConfig) -> Output:
    """Write a scene's tasks, routes, objects, landmarks, anchors and scene row to the release."""
    scenes, landmarks, objects, anchors = (job.read(t) for t in ("scenes", "landmarks", "objects", "anchors"))
    scene = scenes.to_pylist()[0]
    verdicts = job.read("verdicts")
    kept = verdicts.filter(verdicts.column("keep"))
    key = key_of(config.salt, job.seed)
    plans = job.read("plans")
    routes = routes_table(job.scene, kept, job.read("pairs"), plans, anchors.filter(anchors.column("selected")), key)
    objects = described(objects, job.read("descriptions"))
    references = _take(job.read("references"), "object_id", objects.column("object_id"))
    names = [reference_id(job.scene, k, key) for k in objects.column("object_id").to_pylist()]
    references = references.append_column("reference_image_id", pa.array(names, pa.string()))
    pictured = pa.table(
        {
            name: (objects if name in objects.column_names else references).column(name)
            for name in RELEASE_OBJECTS.schema.names
        },
        schema=RELEASE_OBJECTS.schema,
    )
    # Without the pictures: every task takes its target's row, and would take a copy of the picture with it.
    named = pictured.drop_columns("reference_image").append_column(
        "landmark", _take(landmarks, "landmark_id", objects.column("landmark_id")).column("name")
    )
    policy = policy_of(job.scene, config.quota, job.seed)
    routes = routes.filter(pa.array(policy.release(_accepted(routes))))
    fraction = _train_fraction(job.scene, scene["partition"] == "OOD", config)
    trains = policy.train_counts(routes.column("setting").to_pylist(), fraction)
    train = train_mask(
        routes.column("sampling_key").to_pylist(), routes.column("setting").to_pylist(), trains, job.seed
    )
    routes = with_lists(routes, plans)
    out = held_out(job.scene, objects.column("object_id").to_pylist(), config.held_out_fraction, key)
    tasks = tasks_table(routes, train, scene, named, out)
    routes = routes.drop_columns("action_budget")
    is_train = pc.equal(tasks.column("subset"), "train")
    tables = {
        "tasks/train": tasks.filter(is_train),
        "tasks/test": tasks.filter(pc.invert(is_train)),
        "routes/train": routes.filter(pa.array(train)),
        "routes/test": routes.filter(pa.array(~train)),
        "release/scenes": scenes,
        "release/landmarks": landmarks,
        "release/objects": pictured,
        "release/anchors": anchors.select(RELEASE_ANCHORS.schema.names),
        "release/viewpoints": job.read("viewpoints"),
    }
    counts = {
        "train": int(np.count_nonzero(train)) * 2,
        "test": int(np.count_nonzero(~train)) * 2,
        "navigation tasks": routes.num_rows,
    }
    return Output(tables, rows_in=kept.num_rows, rows_out=tasks.num_rows, counts=counts)
