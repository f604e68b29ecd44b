"""Checks of single rows, one at a time: each finds its fault in the first, a middle and the last row of every part.

Faults lie just beyond what a check allows; just within it nothing is found.
"""

import dataclasses
import math

import numpy as np
import pyarrow as pa
import pytest
from support.layout_checks import drawn
from support.planting import add, check, check_of, definitions, named, put

from aerialdojo_gen.dataset.contents import SHARDS
from aerialdojo_gen.dataset.validate.parts import read_tables, release_of
from aerialdojo_gen.dataset.validate.registry import run_checks
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.dataset.validate.run import SCENE_CHECKS
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import APPROACH, STOP

SCENE = "U_Courtyard_0"
RADIUS = 0.25


@pytest.fixture(scope="module")
def data(smoke):
    """A scene of a sound release; a test judges a copy of it in which rows are changed."""
    tables, _ = read_tables(release_of(smoke / "release"), SCENE)
    return SceneData(SCENE, release_of(smoke / "release"), definitions(), tables)


def judged(data, name, table, change, wanted=lambda _: True):
    """Change the first, a middle and the last row of every part; give the rows changed, and those that are found."""
    rows = data.tables[table]
    changed = rows.table.to_pylist()
    places = set()
    for begin, end in zip((0, *rows.ends), rows.ends, strict=False):
        fit = [k for k in range(begin, end) if wanted(changed[k])]
        places |= {fit[0], fit[len(fit) // 2], fit[-1]}
    for k in places:
        change(changed[k])
    schema = pa.schema([field.with_nullable(True) for field in rows.table.schema])
    planted = dataclasses.replace(rows, table=pa.Table.from_pylist(changed, schema=schema))
    here = dataclasses.replace(data, tables={**data.tables, table: planted}, faulty={})
    one = next(one for one in SCENE_CHECKS if one.name == name and one.table in (table, "*"))
    (outcome,) = (o for o in run_checks(here, [one]) if o.table == table)
    assert not outcome.skipped
    return sorted(planted.key(k) for k in places), sorted({fault.key for fault in outcome.faults})


def approaches(row):
    return row["action"][-2] == APPROACH


def by_rule(row):
    return row["selected_by"] == "auto"


PLACES = ("x_m", "y_m", "z_m")
FAULTS = [
    *(("null_value", "routes", put(name, None)) for name in ("setting", "length_m", "x_m")),
    *(("null_value", "routes", put("yaw_rad", None, at)) for at in (0, 0.5, 1)),
    ("null_value", "tasks", put("target_name", None)),
    *(("not_finite", "routes", put("z_m", value, at)) for at in (0, 0.5, 1) for value in (math.nan, math.inf)),
    *(("not_finite", "tasks", put("start_yaw_rad", value)) for value in (math.nan, math.inf, -math.inf)),
    ("unknown_word", "tasks", put("subset", "validation")),
    ("unknown_word", "routes", put("setting", "Base")),
    ("wrong_part", "routes", put("scene", "U_Courtyard_1")),
    ("wrong_part", "tasks", lambda row: row.update(subset={"train": "test", "test": "train"}[row["subset"]])),
    *(("action_order", "routes", put("action", STOP, at)) for at in (0, 0.5)),
    *(("action_order", "routes", put("action", APPROACH, at)) for at in (0, 0.5, 1)),
    ("action_order", "routes", put("action", APPROACH + 1, 0)),
    ("action_order", "routes", put("action", 1, 1)),
    *(("list_lengths_differ", "routes", lambda row, n=name: row[n].pop()) for name in (*PLACES, "yaw_rad", "action")),
    *(("n_actions", "routes", add("n_actions", off)) for off in (-1, 1)),
    *(("route_length", "routes", add("length_m", off)) for off in (-2e-6, 2e-6)),
    *(("euclidean_distance", "routes", add("euclidean_m", off)) for off in (-2e-6, 2e-6)),
    *(("detour_ratio", "routes", add("detour_ratio", off)) for off in (-2e-6, 2e-6)),
    *(("replay_differs", "routes", add(name, 2e-5, at)) for name in (*PLACES, "yaw_rad") for at in (0.4, 0.6)),
    ("replay_differs", "routes", add("yaw_rad", 2e-5, 1)),
    *(("start_anchor", "routes", add(name, 2e-6, 0)) for name in (*PLACES, "yaw_rad")),
    *(("goal_anchor", "routes", add(f"goal_{name}", -2e-6)) for name in (*PLACES, "yaw_rad")),
    *(("end_position", "routes", add(name, 2e-6, 1)) for name in PLACES),
    *(("task_start", "tasks", add(f"start_{name}", 1e-3)) for name in (*PLACES, "yaw_rad")),
    *(("task_budget", "tasks", add("action_budget", off)) for off in (-1, 1)),
    ("task_setting", "tasks", put("setting", "long_horizon")),
    ("task_goal", "tasks", put("landmark", "a lamp")),
    ("unknown_target", "routes", put("target_object_id", 999)),
    ("unknown_start", "routes", put("start_anchor_id", 9)),
    *(("anchor_yaw", "anchors", add("yaw_rad", off), by_rule) for off in (-2e-6, 2e-6)),
    *(("anchor_visibility", "anchors", put("visible_fraction", value)) for value in (0.0, 0.299, 1.001, -0.5)),
    *(("anchor_surface", "anchors", add("surface_distance_m", off)) for off in (-2e-4, 2e-4)),
    *(("anchor_clearance", "anchors", add("clearance_m", off)) for off in (-2e-3, 2e-3)),
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: f"{fault[0]}-{FAULTS.index(fault)}")
def test_a_fault_is_found_in_whatever_row_it_stands(data, fault):
    planted, found = judged(data, *fault)
    assert found == planted


@pytest.mark.parametrize("place", [0, 0.5, 1])
@pytest.mark.parametrize("axis", range(3))
def test_the_flight_volume_ends_at_each_of_its_six_sides(data, axis, place):
    scenes = data.tables["scenes"].table.to_pylist()[0]
    for end, inwards in (("min", 1), ("max", -1)):
        side = scenes[f"{end}_{'xyz'[axis]}_m"] + inwards * RADIUS
        planted, found = judged(data, "out_of_bounds", "routes", put(PLACES[axis], side - inwards * 1e-4, place))
        assert found == planted
        _, found = judged(data, "out_of_bounds", "routes", put(PLACES[axis], side, place))
        assert found == []


def ending_turned(degrees):
    return lambda row: put("yaw_rad", row["goal_yaw_rad"] + math.radians(degrees), 1)(row)


def approaching_from(metres):
    return lambda row: [row[name].__setitem__(-2, row[f"goal_{name}"] + metres / math.sqrt(3)) for name in PLACES]


# The last yaw may be half a turn of 15 degrees off, and an Approach a metre long.
EDGES = [
    *(("final_yaw", ending_turned(off), lambda _: True, abs(off) > 7.5) for off in (-7.6, -7.4, 7.4, 7.6, 179)),
    *(("stops_far", approaching_from(metres), approaches, metres > 1.0) for metres in (1.001, 0.999)),
]


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: f"{edge[0]}-{EDGES.index(edge)}")
def test_what_is_just_beyond_a_limit_is_found_and_what_is_just_within_it_is_not(data, edge):
    name, change, wanted, beyond = edge
    planted, found = judged(data, name, "routes", change, wanted)
    assert found == (planted if beyond else [])


@pytest.mark.parametrize("metres", [-0.1, 0.1])
def test_an_anchor_is_a_metre_from_its_object(data, smoke, metres):
    """Moved away from what it faces, or towards it, and its stored distance with it."""
    scene = read_glb(smoke / "meshes" / f"{SCENE}.glb")
    nodes = {row["object_id"]: row["mesh_node"] for row in data.tables["objects"].table.to_pylist()}

    def change(row):
        thing = scene[nodes[row["object_id"]]]
        here = np.array([row[name] for name in PLACES])
        moved = here + metres * (here - thing.centroid) / np.linalg.norm(here - thing.centroid)
        row.update(zip(PLACES, moved.tolist(), strict=True))
        row["surface_distance_m"] = float(Surface.of(thing).distance_m(moved[None])[0])
        assert abs(row["surface_distance_m"] - 1.0) > 0.01

    planted, found = judged(data, "anchor_surface", "anchors", change, by_rule)
    assert found == planted


def test_an_anchor_nearer_to_a_surface_than_the_radius_is_in_collision(data, smoke):
    low = read_glb(smoke / "meshes" / f"{SCENE}.glb").bounds[0, 2]
    for height, collides in ((RADIUS - 1e-3, True), (RADIUS + 1e-3, False)):

        def change(row, height=height):
            row.update(z_m=float(low) + height, clearance_m=height)

        planted, found = judged(data, "anchor_clearance", "anchors", change)
        assert set(found) == set(planted if collides else [])


def test_rows_out_of_order_are_found_in_every_part(data):
    rows = data["routes"]
    for part, end in enumerate(rows.ends):
        order = np.arange(len(rows))
        order[[end - 2, end - 1]] = order[[end - 1, end - 2]]
        swapped = dataclasses.replace(rows, table=rows.table.take(order))
        here = dataclasses.replace(data, tables={**data.tables, "routes": swapped}, faulty={})
        one = next(one for one in SCENE_CHECKS if one.name == "unsorted_rows")
        (outcome,) = (o for o in run_checks(here, [one]) if o.table == "routes")
        assert [(fault.part, fault.key) for fault in outcome.faults] == [(rows.parts[part], swapped.key(end - 1))]


# Every fourth pixel is looked at: a box that is off by one is within what that can tell.
# Of the points of a target one or two may be seen or not: rays along an edge.
UNTOLD = {"box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px", "target_visible_at_start"}
# What others say or refer to is told at them.
TOLD_ELSEWHERE = {
    "landmark_id": "unknown_landmark", "selected": "selected_anchor", "description": "task_text", "name": "task_goal",
    "paraphrases": "task_text", "reference_image_id": "task_goal", "shape_held_out": "task_goal",
}  # fmt: skip


def other(value, kind):
    """Another value of a column's type, near the first where that is hardest to see."""
    if pa.types.is_list(kind):
        return [value[0], other(value[1], kind.value_type), *value[2:]]
    if isinstance(value, dict):
        return value | {"text": value["text"][:-3] + "xyz"}
    if value is None:
        return "x" if pa.types.is_string(kind) else b"x" if pa.types.is_binary(kind) else 1
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return value + 0.05
    if isinstance(value, int):
        return value + 1 if value < 100 else value - 1
    return value[:-3] + (b"xyz" if isinstance(value, bytes) else "x")


@pytest.mark.parametrize("key", drawn([key for key in SHARDS if not key.endswith("/test")], 2))
def test_every_cell_is_held_to_something(planted, key):
    spec = store.LAYOUT[key].spec
    columns = [field for field in spec.schema if field.name not in UNTOLD]
    clean = planted.rows(key)
    tables = {"*", spec.name, *(("objects", "tasks") if TOLD_ELSEWHERE.keys() & set(spec.schema.names) else ())}
    while columns:
        rows = [dict(row) for row in clean]
        # A row a column, as many as there are rows, so that each fault stands in a row of its own.
        now, columns = columns[: len(rows)], columns[len(rows) :]
        wanted = {}
        for row, field in zip(rows, now, strict=False):
            before = dict(row)
            row[field.name] = other(row[field.name], field.type)
            wanted[field.name] = {named(key, r) for r in (before, row)}
        planted.write(key, rows)
        found = check_of(planted, *tables)
        told = {row for rows in found.values() for row in rows}
        untold = {name for name, keys in wanted.items() if not keys & told}
        assert untold <= {name for name, by in TOLD_ELSEWHERE.items() if by in found}


@pytest.mark.parametrize("value", drawn([None, math.nan, -1, 2**31 - 1, 1e300, ""], 1))
def test_no_value_is_too_strange_to_be_judged(planted, value):
    for key in SHARDS:
        rows = planted.rows(key)
        for field in store.LAYOUT[key].spec.schema:
            kind = field.type.value_type if pa.types.is_list(field.type) else field.type
            if pa.types.is_struct(kind):
                continue  # its fields are not nullable
            try:
                strange = pa.scalar(value, kind).as_py()
            except (pa.ArrowInvalid, pa.ArrowTypeError, OverflowError):
                continue
            for row in rows[::2]:
                row[field.name] = [strange] * 3 if pa.types.is_list(field.type) and value is not None else strange
        planted.write(key, rows, sort=False)
    assert check(planted, sample=5)
