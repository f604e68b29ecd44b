"""Faults planted in routes that are otherwise measured anew: each is found by its check and its row, and only it."""

import numpy as np
import pytest
import trimesh
from support.flying import town
from support.handmade import instance
from support.planting import (
    PlantedFault,
    add,
    check,
    measured,
    named,
    of_nav,
    outcome_of,
    plant,
    poses,
    refly,
    scene_data,
    turned,
)

from aerialdojo_gen.dataset.validate import flights
from aerialdojo_gen.dataset.validate.detours import _pieces
from aerialdojo_gen.dataset.validate.reachability import open_above, over_lattice, way_aside
from aerialdojo_gen.dataset.validate.registry import ALWAYS_AFTER, TABLES
from aerialdojo_gen.dataset.validate.run import SCENE_CHECKS
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.model import Material, Scene
from aerialdojo_gen.store.schemas import APPROACH, STOP, TURN_LEFT, TURN_RIGHT

RADIUS = 0.25
LEFT_1, RIGHT_1, UP_1, UP_2, DOWN_1, DOWN_2, LEFT_5, RIGHT_5 = 4, 7, 10, 11, 12, 13, 6, 9
KEY = "routes/train"


@pytest.fixture
def world(planted):
    return scene_data(planted).world


def roomy(row, metres=0.0, actions=0):
    """Whether a route may grow by so much and keep its setting and its budget."""
    longest, budget = {"base": (30, 90), "standard": (60, 180), "long_horizon": (100, 300)}[row["setting"]]
    return row["length_m"] + metres < longest and row["n_actions"] + actions <= budget


NUMBERS = [
    PlantedFault(found_by, KEY, add(name, off), lambda row: row["min_clearance_m"] < 0.9)
    for found_by, name, off in (
        ("n_actions", "n_actions", 1),
        ("route_length", "length_m", 0.5),
        ("euclidean_distance", "euclidean_m", -0.01),
        ("detour_ratio", "detour_ratio", 0.02),
        ("min_clearance", "min_clearance_m", 0.01),
        ("min_clearance", "min_clearance_m", -0.01),
        ("goal_anchor", "goal_x_m", 0.1),
        ("goal_anchor", "goal_yaw_rad", 0.01),
    )
]


def with_action(place, action):
    """The route with another action at a place, its poses left as they are."""

    def change(row):
        actions = list(row["action"])
        actions[place] = action
        return row | {"action": actions}

    return change


def turned_elsewhere(row):
    return with_action(row["action"].index(TURN_LEFT), TURN_RIGHT)(row) if TURN_LEFT in row["action"] else None


def over_its_budget(row):
    if row["setting"] != "base":
        return None
    turns = [TURN_LEFT, TURN_RIGHT] * ((92 - row["n_actions"]) // 2)
    new = refly(row, [*turns, *row["action"]])
    assert new["n_actions"] > 90
    return new


def diving_below_the_ground(row):
    dive = int(np.ceil((row["z_m"][0] - RADIUS) / 2)) + 1
    return refly(row, [DOWN_2] * dive + [UP_2] * dive + row["action"]) if roomy(row, 20, 10) else None


def ending_turned_away(row):
    last = 2 if row["action"][-2] == APPROACH else 1
    new = refly(row, [*row["action"][:-last], TURN_LEFT, *row["action"][-last:]])
    away = abs(turned(new["yaw_rad"][-1] - new["goal_yaw_rad"], 0.0)) > np.radians(7.6)
    return new if roomy(row, 0, 1) and away else None


ROUTES = (
    ("list_lengths_differ", lambda row: row | {"z_m": row["z_m"][:-1]}),
    ("action_order", with_action(1, STOP)),
    ("action_order", with_action(1, APPROACH)),
    ("action_order", with_action(-1, TURN_LEFT)),
    ("replay_differs", turned_elsewhere),
    ("keeping_rule", over_its_budget),
    ("out_of_bounds", diving_below_the_ground),
    ("final_yaw", ending_turned_away),
)


def plant_routes(planted, faults):
    """Plant each fault in a route of its own, from the last one backwards; gives what checks should name."""
    rows, expected = planted.rows(KEY), {}
    untouched = rows[::-1]
    for found_by, change in faults:
        old, new = next((row, new) for row in untouched if (new := change(row)))
        untouched.remove(old)
        rows[rows.index(old)] = new
        expected[found_by] = sorted([*expected.get(found_by, ()), named(KEY, new)])
    planted.write(KEY, rows)
    return expected


def test_faults_of_routes(planted):
    """Wrong numbers stand in the first routes, wrong flights in the last."""
    rows = planted.rows(KEY) + planted.rows("routes/test")
    taken = {(r["start_object_id"], r["start_anchor_id"], r["target_object_id"]) for r in rows}

    def from_another_anchor(row):
        free = (a for a in range(3) if (row["start_object_id"], a, row["target_object_id"]) not in taken)
        anchor = next(free, None)
        return None if anchor is None else row | {"start_anchor_id": anchor}

    def of_another_setting(row):
        return row | {"setting": "standard"} if row["setting"] == "base" else None

    others = (("start_anchor", from_another_anchor), ("route_setting", of_another_setting))
    expected = plant_routes(planted, (*ROUTES, *others)) | plant(planted, NUMBERS)
    (longer,) = expected["route_setting"]
    is_longer = of_nav(longer.removeprefix("nav_id="))
    planted.edit_all("tasks/train", lambda task: task.update(setting="standard", action_budget=180), is_longer)
    assert check(planted) == expected


def test_a_way_through_a_wall_and_back(planted, world):
    low, high = scene_data(planted).mesh.bounds + np.array([[RADIUS], [-RADIUS]])

    def through(row):
        for aside in ([LEFT_5, RIGHT_5], [RIGHT_5, LEFT_5]):
            new = refly(row, [*aside, *row["action"]])
            path = poses(new)[:, :3]
            inside = ((path >= low) & (path <= high)).all()
            if inside and world.segment_in_collision(path[0], path[1], RADIUS):
                return new
        return None

    old, new = next((row, new) for row in planted.rows(KEY) if roomy(row, 10, 2) and (new := through(row)))
    key = [named(KEY, old)]
    planted.edit(KEY, lambda row: row.update(new), of_nav(old["nav_id"]))
    assert check(planted) == {"route_collision": key}
    # Not by its own length of arm: a body that fits through finds nothing.
    assert "route_collision" not in check(planted, use_meshes=False)
    # A sample of FCL's certificates may miss the route; the oracle flies them all.
    found = check(planted, sample=0)
    # Out and back through the wall may be a long way round besides, and nothing else.
    assert found in ({"oracle_fails": key}, {"oracle_fails": key, "long_way_round": key})


def test_a_wall_across_any_one_leg_of_any_route_is_found(planted, world):
    """Two free routes joined through a wall: the joint is the first, a middle, the last or the only leg that hits."""
    ends = {"first": (-1, 0), "middle": (0, 0), "last": (0, -1), "only": (-1, -1)}

    def joined(place, row):
        """The row's route and another's, joined as `place` says, where only the joint meets a surface."""
        own = poses(row)
        own = own[ends[place][0] :] if ends[place][0] else own
        for other in others:
            theirs = poses(other) if ends[place][1] == 0 else poses(other)[:1]
            if world.segment_in_collision(own[-1, :3], theirs[0, :3], RADIUS):
                return np.concatenate([own, theirs]), own[-1, :3], theirs[0, :3]
        raise AssertionError("no route of the scene ends behind a wall")

    others = planted.rows(KEY)
    joints = {}
    # The first and a middle route of the first part, and the first and the last of the second.
    chosen = {
        "routes/train": [("last", 0), ("middle", len(others) // 2)],
        "routes/test": [("first", 0), ("only", -1)],
    }
    for part, places in chosen.items():
        rows = planted.rows(part)
        for place, k in places:
            path, *joint = joined(place, rows[k])
            rows[k] |= {name: path[:, i].tolist() for i, name in enumerate(("x_m", "y_m", "z_m", "yaw_rad"))}
            rows[k]["action"] = [STOP] * len(path)
            joints[named(KEY, rows[k])] = joint
        planted.write(part, rows)
    data = scene_data(planted)
    found = {data["routes"].key(f.row): f.found for f in flights.route_collision(data, data["routes"])}
    told = {name: [", ".join(f"{v:.2f}" for v in end) for end in joint] for name, joint in joints.items()}
    assert found == {name: f"the body touches a surface between ({p}) m and ({q}) m" for name, (p, q) in told.items()}


def beside_the_anchor(row):
    if row["action"][-2] != APPROACH:
        return None
    path = poses(row)
    path[-1, 2] += 0.002
    return measured(row, path, row["action"])


def approached_from_afar(row):
    """Without its last move the Approach is more than a metre long."""
    if row["action"][-2] != APPROACH or row["action"][-3] >= TURN_LEFT:
        return None
    new = measured(row, np.delete(poses(row), -3, axis=0), [*row["action"][:-3], APPROACH, STOP])
    new = refly(new, new["action"])
    gap = float(np.linalg.norm(np.diff(poses(new)[-2:, :3], axis=0)))
    return new if gap > 1.001 and new["detour_ratio"] > 1.06 and new["length_m"] > 5 and roomy(new) else None


def test_ends_off_the_goal(planted):
    expected = plant_routes(planted, (("end_position", beside_the_anchor), ("stops_far", approached_from_afar)))
    assert check(planted, use_meshes=False) == expected


def test_replayed_actions_are_swept_for_themselves(planted, world):
    def change(row):
        row["action"][:2] = [LEFT_5, RIGHT_5]

    def hits(row):
        return world.segment_in_collision(*replay(poses(row)[0], [LEFT_5])[:, :3], RADIUS)

    row = planted.edit(KEY, change, hits)
    data = scene_data(planted)
    found = [data["routes"].key(f.row) for f in flights.replay_collision(data, data["routes"])]
    assert found == [named(KEY, row)]
    assert not list(flights.route_collision(data, data["routes"]))


@pytest.mark.parametrize(
    ("key", "change", "words"),
    [
        (KEY, lambda row: row.update(length_m=0.9 * row["length_m"]), "m told: SPL 0.9"),
        (KEY, lambda row: row.update(goal_z_m=row["goal_z_m"] + 4.5), "m from the goal"),
        (KEY, lambda row: row["action"].__setitem__(-1, TURN_LEFT), "no Stop in its "),
        (KEY, lambda row: row["action"].__setitem__(slice(0, 20), [UP_2] * 20), "that would leave the flight volume"),
        ("tasks/train", lambda task: task.update(action_budget=5), "no Stop within the budget of 5 actions"),
        ("tasks/train", lambda task: task.update(start_z_m=0.1), "a collision at action 1, at ("),
    ],
)
def test_the_oracle_says_what_a_flight_lacks(planted, world, key, change, words):
    def wanted(row):
        # Nothing above the start, so that twenty moves up end at the ceiling.
        start = [row[f"{axis}_m"][0] for axis in "xyz"]
        return row["n_actions"] > 25 and not world.segment_in_collision(start, start + 30 * np.eye(3)[2], RADIUS)

    def first_instance(task):
        return task["nav_id"] in nav_ids and task["modality"] == "image"

    nav_ids = {row["nav_id"] for row in planted.rows(KEY) if wanted(row)}
    row = planted.edit(key, change, wanted if key == KEY else first_instance)
    data = scene_data(planted)
    found = {data["routes"].key(fault.row): fault.found for fault in flights.oracle_fails(data, data["routes"])}
    assert list(found) == [f"nav_id={row['nav_id']}"]
    assert words in found[f"nav_id={row['nav_id']}"]


# Two metres are a clear share of so short a route: a wider search finds a better one.
SHORT_M = 9


def longer(row, insert, data):
    """A short route with needless moves at its start, measured anew; None where they hit something."""
    if row["length_m"] > SHORT_M or row["action"][0] == APPROACH:
        return None
    new = refly(row, [*insert, *row["action"]])
    path, radius = poses(new)[:, :3], data.pipeline.embodiment.radius_m
    low, high = data.mesh.bounds
    inside = ((path >= low + radius) & (path <= high - radius)).all()
    return new if inside and not data.world.route_in_collision(path, radius) else None


def test_routes_longer_than_they_need_be_with_right_figures(planted):
    data, rows = scene_data(planted), planted.rows(KEY)
    keys = []
    for insert in ([UP_1, DOWN_1], [LEFT_1, RIGHT_1], [UP_2, UP_2, UP_2, DOWN_2, DOWN_2, DOWN_2]):
        untouched = (k for k, row in enumerate(rows) if named(KEY, row) not in keys)
        k, new = next((k, new) for k in untouched if (new := longer(rows[k], insert, data)))
        rows[k] = new
        keys.append(named(KEY, new))
    planted.write(KEY, rows)
    found = check(planted)
    assert found["needless_piece"] == sorted(keys)
    assert set(found) <= {"needless_piece", "min_clearance", "long_way_round"}
    # Without its corners, which a sample may leave out, the longest is found.
    round_about = outcome_of(scene_data(planted, sample=0), "long_way_round").faults
    assert keys[-1] in {fault.key for fault in round_about}


def test_pieces_are_the_shortest_that_are_worth_it(planted):
    square = np.array([[0, 0, 0], [5, 0, 0], [5, 2, 0], [5, 0, 0], [9, 0, 0], [9, 0, 3.0]])
    assert _pieces(square) == [(1, 3, 4.0, 0.0)]
    straight = poses(planted.rows(KEY)[0])[:1, :3] + np.arange(4)[:, None] * [1.0, 0.0, 0.0]
    assert _pieces(straight) == []


def test_checks_stand_after_those_that_they_build_on():
    seen = {table: set() for table in TABLES}
    for one in SCENE_CHECKS:
        for table in TABLES if one.table == "*" else (one.table,):
            assert set(one.after) <= seen[table], one.name
            seen[table].add(one.name)
    assert all(set(ALWAYS_AFTER) <= names for names in seen.values())
    assert len({one.name for one in SCENE_CHECKS}) == len(SCENE_CHECKS)


def hall(door: bool) -> Scene:
    """A hall around a closet around a place; with doors on sides that face away from each other."""

    def shell(half: float, side: int) -> trimesh.Trimesh:
        body = trimesh.creation.box((2 * half, 2 * half, 6 + half)).apply_translation([0, 0, (6 + half) / 2])
        body = body.subdivide().subdivide().subdivide()
        middle = body.triangles_center
        open_ = (middle[:, 0] * side > half - 1e-6) & (np.abs(middle[:, 1]) < half / 3) & (middle[:, 2] < 4)
        body.update_faces(~(open_ if door else np.zeros(len(middle), dtype=bool)))
        return body

    ground = trimesh.creation.box(bounds=[[-30, -30, -1], [30, 30, 0]])
    bodies = (("ground", ground), ("hall", shell(12, 1)), ("closet", shell(4, -1)))
    return Scene(
        "Hall_0", tuple(instance(n, b) for n, b in bodies), {"grey": Material("grey", (128, 128, 128))},
        np.array([[-30.0, -30, 0], [30, 30, 25]]),
    )  # fmt: skip


def test_a_way_out_is_found_round_corners_and_none_through_walls():
    places = np.array([[20.0, 20, 3], [8, 8, 3], [0, 0, 2]])
    for door, expected in ((False, [True, False, False]), (True, [True, True, True])):
        scene = hall(door)
        rays = RayCaster(scene)
        assert open_above(rays, places).tolist() == [True, False, False]
        assert over_lattice(rays, scene.bounds, places).tolist() == expected
        assert not way_aside(rays, places)[~np.array(expected)].any()


def test_where_the_generator_has_a_way_rays_find_one():
    scene = town()
    grid, rays = ClearanceGrid.build(scene), RayCaster(scene)
    p = np.random.default_rng(1).uniform(scene.bounds[0] + 0.3, scene.bounds[1] - 0.3, (1500, 3))
    reachable = np.array([grid.reachable(x) for x in p])
    assert reachable.sum() > 300
    free = way_aside(rays, p[reachable])
    assert over_lattice(rays, scene.bounds, p[reachable][~free]).all()
