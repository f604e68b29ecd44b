"""Every table of the store: its columns with unit and meaning, and its primary key.

Frames and units: world is right-handed, x east, y north, z up, metres; yaw is in radians, counter-clockwise from
+x. A column's name carries its unit; its field metadata carries unit and meaning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pyarrow as pa

# The action set (paper, section on the action space); `APPROACH` stands in reference trajectories only.
ACTION_NAMES = (
    "Stop",
    "MoveForward1", "MoveForward3", "MoveForward5",
    "MoveLeft1", "MoveLeft3", "MoveLeft5",
    "MoveRight1", "MoveRight3", "MoveRight5",
    "MoveUp1", "MoveUp2", "MoveDown1", "MoveDown2",
    "TurnLeft15", "TurnRight15",
    "Approach",
)  # fmt: skip
STOP, MOVE_UP_1, MOVE_DOWN_1, TURN_LEFT, TURN_RIGHT, APPROACH = 0, 10, 12, 14, 15, 16

OUTCOMES = ("SOLVED", "START_IN_COLLISION", "GOAL_IN_COLLISION", "NO_PATH", "NEAR_STRAIGHT", "BUDGET_EXHAUSTED")
SETTINGS = ("base", "standard", "long_horizon")
SUBSETS = ("id_train", "id_test", "ood_train", "ood_test")
DIRECTIONS = ("east", "northeast", "north", "northwest", "west", "southwest", "south", "southeast")
VIEWS = ("front", "left", "right", "down")
# What ends an episode (benchmark): an agent's Stop, a collision, or the last action of the budget.
TERMINATIONS = ("stop", "collision", "budget")
FAMILIES = {"U": "Urban", "N": "Natural", "I": "Infrastructure", "D": "Disaster"}


def _field(name: str, kind: pa.DataType, meaning: str, unit: str = "", nullable: bool = False) -> pa.Field:
    meta = {"meaning": meaning} | ({"unit": unit} if unit else {})
    return pa.field(name, kind, nullable=nullable, metadata=meta)


def _list(kind: pa.DataType) -> pa.DataType:
    # Parquet renames the child of pa.list_(x) to "element": name it so from the start.
    return pa.list_(pa.field("element", kind, nullable=False))


def _xyz(what: str, prefix: str = "") -> list[pa.Field]:
    return [_field(f"{prefix}{a}_m", pa.float64(), f"{what}, {a}, world frame", "m") for a in "xyz"]


@dataclass(frozen=True)
class TableSpec:
    """A table of the store.

    Attributes
    ----------
    name : str
        Folder of the table under the data directory.
    schema : pyarrow.Schema
        Fields with unit and meaning in their metadata.
    key : tuple of str
        Columns that identify a row.
    clusters : tuple of str
        Columns by which the rows of a shard are sorted before the key; a row group holds one value of each, so that a
        filter on them reads no other rows.
    plain : tuple of str
        Columns whose values compress better as they stand than by way of a dictionary.
    """

    name: str
    schema: pa.Schema
    key: tuple[str, ...]
    clusters: tuple[str, ...] = ()
    plain: tuple[str, ...] = ()

    @property
    def order(self) -> tuple[str, ...]:
        """Columns that the rows of a shard are sorted by."""
        return tuple(dict.fromkeys((*self.clusters, *self.key)))


_SCENE = _field("scene", pa.string(), "name of the scene, e.g. U_Mall_0")
_SETTING = _field("setting", pa.string(), "length setting: base, standard or long_horizon")
_LISTS = [
    _field("x_m", _list(pa.float64()), "x of every pose, world frame", "m"),
    _field("y_m", _list(pa.float64()), "y of every pose, world frame", "m"),
    _field("z_m", _list(pa.float64()), "z of every pose, world frame", "m"),
    _field("yaw_rad", _list(pa.float64()), "yaw of every pose, counter-clockwise from +x", "rad"),
    _field("action", _list(pa.int8()), "what is done at every pose; the last is 0 (Stop); 16 is Approach"),
]
_ROUTE = [
    _field("length_m", pa.float64(), "sum of the distances between consecutive positions", "m"),
    _field("n_actions", pa.int32(), "number of actions, Stop included"),
]
_PAIR = [
    _field("start_object_id", pa.int32(), "object that the task starts from"),
    _field("start_anchor_id", pa.int32(), "anchor of the start object; the start's yaw is its yaw + 180°"),
    _field("target_object_id", pa.int32(), "object to be found; the goal is its selected anchor"),
]
_EUCLIDEAN = _field("euclidean_m", pa.float64(), "straight distance from start to goal, d_E", "m")
_DETOUR = "length_m / euclidean_m, κ"
_CLEARANCE = "smallest distance along the route from the body's centre line to any surface, up to 5 m"


def _table(
    name: str, key: Sequence[str], *fields: pa.Field, clusters: Sequence[str] = (), plain: Sequence[str] = ()
) -> TableSpec:
    return TableSpec(name, pa.schema(list(fields)), tuple(key), tuple(clusters), tuple(plain))


_OBJECT_FIELDS = [
    _SCENE,
    _field("object_id", pa.int32(), "id of the target object within its scene"),
    _field("name", pa.string(), "what a person would call it, e.g. red delivery van"),
    _field("category", pa.string(), "semantic category, one of the catalogue's"),
    _field("description", pa.string(), "what it looks like and what stands by it"),
    _field("mesh_node", pa.string(), "node of the scene's mesh"),
    *_xyz("centre of the object's axis-aligned box"),
    *[_field(f"size_{a}_m", pa.float64(), f"extent of the box along {a}", "m") for a in "xyz"],
    _field("landmark_id", pa.int32(), "nearest landmark in the plane"),
    _field("direction", pa.string(), "compass direction from that landmark to the object, one of eight"),
]
_REFERENCE_ID = _field("reference_image_id", pa.string(), "opaque id that image tasks name")
_REFERENCE = [
    _field("reference_image", pa.binary(), "PNG: front view from the selected anchor", nullable=True),
    _field("box_u0_px", pa.int32(), "object's box in the image, left column", "px", True),
    _field("box_v0_px", pa.int32(), "object's box in the image, top row", "px", True),
    _field("box_u1_px", pa.int32(), "object's box in the image, one past the right column", "px", True),
    _field("box_v1_px", pa.int32(), "object's box in the image, one past the bottom row", "px", True),
    _field("image_fraction", pa.float64(), "share of the image's pixels that show the object", nullable=True),
]

SCENES = _table(
    "scenes", ["scene"],
    _SCENE,
    _field("family", pa.string(), "Urban, Natural, Infrastructure or Disaster"),
    _field("scene_type", pa.string(), "one of the 21 types, e.g. Mall"),
    _field("partition", pa.string(), "ID (suffix _0) or OOD (suffix _1)"),
    _field("mesh_path", pa.string(), "GLB, relative to the data directory"),
    _field("mesh_sha256", pa.string(), "SHA-256 of the GLB's bytes, hexadecimal"),
    *[_field(f"{e}_{a}_m", pa.float64(), f"{e} bound of the flight volume along {a}", "m")
      for e in ("min", "max") for a in "xyz"],
    _field("ceiling_m", pa.float64(), "highest z of the flight volume", "m"),
    _field("n_triangles", pa.int64(), "triangles of all instances"),
    _field("n_instances", pa.int32(), "named nodes"),
    _field("n_categories", pa.int32(), "distinct categories among the nodes"),
)  # fmt: skip

LANDMARKS = _table(
    "landmarks", ["scene", "landmark_id"],
    _SCENE,
    _field("landmark_id", pa.int32(), "id of the landmark within its scene"),
    _field("name", pa.string(), "what a person would call it, e.g. clock tower"),
    _field("mesh_node", pa.string(), "node of the scene's mesh"),
    *_xyz("centre of the landmark's axis-aligned box"),
)  # fmt: skip

OBJECTS = _table("objects", ["scene", "object_id"], *_OBJECT_FIELDS)

CHOSEN_ANCHORS = _table(
    "chosen_anchors", ["scene", "object_id"],
    _SCENE,
    _field("object_id", pa.int32(), "object that a person chose an anchor for; the others have no row"),
    *_xyz("position of the body's centre"),
    _field("yaw_rad", pa.float64(), "yaw", "rad"),
)  # fmt: skip

_ANCHOR_FIELDS = (
    _SCENE,
    _field("object_id", pa.int32(), "object that the anchor looks at"),
    _field("anchor_id", pa.int32(), "rank among the object's anchors, 0 is the best or the one that a person chose"),
    *_xyz("position of the body's centre"),
    _field("yaw_rad", pa.float64(), "yaw that faces the object's centroid", "rad"),
    _field("clearance_m", pa.float64(), "distance to the nearest surface of the scene", "m"),
    _field("surface_distance_m", pa.float64(), "distance to the object's own surface", "m"),
    _field("visible_fraction", pa.float64(), "share of the object's sample points that the anchor sees"),
    _field("score", pa.float64(), "what the anchors are ranked by, the scorers' weighted mean, higher is better"),
    *[
        _field(f"score_{name}", pa.float64(), f"the scorer {name}'s, 0 to 1; null where not asked", "", True)
        for name in ("geometric", "clip", "vlm")
    ],
    _field("part_unoccluded", pa.float64(), "of the pixels that would show the object alone, the share that do"),
    _field("part_shown", pa.float64(), "share of the object that the picture tells"),
    _field("part_size", pa.float64(), "edge of the object's box in the picture, 1 from half of the picture's edge"),
    _field("part_centred", pa.float64(), "how near the object is to the picture's centre, 0 to 1"),
    _field("part_contrast", pa.float64(), "colour difference to what surrounds it in the picture, 0 to 1"),
    _field("part_sky", pa.float64(), "share of sky in what surrounds it in the picture"),
    _field("part_level", pa.float64(), "1 up to 15 degrees above or below the centroid, 0 from 45"),
    _field("part_clear", pa.float64(), "room around the body, 1 at the standoff"),
    _field("selected", pa.bool_(), "true for one anchor an object: the goal of its tasks"),
    _field("selected_by", pa.string(), "human or auto"),
)  # fmt: skip

RELEASE_ANCHORS = _table("anchors", ["scene", "object_id", "anchor_id"], *_ANCHOR_FIELDS)
ANCHORS = _table(
    "anchors", ["scene", "object_id", "anchor_id"],
    *_ANCHOR_FIELDS,
    _field("thumbnail", pa.binary(), "the front view, JPEG"),
    plain=["thumbnail"],
)  # fmt: skip

PAIRS = _table(
    "pairs", ["scene", "pair_id"],
    _SCENE,
    _field("pair_id", pa.string(), "<start object>_<start anchor>__<target object>"),
    *_PAIR,
    _EUCLIDEAN,
)  # fmt: skip

PLANS = _table(
    "plans", ["scene", "pair_id"],
    _SCENE,
    _field("pair_id", pa.string(), "candidate task"),
    _field("outcome", pa.string(), "SOLVED, START_IN_COLLISION, GOAL_IN_COLLISION, NO_PATH or BUDGET_EXHAUSTED"),
    *_ROUTE,
    _field("expansions", pa.int64(), "nodes that the search expanded, all attempts together"),
    _field("min_clearance_m", pa.float64(), _CLEARANCE, "m", True),
    *_LISTS,
)  # fmt: skip

VERDICTS = _table(
    "verdicts", ["scene", "pair_id"],
    _SCENE,
    _field("pair_id", pa.string(), "candidate task"),
    _EUCLIDEAN,
    _field("length_m", pa.float64(), "length of the planned route", "m", True),
    _field("detour_ratio", pa.float64(), _DETOUR, nullable=True),
    _field("n_actions", pa.int32(), "number of actions, Stop included", nullable=True),
    _field("keep", pa.bool_(), "whether the candidate becomes a task"),
    _field("reason", pa.string(), "kept, or why not: a stable word"),
    _field("setting", pa.string(), "length setting, null where the length fits none", nullable=True),
    _field("action_budget", pa.int32(), "most actions an episode of that setting may take", nullable=True),
)  # fmt: skip

REFERENCES = _table(
    "references", ["scene", "object_id"],
    _SCENE,
    _field("object_id", pa.int32(), "object that the image shows"),
    *_REFERENCE,
)  # fmt: skip

RECORDINGS = _table(
    "recordings", ["scene", "nav_id", "view", "modality"],
    _SCENE,
    _field("nav_id", pa.string(), "navigation task"),
    _field("view", pa.string(), "front, left, right or down"),
    _field("modality", pa.string(), "rgb, depth or instance"),
    _field("path", pa.string(), "video, or folder of PNG files; relative to the data directory"),
    _field("sampling", pa.string(), "steps: one frame a trajectory pose; time: constant frame rate"),
    _field("n_frames", pa.int32(), "number of frames"),
    _field("fps", pa.float64(), "frames a second", "1/s"),
    _field("width", pa.int32(), "columns", "px"),
    _field("height", pa.int32(), "rows", "px"),
    _field("fov_deg", pa.float64(), "horizontal field of view", "deg"),
    _field("codec", pa.string(), "h264, ffv1 or png"),
    _field("renderer", pa.string(), "gl or pybullet"),
    _field("device", pa.string(), "what drew, in the driver's words"),
    _field("bytes", pa.int64(), "size of the file, or of the folder's files", "B"),
    _field("sha256", pa.string(), "SHA-256 of the file, hexadecimal; of a folder, of its files one after the other"),
    _field("ok", pa.bool_(), "no quality flag is set"),
    _field("flags", _list(pa.string()), "quality flags, empty where all is well"),
)  # fmt: skip

FRAMES = _table(
    "frames", ["scene", "nav_id", "frame"],
    _SCENE,
    _field("nav_id", pa.string(), "navigation task"),
    _field("frame", pa.int32(), "index of the frame in every video of the recording"),
    _field("time_s", pa.float64(), "time since the first frame", "s"),
    _field("step", pa.int32(), "trajectory pose that the frame belongs to"),
    _field("action", pa.int8(), "action under way"),
    *_xyz("position of the body's centre"),
    _field("yaw_rad", pa.float64(), "yaw", "rad"),
)  # fmt: skip

TASKS = _table(
    "tasks", ["scene", "nav_id", "modality"],
    _field("task_id", pa.string(), "the instance: nav_id and the modality's letter"),
    _field("nav_id", pa.string(), "the navigation task, shared by its two instances"),
    _SCENE,
    _field("family", pa.string(), "Urban, Natural, Infrastructure or Disaster"),
    _field("scene_type", pa.string(), "one of the 21 types"),
    _field("partition", pa.string(), "ID or OOD"),
    _field("subset", pa.string(), "train or test"),
    _SETTING,
    _field("modality", pa.string(), "semantic or image"),
    _field("action_budget", pa.int32(), "most actions an episode may take, Stop included"),
    *_xyz("start position of the body's centre", "start_"),
    _field("start_yaw_rad", pa.float64(), "yaw at the start", "rad"),
    _field("target_name", pa.string(), "name of the object to be found"),
    _field("landmark", pa.string(), "name of the landmark nearest to the target"),
    _field("direction", pa.string(), "compass direction from that landmark to the target"),
    _field("description", pa.string(), "the target's description; null for image goals", nullable=True),
    _field("reference_image_id", pa.string(), "the target's picture in objects; null for semantic goals",
           nullable=True),
    clusters=["setting", "modality"],
    plain=["task_id", "nav_id"],
)  # fmt: skip

ROUTES = _table(
    "routes", ["scene", "nav_id"],
    _field("nav_id", pa.string(), "the navigation task"),
    _SCENE,
    _SETTING,
    *_PAIR,
    *_xyz("goal: the target's selected anchor", "goal_"),
    _field("goal_yaw_rad", pa.float64(), "yaw of the goal anchor", "rad"),
    _EUCLIDEAN,
    _ROUTE[0],
    _field("detour_ratio", pa.float64(), _DETOUR),
    _ROUTE[1],
    _field("min_clearance_m", pa.float64(), _CLEARANCE, "m"),
    *_LISTS,
    clusters=["setting"],
    plain=["nav_id", "euclidean_m", "length_m", "detour_ratio", "min_clearance_m",
           *[field.name for field in _LISTS]],
)  # fmt: skip

RELEASE_OBJECTS = _table(
    "objects", ["scene", "object_id"], *_OBJECT_FIELDS, _REFERENCE_ID, *_REFERENCE, plain=["reference_image"]
)  # fmt: skip

# What an agent did (benchmark). All of it is the evaluator's: an agent sees none of these tables.
_RUN = _field("run_id", pa.string(), "name of the evaluation run")
_TASK_ID = _field("task_id", pa.string(), "the task instance")

EPISODES = _table(
    "episodes", ["run_id", "task_id"],
    _RUN,
    _field("agent", pa.string(), "name of the agent, or package.module:Class"),
    _field("agent_options", pa.string(), "the agent's options, JSON with sorted keys"),
    _TASK_ID,
    _field("nav_id", pa.string(), "the navigation task, shared by its two instances"),
    _SCENE,
    *[TASKS.schema.field(name) for name in ("family", "scene_type", "partition", "subset")],
    _field("split", pa.string(), "id_train, id_test, ood_train or ood_test"),
    *[TASKS.schema.field(name) for name in ("setting", "modality", "action_budget")],
    *_xyz("start position of the body's centre", "start_"),
    _field("start_yaw_rad", pa.float64(), "yaw at the start", "rad"),
    _field("success", pa.bool_(), "Stop within 3 m of the goal, without collision, within the budget"),
    _field("oracle_success", pa.bool_(), "min_distance_m is at most 3 m, whatever happens later"),
    _field("collision", pa.bool_(), "the episode ended in a collision"),
    _field("stop_called", pa.bool_(), "the agent chose Stop"),
    _field("termination", pa.string(), "stop, collision or budget"),
    _field("final_distance_m", pa.float64(), "distance to the goal where the episode ended", "m"),
    _field("min_distance_m", pa.float64(),
           "smallest distance to the goal at the start, after any action, or where the episode ended", "m"),
    _field("final_horizontal_distance_m", pa.float64(), "final_distance_m in the plane", "m"),
    _field("min_horizontal_distance_m", pa.float64(), "smallest such distance at the same poses, in the plane", "m"),
    _field("path_length_m", pa.float64(), "metres flown, up to the contact in a collision", "m"),
    _field("reference_length_m", pa.float64(), "length of the reference route, L", "m"),
    _EUCLIDEAN,
    _field("n_actions", pa.int32(), "actions spent, Stop included, refused and unreadable ones too"),
    _field("n_refused", pa.int32(), "moves that would have left the flight volume: spent, nothing moved"),
    _field("n_invalid", pa.int32(), "answers that named no action: spent, nothing moved"),
    _field("n_requests", pa.int32(), "calls of an outside service; null for agents without one", nullable=True),
    _field("input_tokens", pa.int64(), "tokens sent, where the service says", nullable=True),
    _field("output_tokens", pa.int64(), "tokens received, where the service says", nullable=True),
    _field("cost_usd", pa.float64(), "US dollars, where prices are known", nullable=True),
)  # fmt: skip

STEPS = _table(
    "steps", ["run_id", "task_id", "step"],
    _RUN,
    _TASK_ID,
    _SCENE,
    _field("step", pa.int32(), "number of the action in its episode, from 0"),
    _field("action", pa.int8(), "the action; null for an answer that named none", nullable=True),
    _field("refused", pa.bool_(), "the move would have left the flight volume: nothing moved"),
    *_xyz("position of the body's centre after the action"),
    _field("yaw_rad", pa.float64(), "yaw after the action", "rad"),
    _field("distance_m", pa.float64(), "distance to the goal after the action", "m"),
    _field("answer", pa.string(), "what the agent said, word for word, where it says anything", nullable=True),
)  # fmt: skip

# Apart from the two above, which are the same bytes for a deterministic agent, run after run.
TIMINGS = _table(
    "timings", ["run_id", "task_id"],
    _RUN,
    _TASK_ID,
    _SCENE,
    _field("wall_s", pa.float64(), "wall time of the episode", "s"),
    _field("agent_s", pa.float64(), "wall time inside the agent", "s"),
    _field("attempts", pa.int32(), "how often the episode was begun, infrastructure failures and all"),
    _field("request_s", pa.float64(), "time of all requests to an outside service; null without one", "s",
           nullable=True),
    _field("longest_request_s", pa.float64(), "time of the longest of them", "s", nullable=True),
)  # fmt: skip

FAILURES = _table(
    "failures", ["run_id", "task_id"],
    _RUN,
    _TASK_ID,
    _SCENE,
    _field("attempts", pa.int32(), "how often the episode was tried"),
    _field("kind", pa.string(),
           "what failed: rate limit, server error, time-out, connection lost, malformed answer, content filter, "
           "context too long, bad request, not found, renderer, agent error, unavailable"),
    _field("reason", pa.string(), "in words: of a service's answer its first line"),
    _field("n_requests", pa.int32(), "calls of an outside service all the same", nullable=True),
    _field("input_tokens", pa.int64(), "tokens sent all the same, where the service says", nullable=True),
    _field("output_tokens", pa.int64(), "tokens received all the same, where the service says", nullable=True),
    _field("cost_usd", pa.float64(), "US dollars spent all the same, where prices are known", nullable=True),
)  # fmt: skip

TABLES = {
    t.name: t
    for t in (
        SCENES,
        LANDMARKS,
        OBJECTS,
        CHOSEN_ANCHORS,
        ANCHORS,
        PAIRS,
        PLANS,
        VERDICTS,
        REFERENCES,
        RECORDINGS,
        FRAMES,
    )
}
