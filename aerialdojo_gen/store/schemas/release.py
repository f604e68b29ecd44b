"""The tables of the release: what an agent may know, and what only the evaluator may."""

from __future__ import annotations

import pyarrow as pa

from aerialdojo_gen.store.schemas.staged import (
    AGENT_ACTION,
    ANCHOR_COLUMNS,
    CLEARANCE,
    DETOUR,
    DIFFICULTY,
    EUCLIDEAN,
    LISTS,
    OBJECT_COLUMNS,
    PAIR,
    PARAPHRASE,
    REFERENCE,
    ROUTE,
    SCENE,
    SETTING,
    START_VIEW,
    column,
    list_of,
    table,
    xyz,
)

RELEASE_ANCHORS = table("anchors", ["scene", "object_id", "anchor_id"], *ANCHOR_COLUMNS)

# What `tasks` says of train and test beside the subset; null in a release of an older version.
SPLITS = [
    column("target_seen_in_train", pa.bool_(),
           "whether a training task of the same partition has the same target; by the paper's split", nullable=True),
    column("start_seen_in_train", pa.bool_(),
           "whether a training task of the same partition starts from the same pose; by the paper's split",
           nullable=True),
    column("pair_seen_in_train", pa.bool_(),
           "whether a training task of the same partition leads from the same start object to the same target; by "
           "the paper's split", nullable=True),
    column("target_split", pa.string(),
           "the split by objects: train where neither the target nor the object that the task starts from is held "
           "out, else test", nullable=True),
    column("target_held_out", pa.bool_(), "whether the target is one of the scene's objects that are held out",
           nullable=True),
    column("start_held_out", pa.bool_(), "whether the object that the task starts from is held out", nullable=True),
    column("frame_seen_in_train", pa.bool_(),
           "whether descriptions of training tasks have sentences built like that of the semantic task",
           nullable=True),
    column("shape_seen_in_train", pa.bool_(),
           "whether training scenes may have things of the target's shape: false where its design is held out; null "
           "of imported meshes", nullable=True),
]  # fmt: skip

TASKS = table(
    "tasks", ["scene", "nav_id", "modality"],
    column("task_id", pa.string(), "the instance: nav_id and the modality's letter"),
    column("nav_id", pa.string(), "the navigation task, shared by its two instances"),
    SCENE,
    column("family", pa.string(), "Urban, Natural, Infrastructure or Disaster"),
    column("scene_type", pa.string(), "one of the 21 types"),
    column("partition", pa.string(), "ID or OOD"),
    column("subset", pa.string(), "train or test"),
    SETTING,
    column("modality", pa.string(), "semantic or image"),
    column("action_budget", pa.int32(), "most actions an episode may take, Stop included"),
    *xyz("start position of the body's centre", "start_"),
    column("start_yaw_rad", pa.float64(), "yaw at the start", "rad"),
    column("target_name", pa.string(), "name of the object to be found"),
    column("landmark", pa.string(), "name of the landmark nearest to the target"),
    column("direction", pa.string(), "compass direction from that landmark to the target"),
    column("description", pa.string(), "the target's description; null for image goals", nullable=True),
    column("reference_image_id", pa.string(), "the target's picture in objects; null for semantic goals",
           nullable=True),
    column("image_distance_m", pa.float64(),
           "how far behind the goal that picture was taken; null for semantic goals or unknown", "m", True),
    *SPLITS,
    clusters=["setting", "modality"],
    plain=["task_id", "nav_id"],
)  # fmt: skip

ROUTES = table(
    "routes", ["scene", "nav_id"],
    column("nav_id", pa.string(), "the navigation task"),
    SCENE,
    SETTING,
    *PAIR,
    *xyz("goal: the target's selected anchor", "goal_"),
    column("goal_yaw_rad", pa.float64(), "yaw of the goal anchor", "rad"),
    EUCLIDEAN,
    ROUTE[0],
    column("detour_ratio", pa.float64(), DETOUR),
    ROUTE[1],
    column("min_clearance_m", pa.float64(), CLEARANCE, "m"),
    *DIFFICULTY,
    *START_VIEW,
    *LISTS,
    AGENT_ACTION,
    clusters=["setting"],
    plain=["nav_id", "euclidean_m", "length_m", "detour_ratio", "min_clearance_m", "free_length_m", "plan_detour",
           *[field.name for field in LISTS], "agent_action"],
)  # fmt: skip

REFERENCE_ID = column("reference_image_id", pa.string(), "opaque id that image tasks name")

PARAPHRASES = column(
    "paraphrases", list_of(pa.struct([pa.field(f.name, f.type, nullable=False) for f in PARAPHRASE])),
    "the object's descriptions; training tasks have those that are not held out, test tasks the others",
)  # fmt: skip

RELEASE_OBJECTS = table(
    "objects", ["scene", "object_id"], *OBJECT_COLUMNS, PARAPHRASES, REFERENCE_ID, *REFERENCE,
    plain=["reference_image"],
)  # fmt: skip

# Columns that a task is not flown by: other formats have no field for them.
SPLIT_COLUMNS = tuple(field.name for field in SPLITS)
DIFFICULTY_COLUMNS = tuple(field.name for field in (*DIFFICULTY, *START_VIEW, AGENT_ACTION))
