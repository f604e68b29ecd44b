"""Readers of other benchmarks' records: AerialVLN, OpenFly, CityAVOS and UAV-ON.

AerialVLN: NED metres, quaternions wxyz. OpenFly: z up, yaw in radians counter-clockwise. CityAVOS: metres, z negative
above the ground. UAV-ON: NED metres, quaternions xyzw. OpenFly and CityAVOS do not state which way x points.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from aerialdojo_gen.exchange.frames import Move, move, replay_moves
from aerialdojo_gen.exchange.records import BadField, Fields, Floats, rows_of, shown
from aerialdojo_gen.exchange.task import Context, Instance, Route, Task, picture_at

AERIALVLN_MOVES = dict(enumerate(map(move, (
    "stop", "forward 5 m", "turn left 15°", "turn right 15°", "up 2 m", "down 2 m", "left 5 m", "right 5 m",
))))  # fmt: skip
OPENFLY_MOVES = dict(enumerate(map(move, (
    "stop", "forward 3 m", "turn left 30°", "turn right 30°", "up 3 m", "down 3 m", "left 3 m", "right 3 m",
    "forward 6 m", "forward 9 m",
))))  # fmt: skip
_FULL_TURN = 2 * math.pi + 1e-6


def moves_of(record: Fields, key: str, moves: dict[int, Move]) -> list[Move]:
    """Look a record's actions up by number; BadField where there is no such action, or a stop before the end."""
    numbers = record.whole_numbers(key)
    for k, number in enumerate(numbers):
        if number not in moves:
            raise BadField(f"{key}[{k}]", f"unknown action {number}: known are {', '.join(map(str, moves))}")
    flown = [moves[number] for number in numbers]
    if "stop" in (names := [m.name for m in flown])[:-1]:
        raise BadField(f"{key}[{names.index('stop')}]", "stop before the end")
    return flown


def without_stop(moves: list[Move]) -> list[Move]:
    """Actions that lead from pose to pose: all but a stop at the end."""
    return moves[:-1] if moves[-1].name == "stop" else moves


def route_of(moves: list[Move], poses: Floats, context: Context) -> Route:
    """Join actions and poses; where they are not one a pose, the poses stand and the actions keep their own names."""
    done = without_stop(moves)
    ours, lack = [m.ours for m in done if m.ours is not None], ""
    if len(done) != len(poses) - 1:
        lack = "not one action a pose"
    elif len(ours) < len(done):
        lack = "has actions that are none of ours"
    if lack:
        context.notes[f"{lack}: action is null, source_action has them"] += 1
    error_m = float(np.linalg.norm(replay_moves(poses[0], done)[-1, :3] - poses[-1, :3]))
    return Route(poses, None if lack else [*ours, 0], [m.name for m in moves], error_m)


def read_aerialvln(record: Fields, context: Context) -> Task:
    """Read an episode. Its path has positions; yaws follow from the start's and the turns."""
    w, x, y, z = record.quaternion("start_rotation").tolist()
    start = context.upright_pose(record.position("start_position"), np.array([x, y, z, w]))
    goals = [Fields(goal, f"goals[{i}]") for i, goal in enumerate(record.items("goals"))]
    goal = context.frame.positions_to_world(goals[0].position("position"))
    instruction = record.child("instruction")
    route = None
    if record.has("reference_path"):
        rows = record.items("reference_path")
        for i, row in enumerate(rows):
            if not isinstance(row, list) or len(row) not in (3, 6, 7):
                raise BadField(f"reference_path[{i}]", f"expected x, y, z, maybe an attitude, found {shown(row)}")
        if any(len(row) > 3 for row in rows):
            context.notes["reference_path has attitudes: yaws are taken from start_rotation and the turns"] += 1
        points = context.frame.positions_to_world(record.positions_of([row[:3] for row in rows], "reference_path"))
        if record.has("actions"):
            moves = moves_of(record, "actions", AERIALVLN_MOVES)
            done = without_stop(moves)
            fits = len(done) == len(points) - 1
            yaws = replay_moves(start, done)[:, 3] if fits else np.full(len(points), start[3])
            route = route_of(moves, np.column_stack([points, yaws]), context)
        else:
            context.notes["reference_path without actions, hence without yaws: left aside"] += 1
    if len(goals) > 1:
        context.notes["has several goals: the first is kept"] += 1
    record.has("trajectory_id") and record.name("trajectory_id")
    instances = [Instance("semantic", instruction.text("instruction_text", empty=False))]
    return Task(record.name("episode_id"), record.name("scene_id"), start, goal, instances, route=route)


def read_openfly(record: Fields, context: Context) -> Task:
    """Read a trajectory: an instruction and the way it describes; its end is the goal, and no object is named."""
    image_path = record.text("image_path", empty=False)
    points = context.frame.positions_to_world(record.positions("pos"))
    yaws = record.numbers("yaw")
    if len(yaws) != len(points):
        raise BadField("yaw", f"has {len(yaws)} values for {len(points)} positions")
    if np.abs(yaws).max() > _FULL_TURN:
        k = int(np.abs(yaws).argmax())
        raise BadField(f"yaw[{k}]", f"{yaws[k]:g} is more than a turn in radians: degrees?")
    poses = np.column_stack([points, context.frame.yaw_to_world(yaws)])
    route = route_of(moves_of(record, "action", OPENFLY_MOVES), poses, context)
    instances = [Instance("semantic", record.text("gpt_instruction", empty=False))]
    scene = image_path.replace("\\", "/").split("/")[0]
    return Task(image_path, scene, poses[0], points[-1], instances, route=route)


def read_cityavos(record: Fields, context: Context) -> Task:
    """Read a mission: a target in words and as a picture, and no reference trajectory."""
    *position, pitch, roll, yaw = rows_of([record.take("initial_pos")], 6, lambda _: "initial_pos")[0].tolist()
    if pitch or roll:
        context.notes["the start's attitude has roll or pitch: only its yaw is kept"] += 1
    start = context.start_pose(record.positions_of([position], "initial_pos")[0], _radians(yaw, context))
    goal = context.frame.positions_to_world(record.position("target_pos"))
    text = record.text("target_text", empty=False)
    instances = [Instance("semantic", text)]
    if context.pictures is not None:
        name = record.text("target_image_path", empty=False)
        instances.append(Instance("image", picture=picture_at(context.pictures, name, "target_image_path")))
    source_id, scene = record.name("mission_id"), record.name("scene_id")
    return Task(source_id, scene, start, goal, instances, object_key=tuple(goal.tolist()), object_m=goal)


def _radians(yaw: float, context: Context) -> float:
    """The yaw in radians: some of these files have degrees in some rows."""
    if context.angles == "degrees":
        return math.radians(yaw)
    if abs(yaw) <= _FULL_TURN:
        return yaw
    if context.angles == "radians":
        raise BadField(
            "initial_pos[5]", f"yaw {yaw:g} is more than a turn in radians: --angles degrees, or mixed if rows differ"
        )
    context.notes["yaw of more than a turn in radians: taken as degrees, as --angles mixed asks"] += 1
    return math.radians(yaw)


def read_uav_on(record: Fields, context: Context) -> Task:
    """Read an episode; it has a target and its places, and no reference trajectory."""
    pose = record.child("start_pose")
    start = context.upright_pose(pose.position("start_position"), pose.quaternion("start_quaternionr"))
    places = context.frame.positions_to_world(record.positions("pose"))
    nearest = places[int(np.argmin(np.linalg.norm(places - start[:3], axis=1)))]
    if len(places) > 1:
        context.notes["pose has several places of the target: the nearest to the start is the goal"] += 1
    scene, node = record.name("map_name"), record.text("object_name", empty=False)
    known: dict[str, Any] = {"target_name": record.text("true_name", empty=False), "mesh_node": node}
    known["category"] = record.optional_text("category")
    if record.has("used-in-train"):
        known["subset"] = "train" if record.flag("used-in-train") else "test"
    if record.has("info") and (info := record.child("info")).has("geodesic_distance"):
        known["stated_length_m"] = info.number("geodesic_distance")
    instances, key = [Instance("semantic", record.optional_text("description"))], (node, *nearest.tolist())
    source_id = f"{scene}/{record.name('episode_id')}"
    return Task(source_id, scene, start, nearest, instances, object_key=key, object_m=nearest, known=known)
