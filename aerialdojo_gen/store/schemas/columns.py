"""What a table is, and the columns that several tables have.

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
