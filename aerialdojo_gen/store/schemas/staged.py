"""What a table is, the columns that several tables have, and the tables of the stages before the release.

Frames and units: world is right-handed, x east, y north, z up, metres; yaw is in radians, counter-clockwise from
+x. A column's name carries its unit; its field metadata carries unit and meaning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pyarrow as pa


def column(name: str, kind: pa.DataType, meaning: str, unit: str = "", nullable: bool = False) -> pa.Field:
    """Describe a column; its unit and meaning go into the field's metadata."""
    meta = {"meaning": meaning} | ({"unit": unit} if unit else {})
    return pa.field(name, kind, nullable=nullable, metadata=meta)


def list_of(kind: pa.DataType) -> pa.DataType:
    """Make the type of lists without nulls."""
    # Parquet renames the child of pa.list_(x) to "element": name it so from the start.
    return pa.list_(pa.field("element", kind, nullable=False))


def xyz(what: str, prefix: str = "") -> list[pa.Field]:
    """Describe the three columns of a position, metres, world frame."""
    return [column(f"{prefix}{a}_m", pa.float64(), f"{what}, {a}, world frame", "m") for a in "xyz"]


@dataclass(frozen=True)
class TableSpec:
    """A table of the store."""

    name: str  # Folder of the table under the data directory
    schema: pa.Schema  # Fields with unit and meaning in their metadata
    key: tuple[str, ...]  # Columns that identify a row
    clusters: tuple[str, ...] = ()
    plain: tuple[str, ...] = ()  # Columns whose values compress better as they stand than by way of a dictionary
    command: str = ""  # The stage that writes it, for messages; empty where tables of several places are of this kind

    @property
    def order(self) -> tuple[str, ...]:
        """Columns that the rows of a shard are sorted by."""
        return tuple(dict.fromkeys((*self.clusters, *self.key)))


SCENE = column("scene", pa.string(), "name of the scene, e.g. U_Mall_0")
SETTING = column("setting", pa.string(), "length setting: base, standard or long_horizon")
LISTS = [
    column("x_m", list_of(pa.float64()), "x of every pose, world frame", "m"),
    column("y_m", list_of(pa.float64()), "y of every pose, world frame", "m"),
    column("z_m", list_of(pa.float64()), "z of every pose, world frame", "m"),
    column("yaw_rad", list_of(pa.float64()), "yaw of every pose, counter-clockwise from +x", "rad"),
    column("action", list_of(pa.int8()), "what is done at every pose; the last is 0 (Stop); 16 is Approach"),
]
ROUTE = [
    column("length_m", pa.float64(), "sum of the distances between consecutive positions", "m"),
    column("n_actions", pa.int32(), "number of actions, Stop included"),
]
# How much of the target the start gives away.
START_VIEW = [
    column("target_visible_at_start", pa.float64(),
           "of the target's surface points that its own body does not hide from the start, the share that is in one "
           "of the four views there and that nothing else hides", nullable=True),
    column("visible_view_at_start", pa.string(),
           "view that shows most of them: front, left, right or down; null where nothing is seen", nullable=True),
]  # fmt: skip
PAIR = [
    column("start_object_id", pa.int32(), "object that the task starts from"),
    column("start_anchor_id", pa.int32(), "anchor of the start object; the start's yaw is its yaw + 180°"),
    column("target_object_id", pa.int32(), "object to be found; the goal is its selected anchor"),
]
EUCLIDEAN = column("euclidean_m", pa.float64(), "straight distance from start to goal, d_E", "m")
DETOUR = "length_m / euclidean_m, κ"
# What `plan` says of a route's difficulty, null where there is no route.
DIFFICULTY = [
    column("free_length_m", pa.float64(), "shortest length_m from start to goal were there no obstacles", "m", True),
    column("plan_detour", pa.float64(), "length_m / free_length_m", nullable=True),
    column("straight_line_free", pa.bool_(), "whether the body could fly the straight line from start to goal",
           nullable=True),
    column("climb_m", pa.float64(), "metres flown upwards", "m", True),
]  # fmt: skip
AGENT_ACTION = column(
    "agent_action", list_of(pa.int8()), "the route as an agent can fly it: actions 0 to 15, the last is 0 (Stop)",
    nullable=True,
)  # fmt: skip
PREDICTED = "length of the cheapest path over the grid, null where there is none: what the route's is predicted to be"
CLEARANCE = "smallest distance along the route from the body's centre line to any surface, up to 5 m"


def table(
    name: str, key: Sequence[str], *fields: pa.Field, clusters: Sequence[str] = (), plain: Sequence[str] = (),
    command: str = "",
) -> TableSpec:  # fmt: skip
    """Describe a table: see `TableSpec`."""
    return TableSpec(name, pa.schema(list(fields)), tuple(key), tuple(clusters), tuple(plain), command)


OBJECT_COLUMNS = [
    SCENE,
    column("object_id", pa.int32(), "id of the target object within its scene"),
    column("name", pa.string(), "what a person would call it, e.g. red delivery van"),
    column("category", pa.string(), "semantic category, one of the catalogue's"),
    column("description", pa.string(), "what it looks like and what stands by it, as a person wrote it; else the "
           "first paraphrase, in the release", nullable=True),
    column("mesh_node", pa.string(), "node of the scene's mesh"),
    *xyz("centre of the object's axis-aligned box"),
    *[column(f"size_{a}_m", pa.float64(), f"extent of the box along {a}", "m") for a in "xyz"],
    column("landmark_id", pa.int32(), "nearest landmark in the plane"),
    column("direction", pa.string(), "compass direction from that landmark to the object, one of eight"),
    column(
        "claims", pa.string(), "what can be said of it, true of the mesh: a JSON list of claims (kind, key, things)",
    ),
    column("shape", pa.string(), "digest of its geometry in its own frame: congruent things of the catalogue have "
           "the same; null of imported meshes", nullable=True),
    column("shape_held_out", pa.bool_(),
           "whether its design stands in no scene of the training side; null of imported meshes", nullable=True),
]  # fmt: skip
REFERENCE = [
    column("reference_image", pa.binary(), "PNG: front view from the selected anchor, or from further back "
           "along its viewing axis, where the object fits", nullable=True),
    *[column(f"reference_{a}_m", pa.float64(), f"position of the picture's camera, {a}", "m", True) for a in "xyz"],
    column("reference_yaw_rad", pa.float64(), "its yaw; it is level", "rad", True),
    column("step_back_m", pa.float64(), "its distance from the anchor", "m", True),
    column("box_u0_px", pa.int32(), "object's box in the image, left column", "px", True),
    column("box_v0_px", pa.int32(), "object's box in the image, top row", "px", True),
    column("box_u1_px", pa.int32(), "object's box in the image, one past the right column", "px", True),
    column("box_v1_px", pa.int32(), "object's box in the image, one past the bottom row", "px", True),
    column("image_fraction", pa.float64(), "share of the image's pixels that show the object", nullable=True),
    column("tells_shown", pa.float64(), "of the parts that make the name true, the share that the image shows; null "
           "where the whole body does", nullable=True),
    column("tells_missing", pa.string(), "those that it does not show, separated by commas; null where there "
           "are none", nullable=True),
]  # fmt: skip

SCENES = table(
    "scenes", ["scene"],
    SCENE,
    column("family", pa.string(), "Urban, Natural, Infrastructure or Disaster"),
    column("scene_type", pa.string(), "one of the 21 types, e.g. Mall"),
    column("partition", pa.string(), "ID (suffix _0) or OOD (suffix _1)"),
    column("mesh_path", pa.string(), "GLB, relative to the data directory"),
    column("mesh_sha256", pa.string(), "SHA-256 of the GLB's bytes, hexadecimal"),
    *[column(f"{e}_{a}_m", pa.float64(), f"{e} bound of the flight volume along {a}", "m")
      for e in ("min", "max") for a in "xyz"],
    column("ceiling_m", pa.float64(), "highest z of the flight volume", "m"),
    column("n_triangles", pa.int64(), "triangles of all instances"),
    column("n_instances", pa.int32(), "named nodes"),
    column("n_categories", pa.int32(), "distinct categories among the nodes"),
    column("attribution", pa.string(), "whose data a real place is made of, and their licence; null for other scenes",
           nullable=True),
    command="build-scenes",
)  # fmt: skip

LANDMARKS = table(
    "landmarks", ["scene", "landmark_id"],
    SCENE,
    column("landmark_id", pa.int32(), "id of the landmark within its scene"),
    column("name", pa.string(), "what a person would call it, e.g. clock tower"),
    column("mesh_node", pa.string(), "node of the scene's mesh"),
    *xyz("centre of the landmark's axis-aligned box"),
    command="annotate-import",
)  # fmt: skip

OBJECTS = table("objects", ["scene", "object_id"], *OBJECT_COLUMNS, command="annotate-import")

CHOSEN_ANCHORS = table(
    "chosen_anchors", ["scene", "object_id"],
    SCENE,
    column("object_id", pa.int32(), "object that a person chose an anchor for; the others have no row"),
    *xyz("position of the body's centre"),
    column("yaw_rad", pa.float64(), "yaw", "rad"),
    command="annotate-import",
)  # fmt: skip

ANCHOR_COLUMNS = (
    SCENE,
    column("object_id", pa.int32(), "object that the anchor looks at"),
    column("anchor_id", pa.int32(), "rank among the object's anchors, 0 is the best or the one that a person chose"),
    *xyz("position of the body's centre"),
    column("yaw_rad", pa.float64(), "yaw that faces the object's centroid", "rad"),
    column("clearance_m", pa.float64(), "distance to the nearest surface of the scene", "m"),
    column("surface_distance_m", pa.float64(), "distance to the object's own surface", "m"),
    column("visible_fraction", pa.float64(), "share of the object's sample points that the anchor sees"),
    column("off_front_rad", pa.float64(), "angle in the plane to the nearest of the object's fronts, seen from its "
           "centroid; null where it has none", "rad", True),
    column("no_front_reason", pa.string(), "why the selected anchor is more than 60 degrees off the front: the test "
           "that most places there failed; null where it is not", nullable=True),
    column("step_back_m", pa.float64(), "how far back the object fits the picture, as far as the way is free", "m"),
    column("score", pa.float64(), "what the anchors are ranked by, the scorers' weighted mean, higher is better"),
    *[
        column(f"score_{name}", pa.float64(), f"the scorer {name}'s, 0 to 1; null where not asked", "", True)
        for name in ("geometric", "clip", "vlm")
    ],
    column("part_unoccluded", pa.float64(), "of the pixels that would show the object alone, the share that do"),
    column("part_shown", pa.float64(), "share of the object that the picture tells"),
    column("part_size", pa.float64(), "edge of the object's box in the picture, 1 from half of the picture's edge"),
    column("part_centred", pa.float64(), "how near the object is to the picture's centre, 0 to 1"),
    column("part_contrast", pa.float64(), "colour difference to what surrounds it in the picture, 0 to 1"),
    column("part_sky", pa.float64(), "share of sky in what surrounds it in the picture"),
    column("part_level", pa.float64(), "1 from 5 degrees below the centroid to 20 above, 0 at 30 below and 50 above"),
    column("part_clear", pa.float64(), "room around the body, 1 at the standoff"),
    column("part_tells", pa.float64(), "how well the parts that make the name true are seen, 0 to 1; null where the "
           "whole body does", nullable=True),
    column("part_front", pa.float64(), "1 up to 25 degrees off the front, little beyond 60; null without a front",
           nullable=True),
    column("part_framed", pa.float64(), "share of the object that lies within the picture's edges"),
    column("part_open", pa.float64(), "1 less the share that what stands nearer takes of the picture or of the "
           "object's box in it"),
    column("selected", pa.bool_(), "true for one anchor an object: the goal of its tasks"),
    column("selected_by", pa.string(), "annotation (an annotation places it) or auto (the score)"),
)  # fmt: skip

ANCHORS = table(
    "anchors", ["scene", "object_id", "anchor_id"],
    *ANCHOR_COLUMNS,
    column("thumbnail", pa.binary(), "the front view, JPEG"),
    plain=["thumbnail"],
    command="anchor-sample",
)  # fmt: skip

VIEWPOINTS = table(
    "viewpoints", ["scene", "object_id", "viewpoint_id"],
    SCENE,
    column("object_id", pa.int32(), "object that is seen"),
    column("viewpoint_id", pa.int32(), "number among the object's"),
    *xyz("position of the body's centre: free, reachable, at the standoff from the object, which it sees"),
    column("yaw_rad", pa.float64(), "yaw that faces the object's centroid", "rad"),
    command="anchor-sample",
)  # fmt: skip

PAIRS = table(
    "pairs", ["scene", "pair_id"],
    SCENE,
    column("pair_id", pa.string(), "<start object>_<start anchor>__<target object>"),
    *PAIR,
    EUCLIDEAN,
    *START_VIEW,
    command="pair-objects",
)  # fmt: skip

PLANS = table(
    "plans", ["scene", "pair_id"],
    SCENE,
    column("pair_id", pa.string(), "candidate task"),
    column("outcome", pa.string(), "what became of it: SOLVED, or why there is no route"),
    column("predicted_length_m", pa.float64(), PREDICTED, "m", True),
    *ROUTE,
    column("expansions", pa.int64(), "nodes that the search expanded, all attempts together"),
    column("min_clearance_m", pa.float64(), CLEARANCE, "m", True),
    *DIFFICULTY,
    *LISTS,
    AGENT_ACTION,
    command="plan",
)  # fmt: skip

# What candidates are stands in `pairs`, and their routes' figures in `plans`, by the same key.
VERDICTS = table(
    "verdicts", ["scene", "pair_id"],
    SCENE,
    column("pair_id", pa.string(), "candidate task"),
    column("keep", pa.bool_(), "whether the candidate becomes a task"),
    column("reason", pa.string(), "kept, or why not: a stable word"),
    column("setting", pa.string(), "length setting, null where the length fits none", nullable=True),
    column("action_budget", pa.int32(), "most actions an episode of that setting may take", nullable=True),
    command="filter",
)  # fmt: skip

REFERENCES = table(
    "references", ["scene", "object_id"],
    SCENE,
    column("object_id", pa.int32(), "object that the image shows"),
    *REFERENCE,
    column("parts_shown", list_of(pa.string()), "named parts that both the image and the view from the anchor show"),
    command="reference-images",
)  # fmt: skip

PARAPHRASE = (
    column("level", pa.string(), "terse, normal, detailed or vague; written if a person wrote it"),
    column("text", pa.string(), "the description"),
    column("claims", list_of(pa.int32()), "which of the object's claims it makes, from 0"),
    column("frame", pa.string(), "its sentences with slots for noun phrases and places"),
    column("held_out", pa.bool_(), "whether no training task has a text with its first sentence's template"),
)

DESCRIPTIONS = table(
    "descriptions", ["scene", "object_id", "paraphrase_id"],
    SCENE,
    column("object_id", pa.int32(), "object that is described"),
    column("paraphrase_id", pa.int32(), "number among the object's texts"),
    *PARAPHRASE,
    command="describe",
)  # fmt: skip

# What lies in a folder of its own, by scene and part; a new stage's table is listed here.
STAGED = (SCENES, LANDMARKS, OBJECTS, CHOSEN_ANCHORS, ANCHORS, VIEWPOINTS, REFERENCES, DESCRIPTIONS, PAIRS, PLANS,
          VERDICTS)  # fmt: skip


RECORDINGS = table(
    "recordings", ["scene", "nav_id", "view", "modality"],
    SCENE,
    column("nav_id", pa.string(), "navigation task"),
    column("view", pa.string(), "front, left, right or down"),
    column("modality", pa.string(), "rgb, depth or instance"),
    column("path", pa.string(), "video, or folder of PNG files; relative to the data directory"),
    column("stream", pa.int8(), "which of the file's videos; 0 where it has one"),
    column("left_px", pa.int32(), "leftmost column of the view in the file's frames", "px"),
    column("top_px", pa.int32(), "topmost row of the view in the file's frames", "px"),
    column("sampling", pa.string(), "steps: one frame a trajectory pose; time: constant frame rate"),
    column("n_frames", pa.int32(), "number of frames"),
    column("fps", pa.float64(), "frames a second", "1/s"),
    column("width", pa.int32(), "columns of the view", "px"),
    column("height", pa.int32(), "rows of the view", "px"),
    column("fov_deg", pa.float64(), "horizontal field of view", "deg"),
    column("depth_step", pa.float64(), "share by which stored depths grow, 0: millimetres; null: no depth", "", True),
    column("codec", pa.string(), "h264, ffv1 or png"),
    column("renderer", pa.string(), "gl or pybullet"),
    column("device", pa.string(), "what drew, in the driver's words"),
    column("bytes", pa.int64(), "size of the file, or of the folder's files; rows may share a file", "B"),
    column("sha256", pa.string(), "SHA-256 of the file, hexadecimal; of a folder, of its files one after the other"),
    column("ok", pa.bool_(), "no quality flag is set"),
    column("flags", list_of(pa.string()), "quality flags, empty where all is well"),
    command="render",
)  # fmt: skip

FRAMES = table(
    "frames", ["scene", "nav_id", "frame"],
    SCENE,
    column("nav_id", pa.string(), "navigation task"),
    column("frame", pa.int32(), "index of the frame in every video of the recording"),
    column("time_s", pa.float64(), "time since the first frame", "s"),
    column("step", pa.int32(), "trajectory pose that the frame belongs to"),
    column("action", pa.int8(), "action under way"),
    *xyz("position of the body's centre"),
    column("yaw_rad", pa.float64(), "yaw", "rad"),
    command="render",
)  # fmt: skip
