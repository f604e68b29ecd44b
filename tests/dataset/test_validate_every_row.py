"""Checks of single rows, one at a time: each finds its fault in the first, a middle and the last row of every part.

Faults lie just beyond what a check allows; just within it nothing is found.
"""

import dataclasses
import math

import numpy as np
import pyarrow as pa
import pytest
from support.planting import add, definitions, put

from aerialdojo_gen.dataset.validate.parts import read_tables, release_of
from aerialdojo_gen.dataset.validate.registry import run_checks
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.dataset.validate.run import SCENE_CHECKS
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.scenes.glb import read_glb
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


@pytest.mark.parametrize(("degrees", "off"), [(-7.6, True), (-7.4, False), (7.4, False), (7.6, True), (179, True)])
def test_the_last_yaw_may_be_half_a_turn_of_15_degrees_off(data, degrees, off):
    def change(row):
        row["yaw_rad"][-1] = row["goal_yaw_rad"] + math.radians(degrees)

    planted, found = judged(data, "final_yaw", "routes", change)
    assert found == (planted if off else [])


@pytest.mark.parametrize(("metres", "far"), [(1.001, True), (0.999, False)])
def test_an_approach_may_be_a_metre_long(data, metres, far):
    def change(row):
        for name in PLACES:
            row[name][-2] = row[f"goal_{name}"] + metres / math.sqrt(3)

    planted, found = judged(data, "stops_far", "routes", change, approaches)
    assert found == (planted if far else [])


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
